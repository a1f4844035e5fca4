"""Measure robots without a policy: `python -m eval.zero_actions walking`.

All layers meet the same starts, commands and pushes. Tables:
"""

import math
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from eval.page.docs import DOCS, command_block, markdown_table, splice, spliced
from eval.zero_actions.measures import Row
from eval.zero_actions.tables import TABLES, Case, Table, ZeroActionConfig, cases
from fbid_gym.errors import InvalidValueError, RunError
from train.command import run_command
from train.runs.files import check_output, write
from train.runs.tables import check_kept, read_rows, to_csv

WITHIN = 0.1  # share by which survival and error may differ from what they are compared with


class Sum(NamedTuple):
    """Number of robots that stayed up, of how many, and their mean errors; NaN for none."""

    up: int
    of: int
    error: float

    @classmethod
    def over(cls, rows: Sequence[Row], error: str) -> "Sum":
        """Return the sum of some rows, `error` being the column of their errors."""
        errors = [float(row[error]) for row in rows if row.get(error)]
        up, of = (sum(int(row[name]) for row in rows) for name in ("up", "episodes"))
        return cls(up, of, sum(errors) / len(errors) if errors else math.nan)

    def words(self, first: "Sum | None") -> str:
        """Return the cell of a short table; `first` is what it is compared with."""
        if not self.of:
            return "–"
        said = f"{self.up}/{self.of}"
        if math.isfinite(self.error):
            decimals = 0 if self.error >= 10.0 else 3 if first else 2
            said += f", {self.error:.{decimals}f}"
        if first is None or first is self or not (self.up or first.up):
            return said  # the errors of robots that all fall say nothing
        # By which shares survival and error are greater here.
        pairs = (self.up / self.of, first.up / first.of), (self.error, first.error)
        shares = [0.0 if a == b else a / b - 1.0 if b else math.inf for a, b in pairs]
        bold = "**" if max(map(abs, shares)) > WITHIN else ""
        return f"{said} ({bold}{100 * shares[1]:+.0f} %{bold})"


def run(config: ZeroActionConfig, command: Sequence[str]) -> None:
    """Measure, print, write; what can be refused is refused before."""
    table, file, page = TABLES[config.table], config.csv, DOCS / f"{config.table}.md"
    if config.write_docs:
        if file is not None:
            raise InvalidValueError("csv", str(file), "none with --write-docs, which has its own")
        file = DOCS / "data" / f"{config.table}.csv"
    todo = cases(config)
    if config.write_docs:
        spliced(page, "")
    check_output(file, "csv", (".csv",))
    rows = list(measured(todo, table, file, config.overwrite))
    text = markdown_table(*short(table, rows))
    print(f"\n{text}")
    if config.write_docs:
        splice(page, f"{said(table, rows, page)}\n\n{command_block(command)}\n\n{text}")


def measured(
    todo: Sequence[Case], table: Table, file: Path | None, overwrite: bool
) -> Iterator[Row]:
    """Measure rows, print each when it is there, and add it to a file unless it has it already."""
    kept = [] if file is None or overwrite else kept_rows(file, table)
    print(to_csv(table.columns, []), end="")
    for case in todo:
        row = next((row for row in kept if case.cells.items() <= row.items()), None)
        if row is None:
            row = dict.fromkeys(table.columns, "") | case.cells | case.measure()
            kept.append(row)
            if file is not None:
                write(file, to_csv(table.columns, kept))
        print(to_csv(table.columns, [row]).splitlines()[1], flush=True)
        yield row


def kept_rows(file: Path, table: Table) -> list[Row]:
    """Return the rows of a file, none before it is there; RunError where no such table wrote it."""
    if file.exists():
        check_kept(file, table.columns, 0)
    rows = read_rows(file)
    for row in rows:
        try:
            [float("nan" if row[name] == "" else row[name]) for name in table.numbers]
            fits = 0 <= int(row.get("up", "0")) <= int(row["episodes"])
        except (KeyError, TypeError, ValueError):
            fits = False
        if not fits or tuple(row) != table.columns:
            words = ",".join(map(str, row.values()))
            expected = f"{','.join(table.columns)}, the latter numbers; or --overwrite"
            raise RunError(f"{file}: has a row {words!r}. Expected {expected}.")
    return rows


def said(table: Table, rows: Sequence[Row], page: Path) -> str:
    """Say of what the short table of a page is, and where the rows are."""
    episodes, seconds, push = (rows[0][name] for name in ("episodes", "seconds", "push"))
    means = {"reward": "reward a step until they fell", "return": "return"}
    means |= {"yaw_rate_error": "yaw rate error in rad/s", "slip": "slip in m/s"}
    names = [table.error, *table.more] if table.error else []
    told = ", ".join(means.get(name, "velocity error in m/s") for name in names)
    error = f", and their mean {told}" if told else ""
    pushed = "" if "push" in table.without else f", pushes of {push} N"
    return (
        f"{episodes} robots each, {seconds} s{pushed}. Cells: how many of them stayed "
        f"up{error}. [{page.stem}.csv](data/{page.stem}.csv) has every row, with all numbers and "
        "the 95 % interval of the share that stayed up. By"
    )


def short(table: Table, rows: Sequence[Row]) -> tuple[list[str], list[Sequence[str]]]:
    """Return heads and lines of the short table."""
    across, lines = list(dict.fromkeys(row[table.across] for row in rows)), list[Sequence[str]]()
    for line in dict.fromkeys(tuple(row[name] for name in table.rows) for row in rows):
        its = [row for row in rows if tuple(row[name] for name in table.rows) == line]
        by_value = [[row for row in its if row[table.across] == value] for value in across]
        if "torque_nm" in table.numbers:
            lines.append([*line, *(matched(some[0], its[0]) for some in by_value)])
        else:
            sums = [Sum.over(some, table.error) for some in by_value]
            words = [one.words(sums[0] if table.compared else None) for one in sums]
            for name in table.more:
                means = (Sum.over(some, name).error for some in by_value)
                words = [f"{said}, {m:.3f}" for said, m in zip(words, means, strict=True)]
            lines.append([*line, *words])
    # So that pages can wrap them.
    return [name.replace("_", " ") for name in (*table.rows, *across)], lines


def matched(row: Row, first: Row) -> str:
    """Say how much torque the noise of a layer is, and what noise makes it that of another one."""
    torque, noise = float(row["torque_nm"]), float(row["log_std_init"])
    said = f"{torque:.3g} N m at log_std_init {noise:g}"
    share = float(first["torque_nm"]) / torque if torque else 0.0
    return f"{said}; that of the first at {noise + math.log(share):.2f}" if share else said


_ABOUT = f"{__doc__}\n" + "\n\n".join(f"{name}: {its.about}." for name, its in TABLES.items())
main = partial(run_command, "eval.zero_actions", ZeroActionConfig, run, about=_ABOUT, told=True)


if __name__ == "__main__":
    sys.exit(main())
