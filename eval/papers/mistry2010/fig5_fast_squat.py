"""[M10] figure 5: the squat/bow five times faster, through full extension of the knees."""

from typing import Any

from eval.page.html import figure, text
from eval.papers.experiment import Experiment, Result, Setting, main, row
from eval.papers.mistry2010 import joint_tracking as jt
from eval.papers.page import Finding, fate, judged

PAPER_BOTH = (0.005, 0.109, 0.052)


def run(setting: Setting) -> Result:
    """Run every controller over the fast motion."""
    numbers, arrays = jt.run(5.0, setting)
    return Result(findings(numbers), numbers, arrays)


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's numbers beside ours."""
    rows = numbers["rows"]
    ours, stiff = row(rows, name="PD+FF, soft gains"), row(rows, name="PD, best gains")
    soft, best = row(rows, name="PD, soft gains"), numbers["best"]
    small = all(a <= b for a, b in zip(ours["rms"], PAPER_BOTH, strict=True))
    fallen = sum(gains["fell"] is not None for gains in numbers["alone"])
    return [
        judged(
            "PD+FF through full knee extension",
            "stays up",
            fate(ours["fell"]),
            "stays up",
            ours["fell"] is None,
        ),
        judged(
            "RMS error of hip, knee, ankle with PD+FF, rad",
            jt.triple(PAPER_BOTH),
            jt.triple(ours["rms"]),
            "no worse than the paper's",
            small,
        ),
        judged(
            "PD alone, gains that err like the paper's in the slow motion",
            "falls within 1 s",
            fate(soft["fell"]),
            "falls",
            soft["fell"] is not None,
        ),
        Finding(
            f"PD alone, the best gains of the sweep ({best['hertz']:g} Hz, ζ {best['zeta']:g})",
            "not given",
            f"{fate(stiff['fell'])}; {jt.triple(stiff['rms'])}",
        ),
        Finding(
            "PD alone, gains of the sweep that fall", "", f"{fallen} of {len(numbers['alone'])}"
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    return [
        jt.pictures(
            result,
            "PD+FF, soft gains",
            (0.0, 0.5, 1.0, 1.5, 4.0, 4.5, 5.0),
            "PD with inverse dynamics. At 4 and 5 s the knees are at their limit.",
        ),
        jt.pictures(
            result,
            "PD, soft gains",
            (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5),
            "PD alone at the same gains.",
        ),
        figure(
            [*jt.joint_charts(result), jt.gains_chart(numbers)],
            "Left leg, as the paper's figure 5. A curve ends where the robot falls.",
        ),
        jt.controllers_table(numbers),
        figure(
            jt.error_charts(result),
            "Errors of the paper's rivals on the same motion, at the same gains.",
            3,
        ),
        text(
            "PD alone does not have to fall: stiff enough, it follows the planned motion, "
            "which keeps the centre of mass over the feet. It falls at gains at which it errs "
            "as much as the paper's PD does."
        ),
        jt.gains_table(numbers),
    ]


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig5_fast_squat",
    title="Figure 5: five times faster",
    about=(
        "The same motion in 6 s: a squat a second, full extension of the knees at their joint "
        "limit from 4 s on. No balance controller."
    ),
    run=run,
    show=show,
)

if __name__ == "__main__":
    main(EXPERIMENT)
