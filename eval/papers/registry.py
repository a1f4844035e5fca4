"""All experiments: each paper's, in the order of the page."""

from collections.abc import Sequence
from typing import NamedTuple

from eval.papers.experiment import Experiment
from eval.papers.garofalo2015 import largest_blow, push, tracking, uneven
from eval.papers.garofalo2015 import model_errors as wrong_robots
from eval.papers.mistry2010 import (
    continuity,
    identification,
    minimum_norm,
    model_errors,
    quadruped,
    squats,
    stepping,
    stepping_search,
    weights,
    wrong_contacts,
)
from fbid_gym.checks import check_choices


class Paper(NamedTuple):
    """A paper and its experiments; `about` is what stands above their sections."""

    title: str
    about: str
    experiments: tuple[Experiment, ...]


PAPERS = {
    "mistry2010": Paper(
        "Mistry, Buchli, Schaal 2010: inverse dynamics by orthogonal decomposition",
        "M. Mistry, J. Buchli, S. Schaal, “Inverse dynamics control of floating base systems using "
        "orthogonal decomposition”, ICRA 2010. The paper's biped is a simulated Sarcos humanoid's "
        "lower half, its quadruped the real LittleDog; ours are robots of the same size and build, "
        "simulated at 1 kHz and controlled at 500 Hz as in the paper. The paper shows its motions "
        "as plots, without formulas, so ours are of the same kind, not the same. PD+FF is the "
        "paper's controller, eq. (18) with eq. (15).",
        (
            *(squats.fig4_slow_squat, squats.fig5_fast_squat, weights.fig6_7_weights),
            *(stepping.fig8_9_stepping, stepping_search.fig8_9_search),
            *(quadruped.fig10_11_quadruped, identification.identification),
            *(continuity.claim_continuity, wrong_contacts.claim_wrong_contacts),
            *(model_errors.claim_model_errors, minimum_norm.claim_minimum_norm),
        ),
    ),
    "garofalo2015": Paper(
        "Garofalo, Henze, Englsberger, Ott 2015: inertially decoupled dynamics",
        "G. Garofalo, B. Henze, J. Englsberger, C. Ott, “On the inertially decoupled structure of "
        "the floating base robot dynamics”, IFAC 2015. The paper's robot is the real TORO; ours is "
        "a simulated one of its published link data, 27 joints and 77.5 kg. Three balancers are "
        "compared: that of Ott, Roa and Hirzinger 2011 as the paper states it, the paper's, and "
        "the paper's wrench through full inverse dynamics.",
        (
            *(push.fig2_push, largest_blow.largest_blow, tracking.tracking, uneven.uneven),
            wrong_robots.model_errors,
        ),
    ),
}
"""By the name of their packages."""


def experiments(only: Sequence[str]) -> list[tuple[Paper, list[Experiment]]]:
    """Return the experiments of the papers, or those named.

    Args:
        only: names of experiments or papers' packages; all if empty.

    Raises:
        UnknownOptionError: a name that is neither.
    """
    names = [one.name for paper in PAPERS.values() for one in paper.experiments] + [*PAPERS]
    check_choices("experiment", only, names)
    chosen = (
        (paper, [e for e in paper.experiments if not only or {e.name, package} & {*only}])
        for package, paper in PAPERS.items()
    )
    return [(paper, some) for paper, some in chosen if some]
