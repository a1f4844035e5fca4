"""Which experiments there are: each paper's, in the order of the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from eval.papers.experiment import Experiment, found
from fbid_gym.errors import UnknownOptionError


@dataclass(frozen=True)
class Entry:
    """A paper and its experiments.

    Attributes:
        package: name under `eval.papers`.
        title: of the paper.
        about: what stands above its sections.
        modules: those of the package that hold its experiments, with their names.
    """

    package: str
    title: str
    about: str
    modules: Mapping[str, str]

    def experiments(self) -> list[Experiment]:
        """Import the experiments."""
        named = ((module, names.split()) for module, names in self.modules.items())
        return [found(self.package, module, name) for module, names in named for name in names]


MISTRY = Entry(
    "mistry2010",
    "Mistry, Buchli, Schaal 2010: inverse dynamics by orthogonal decomposition",
    "M. Mistry, J. Buchli, S. Schaal, “Inverse dynamics control of floating base systems using "
    "orthogonal decomposition”, ICRA 2010. The paper's biped is a simulated Sarcos humanoid's "
    "lower half, its quadruped the real LittleDog; ours are robots of the same size and build, "
    "simulated at 1 kHz and controlled at 500 Hz as in the paper. The paper shows its motions as "
    "plots, without formulas, so ours are of the same kind, not the same. PD+FF is the paper's "
    "controller, eq. (18) with eq. (15).",
    {
        "squats": "fig4_slow_squat fig5_fast_squat",
        "weights": "fig6_7_weights",
        "stepping": "fig8_9_stepping",
        "stepping_search": "fig8_9_search",
        "quadruped": "fig10_11_quadruped",
        "identification": "identification",
        "continuity": "claim_continuity",
        "wrong_contacts": "claim_wrong_contacts",
        "model_errors": "claim_model_errors",
        "minimum_norm": "claim_minimum_norm",
    },
)
GAROFALO = Entry(
    "garofalo2015",
    "Garofalo, Henze, Englsberger, Ott 2015: inertially decoupled dynamics",
    "G. Garofalo, B. Henze, J. Englsberger, C. Ott, “On the inertially decoupled structure of the "
    "floating base robot dynamics”, IFAC 2015. The paper's robot is the real TORO; ours is a "
    "simulated one of its published link data, 27 joints and 77.5 kg. Three balancers are "
    "compared: that of Ott, Roa and Hirzinger 2011 as the paper states it, the paper's, and the "
    "paper's wrench through full inverse dynamics.",
    {
        "push": "fig2_push",
        "largest_blow": "largest_blow",
        "tracking": "tracking",
        "uneven": "uneven",
        "model_errors": "model_errors",
    },
)
PAPERS = (MISTRY, GAROFALO)


def experiments(
    papers: Sequence[Entry], only: Sequence[str]
) -> list[tuple[Entry, list[Experiment]]]:
    """Return the experiments of some papers, or those named.

    Args:
        papers: which.
        only: names of experiments or packages; all if empty.

    Raises:
        UnknownOptionError: a name that is neither.
    """
    every = [(entry, entry.experiments()) for entry in papers]
    names = [e.name for _, its in every for e in its] + [entry.package for entry in papers]
    for name in only:
        if name not in names:
            raise UnknownOptionError("experiment", name, names)
    chosen = [
        (entry, [e for e in its if not only or e.name in only or entry.package in only])
        for entry, its in every
    ]
    return [(entry, its) for entry, its in chosen if its]
