"""The outcome of a policy step, for observation and reward."""

from typing import NamedTuple

import numpy as np

from fbid_gym.quantities import DynamicsTerms, RobotState


class Posture(NamedTuple):
    """Posture of N robots; P points.

    Attributes:
        base: (N, 3) m, where each base is in its support frame.
        velocity: (N, 3) m/s, of the base along the axes of that frame.
        upright: (N,) cosine of the angle between the base's up direction and the vertical. The
            base's up direction is that which points up at home.
        touching: (N, P) bool, which points carry weight.
        grounded: (N,) share of the points that do.
        slip: (N,) m/s, mean speed of the points on the ground.
        fallen: (N,) bool, who lies: is too low or too far from upright, see `Body`.
    """

    base: np.ndarray
    velocity: np.ndarray
    upright: np.ndarray
    touching: np.ndarray
    grounded: np.ndarray
    slip: np.ndarray
    fallen: np.ndarray


class Outcome(NamedTuple):
    """Outcome of one policy step of N robots: as it is, or as the robots believe it to be.

    Attributes:
        state: at the end of the step.
        terms: dynamics at the end of the step.
        posture: at the end of the step.
        torque: (N, n) N·m, on the last control tick.
        torque_rms: (N,) N·m, root mean square over the joints and ticks of the step.
        power: (N,) W, mean over the ticks of the joints' summed |torque * velocity|.
        distance: (N,) m, horizontal way of the base since the episode began.
        energy: (N,) J, the integral of the power since then.
        actual: dynamics where the robots are; the same as `terms` unless these are an estimate's.
    """

    state: RobotState
    terms: DynamicsTerms
    posture: Posture
    torque: np.ndarray
    torque_rms: np.ndarray
    power: np.ndarray
    distance: np.ndarray
    energy: np.ndarray
    actual: DynamicsTerms

    @property
    def estimated(self) -> bool:
        """Whether this is what robots believe, and not what is."""
        return self.terms is not self.actual

    @property
    def metrics(self) -> dict[str, np.ndarray]:
        """Metrics of every task, name -> (N,): torques, power and slip."""
        return {"torque_rms": self.torque_rms, "power": self.power, "slip": self.posture.slip}


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths (N,) of vectors (N, k)."""
    return np.sqrt(np.einsum("nk,nk->n", vectors, vectors))
