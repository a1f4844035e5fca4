"""What a training shows while it runs: a progress bar, or lines where there is no terminal."""

import math
import sys
import time
from collections.abc import Mapping

from tqdm import tqdm

_LINE_SECONDS = 2.0


class Display:
    """A bar on a terminal; elsewhere a line per iteration, at most one every two seconds."""

    def __init__(self, name: str, total: int, steps: int) -> None:
        """Start at `steps` of `total`."""
        self._name, self._total, self._start = name, total, steps
        self._began = self._printed = time.monotonic()
        self._bar = None
        if sys.stderr.isatty():
            self._bar = tqdm(
                total=total, initial=steps, desc=name, unit="step", unit_scale=True,
                dynamic_ncols=True,
            )  # fmt: skip

    def update(self, row: Mapping[str, float]) -> None:
        """Show one row of `progress.csv`."""
        steps = int(row["steps"])
        if self._bar is not None:
            self._bar.set_postfix_str(_episodes(row), refresh=False)
            self._bar.update(steps - self._bar.n)
            return
        now = time.monotonic()
        if now - self._printed < _LINE_SECONDS and steps < self._total:
            return
        self._printed = now
        left = (now - self._began) / max(steps - self._start, 1) * max(self._total - steps, 0)
        self._print(
            f"{steps}/{self._total} steps, {_episodes(row)}, {row['fps']:.0f} steps/s, "
            f"{left:.0f} s left"
        )

    def note(self, text: str) -> None:
        """Show a line of text."""
        if self._bar is not None:
            self._bar.write(f"{self._name}: {text}", file=sys.stderr)
        else:
            self._print(text)

    def close(self) -> None:
        """Leave the terminal tidy."""
        if self._bar is not None:
            self._bar.close()

    def _print(self, text: str) -> None:
        print(f"{self._name}: {text}", flush=True)


def _episodes(row: Mapping[str, float]) -> str:
    """Describe the last episodes; where robots do not fall, the first end late."""
    if math.isnan(row["return_mean"]):
        return "no episode over yet"
    return f"return {row['return_mean']:.1f}, length {row['length_mean']:.0f}"
