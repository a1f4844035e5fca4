"""Inertial parameters from motion data, without contact forces ([M10] III-B.6, reference [13]).

The dynamics M a + h = S^T tau + J^T lambda are linear in the inertial parameters pi of the bodies,
M a + h = Y(q, v, a) pi + armature * a. Rows N^T that span the null space of J, [M10]'s S_u Q^T,
take the contact forces out of them, and with them the need to measure them. At every sample

    N^T Y pi = N^T (S^T tau - armature * a).

This holds whether or not the contacts move; they only have to lie where J says. The estimate
minimises

    mean |N^T Y pi - N^T (S^T tau - armature * a)|^2 / (2 t^2) + w sum_b D(P_b | P0_b),
    D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4,

with means over the rows, t the root mean square of the right-hand sides, w the weight of the prior,
P_b the pseudo-inertia of body b (`inertia`) and P0_b that of the nominal model.
D, the entropic divergence, is half the square of a small relative change, whatever the units and
frames, and grows without bound as a body comes to the border of what can exist (T. Lee,
P. M. Wensing, F. C. Park, "Geometric robot dynamic identification: a convex programming approach",
IEEE Transactions on Robotics 36(2), 2020). So every estimate is physically consistent, what the
data do not tell stays as nominal as what they tell allows, and the problem is convex with a single
minimum (`entropic_fit`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eval.papers.inertial_parameters.entropic_fit import (
    Weighed,
    divergence,
    fit,
    relative_inertia,
)
from eval.papers.inertial_parameters.excitation import (
    Excitation,
    ExcitationError,
    by_steps,
    excitation_of,
    natural_steps,
)
from eval.papers.inertial_parameters.inertia import consistency, with_parameters
from eval.papers.inertial_parameters.regressor import InertialRegressor
from fbid_gym.checks import check_finite, check_positive
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics, check_states
from fbid_gym.errors import (
    InvalidValueError,
    RobotError,
    ShapeError,
)
from fbid_gym.robots import Robot

PRIOR_WEIGHT = 1e-6
"""Default weight of the prior: a change of one body by its own size costs as much as an error of a
thousandth of the torque. The right weight grows with the errors of the data; it is about their mean
square, relative to that of the torque, over the number of samples that err independently."""

RESOLUTION = 1e-5
"""Default share of the torque that the data are taken to resolve."""

_CHUNK = 256
_RANK_RTOL = 1e-6
_FLAT = 1e-12


class Samples(NamedTuple):
    """What was measured at N instants of a robot's motion; P contact points.

    Attributes:
        qpos: (N, nq) m, quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s; as everywhere, the angular part in the base's frame.
        qacc: (N, nv) m/s^2, rad/s^2, rate of qvel.
        torque: (N, n) N·m (N for slides), what the links feel: the motors' less the joints'
            damping and friction.
        active: (N, P) bool, contact points that may carry force, in the order of the robot's feet;
            None for all. A point too many costs information, one too few costs the truth.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    torque: np.ndarray
    active: np.ndarray | None = None

    @classmethod
    def joined(cls, robot: Robot, parts: Sequence["Samples"]) -> "Samples":
        """Return the samples of several motions of one robot, whatever their contacts."""
        every = np.ones(robot.num_points, bool)
        active = [np.tile(every, (len(p.qpos), 1)) if p.active is None else p.active for p in parts]
        return cls(
            np.concatenate([part.qpos for part in parts]),
            np.concatenate([part.qvel for part in parts]),
            np.concatenate([part.qacc for part in parts]),
            np.concatenate([part.torque for part in parts]),
            np.concatenate(active),
        )

    def rows(self, start: int, stop: int) -> "Samples":
        """Return some of the samples."""
        active = None if self.active is None else self.active[start:stop]
        qpos, qvel, qacc, torque = (array[start:stop] for array in self[:4])
        return Samples(qpos, qvel, qacc, torque, active)


class Regression(NamedTuple):
    """All that samples say about p parameters: |matrix pi - target|^2 + rest^2 over `rows` rows.

    Attributes:
        matrix: (p, p).
        target: (p,).
        rest: what no parameters explain.
        rows: number of projected equations.
        square: sum of squares of their right-hand sides.
        samples: number of samples.
        most: rows of the sample with the most of them.
    """

    matrix: np.ndarray
    target: np.ndarray
    rest: float
    rows: int
    square: float
    samples: int
    most: int

    def residual(self, parameters: np.ndarray) -> float:
        """Root mean square error of the equations with the parameters (B, 10), N·m (N)."""
        error = self.matrix @ parameters.ravel() - self.target
        return float(np.sqrt((error @ error + self.rest**2) / self.rows))


