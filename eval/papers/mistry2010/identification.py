"""[M10] III-B.6: inertial parameters from motion, in the space where contact forces vanish."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from eval.page.figures import Marks, Series
from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.inertial_parameters.estimation import (
    Identification,
    Regression,
    Samples,
    estimate,
    free_motions,
    regression,
    scaled,
)
from eval.papers.inertial_parameters.excitation import RESOLUTION
from eval.papers.inertial_parameters.inertia import consistency
from eval.papers.inertial_parameters.regressor import InertialRegressor
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.exciting import NOISE, STANCES, carrying_out, exciting, measured
from eval.papers.mistry2010.laws import limited, orthogonal, planned_points, posed
from eval.papers.trial import RATES, Trial, simulate
from eval.papers.wrong_models import believing, wrong_model
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.motions import MotionTable, Steps, periodic_squat, squat_bow, stepping
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot, load

WRONG = 0.3
"""Largest relative error of the nominal masses and centres of mass."""

LEVELS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Sensor noise, in multiples of `Noise`."""

FACTOR = 10.0
"""How many times smaller the feedforward torque error shall become."""

_SOFT = (1.35, 0.5)  # Hz and damping ratio of the joint PD under which models are compared
_SHOWN, _EVERY = "left_knee", 5
METHODS = {
    "nominal": ("nominal", 1),
    "plain": ("least squares", 5),
    "identified": ("identified", 0),
}


@cache
def held_out(robot: Robot) -> dict[str, tuple[MotionTable, Target]]:
    """Return motions of the other experiments, and what they have at every fifth tick."""
    motions = {
        "2 Hz squat": periodic_squat(robot),
        "fast squat/bow": squat_bow(robot, speed=5.0),
        "stepping": stepping(robot, Steps(ramp=0.15)),
    }
    return {
        name: (motion, motion.reference(np.arange(0, motion.period, _EVERY)))
        for name, motion in motions.items()
    }


def feedforward(model: Robot, motion: Target) -> np.ndarray:
    """Return the torques (T, n) N·m of eq. (15) along a motion, by a model."""
    points = planned_points(model, motion)
    asked, _ = posed(model, motion.qpos, motion.qvel, motion.qacc, points)
    return orthogonal_inverse_dynamics(*asked).torque


def feedforward_of(
    regressor: InertialRegressor, parameters: np.ndarray, motion: Target
) -> np.ndarray:
    """Return the same torques by parameters (B, 10) of bodies that no simulator would take.

    The motions are consistent with their contacts, so eq. (15) can be taken at its word.
    """
    qpos, qvel, qacc = motion.qpos, motion.qvel, motion.qacc
    points = planned_points(regressor.robot, motion)
    asked, _ = posed(regressor.robot, qpos, qvel, qacc, points)
    rows, _ = free_motions(asked.jacobian)
    force = regressor.rows(qpos, qvel, qacc) @ parameters.ravel() + regressor.armature * qacc
    inverse = np.linalg.pinv(rows[:, :, 6:], rcond=1e-6)
    return np.asarray(np.matvec(inverse, np.matvec(rows, force)))


def rms(values: Any) -> float:
    """Root mean square over everything."""
    return float(np.sqrt(np.mean(np.square(values))))


def plain_least_squares(regressor: InertialRegressor, data: Regression) -> np.ndarray:
    """Return the parameters (B, 10) of least squares, nearest to nominal where data are silent."""
    nominal = regressor.parameters()
    steps, effect, error = scaled(data, nominal)
    change, *_ = np.linalg.lstsq(effect, error, rcond=RESOLUTION)
    return np.asarray(nominal + np.matvec(steps, change.reshape(-1, 10)))


def samples_of(robot: Robot, log: Log, model: int, stances: Sequence[int], level: float) -> Samples:
    """Return what the sensors of one model's robot say in some of the stances."""
    planted, parts = list(STANCES.values()), []
    for stance in stances:
        index = len(STANCES) * model + stance
        rng = np.random.default_rng([index, round(1000 * level)])
        parts.append(measured(robot, log, index, np.array(planted[stance]), level, rng))
    return Samples.joined(parts)


