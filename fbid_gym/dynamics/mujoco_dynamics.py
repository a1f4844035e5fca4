"""Dynamics terms by MuJoCo: of a whole batch, read from its own buffers, and at any states."""

import copy
from functools import partial
from typing import NamedTuple

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.checks import check_finite
from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.dynamics.vectors import (
    Rotation,
    add,
    cross,
    matrix,
    product,
    scale,
    store,
    store_matrix,
    subtract,
    turn,
    vector,
)
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots import Robot

_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


class MuJoCoDynamics:
    """Dynamics terms of a robot at any states, computed by MuJoCo."""

    def __init__(self, robot: Robot) -> None:
        """Leave it to the first call to make what computes them."""
        self.robot = robot
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
            self._batch = mujoco.batch.Batch(model, len(qpos), 1, persistent=True)
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


class _Layout(NamedTuple):
    """Places of a robot's quantities in MuJoCo's buffers; F feet, nv coordinates, B bodies."""

    base: int
    base_from_trunk: np.ndarray  # (3, 3)
    feet: np.ndarray  # (F,) body ids
    centre: np.ndarray  # (F, 3) m, centre of the foot's points, body frame
    drop: np.ndarray  # (F,) m, height of that centre above the lowered reference
    last: np.ndarray  # (F,) the last coordinate that moves the foot
    parent: np.ndarray  # (nv,) the coordinate before it on the way to the base; -1: none
    row: np.ndarray  # (nv + 1,) where the rows of MuJoCo's sparse M begin, and where the last ends
    column: np.ndarray  # columns of its entries, which are those of the lower half
    base_armature: np.ndarray  # (3,) kg, armature on the base's translation


class _Buffers(NamedTuple):
    """Results of MuJoCo for N robots, under its own names."""

    M: np.ndarray
    qfrc_bias: np.ndarray
    cdof: np.ndarray
    cdof_dot: np.ndarray
    cvel: np.ndarray
    subtree_com: np.ndarray
    xpos: np.ndarray
    xmat: np.ndarray


