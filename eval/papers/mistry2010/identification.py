"""[M10] III-B.6: inertial parameters from motion, in the space where contact forces vanish."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from eval.page.figures import Marks, Series, lines, panel, traces
from eval.page.html import columns, figure, folded, table
from eval.papers.experiment import (
    Finding,
    Progress,
    Result,
    Setting,
    experiment,
    fate,
    judged,
    prose,
)
from eval.papers.inertial_parameters.estimation import (
    Identification,
    Regression,
    Samples,
    estimate,
    free_motions,
    regression,
)
from eval.papers.inertial_parameters.excitation import RESOLUTION, by_steps, natural_steps
from eval.papers.inertial_parameters.inertia import consistency
from eval.papers.inertial_parameters.regressor import InertialRegressor
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.exciting import NOISE, STANCES, carrying_out, exciting, measured
from eval.papers.mistry2010.laws import equation, limited, orthogonal
from eval.papers.trial import RATES, Trial, simulate
from eval.papers.wrong_models import believing, wrong_model
from eval.wording import number
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
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
_METHODS = {
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
    terms, geometry = MuJoCoDynamics(model).terms(motion.qpos, motion.qvel), contact_geometry(model)
    contacts = reduced_contacts(geometry, terms, motion.planted[:, geometry.foot_of_point])
    return orthogonal_inverse_dynamics(*equation(terms, contacts, motion.qacc)).torque


def feedforward_of(
    regressor: InertialRegressor, parameters: np.ndarray, motion: Target
) -> np.ndarray:
    """Return the same torques by parameters (B, 10) of bodies that no simulator would take.

    The motions are consistent with their contacts, so eq. (15) can be taken at its word.
    """
    robot = regressor.robot
    terms, geometry = MuJoCoDynamics(robot).terms(motion.qpos, motion.qvel), contact_geometry(robot)
    contacts = reduced_contacts(geometry, terms, motion.planted[:, geometry.foot_of_point])
    rows, _ = free_motions(contacts.jacobian)
    force = regressor.rows(motion.qpos, motion.qvel, motion.qacc) @ parameters.ravel()
    force += regressor.armature * motion.qacc
    inverse = np.linalg.pinv(rows[:, :, 6:], rcond=1e-6)
    return np.asarray(np.matvec(inverse, np.matvec(rows, force)))


def rms(values: Any) -> float:
    """Root mean square over everything."""
    return float(np.sqrt(np.mean(np.square(values))))


def plain_least_squares(regressor: InertialRegressor, data: Regression) -> np.ndarray:
    """Return the parameters (B, 10) of least squares, nearest to nominal where data are silent."""
    nominal = regressor.parameters()
    steps, size = natural_steps(nominal), np.sqrt(data.square)
    change, *_ = np.linalg.lstsq(
        by_steps(data.matrix, steps) / size,
        (data.target - data.matrix @ nominal.ravel()) / size,
        rcond=RESOLUTION,
    )
    return np.asarray(nominal + np.matvec(steps, change.reshape(-1, 10)))


def samples_of(robot: Robot, log: Log, model: int, stances: Sequence[int], level: float) -> Samples:
    """Return what the sensors of one model's robot say in some of the stances."""
    planted, parts = list(STANCES.values()), []
    for stance in stances:
        index = len(STANCES) * model + stance
        rng = np.random.default_rng([index, round(1000 * level)])
        parts.append(measured(robot, log, index, np.array(planted[stance]), level, rng))
    return Samples.joined(parts)


def fitted(robot: Robot, nominal: Robot, samples: Samples) -> tuple[dict[str, Any], Identification]:
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


def told_by(robot: Robot, log: Log, nominal: Robot) -> list[dict[str, Any]]:
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


def collect(robot: Robot, models: Sequence[Robot], seconds: int, progress: Progress) -> Log:
    """Let every model's robot carry out every stance's motion: row 3 k + s is model k, stance s."""
    each = [model for model in models for _ in STANCES]
    plan, gains = following(exciting(robot, seconds, seed=0)), PdGains.of(robot, 1.5)
    trial = Trial(robot, plan, float(seconds), len(each), believe=believing(each))
    # Forces that the ground can deliver: it has to stand with a wrong model.
    law, desire = limited(robot, base_priority=1.0), carrying_out(robot, 1.2, 2.0)
    return simulate(trial, JointController(robot, gains, law, desire=desire), progress)


