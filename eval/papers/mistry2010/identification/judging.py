"""Fitting parameters to samples in several ways, and judging them by motions not used for it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from eval.papers.inertial_parameters import (
    RESOLUTION,
    Identification,
    InertialRegressor,
    Regression,
    Samples,
    by_steps,
    consistency,
    estimate,
    free_motions,
    natural_steps,
    regression,
)
from eval.papers.log import Log
from eval.papers.mistry2010.identification.exciting import STANCES
from eval.papers.mistry2010.identification.measuring import measured
from eval.papers.mistry2010.laws import equation
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.motions import MotionTable, Steps, periodic_squat, squat_bow, stepping
from fbid_gym.robots import Robot

_EVERY = 5


class HeldOut(NamedTuple):
    """A motion that is not used for fitting, at T instants.

    Attributes:
        qpos: (T, nq).
        qvel: (T, nv).
        qacc: (T, nv).
        active: (T, P) bool, points of planted feet.
        time: (T,) s.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    active: np.ndarray
    time: np.ndarray


def held_out(robot: Robot) -> dict[str, HeldOut]:
    """The motions of the other experiments."""
    motions: dict[str, MotionTable] = {
        "2 Hz squat": periodic_squat(robot),
        "fast squat/bow": squat_bow(robot, speed=5.0),
        "stepping": stepping(robot, Steps(ramp=0.15)),
    }
    found = {}
    for name, motion in motions.items():
        ticks = np.arange(0, motion.period, _EVERY)
        reference = motion.reference(ticks)
        foot_of_point = contact_geometry(robot).foot_of_point
        found[name] = HeldOut(
            reference.qpos, reference.qvel, reference.qacc,
            reference.planted[:, foot_of_point], ticks / motion.hz,
        )  # fmt: skip
    return found


def feedforward(model: Robot, motion: HeldOut) -> np.ndarray:
    """Torques (T, n) N·m of eq. (15) along a motion, by a model."""
    terms = MuJoCoDynamics(model).terms(motion.qpos, motion.qvel)
    contacts = reduced_contacts(contact_geometry(model), terms, motion.active)
    return orthogonal_inverse_dynamics(*equation(terms, contacts, motion.qacc)).torque


def feedforward_of(
    regressor: InertialRegressor, parameters: np.ndarray, motion: HeldOut
) -> np.ndarray:
    """The same torques by parameters (B, 10) of whatever bodies, which no simulator would take.

    The motions are consistent with their contacts, so eq. (15) can be taken at its word.
    """
    terms = MuJoCoDynamics(regressor.robot).terms(motion.qpos, motion.qvel)
    contacts = reduced_contacts(contact_geometry(regressor.robot), terms, motion.active)
    rows, _ = free_motions(contacts.jacobian)
    force = regressor.rows(motion.qpos, motion.qvel, motion.qacc) @ parameters.ravel()
    force += regressor.armature * motion.qacc
    inverse = np.linalg.pinv(rows[:, :, 6:], rcond=1e-6)
    return np.asarray(np.matvec(inverse, np.matvec(rows, force)))


def rms(values: np.ndarray) -> float:
    """Root mean square over everything."""
    return float(np.sqrt(np.mean(values**2)))


def plain_least_squares(regressor: InertialRegressor, data: Regression) -> np.ndarray:
    """Parameters (B, 10) of least squares, nearest to nominal where the data are silent."""
    nominal = regressor.parameters()
    steps, size = natural_steps(nominal), np.sqrt(data.square)
    change, *_ = np.linalg.lstsq(
        by_steps(data.matrix, steps) / size,
        (data.target - data.matrix @ nominal.ravel()) / size,
        rcond=RESOLUTION,
    )
    return np.asarray(nominal + np.matvec(steps, change.reshape(-1, 10)))


def samples_of(robot: Robot, log: Log, model: int, stances: Sequence[int], level: float) -> Samples:
    """What the sensors of one model's robot say in some of the stances."""
    planted = list(STANCES.values())
    parts = []
    for stance in stances:
        index = len(STANCES) * model + stance
        rng = np.random.default_rng([index, round(1000 * level)])
        parts.append(measured(robot, log, index, np.array(planted[stance]), level, rng))
    return Samples.joined(robot, parts)


def errors_of(
    model: Robot, motions: dict[str, HeldOut], true: dict[str, np.ndarray]
) -> dict[str, float]:
    """RMS torque error of a model's eq. (15), by motion, N·m."""
    return {name: rms(feedforward(model, motions[name]) - true[name]) for name in motions}


def fitted(
    robot: Robot, nominal: Robot, samples: Samples, motions: dict[str, HeldOut]
) -> tuple[dict[str, Any], Identification]:
    """Identify from samples in every way, and judge by motions that were not used."""
    true = {name: feedforward(robot, motion) for name, motion in motions.items()}
    regressor = InertialRegressor(nominal)
    data = regression(regressor, samples)
    found = estimate(regressor, data)
    weighed = estimate(regressor, data, total_mass=robot.mass)
    plain = plain_least_squares(regressor, data)
    error = {
        "nominal": errors_of(nominal, motions, true),
        "identified": errors_of(found.model(), motions, true),
        "weighed": errors_of(weighed.model(), motions, true),
        "plain": {
            name: rms(feedforward_of(regressor, plain, motion) - true[name])
            for name, motion in motions.items()
        },
    }
    return {
        "error": error,
        "consistent": found.consistent and weighed.consistent,
        "impossible": int((consistency(plain) <= 0.0).sum()),
        "residual": found.residual,
        "mass": found.mass,
        "dimension": found.excitation.dimension,
    }, found


def told_by(robot: Robot, log: Log, nominal: Robot) -> list[dict[str, Any]]:
    """What the data of each stance, and of all, can tell about the parameters."""
    regressor = InertialRegressor(nominal)
    choices = {name: [k] for k, name in enumerate(STANCES)} | {"all": list(range(len(STANCES)))}
    rows = []
    for name, stances in choices.items():
        samples = samples_of(robot, log, 0, stances, 0.0)
        seen = estimate(regressor, regression(regressor, samples)).excitation
        rows.append(
            {
                "stance": name,
                "dimension": seen.dimension,
                "attainable": seen.attainable,
                "condition": seen.condition,
                "told": list(seen.told),
                "combined": list(seen.combined),
                "untold": list(seen.untold),
                "singular_values": seen.singular_values.tolist(),
            }
        )
    return rows
