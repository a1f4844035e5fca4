"""Dynamics terms at any states, by MuJoCo."""

import copy

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.checks import check_finite
from fbid_gym.dynamics.live_terms import LiveTerms
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots import Robot

_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


class MuJoCoDynamics:
    """Dynamics terms of a robot at any states, computed by MuJoCo."""

    def __init__(self, robot: Robot, *, num_threads: int = 1) -> None:
        """Compute on `num_threads` threads."""
        self.robot, self._num_threads = robot, num_threads
        self._batch: mujoco.batch.Batch | None = None

    def terms(self, qpos: np.ndarray, qvel: np.ndarray) -> DynamicsTerms:
        """Return the terms at N states.

        Args:
            qpos: (N, nq) m, unit quaternion wxyz, rad.
            qvel: (N, nv) m/s, rad/s.

        Returns:
            The terms, in arrays of their own.

        Raises:
            ShapeError: qpos or qvel is not a batch of this robot's states.
            NonFiniteError: a state holds NaN or infinity.
        """
        qpos, qvel = check_states(self.robot, qpos, qvel)
        return DynamicsTerms(*(part.copy() for part in self.live(qpos, qvel)))

    def live(self, qpos: np.ndarray, qvel: np.ndarray) -> DynamicsTerms:
        """Return the same at states that have been checked, in arrays that the next writes anew."""
        if self._batch is None or self._batch.nsim != len(qpos):
            model = without_contact(self.robot)
            self._batch = mujoco.batch.Batch(model, len(qpos), self._num_threads, persistent=True)
            self._live = LiveTerms(self.robot, self._batch)
            self._state = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._state[0][:], self._state[1][:] = qpos, qvel
        self._batch.forward(stage=_VELOCITY)
        return self._live()


def without_contact(robot: Robot) -> mujoco.MjModel:
    """Return a copy of a robot's model that looks for no contacts: dynamics terms need none."""
    model = copy.copy(robot.model)
    unused = mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.opt.disableflags |= int(unused[0]) | int(unused[1])
    return model


def check_states(robot: Robot, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the states as float arrays, or raise one error that names what is wrong."""
    qpos, qvel = np.asarray(qpos, dtype=float), np.asarray(qvel, dtype=float)
    if qpos.ndim != 2 or qpos.shape[1] != robot.nq:
        raise ShapeError("qpos", qpos.shape, f"(N, {robot.nq}): {robot.name} has nq = {robot.nq}")
    if qvel.shape != (len(qpos), robot.nv):
        raise ShapeError("qvel", qvel.shape, f"({len(qpos)}, {robot.nv}), one row per row of qpos")
    check_finite("qpos", qpos)
    check_finite("qvel", qvel)
    return qpos, qvel