def tracked(robot: Robot, models: dict[str, Robot], seconds: float) -> list[dict[str, Any]]:
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
def identification(setting: Setting) -> Result:
    """Draw wrong models, let them move, identify them at every noise, and compare."""
    robot, progress = load("biped"), setting.progress
    count, levels = setting.pick(4, 1), setting.pick(LEVELS, (0.0, 1.0))
    models = [wrong_model(robot, WRONG, np.random.default_rng([10, k])) for k in range(count)]
    log = collect(robot, models, setting.pick(10, 8), progress.part(0.05, 0.5, "exciting motions"))
    fitting = progress.part(0.5, 0.95, "identification")
    rows, chosen = [], None
    for k, nominal in enumerate(models):
        for i, level in enumerate(levels):
            samples = samples_of(robot, log, k, range(len(STANCES)), level)
            row, found = fitted(robot, nominal, samples)
            rows.append({"model": k, "level": level, **row})
            if level == 1.0 and chosen is None:
                chosen = found
            fitting((k + (i + 1) / len(levels)) / count)
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
        "bodies": list(chosen.names),
    }
    return Result(findings(numbers), numbers, _body(numbers, chosen, compared))


def improvements(numbers: dict[str, Any], level: float, method: str = "identified") -> np.ndarray:
    """Return how many times the torque error falls: every model and motion at one noise."""
    rows = [row["error"] for row in numbers["rows"] if row["level"] == level]
    return np.array(
        [row["nominal"][name] / row[method][name] for row in rows for name in row[method]]
    )