@dataclass(frozen=True, eq=False)
class Identification:
    """Inertial parameters found from data; B bodies.

    Attributes:
        robot: the nominal robot.
        bodies: (B,) MuJoCo ids of the bodies.
        names: their names.
        parameters: (B, 10) estimates, see `eval.papers.inertial_parameters.inertia.PARAMETERS`.
        nominal: (B, 10) what they were.
        residual: root mean square error of the projected equations, N·m (N).
        nominal_residual: the same for the nominal model.
        torque_scale: root mean square of their right-hand sides.
        divergence: (B,) D(P_b | P0_b), how far each body went from its nominal one.
        excitation: what the data could tell.
    """

    robot: Robot
    bodies: np.ndarray
    names: tuple[str, ...]
    parameters: np.ndarray
    nominal: np.ndarray
    residual: float
    nominal_residual: float
    torque_scale: float
    divergence: np.ndarray
    excitation: Excitation

    @property
    def consistent(self) -> bool:
        """Whether every body can exist: a positive definite pseudo-inertia."""
        return bool((consistency(self.parameters) > 0.0).all())

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(self.parameters[:, 0].sum())

    def model(self, name: str | None = None) -> Robot:
        """Return the robot with the identified parameters: a model for any provider of terms."""
        return with_parameters(self.robot, self.bodies, self.parameters, name=name)


def identify(
    robot: Robot,
    samples: Samples,
    *,
    prior_weight: float = PRIOR_WEIGHT,
    total_mass: float | None = None,
    resolution: float = RESOLUTION,
) -> Identification:
    """Find the inertial parameters of a robot from samples of its motion.

    Armature and kinematics are taken to be known.

    Args:
        robot: the nominal robot.
        samples: of the real one's motion.
        prior_weight: w, how strongly the estimate is drawn to the nominal parameters.
        total_mass: kg, if the robot was weighed; the estimate then has this mass.
        resolution: share of the torque's root mean square that a change of the parameters by their
            size must make for the data to count as telling it. It affects `excitation` and what
            counts as data without excitation, not the estimate. Noise cannot be told from motion:
            with noisy data, give what the noise leaves to be resolved.

    Raises:
        ShapeError: an array of the samples has another shape.
        NonFiniteError: an array holds NaN or infinity.
        InvalidValueError: an option is not a positive number, or there is no torque at all.
        RobotError: a body of the nominal model is a point, a line or a plane, or Pinocchio cannot
            represent the robot.
        ExcitationError: all samples together tell no more than one of them could, as when the
            robot stands still.
    """
    regressor = InertialRegressor(robot)
    return estimate(
        regressor,
        regression(regressor, samples),
        prior_weight=prior_weight,
        total_mass=total_mass,
        resolution=resolution,
    )


def estimate(
    regressor: InertialRegressor,
    data: Regression,
    *,
    prior_weight: float = PRIOR_WEIGHT,
    total_mass: float | None = None,
    resolution: float = RESOLUTION,
) -> Identification:
    """Find the inertial parameters from condensed samples; arguments and errors as `identify`."""
    check_positive(prior_weight=prior_weight, resolution=resolution)
    if total_mass is not None:
        check_positive(total_mass=total_mass)
    nominal = regressor.parameters()
    flat = consistency(nominal) <= _FLAT
    if flat.any():
        raise RobotError(
            f"Body {regressor.names[int(flat.argmax())]!r} has no extent in some direction. "
            "Expected nominal inertias of solid bodies: principal moments of which each is less "
            "than the sum of the other two."
        )
    if data.square == 0.0:
        raise InvalidValueError("torque", "zero at all samples", "torques that the joints feel")
    steps, size = natural_steps(nominal), np.sqrt(data.square)
    excitation = excitation_of(regressor, steps, data.matrix / size, resolution)
    if excitation.dimension <= data.most:
        raise ExcitationError(data.samples, excitation.dimension, excitation.attainable)

    weighed = None
    if total_mass is not None:
        weighed = Weighed(steps[:, 0].ravel(), total_mass, float(nominal[:, 0].sum()))
    change = fit(
        by_steps(data.matrix, steps) / size,
        (data.target - data.matrix @ nominal.ravel()) / size,
        prior_weight,
        weighed,
    )
    parameters = nominal + np.matvec(steps, change.reshape(-1, 10))
    return Identification(
        robot=regressor.robot,
        bodies=regressor.bodies,
        names=regressor.names,
        parameters=parameters,
        nominal=nominal,
        residual=data.residual(parameters),
        nominal_residual=data.residual(nominal),
        torque_scale=float(size / np.sqrt(data.rows)),
        divergence=divergence(relative_inertia(change)),
        excitation=excitation,
    )


