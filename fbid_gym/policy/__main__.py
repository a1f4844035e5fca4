"""List the policies that come with the package, or print the cards of some.

python -m fbid_gym.policy
python -m fbid_gym.policy QuadrupedWalk-v0/base_acceleration
"""

import argparse
import sys
from collections.abc import Sequence

from fbid_gym.__main__ import called
from fbid_gym.checks import check_choices
from fbid_gym.exit_status import exit_status
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
    known = {each.name: each for each in shipped()}
    check_choices("shipped policy", asked, known)
    for name in known if not asked else ():
        print(name)
    for name in asked:
        print("\n".join([name, *(f"  {line}" for line in known[name].lines())]))


if __name__ == "__main__":
    sys.exit(main())
