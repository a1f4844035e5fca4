"""The Coriolis matrix C of a batch of robots, with C v + g the bias and Mdot - 2 C skew.

Many matrices satisfy C v = the velocity-dependent forces. This one is built from the bodies'
Christoffel symbols (Echeandia and Wensing, "Numerical methods to compute the Coriolis matrix and
Christoffel symbols for rigid-body systems", 2021):

    C = sum over bodies J_b^T (I_b Jdot_b + B_b J_b),
    B_b = 1/2 ((v x*) I - I (v x) + (I v) xbar*),

in which the derivative of every column of J_b is the true one. Armature is constant and adds
nothing. From MuJoCo's buffers it is a composite rigid body algorithm without a loop over robots:
for coordinates j and k with the deeper one on body b, and ^c the sum over the subtree of b,
C_jk = S_j^T (I_b^c Sdot_k + B_b^c S_k).

MuJoCo's `cdof_dot` gives the right sum Jdot v, but not the right columns where a joint has several
axes that turn with the body: those of the free joint's rotation are replaced by omega_base x axis.

`eval.papers.garofalo2015.pinocchio_coriolis` has the same matrix of a nominal model.
"""

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.mujoco_dynamics import check_states
from fbid_gym.robots import Robot


def _spatial_inertia_map() -> np.ndarray:
    """Map (10, 36) from MuJoCo's `cinert` to the 6x6 spatial inertia, angular part first."""
    entries = np.zeros((10, 6, 6))
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    for index, (row, column) in enumerate(places):
        entries[index, row, column] = entries[index, column, row] = 1.0
    first_moment = skew(np.eye(3))
    entries[6:9, :3, 3:] = first_moment
    entries[6:9, 3:, :3] = -first_moment
    entries[9, 3:, 3:] = np.eye(3)
    return entries.reshape(10, 36)


def _motion_cross_map() -> np.ndarray:
    """Map (6, 36) from v = [omega; u] to v x = [[omega x, 0], [u x, omega x]]."""
    entries, cross = np.zeros((6, 6, 6)), skew(np.eye(3))
    entries[:3, :3, :3] = entries[:3, 3:, 3:] = entries[3:, 3:, :3] = cross
    return entries.reshape(6, 36)


def _force_cross_map() -> np.ndarray:
    """Map (6, 36) from f = [n; f] to f xbar* = -[[n x, f x], [f x, 0]], (f xbar*) v = v x* f."""
    entries, cross = np.zeros((6, 6, 6)), skew(np.eye(3))
    entries[:3, :3, :3] = entries[3:, :3, 3:] = entries[3:, 3:, :3] = -cross
    return entries.reshape(6, 36)


_INERTIA, _CROSS, _FORCE_CROSS = _spatial_inertia_map(), _motion_cross_map(), _force_cross_map()


class CoriolisMatrix:
    """The Coriolis matrix of a robot at any states, from MuJoCo's buffers."""

    def __init__(self, robot: Robot, *, num_threads: int = 1) -> None:
        """Find the ancestors of bodies and coordinates."""
        model = robot.model
        self.robot = robot
        self._num_threads = num_threads
        self._batch: mujoco.batch.Batch | None = None
        # subtree[a, b]: body b is a or hangs from a.
        subtree = np.eye(model.nbody)
        for body in range(model.nbody - 1, 0, -1):
            subtree[model.body_parentid[body]] += subtree[body]
        self._subtree = subtree
        self._body = model.dof_bodyid.copy()
        # deeper[j, k]: coordinate k moves the body of j or one that hangs from it.
        self._deeper = subtree[np.ix_(self._body, self._body)]
        self._shallower = self._deeper.T * (1.0 - self._deeper)

    def __call__(self, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """Return C at N states.

        Args:
            qpos: (N, nq) m, quaternion wxyz, rad.
            qvel: (N, nv) m/s, rad/s.

        Returns:
            (N, nv, nv), in MuJoCo's coordinates.

        Raises:
            ShapeError: qpos or qvel is not a batch of this robot's states.
            NonFiniteError: a state holds NaN or infinity.
        """
        qpos, qvel = check_states(self.robot, qpos, qvel)
        if self._batch is None or self._batch.nsim != len(qpos):
            self._batch = mujoco.batch.Batch(
                self.robot.model, len(qpos), self._num_threads, persistent=True
            )
        batch = self._batch
        batch.bind("qpos")[:], batch.bind("qvel")[:] = qpos, qvel
        batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
        buffers = {name: batch.bind(name) for name in ("cdof", "cdof_dot", "cvel", "cinert")}
        return self._assemble(**buffers)

    def _assemble(
        self, cdof: np.ndarray, cdof_dot: np.ndarray, cvel: np.ndarray, cinert: np.ndarray
    ) -> np.ndarray:
        """Composite inertias, then products along the kinematic chains."""
        num_robots, num_bodies, _ = cvel.shape
        shape = (num_robots, num_bodies, 6, 6)
        inertia = (cinert @ _INERTIA).reshape(shape)
        cross = (cvel @ _CROSS).reshape(shape)
        product = inertia @ cross
        momentum = np.matvec(inertia, cvel)
        # (v x*) = -(v x)^T, and I is symmetric.
        factor = -product.mT - product + (momentum @ _FORCE_CROSS).reshape(shape)

        def composite(matrices: np.ndarray) -> np.ndarray:
            flat = self._subtree @ matrices.reshape(num_robots, num_bodies, 36)
            return flat.reshape(shape)[:, self._body]

        inertia, factor = composite(inertia), composite(0.5 * factor)
        rate = cdof_dot.copy()
        rate[:, 3:6] = np.matvec(cross[:, None, self._body[3]], cdof[:, 3:6])

        moved = np.matvec(inertia, rate) + np.matvec(factor, cdof)  # by the column's own subtree
        result = cdof @ moved.mT * self._deeper
        # and where the row's subtree is the smaller one
        left, left_factor = np.vecmat(cdof, inertia), np.vecmat(cdof, factor)
        result += (left @ rate.mT + left_factor @ cdof.mT) * self._shallower
        return result
