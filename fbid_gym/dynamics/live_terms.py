"""Dynamics terms read from MuJoCo's own buffers, for a whole batch at once."""

from functools import partial
from typing import NamedTuple

import mujoco
import mujoco.batch
import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.dynamics.vectors import (
    add,
    cross,
    matrix,
    product,
    scale,
    store,
    subtract,
    turn,
    vector,
)
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots import Robot


class _Layout(NamedTuple):
    """Where a robot's quantities lie in MuJoCo's buffers; F feet, nv coordinates, B bodies."""

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
    """What MuJoCo has computed for N robots, under its own names."""

    M: np.ndarray
    qfrc_bias: np.ndarray
    cdof: np.ndarray
    cdof_dot: np.ndarray
    cvel: np.ndarray
    subtree_com: np.ndarray
    xpos: np.ndarray
    xmat: np.ndarray


class _Velocities(NamedTuple):
    """Where the velocities of N robots are."""

    rows: np.ndarray  # (N, S), all of MuJoCo's state
    first: int  # column of the first coordinate's


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
        velocities = _Velocities(batch.state, column_of(batch.bind("qvel"), batch))
        # What is zero in one state is zero in all, and feet go as their base does.
        self._terms = zero_terms(robot, len(batch.state))
        self._terms.foot_jacobian[..., :3, :3] = np.eye(3)
        self._all = np.ones(len(batch.state), bool)
        self._read = partial(_read, _layout_of(robot), buffers, velocities, self._terms)

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
    velocities: _Velocities,
    terms: DynamicsTerms,
    which: np.ndarray,
) -> None:
    """Write the terms of robots, (N,) bool."""
    nv, first = len(layout.parent), velocities.first
    xpos, xmat = buffers.xpos, buffers.xmat
    for i in range(len(which)):
        if not which[i]:
            continue
        qvel = velocities.rows[i, first : first + nv]
        _unpack(i, buffers.M, layout.row, layout.column, terms.mass_matrix)
        for j in range(nv):
            terms.bias[i, j] = buffers.qfrc_bias[i, j]
        store(vector(xpos, (i, layout.base)), terms.base_position, (i,))
        for axis in range(3):
            store(vector(xmat, (i, layout.base), 3 * axis), terms.world_from_base, (i, axis))
        trunk = product(matrix(terms.world_from_base, (i,)), matrix(layout.base_from_trunk, ()))
        for axis in range(3):
            store(trunk[axis], terms.world_from_trunk, (i, axis))
        origin = vector(buffers.subtree_com, (i, layout.base))
        store(origin, terms.com, (i,))

        mass = terms.mass_matrix[i, 0, 0] - layout.base_armature[0]
        for axis in range(3):
            momentum = -layout.base_armature[axis] * qvel[axis]
            for j in range(nv):
                momentum += terms.mass_matrix[i, axis, j] * qvel[j]
            terms.com_velocity[i, axis] = momentum / mass

        for foot in range(len(layout.feet)):
            body, lowered = layout.feet[foot], (0.0, 0.0, layout.drop[foot])
            rotation = (
                vector(xmat, (i, body), 0),
                vector(xmat, (i, body), 3),
                vector(xmat, (i, body), 6),
            )
            for axis in range(3):
                store(rotation[axis], terms.world_from_foot, (i, foot, axis))
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
def _unpack(
    i: int, sparse: np.ndarray, row: np.ndarray, column: np.ndarray, matrix: np.ndarray
) -> None:
    """Fill the symmetric matrix [i] of (N, nv, nv), zero elsewhere, from MuJoCo's lower half."""
    for j in range(matrix.shape[1]):
        for place in range(row[j], row[j + 1]):
            k = column[place]
            matrix[i, j, k] = matrix[i, k, j] = sparse[i, place]