# --- the projected equations -------------------------------------------------------------------


def free_motions(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows that take contact forces out of the dynamics, [M10]'s S_u Q^T.

    Args:
        jacobian: (N, k, nv) of the contacts, of any rank.

    Returns:
        rows: (N, nv, nv) orthonormal rows with rows @ J^T = 0, and zero rows beside them.
        count: (N,) how many are not zero: nv less the rank of J.
    """
    _, sizes, rows = np.linalg.svd(jacobian)
    held = np.zeros(rows.shape[:2], bool)
    held[:, : sizes.shape[1]] = sizes > _RANK_RTOL * np.maximum(sizes[:, :1], 1.0)
    return np.where(held[:, :, None], 0.0, rows), (~held).sum(axis=1)


def projected_equations(
    regressor: InertialRegressor, samples: Samples
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield N^T Y, N^T (S^T tau - armature * a) and the number of rows by sample, in chunks.

    Args:
        regressor: of the robot.
        samples: N of them.

    Yields:
        (C, nv, p) and (C, nv), zero rows included, and (C,).
    """
    dynamics, geometry = MuJoCoDynamics(regressor.robot), contact_geometry(regressor.robot)
    for start in range(0, len(samples.qpos), _CHUNK):
        part = samples.rows(start, start + _CHUNK)
        terms = dynamics.terms(part.qpos, part.qvel)
        contacts = reduced_contacts(geometry, terms, part.active)
        rows, count = free_motions(contacts.jacobian)
        force = -regressor.armature * part.qacc
        force[:, 6:] += part.torque
        yield rows @ regressor.rows(*part[:3]), np.matvec(rows, force), count


def regression(regressor: InertialRegressor, samples: Samples) -> Regression:
    """Condense samples, however many, into as many equations as there are parameters.

    By orthogonal transformations of one chunk after the other, so that nothing is squared and the
    small singular values stay what they are.

    Raises:
        ShapeError: an array of the samples has another shape.
        NonFiniteError: an array holds NaN or infinity.
    """
    samples = _checked(regressor.robot, samples)
    p = regressor.num_parameters
    triangle: np.ndarray = np.zeros((0, p + 1))
    square, counts = 0.0, []
    for matrix, target, count in projected_equations(regressor, samples):
        block = np.concatenate([matrix, target[:, :, None]], axis=2).reshape(-1, p + 1)
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, block]), mode="r"))
        square += float((target**2).sum())
        counts.append(count)
    whole = np.zeros((p + 1, p + 1))
    whole[: len(triangle)] = triangle
    rows = np.concatenate(counts)
    return Regression(
        matrix=whole[:p, :p],
        target=whole[:p, p],
        rest=float(abs(whole[p, p])),
        rows=int(rows.sum()),
        square=square,
        samples=len(rows),
        most=int(rows.max()),
    )


def _checked(robot: Robot, samples: Samples) -> Samples:
    """Return samples as float arrays, or raise one error that names what is wrong."""
    qpos, qvel = check_states(robot, samples.qpos, samples.qvel)
    count = len(qpos)
    if count == 0:
        raise ShapeError("qpos", qpos.shape, f"(N, {robot.nq}) with at least one sample")
    qacc, torque = np.asarray(samples.qacc, float), np.asarray(samples.torque, float)
    for name, array, width in (("qacc", qacc, robot.nv), ("torque", torque, robot.num_joints)):
        if array.shape != (count, width):
            raise ShapeError(name, array.shape, f"({count}, {width}), one row per row of qpos")
        check_finite(name, array)
    active = samples.active
    if active is not None:
        active = np.asarray(active, bool)
        if active.shape != (count, robot.num_points):
            raise ShapeError("active", active.shape, f"({count}, {robot.num_points}), points")
    return Samples(qpos, qvel, qacc, torque, active)