def fitted(robot: Robot, nominal: Robot, samples: Samples) -> tuple[Numbers, Identification]:
    """Identify from samples in every way, and judge by motions that were not used."""
    regressor = InertialRegressor(nominal)
    data = regression(regressor, samples)
    found = estimate(regressor, data)
    weighed = estimate(regressor, data, total_mass=robot.mass)
    plain = plain_least_squares(regressor, data)
    models = {"nominal": nominal, "identified": found.model(), "weighed": weighed.model()}
    error: dict[str, dict[str, float]] = {method: {} for method in (*models, "plain")}
    for name, (_, motion) in held_out(robot).items():
        true = feedforward(robot, motion)
        for method, model in models.items():
            error[method][name] = rms(feedforward(model, motion) - true)
        error["plain"][name] = rms(feedforward_of(regressor, plain, motion) - true)
    return {
        "error": error,
        "consistent": found.consistent and weighed.consistent,
        "impossible": int((consistency(plain) <= 0.0).sum()),
        "residual": found.residual,
        "mass": found.mass,
        "dimension": found.excitation.dimension,
    }, found


def told_by(robot: Robot, log: Log, nominal: Robot) -> list[Numbers]:
    """Return what the data of each stance, and of all, can tell about the parameters."""
    regressor, rows = InertialRegressor(nominal), []
    choices = {name: [k] for k, name in enumerate(STANCES)} | {"all": list(range(len(STANCES)))}
    named = ("dimension", "attainable", "condition", "told", "combined", "untold")
    for name, stances in choices.items():
        samples = samples_of(robot, log, 0, stances, 0.0)
        seen = estimate(regressor, regression(regressor, samples)).excitation
        row = {"stance": name} | {key: getattr(seen, key) for key in named}
        rows.append(row | {"singular_values": seen.singular_values.tolist()})
    return rows


def collect(robot: Robot, models: Sequence[Robot], seconds: int) -> Log:
    """Let every model's robot carry out every stance's motion: row 3 k + s is model k, stance s."""
    each = [model for model in models for _ in STANCES]
    plan, gains = following(exciting(robot, seconds, seed=0)), PdGains.of(robot, 1.5)
    trial = Trial(robot, plan, float(seconds), len(each), believe=believing(each))
    # Forces that the ground can deliver: it has to stand with a wrong model.
    law, desire = limited(robot, base_priority=1.0), carrying_out(robot, 1.2, 2.0)
    return simulate(trial, JointController(robot, gains, law, desire=desire))


def tracked(robot: Robot, models: dict[str, Robot], seconds: float) -> list[Numbers]:
    """Track the 2 Hz squat with PD+FF, soft gains, by each of the models."""
    plan, believe = following(periodic_squat(robot)), believing(list(models.values()))
    trial = Trial(robot, plan, seconds, len(models), believe=believe)
    log = simulate(trial, JointController(robot, PdGains.of(robot, *_SOFT), orthogonal()))
    return [
        {
            "model": name,
            "error": rms(log.error[:, k][log.up[:, k]]),
            "feedback": rms(log["feedback"][:, k][log.up[:, k]]),
            "fell": log.fall(k),
        }
        for k, name in enumerate(models)
    ]


