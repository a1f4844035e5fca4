"""List the policies that come with the package, or print the cards of some.

python -m fbid_gym.policy
python -m fbid_gym.policy QuadrupedWalk-v0/base_acceleration any-quadruped
"""

import argparse
import sys
from collections.abc import Sequence

from fbid_gym.__main__ import called
from fbid_gym.exit_status import exit_status
from fbid_gym.policy.policy_file import PREFIX, place_of
from fbid_gym.policy.shipping import shipped


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the names, or the cards of those that are named; returns 2 on errors."""
    about = "List the policies that come with the package, or print the cards of some."
    prog = " ".join(called("fbid_gym.policy"))
    parser = argparse.ArgumentParser(prog=prog, description=about)
    parser.add_argument("names", nargs="*", help="of which the cards are printed")
    asked = parser.parse_args(arguments).names
    return exit_status(lambda: _show(asked))


def _show(asked: Sequence[str]) -> None:
    known = {each.path: each for each in shipped()}
    of_them = [known[place_of(PREFIX + name.removeprefix(PREFIX))] for name in asked]
    for each in known.values() if not asked else ():
        print(each.name)
    for each in of_them:
        print("\n".join([each.name, *(f"  {line}" for line in each.lines())]))


if __name__ == "__main__":
    sys.exit(main())
