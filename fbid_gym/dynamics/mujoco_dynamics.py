"""Dynamics terms read from MuJoCo's own buffers, for a whole batch at once."""

from dataclasses import dataclass

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.errors import NonFiniteError, ShapeError
from fbid_gym.robots import Robot

BUFFERS = ("M", "qfrc_bias", "cdof", "cdof_dot", "cvel", "subtree_com", "xpos", "xmat")

# _TRANSPORT + r @ _TRANSPORT_ARM is the 6×6 matrix that takes a spatial velocity [angular; linear
# at c] to [linear at c + r; angular]: both MuJoCo's order and its reference point are left behind.
_TRANSPORT = np.roll(np.eye(6), 3, axis=0).reshape(36)
_TRANSPORT_ARM = np.pad(-skew(np.eye(3)), [(0, 0), (0, 3), (0, 3)]).reshape(3, 36)


@dataclass(frozen=True)
class _Layout:
    """Where a robot's quantities lie in MuJoCo's buffers; F feet, nv coordinates."""

    base: int
    feet: np.ndarray  # (F,) body ids
    centre: np.ndarray  # (F, 3) m, centre of the foot's points, body frame
    drop: np.ndarray  # (F, 3) m, from the lowered reference up to that centre, world
    mask: np.ndarray  # (F, nv) 1 where the coordinate moves the foot
    sparse: np.ndarray  # (nv * nv,) for each entry of M, its place in MuJoCo's sparse M
    present: np.ndarray  # (nv * nv,) 1 where M can be nonzero
    base_armature: np.ndarray | None  # (3,) armature on the base's translation, if any
    members: np.ndarray  # (B,) 1 for the robot's bodies, 0 for others
    mass: float

    @classmethod
    def of(cls, robot: Robot) -> "_Layout":
        model = robot.model
        nv = model.nv
        feet = np.array([foot.body for foot in robot.feet])
        mask = np.zeros((len(feet), nv))
        for row, body in zip(mask, feet, strict=True):
            dof = _last_dof(model, body)
            while dof >= 0:
                row[dof] = 1.0
                dof = model.dof_parentid[dof]
        sparse, present = np.zeros((nv, nv), int), np.zeros((nv, nv))
        for row in range(nv):
            places = model.M_rowadr[row] + np.arange(model.M_rownnz[row])
            columns = model.M_colind[places]
            sparse[row, columns] = sparse[columns, row] = places
            present[row, columns] = present[columns, row] = 1.0
        return cls(
            base=robot.base_body,
            feet=feet,
            centre=np.array([foot.points.mean(axis=0) for foot in robot.feet]),
            drop=np.array([[0.0, 0.0, foot.radius] for foot in robot.feet]),
            mask=mask,
            sparse=sparse.ravel(),
            present=present.ravel(),
            base_armature=model.dof_armature[:3].copy() if model.dof_armature[:3].any() else None,
            members=(model.body_rootid == robot.base_body).astype(float),
            mass=robot.mass,
        )


def _last_dof(model: mujoco.MjModel, body: int) -> int:
    """The last coordinate that moves `body`, or -1."""
    while body > 0 and model.body_dofnum[body] == 0:
        body = model.body_parentid[body]
    return model.body_dofadr[body] + model.body_dofnum[body] - 1 if body > 0 else -1


