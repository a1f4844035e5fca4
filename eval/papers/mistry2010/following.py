"""What the robots of [M10]'s experiments shall do: follow a motion."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from eval.papers.trial import Plan, Wanted
from fbid_gym.envs.simulation import Simulation
from fbid_gym.quantities import Target


class Motion(Protocol):
    """What the robots shall do; see `fbid_gym.motions`."""

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Target:
        """Return what each robot shall do at its own `tick` (N,), at `speed` (N,) m/s."""
        ...


def following(motion: Motion, speed: float = 0.0, pose: np.ndarray | None = None) -> Plan[Target]:
    """Return the plan to follow a motion. The log gets the "target" (T, N, n) rad of the joints.

    Args:
        motion: what to do.
        speed: m/s commanded.
        pose: (N, 3) m, m, rad: where each robot begins in the world, and its heading; None for the
            origin.
    """

    def begin(simulation: Simulation, start: np.ndarray) -> Callable[[np.ndarray], Wanted]:
        every = np.arange(simulation.num_robots)
        speeds = np.full(len(every), speed)
        first = motion.reference(start, speeds)
        simulation.place(every, *_placed(first.qpos.copy(), first.qvel.copy(), pose))

        def wanted(tick: np.ndarray) -> Wanted[Target]:
            reference = motion.reference(tick, speeds)
            target = reference.qpos[:, 7:]
            return Wanted(reference, reference.qpos[:, 2], lambda: {"target": target})

        return wanted

    return begin


def _placed(
    qpos: np.ndarray, qvel: np.ndarray, pose: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Take states to places and headings of their own."""
    if pose is not None:
        heading = pose[:, 2]
        _turn(qpos, [0, 1], heading)
        _turn(qvel, [0, 1], heading)
        qpos[:, :2] += pose[:, :2]
        _turn(qpos, [3, 6], 0.5 * heading)
        _turn(qpos, [4, 5], 0.5 * heading)
    return qpos, qvel


def _turn(values: np.ndarray, pair: list[int], angle: np.ndarray) -> None:
    """Turn the vectors in two columns."""
    x, y = values[:, pair].T
    cosine, sine = np.cos(angle), np.sin(angle)
    values[:, pair] = np.stack([cosine * x - sine * y, cosine * y + sine * x], axis=1)