@experiment(
    "Inertial parameters without contact forces",
    """The paper points to its reference [13] for estimating inertial parameters in the reduced
    space, where contact forces do not appear, and shows no data. Here it is done with a biped whose
    nominal link masses and centres of mass are wrong by up to 30 %.""",
)
def identification(setting: Setting) -> Measured:
    """Draw wrong models, let them move, identify them at every noise, and compare."""
    robot = load("biped")
    count, levels = setting.pick(4, 1), setting.pick(LEVELS, (0.0, 1.0))
    models = [wrong_model(robot, WRONG, np.random.default_rng([10, k])) for k in range(count)]
    log = collect(robot, models, setting.pick(10, 8))
    rows, chosen = [], None
    for k in setting.each(range(count)):
        for level in levels:
            samples = samples_of(robot, log, k, range(len(STANCES)), level)
            row, found = fitted(robot, models[k], samples)
            rows.append({"model": k, "level": level, **row})
            if level == 1.0 and chosen is None:
                chosen = found
    assert chosen is not None
    identified = chosen.model()
    compared = {"true model": robot, "nominal model": models[0], "identified model": identified}
    numbers = {
        "rows": rows,
        "levels": list(levels),
        "models": count,
        "fell": [log.fall(k) for k in range(len(log.fell))],
        "seconds": float(log.time[-1]),
        "told": told_by(robot, log, models[0]),
        "tracking": tracked(robot, compared, setting.pick(6.0, 3.0)),
        "bodies": list(chosen.regressor.names),
    }
    motion, states = held_out(robot)["fast squat/bow"]
    joint = robot.joint_names.index(_SHOWN)
    torque = {name: feedforward(model, states)[:, joint] for name, model in compared.items()}
    by_level = [summary(numbers, level) for level in levels]
    least = {level: found["least"] for level, found in zip(levels, by_level, strict=True)}
    versions = InertialRegressor(robot).parameters(), chosen.regressor.parameters()
    return numbers, {
        **{"robot": robot, "levelled": by_level, "logarithmic": Marks(logarithmic=True)},
        "most": max((level for level in levels if least[level] >= FACTOR), default=None),
        **{"FACTOR": FACTOR, "NOISE": NOISE, "RATES": RATES},
        "possible": sum(row["impossible"] == 0 for row in rows),
        "time": np.arange(0, motion.period, _EVERY) / motion.hz,
        "wrong": [
            (label, colour, torque[f"{label} model"] - torque["true model"])
            for label, colour in (("nominal", 1), ("identified", 0))
        ],
        "noisy": [(n, c, [found[m] for found in by_level]) for m, (n, c) in METHODS.items()],
        "spectra": [_spectrum(*pair) for pair in zip((1, 2, 3, 0), numbers["told"], strict=True)],
        "untold": {told["stance"]: _grouped(told["untold"]) for told in numbers["told"]},
        "masses": {
            name: [(body[0], 100.0 * body[1:4] / body[0]) for body in bodies]
            for name, *bodies in zip(numbers["bodies"], *versions, chosen.parameters, strict=True)
        },
    }


def improvements(numbers: Numbers, level: float, method: str = "identified") -> np.ndarray:
    """Return how many times the torque error falls: every model and motion at one noise."""
    rows = [row["error"] for row in numbers["rows"] if row["level"] == level]
    return np.array(
        [row["nominal"][name] / row[method][name] for row in rows for name in row[method]]
    )


def summary(numbers: Numbers, level: float) -> Numbers:
    """Return means and extremes at one noise; torque errors of each method are RMS, N·m."""
    rows, times = [r for r in numbers["rows"] if r["level"] == level], improvements(numbers, level)
    errors = {
        method: rms([list(row["error"][method].values()) for row in rows])
        for method in rows[0]["error"]
    }
    means = {w: float(np.mean([r[w] for r in rows])) for w in ("impossible", "residual", "mass")}
    return {"level": level, "least": times.min(), "most": times.max(), **errors, **means}


def _spectrum(colour: int, told: Numbers) -> Series:
    """Compute the change of one stance's data by unit steps of the parameters."""
    values = [value for value in told["singular_values"] if value > 1e-8]
    return Series(told["stance"], colour, range(1, len(values) + 1), values)


def _grouped(names: Sequence[str]) -> str:
    """Parameters by body; all ten of a body as the body alone."""
    by_body: dict[str, list[str]] = {}
    for name in names:
        body, _, parameter = name.partition(" ")
        by_body.setdefault(body, []).append(parameter)
    return ", ".join(b if len(p) == 10 else f"{b} ({', '.join(p)})" for b, p in by_body.items())
