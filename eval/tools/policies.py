"""The cards of the shipped policies as a table: `python -m eval.tools.policies [--write-docs]`."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import tyro

from eval.page.docs import POLICIES_PAGE, markdown_table, splice
from eval.wording import number, percent
from eval.wording import steps as steps_text
from fbid_gym.policy import Measured, Shipped, shipped
from train.command import run_command

_HEAD = (
    "Policy", "Learnt by", "Steps", "Time (min)", "Velocity error (m/s)", "Survival", "Return",
    "Cost of transport", "Measured at",
)  # fmt: skip


@dataclass(frozen=True)
class PoliciesConfig:
    """Print the cards of the shipped policies."""

    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write them into docs/policies.md, too."""


def cards(policies: Sequence[Shipped]) -> str:
    """Return a table of what policies do, and below it the notes of their cards: Markdown."""
    if not policies:
        return "None yet."
    shown, rows = ("velocity_error", "survived", "returned", "cost_of_transport"), []
    for each in policies:
        policy, card = each.policy, each.card
        learnt = [policy.algorithm.upper(), steps_text(policy.trained_steps)]
        cells = [f"`{each.name}`", *learnt, f"{card.wall_seconds / 60:.0f}"]
        cells += (_written(card.metrics.get(name)) for name in shown)
        rows.append([*cells, str(card.measured_with.get("commit") or "unknown")[:8]])
    told = {each.name: " ".join([*each.card.transfer(), each.card.note]) for each in policies}
    notes = (f"\n`{name}`: {text.strip()}" for name, text in told.items() if text)
    return "\n".join([markdown_table(_HEAD, rows), *notes])


def _written(value: Measured | None) -> str:
    if value is None:
        return "–"
    form = percent if value.unit == "share" else number
    return f"{form(value.mean)} ({form(value.low)} to {form(value.high)})"


def main(config: PoliciesConfig) -> None:
    """Print, and write."""
    found = cards(shipped())
    if config.write_docs:
        splice(POLICIES_PAGE, found)
    print(found)


if __name__ == "__main__":
    sys.exit(run_command("eval.tools.policies", PoliciesConfig, main, about=__doc__))
