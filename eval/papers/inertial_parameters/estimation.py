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

from eval.papers.inertial_parameters.entropic_fit import fit
from eval.papers.inertial_parameters.excitation import (
    Excitation,
    by_steps,
    excitation_of,
    natural_steps,
)
from eval.papers.inertial_parameters.inertia import consistency, with_parameters
from eval.papers.inertial_parameters.regressor import InertialRegressor
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.robots import Robot

PRIOR_WEIGHT = 1e-6
"""Default weight of the prior: a change of one body by its own size costs as much as an error of a
thousandth of the torque. The right weight grows with the errors of the data; it is about their mean
square, relative to that of the torque, over the number of samples that err independently."""

_CHUNK = 256
_RANK_RTOL = 1e-6


class Samples(NamedTuple):
    """Measurements at N instants of a robot's motion; P contact points."""

    qpos: np.ndarray  # (N, nq) m, quaternion wxyz, rad
    qvel: np.ndarray  # (N, nv) m/s, rad/s; as everywhere, the angular part in the base's frame
    qacc: np.ndarray  # (N, nv) m/s^2, rad/s^2, rate of qvel
    torque: np.ndarray
    """(N, n) N·m (N for slides), what the links feel: the motors' less the joints' damping and
    friction."""
    active: np.ndarray
    """(N, P) bool, contact points that may carry force, in the order of the robot's feet. A point
    too many costs information, one too few costs the truth."""

    @classmethod
    def joined(cls, parts: Sequence["Samples"]) -> "Samples":
        """Return the samples of several motions of one robot, whatever their contacts."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class Regression(NamedTuple):
    """All that samples say about p parameters: |matrix pi - target|^2 + rest^2 over `rows` rows."""

    matrix: np.ndarray  # (p, p)
    target: np.ndarray  # (p,)
    rest: float  # what no parameters explain
    rows: int  # number of projected equations
    square: float  # sum of squares of their right-hand sides

    def residual(self, parameters: np.ndarray) -> float:
        """Root mean square error of the equations with the parameters (B, 10), N·m (N)."""
        error = self.matrix @ parameters.ravel() - self.target
        return float(np.sqrt((error @ error + self.rest**2) / self.rows))


@dataclass(frozen=True, eq=False)
class Identification:
    """Inertial parameters found from data; B bodies."""

    regressor: InertialRegressor  # of the nominal robot
    parameters: np.ndarray
    """(B, 10) estimates, see `eval.papers.inertial_parameters.inertia.PARAMETERS`."""
    residual: float  # root mean square error of the projected equations, N·m (N)
    excitation: Excitation  # what the data could tell

    @property
    def consistent(self) -> bool:
        """Whether every body can exist: a positive definite pseudo-inertia."""
        return bool((consistency(self.parameters) > 0.0).all())

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(self.parameters[:, 0].sum())

    def model(self) -> Robot:
        """Return the robot with the identified parameters: a model for any provider of terms."""
        return with_parameters(self.regressor.robot, self.regressor.bodies, self.parameters)


def estimate(
    regressor: InertialRegressor,
    data: Regression,
    *,
    prior_weight: float = PRIOR_WEIGHT,
    total_mass: float | None = None,
) -> Identification:
    """Find the inertial parameters of a robot from samples of its motion.

    Armature and kinematics are taken to be known.

    Args:
        regressor: of the nominal robot, whose bodies are solid.
        data: samples of the real one's motion, condensed.
        prior_weight: w, how strongly the estimate is drawn to the nominal parameters.
        total_mass: kg, if the robot was weighed; the estimate then has this mass.
    """
    nominal = regressor.parameters()
    steps, effect, error = scaled(data, nominal)
    change = fit(
        effect,
        error,
        prior_weight,
        # How much each step adds to the total mass, and how much of it is missing.
        None if total_mass is None else (steps[:, 0].ravel(), total_mass / nominal[:, 0].sum()),
    )
    parameters = nominal + np.matvec(steps, change.reshape(-1, 10))
    excitation = excitation_of(regressor, steps, effect)
    return Identification(regressor, parameters, data.residual(parameters), excitation)


def scaled(data: Regression, nominal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a regression in natural steps, in units of the norm of its right-hand sides.

    Returns:
        The steps (B, 10, 10) from nominal parameters (B, 10), what each does, (p, p), and what is
        left to explain, (p,).
    """
    steps, size = natural_steps(nominal), np.sqrt(data.square)
    error = (data.target - data.matrix @ nominal.ravel()) / size
    return steps, by_steps(data.matrix / size, steps), error


def free_motions(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows that take contact forces out of the dynamics, [M10]'s S_u Q^T.

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

    Yields:
        (C, nv, p) and (C, nv), zero rows included, and (C,).
    """
    dynamics, geometry = MuJoCoDynamics(regressor.robot), contact_geometry(regressor.robot)
    for start in range(0, len(samples.qpos), _CHUNK):
        part = Samples(*(array[start : start + _CHUNK] for array in samples))
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
    """
    p = regressor.num_parameters
    triangle: np.ndarray = np.zeros((0, p + 1))
    square, rows = 0.0, 0
    for matrix, target, count in projected_equations(regressor, samples):
        block = np.concatenate([matrix, target[:, :, None]], axis=2).reshape(-1, p + 1)
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, block]), mode="r"))
        square, rows = square + float((target**2).sum()), rows + int(count.sum())
    whole = np.zeros((p + 1, p + 1))
    whole[: len(triangle)] = triangle
    return Regression(whole[:p, :p], whole[:p, p], float(abs(whole[p, p])), rows, square)
