"""[M10] figures 3 and 4: tracking a slow squat/bow that extends the knees fully."""

from typing import Any

from eval.page.html import figure, text
from eval.papers.experiment import Experiment, Result, Setting, main, row
from eval.papers.mistry2010 import joint_tracking as jt
from eval.papers.page import Finding, fate, judged

PAPER_BOTH = (0.001, 0.011, 0.005)
PAPER_ALONE = (0.008, 0.076, 0.021)


def run(setting: Setting) -> Result:
    """Run every controller over the slow motion."""
    numbers, arrays = jt.run(1.0, setting)
    return Result(findings(numbers), numbers, arrays)


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The paper's numbers beside ours."""
    rows = numbers["rows"]
    ours, stiff = row(rows, name="PD+FF, soft gains"), row(rows, name="PD, best gains")
    soft, best = row(rows, name="PD, soft gains"), numbers["best"]
    small = all(a <= b for a, b in zip(ours["rms"], PAPER_BOTH, strict=True))
    frequency, zeta = jt.SOFT
    return [
        judged(
            "RMS error of hip, knee, ankle with PD+FF, rad",
            jt.triple(PAPER_BOTH),
            jt.triple(ours["rms"]),
            "no worse than the paper's",
            small and ours["fell"] is None,
        ),
        Finding(
            f"with PD alone, gains that err like the paper's ({frequency:g} Hz, ζ {zeta:g})",
            jt.triple(PAPER_ALONE),
            f"{jt.triple(soft['rms'])}; {fate(soft['fell'])}",
        ),
        Finding(
            f"with PD alone, the best gains of the sweep ({best['hertz']:g} Hz, "
            f"ζ {best['zeta']:g})",
            "not given",
            f"{jt.triple(stiff['rms'])}; {fate(stiff['fell'])}",
        ),
    ]


def show(result: Result) -> list[str]:
    """Draw the section."""
    numbers = result.numbers
    return [
        jt.pictures(
            result,
            "PD+FF, soft gains",
            (0.0, 2.5, 5.0, 7.5, 10.0, 17.5, 22.5),
            "PD with inverse dynamics. The trunk bows while the legs squat; from 20 s the "
            "knees reach full extension between squats.",
        ),
        figure(
            [*jt.joint_charts(result), jt.gains_chart(numbers)],
            "Left leg, as the paper's figure 4. Where PD+FF covers what is desired, the "
            "curves cannot be told apart. Last: the error against the gains; PD has to be "
            "stiff to be accurate, and too stiff it shakes itself down. PD+FF does not depend "
            "on the gains.",
        ),
        text(
            "The same motion with every controller, at the same soft gains but for the best "
            "PD. Contact-force feedback, eq. (8), knows the same model; what it does not have "
            "is the force that its own torque is about to cause."
        ),
        jt.controllers_table(numbers),
        figure(
            jt.error_charts(result),
            "Errors of the paper's rivals. A force that is measured arrives a step after the "
            "torque that caused it; nothing restores the part of the torque that only presses "
            "the feet against each other, so it wanders, and delay makes it swing. The "
            "estimate from the previous torque adds the feedback's share of that part up.",
            3,
        ),
        jt.gains_table(numbers),
    ]


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.fig4_slow_squat",
    title="Figures 3 and 4: a slow squat and bow",
    about=(
        "A deep squat every 5 s with a bow every 10 s, 30 s in all, planned in "
        "the null space of the contacts; no balance controller. The gains of PD alone are the "
        "best of a sweep of natural frequencies from 1 to 10 Hz and damping ratios from 0.3 to 1."
    ),
    run=run,
    show=show,
)

if __name__ == "__main__":
    main(EXPERIMENT)
