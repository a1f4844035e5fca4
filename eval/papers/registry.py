"""Which experiments there are: name and order of each paper's scripts."""

import importlib
from dataclasses import dataclass

from eval.papers.experiment import Experiment
from fbid_gym.errors import UnknownOptionError


@dataclass(frozen=True)
class Entry:
    """A paper and its scripts.

    Attributes:
        package: name under `eval.papers`.
        title: of the paper.
        about: HTML, what stands above its sections.
        scripts: modules in the order of the page; each has an `EXPERIMENT`.
    """

    package: str
    title: str
    about: str
    scripts: tuple[str, ...]

    def experiments(self) -> list[Experiment]:
        """Import the scripts."""
        names = [f"eval.papers.{self.package}.{script}" for script in self.scripts]
        return [importlib.import_module(name).EXPERIMENT for name in names]


PAPERS = (
    Entry(
        package="mistry2010",
        title="Mistry, Buchli, Schaal 2010: inverse dynamics by orthogonal decomposition",
        about=(
            "M. Mistry, J. Buchli, S. Schaal, “Inverse dynamics control of floating base systems "
            "using orthogonal decomposition”, ICRA 2010. The paper's biped is a simulated Sarcos "
            "humanoid's lower half, its quadruped the real LittleDog; ours are robots of the same "
            "size and build, simulated at 1 kHz and controlled at 500 Hz as in the paper. The "
            "paper shows its motions as plots, without formulas, so ours are of the same kind, not "
            "the same. PD+FF is the paper's controller, eq. (18) with eq. (15)."
        ),
        scripts=(
            "fig4_slow_squat",
            "fig5_fast_squat",
            "fig6_7_weights",
            "fig8_9_stepping",
            "fig10_11_quadruped",
            "identification",
            "claim_continuity",
            "claim_wrong_contacts",
            "claim_model_errors",
            "claim_minimum_norm",
        ),
    ),
    Entry(
        package="garofalo2015",
        title="Garofalo, Henze, Englsberger, Ott 2015: inertially decoupled dynamics",
        about=(
            "G. Garofalo, B. Henze, J. Englsberger, C. Ott, “On the inertially decoupled structure "
            "of the floating base robot dynamics”, IFAC 2015. The paper's robot is the real TORO; "
            "ours is a simulated one of its published link data, 27 joints and 77.5 kg. Three "
            "balancers are compared: that of Ott, Roa and Hirzinger 2011 as the paper states it, "
            "the paper's, and the paper's wrench through full inverse dynamics."
        ),
        scripts=(
            "fig2_push",
            "largest_blow",
            "tracking",
            "uneven",
            "model_errors",
        ),
    ),
)


def experiments(papers: tuple[Entry, ...], only: tuple[str, ...]) -> dict[Entry, list[Experiment]]:
    """Return the experiments of some papers, or those named.

    Args:
        papers: which.
        only: names of scripts or packages; all if empty.

    Raises:
        UnknownOptionError: a name that is neither.
    """
    found = {entry: entry.experiments() for entry in papers}
    names = [e.name for es in found.values() for e in es] + [entry.package for entry in papers]
    for name in only:
        if name not in names:
            raise UnknownOptionError("experiment", name, names)
    if not only:
        return found
    chosen = {
        entry: [e for e in es if e.name in only or entry.package in only]
        for entry, es in found.items()
    }
    return {entry: es for entry, es in chosen.items() if es}
