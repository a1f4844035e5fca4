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
    "Cost of transport",
)  # fmt: skip


@dataclass(frozen=True)
class PoliciesConfig:
    """Print the cards of the shipped policies."""

    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write them into docs/policies.md, too."""


def cards(policies: Sequence[Shipped]) -> str:
    """Return the cards as Markdown: a table of what they do, and how each was trained."""
    if not policies:
        return "None yet."
    shown, rows = ("velocity_error", "survived", "returned", "cost_of_transport"), []
    for each in policies:
        policy, card = each.policy, each.card
        learnt = [policy.algorithm.upper(), steps_text(policy.trained_steps)]
        cells = [f"`{each.name}`", *learnt, f"{card.wall_seconds / 60:.0f}"]
        rows.append([*cells, *(_written(card.metrics.get(name)) for name in shown)])
    return "\n".join([markdown_table(_HEAD, rows), *(f"\n{_training(each)}" for each in policies)])


def _written(value: Measured | None) -> str:
    if value is None:
        return "–"
    form = percent if value.unit == "share" else number
    return f"{form(value.mean)} ({form(value.low)} to {form(value.high)})"


def _training(each: Shipped) -> str:
    card, learnt = each.card, steps_text(each.policy.trained_steps)
    told = (
        f"`{each.name}`: best of {card.evaluations} evaluations of `{card.command}`, at "
        f"{learnt} of {steps_text(card.total_steps)} steps; trained at commit "
        f"`{_commit(card.trained_with)}`, measured on {card.episodes} episodes from seed "
        f"{card.first_seed} at `{_commit(card.measured_with)}`."
    )
    told = " ".join([told, *card.transfer()])
    return f"{told} **{card.note}**" if card.note else told


def _commit(versions: object) -> str:
    commit = versions.get("commit") if isinstance(versions, dict) else None
    return str(commit or "unknown")[:12]


def main(config: PoliciesConfig) -> None:
    """Print, and write."""
    found = cards(shipped())
    if config.write_docs:
        splice(POLICIES_PAGE, found)
    print(found)


if __name__ == "__main__":
    sys.exit(run_command("eval.tools.policies", PoliciesConfig, main, about=__doc__))