def average(numbers: dict[str, Any], level: float, method: str) -> float:
    """Return the RMS torque error over models and motions, N·m."""
    rows = [row["error"][method] for row in numbers["rows"] if row["level"] == level]
    return rms([list(row.values()) for row in rows])


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The claims, and what came out."""
    rows, levels = numbers["rows"], numbers["levels"]
    result = []
    for level, name in ((0.0, "without sensor noise"), (1.0, "with sensor noise")):
        least = improvements(numbers, level).min()
        result.append(
            judged(
                f"torque error of eq. (15) on motions not used for fitting, {name}, N·m RMS",
                "not given",
                f"{number(average(numbers, level, 'nominal'))} nominal, "
                f"{number(average(numbers, level, 'identified'), 2)} identified: "
                f"{number(least, 2)} times less in the worst case",
                "at least ten times less",
                bool(least >= FACTOR),
            )
        )
    most = [level for level in levels if improvements(numbers, level).min() >= FACTOR]
    possible = sum(row["impossible"] == 0 for row in rows)
    both, everything = numbers["told"][0], numbers["told"][-1]
    return [
        *result,
        Finding(
            "most sensor noise of the sweep at which the error falls tenfold in every case",
            "not given",
            f"{number(max(most))} times that of the table" if most else "none",
        ),
        judged(
            "estimates of bodies that can exist",
            "not given",
            f"{sum(row['consistent'] for row in rows)} of {len(rows)}; plain least squares: "
            f"{possible} of {len(rows)}",
            "all",
            all(row["consistent"] for row in rows),
        ),
        Finding(
            "base parameters that the data tell",
            "not given",
            f"{everything['dimension']} of {everything['attainable']}; "
            f"{both['dimension']} if the robot stays on both feet",
        ),
    ]


def _body(numbers: dict[str, Any], chosen: Identification, compared: dict[str, Robot]) -> list[str]:
    robot, levels = compared["true model"], numbers["levels"]
    motion, states = held_out(robot)["fast squat/bow"]
    joint = robot.joint_names.index(_SHOWN)
    torque = {name: feedforward(model, states)[:, joint] for name, model in compared.items()}
    wrong = [
        (label, colour, torque[f"{label} model"] - torque["true model"])
        for label, colour in (("nominal", 1), ("identified", 0))
    ]
    time, marks = np.arange(0, motion.period, _EVERY) / motion.hz, Marks(logarithmic=True)
    noisy = [(n, c, [average(numbers, x, m) for x in levels]) for m, (n, c) in _METHODS.items()]
    spectra = []
    for colour, row in zip((1, 2, 3, 0), numbers["told"], strict=True):
        values = [value for value in row["singular_values"] if value > 1e-8]
        spectra.append(Series(row["stance"], colour, range(1, len(values) + 1), values))
    charts = [
        traces(time, wrong, "Left knee, torque error, N·m"),
        lines(levels, noisy, "Torque error, N·m", "sensor noise", marks=marks),
        panel(
            spectra, "Share of the torque", "direction of the parameters",
            y_format="{:.0e}".format, marks=marks,
        ),
    ]  # fmt: skip
    mass = np.mean([row["mass"] for row in numbers["rows"] if row["level"] == levels[-1]])
    return [
        figure(
            charts,
            "Left: error of eq. (15) on the fast squat/bow, of one nominal model and of what noisy "
            "data (level 1) made of it. Middle: what sensor noise leaves of the gain, all models "
            "and motions. Right: what unit steps of the parameters do to the data, in the order of "
            "their effect; what is below 0.00001 of the torque counts as not told.",
            3,
        ),
        prose(f"""Nominal masses are off by up to 30 %, and with them the inertias; the centres of
            mass by up to 30 % of the link's half-length along every axis. The robot moves under the
            wrong model: sums of sinusoids at all joints, {number(numbers["seconds"], 2)} s each on
            both feet, on the left and on the right one. No contact force is measured. Accelerations
            are derivatives of the noisy velocities through the same filter that the torques
            pass."""),
        _sweep_table(numbers),
        prose(f"""Noise of the measured motion does not average out as noise of the torque does: it
            is in the regressor, and biases the estimate however much data there are. At
            {number(levels[-1])} times the noise of the table below, the total mass comes out as
            {number(float(mass))} kg instead of {number(robot.mass)} kg, and little of the gain is
            left. Least squares without regard for what can exist predicts torques about as well
            without noise and somewhat worse with it, by bodies that no simulator takes."""),
        _excitation_table(numbers["told"]),
        prose("""Feet that stand flat take whatever wrench the ground gives, so nothing tells their
            own parameters; a foot in the air tells them. Single parameters that only count in
            combinations, as the masses of neighbouring links, stay near their nominal values, and
            the torque does not depend on how they share."""),
        columns(
            numbers["tracking"],
            (
                ("2 Hz squat, PD+FF", lambda row: row["model"]),
                ("joint error, mrad RMS", lambda row: number(1e3 * row["error"], 2)),
                ("feedback, N·m RMS", lambda row: number(row["feedback"], 2)),
                ("", lambda row: fate(row["fell"])),
            ),
        ),
        folded("Sensor noise at level 1", _noise_table()),
        folded("Masses and centres of mass of one model", _body_table(robot, chosen)),
    ]


def _sweep_table(numbers: dict[str, Any]) -> str:
    def times_less(level: float) -> str:
        every = improvements(numbers, level)
        return f"{number(every.min(), 2)} to {number(every.max(), 2)}"

    def mean(level: float, what: str) -> float:
        return float(np.mean([row[what] for row in numbers["rows"] if row["level"] == level]))

    def error(head: str, method: str) -> Any:
        return head, lambda level: number(average(numbers, level, method), 2)

    cells = (
        ("noise", number),
        error("nominal, N·m", "nominal"),
        error("identified", "identified"),
        error("total mass known", "weighed"),
        error("least squares", "plain"),
        ("times less", times_less),
        ("impossible bodies by least squares", lambda x: f"{mean(x, 'impossible'):.1f}"),
        ("residual", lambda x: number(mean(x, "residual"), 2)),
    )
    return columns(numbers["levels"], cells)


def _excitation_table(told: Sequence[dict[str, Any]]) -> str:
    """What the data tell, by stance; all ten parameters of a body as the body alone."""

    def grouped(names: Sequence[str]) -> str:
        by_body: dict[str, list[str]] = {}
        for name in names:
            body, _, parameter = name.partition(" ")
            by_body.setdefault(body, []).append(parameter)
        return ", ".join(b if len(p) == 10 else f"{b} ({', '.join(p)})" for b, p in by_body.items())

    cells = (
        ("data", lambda row: row["stance"]),
        ("base parameters", lambda row: f"{row['dimension']} of {row['attainable']}"),
        ("condition", lambda row: number(row["condition"], 2)),
        ("told by themselves", lambda row: str(len(row["told"]))),
        ("in combinations", lambda row: str(len(row["combined"]))),
        ("not told", lambda row: str(len(row["untold"]))),
        ("which", lambda row: grouped(row["untold"]) or "–"),
    )
    return columns(told, cells, wrap=True)


def _noise_table() -> str:
    told = {
        "joint angle": (NOISE.joint, "rad"),
        "joint velocity": (NOISE.joint_rate, "rad/s"),
        "orientation of the base": (NOISE.tilt, "rad"),
        "angular velocity of the base": (NOISE.spin, "rad/s"),
        "linear velocity of the base": (NOISE.drift, "m/s"),
        "joint torque": (NOISE.torque, "N·m"),
    }
    rows = [[sensor, f"{value:g} {unit}"] for sensor, (value, unit) in told.items()]
    return table(["sensor", f"white noise at {RATES.control} Hz, standard deviation"], rows)


def _body_table(robot: Robot, chosen: Identification) -> str:
    versions = {
        "true": InertialRegressor(robot).parameters(),
        "nominal": chosen.nominal,
        "identified": chosen.parameters,
    }
    heads, rows = ["body"], [[name.replace("_", " ")] for name in chosen.names]
    for version, parameters in versions.items():
        heads += [f"{version}, kg", "centre of mass, cm"]
        for row, body in zip(rows, parameters, strict=True):
            com = 100.0 * body[1:4] / body[0]
            row += [number(body[0]), ", ".join(f"{value:.1f}" for value in com)]
    return table(heads, rows)