class LiveTerms:
    """The terms of a persistent batch at its current state, without any further simulation.

    The batch's position- and velocity-dependent fields must be current, as they are after
    `batch.step(nstep, stage=mjSTAGE_VEL)` or `batch.forward(stage=mjSTAGE_VEL)`. Its model may hold
    other bodies after the robot's.
    """

    def __init__(self, robot: Robot, batch: mujoco.batch.Batch) -> None:
        """Bind the buffers of `batch`, which simulates `robot`."""
        self._layout = _Layout.of(robot)
        self._buffers = {name: batch.bind(name) for name in BUFFERS}
        for name in ("qfrc_bias", "cdof", "cdof_dot"):
            self._buffers[name] = self._buffers[name][:, : robot.nv]
        self._qvel = batch.bind("qvel")[:, : robot.nv]
        self._batch = batch

    def __call__(self) -> DynamicsTerms:
        """Return the terms, in arrays of their own."""
        at, buffers, qvel = self._layout, self._buffers, self._qvel
        num_robots, nv = qvel.shape
        num_feet = len(at.feet)

        matrix = buffers["M"].take(at.sparse, axis=1)
        matrix *= at.present
        matrix = matrix.reshape(num_robots, nv, nv)

        com = buffers["subtree_com"][:, at.base]
        rotation = buffers["xmat"].take(at.feet, axis=1).reshape(num_robots, num_feet, 3, 3)
        centre = buffers["xpos"].take(at.feet, axis=1)
        centre += np.matvec(rotation, at.centre)
        reference = centre - at.drop
        transport = (reference - com[:, None]) @ _TRANSPORT_ARM
        transport += _TRANSPORT
        transport = transport.reshape(num_robots, num_feet, 6, 6)

        cdof = buffers["cdof"]
        jacobian = transport @ cdof.swapaxes(1, 2)[:, None]
        jacobian *= at.mask[:, None]

        spatial = buffers["cvel"].take(at.feet, axis=1)
        velocity = np.matvec(transport, spatial)
        bias = np.matvec(transport, at.mask @ (buffers["cdof_dot"] * qvel[:, :, None]))
        # omega × (velocity of the centre): the part of a point's acceleration that its spatial
        # acceleration leaves out.
        spin = skew(velocity[..., 3:])
        bias[..., :3] += np.matvec(spin, velocity[..., :3] + np.matvec(spin, at.drop))

        momentum = np.matvec(matrix[:, :3], qvel)
        if at.base_armature is not None:
            momentum -= at.base_armature * qvel[:, :3]
        return DynamicsTerms(
            mass_matrix=matrix,
            bias=buffers["qfrc_bias"].copy(),
            base_position=buffers["xpos"][:, at.base].copy(),
            base_rotation=buffers["xmat"][:, at.base].copy().reshape(num_robots, 3, 3),
            com=com.copy(),
            com_velocity=momentum / self._mass(),
            foot_position=reference,
            foot_rotation=rotation,
            foot_velocity=velocity,
            foot_jacobian=jacobian,
            foot_bias=bias,
        )

    def _mass(self) -> float | np.ndarray:
        """Mass of the robot, or of each robot, (N, 1), where they differ."""
        masses = self._batch.expanded("body_mass")
        if masses is None:
            return self._layout.mass
        members = self._layout.members
        return np.vecdot(masses[:, : len(members)], members)[:, None]


class MuJoCoDynamics:
    """Dynamics terms of a robot at any states, computed by MuJoCo."""

    def __init__(self, robot: Robot, *, num_threads: int = 1) -> None:
        """Compute on `num_threads` threads."""
        self.robot = robot
        self._num_threads = num_threads
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
        if self._batch is None or self._batch.nsim != len(qpos):
            self._batch = mujoco.batch.Batch(
                self.robot.model, len(qpos), self._num_threads, persistent=True
            )
            self._live = LiveTerms(self.robot, self._batch)
            self._state = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._state[0][:], self._state[1][:] = qpos, qvel
        self._batch.forward(stage=mujoco.mjtStage.mjSTAGE_VEL)
        return self._live()


def check_states(robot: Robot, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the states as float arrays, or raise one error that names what is wrong."""
    qpos, qvel = np.asarray(qpos, dtype=float), np.asarray(qvel, dtype=float)
    if qpos.ndim != 2 or qpos.shape[1] != robot.nq:
        raise ShapeError("qpos", qpos.shape, f"(N, {robot.nq}): {robot.name} has nq = {robot.nq}")
    if qvel.shape != (len(qpos), robot.nv):
        raise ShapeError("qvel", qvel.shape, f"({len(qpos)}, {robot.nv}), one row per row of qpos")
    for name, array in (("qpos", qpos), ("qvel", qvel)):
        if not np.isfinite(array).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise NonFiniteError(name, where)
    return qpos, qvel