def _layout_of(robot: Robot) -> _Layout:
    model = robot.model
    return _Layout(
        base=robot.base_body,
        base_from_trunk=base_from_trunk(robot),
        feet=np.array([foot.body for foot in robot.feet], np.int64),
        centre=np.array([foot.points.mean(axis=0) for foot in robot.feet]),
        drop=np.array([foot.radius for foot in robot.feet]),
        last=np.array([_last_dof(model, foot.body) for foot in robot.feet], np.int64),
        parent=model.dof_parentid.astype(np.int64),
        row=np.append(model.M_rowadr, model.M_rowadr[-1] + model.M_rownnz[-1]).astype(np.int64),
        column=model.M_colind.astype(np.int64),
        base_armature=model.dof_armature[:3].copy(),
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
        buffers = _Buffers(*(batch.bind(name) for name in _Buffers._fields))
        first = column_of(batch.bind("qvel"), batch)
        # What is zero in one state is zero in all, and feet go as their base does.
        self._terms = zero_terms(robot, len(batch.state))
        self._terms.foot_jacobian[..., :3, :3] = np.eye(3)
        self._all = np.ones(len(batch.state), bool)
        self._read = partial(_read, _layout_of(robot), buffers, batch.state, first, self._terms)

    def __call__(self, which: np.ndarray | None = None) -> DynamicsTerms:
        """Return the terms, in arrays that the next call writes anew: all, or of `which` (N,)."""
        self._read(self._all if which is None else which)
        return self._terms


def zero_terms(robot: Robot, count: int) -> DynamicsTerms:
    """Return terms of N robots, to be filled in."""
    feet, nv = (count, robot.num_feet), robot.nv
    return DynamicsTerms(
        mass_matrix=np.zeros((count, nv, nv)),
        bias=np.zeros((count, nv)),
        base_position=np.zeros((count, 3)),
        world_from_base=np.zeros((count, 3, 3)),
        world_from_trunk=np.zeros((count, 3, 3)),
        com=np.zeros((count, 3)),
        com_velocity=np.zeros((count, 3)),
        foot_position=np.zeros((*feet, 3)),
        world_from_foot=np.zeros((*feet, 3, 3)),
        foot_velocity=np.zeros((*feet, 6)),
        foot_jacobian=np.zeros((*feet, 6, nv)),
        foot_bias=np.zeros((*feet, 6)),
    )


def column_of(part: np.ndarray, batch: mujoco.batch.Batch) -> int:
    """Return the column of the batch's state, a row per robot, at which a view of it begins."""
    rows = batch.state
    return int(part.ctypes.data - rows.ctypes.data) // rows.itemsize


@kernel
def _read(
    layout: _Layout,
    buffers: _Buffers,
    states: np.ndarray,
    first: int,
    terms: DynamicsTerms,
    which: np.ndarray,
) -> None:
    """Write the terms of robots, (N,) bool; a state has their velocities from column `first` on."""
    nv, mass_matrix = len(layout.parent), terms.mass_matrix
    xpos, xmat = buffers.xpos, buffers.xmat
    for i in range(len(which)):
        if not which[i]:
            continue
        qvel = states[i, first : first + nv]
        for j in range(nv):
            terms.bias[i, j] = buffers.qfrc_bias[i, j]
            for place in range(layout.row[j], layout.row[j + 1]):  # of the lower half of M
                k = layout.column[place]
                mass_matrix[i, j, k] = mass_matrix[i, k, j] = buffers.M[i, place]
        store(vector(xpos, (i, layout.base)), terms.base_position, (i,))
        rotation = _rotation(xmat, i, layout.base)
        store_matrix(rotation, terms.world_from_base, (i,))
        trunk = product(rotation, matrix(layout.base_from_trunk, ()))
        store_matrix(trunk, terms.world_from_trunk, (i,))
        origin = vector(buffers.subtree_com, (i, layout.base))
        store(origin, terms.com, (i,))

        mass = mass_matrix[i, 0, 0] - layout.base_armature[0]
        for axis in range(3):
            momentum = -layout.base_armature[axis] * qvel[axis]
            for j in range(nv):
                momentum += mass_matrix[i, axis, j] * qvel[j]
            terms.com_velocity[i, axis] = momentum / mass

        for foot in range(len(layout.feet)):
            body, lowered = layout.feet[foot], (0.0, 0.0, layout.drop[foot])
            rotation = _rotation(xmat, i, body)
            store_matrix(rotation, terms.world_from_foot, (i, foot))
            middle = add(vector(xpos, (i, body)), turn(rotation, vector(layout.centre, (foot,))))
            reference = subtract(middle, lowered)
            store(reference, terms.foot_position, (i, foot))

            # MuJoCo's spatial velocities are [angular; linear at the centre of mass].
            arm = subtract(reference, origin)
            angular = vector(buffers.cvel, (i, body))
            linear = add(vector(buffers.cvel, (i, body), 3), cross(angular, arm))
            store(linear, terms.foot_velocity, (i, foot))
            store(angular, terms.foot_velocity, (i, foot), 3)

            spin, rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            dof = layout.last[foot]
            while dof > 2:
                axes = vector(buffers.cdof, (i, dof))
                along = add(vector(buffers.cdof, (i, dof), 3), cross(axes, arm))
                for axis in range(3):
                    terms.foot_jacobian[i, foot, axis, dof] = along[axis]
                    terms.foot_jacobian[i, foot, 3 + axis, dof] = axes[axis]
                spin = add(spin, scale(qvel[dof], vector(buffers.cdof_dot, (i, dof))))
                rate = add(rate, scale(qvel[dof], vector(buffers.cdof_dot, (i, dof), 3)))
                dof = layout.parent[dof]
            # omega × (velocity of the centre): the part of a point's acceleration that its spatial
            # acceleration leaves out.
            rest = cross(angular, add(linear, cross(angular, lowered)))
            store(add(add(rate, cross(spin, arm)), rest), terms.foot_bias, (i, foot))
            store(spin, terms.foot_bias, (i, foot), 3)


@compiled
def _rotation(xmat: np.ndarray, i: int, body: int) -> Rotation:
    """The rotation of a body, world from body."""
    return vector(xmat, (i, body)), vector(xmat, (i, body), 3), vector(xmat, (i, body), 6)
