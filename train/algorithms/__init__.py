"""Algorithms: stable-baselines3's as this package sets them up, one module each.

All that differs between them is in an `Algorithm`; whoever trains, saves and exports asks that, and
never which one it is.
"""

from train.algorithms import crossq, ppo, sac
from train.algorithms.algorithm import Algorithm

ALGORITHMS: dict[str, Algorithm] = {
    "ppo": ppo.ALGORITHM,
    "sac": sac.ALGORITHM,
    "crossq": crossq.ALGORITHM,
}
"""By the names of `train.runs.config.ALGORITHMS`."""
