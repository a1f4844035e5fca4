"""[M10] III-B.6: inertial parameters from motion, in the space where contact forces vanish."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eval.papers.experiment import Experiment, Progress, Result, Setting
from eval.papers.inertial_parameters import InertialRegressor
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains
from eval.papers.mistry2010.following import following
from eval.papers.mistry2010.identification.exciting import STANCES, carrying_out, exciting
from eval.papers.mistry2010.identification.judging import (
    feedforward,
    fitted,
    held_out,
    rms,
    samples_of,
    told_by,
)
from eval.papers.mistry2010.identification.section import average, improvements, show
from eval.papers.mistry2010.laws import Limited, orthogonal
from eval.papers.page import Finding, judged
from eval.papers.trial import Trial, simulate
from eval.papers.wrong_models import believing, wrong_model
from eval.wording import number
from fbid_gym.motions import periodic_squat
from fbid_gym.robots import Robot, load

WRONG = 0.3
"""Largest relative error of the nominal masses and centres of mass."""

LEVELS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Sensor noise, in multiples of `Noise`."""

FACTOR = 10.0
"""How many times smaller the feedforward torque error shall become."""

_SOFT = (1.35, 0.5)  # Hz and damping ratio of the joint PD under which models are compared
_SHOWN = "left_knee"


def collect(robot: Robot, models: Sequence[Robot], seconds: int, progress: Progress) -> Log:
    """Let every model's robot carry out every stance's motion: row 3 k + s is model k, stance s."""
    each = [model for model in models for _ in STANCES]
    plan, gains = following(exciting(robot, seconds, seed=0)), PdGains.of(robot, 1.5)
    trial = Trial(robot, plan, float(seconds), len(each), believe=believing(each))
    # Forces that the ground can deliver: it has to stand with a wrong model.
    law, desire = Limited.of(robot, base_priority=1.0), carrying_out(robot, 1.2, 2.0)
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


def run(setting: Setting) -> Result:
    """Draw wrong models, let them move, identify them at every noise, and compare."""
    robot, progress = load("biped"), setting.progress
    count, levels = setting.pick(4, 1), setting.pick(LEVELS, (0.0, 1.0))
    models = [wrong_model(robot, WRONG, np.random.default_rng([10, k])) for k in range(count)]
    log = collect(robot, models, setting.pick(10, 8), progress.part(0.05, 0.5, "exciting motions"))
    motions = held_out(robot)

    fitting = progress.part(0.5, 0.95, "identification")
    rows, chosen = [], None
    for k, nominal in enumerate(models):
        for i, level in enumerate(levels):
            samples = samples_of(robot, log, k, range(len(STANCES)), level)
            row, found = fitted(robot, nominal, samples, motions)
            rows.append({"model": k, "level": level, **row})
            if level == 1.0 and chosen is None:
                chosen = found
            fitting((k + (i + 1) / len(levels)) / count)
    assert chosen is not None
    identified, shown = chosen.model(), motions["fast squat/bow"]
    joint = robot.joint_names.index(_SHOWN)
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
    truth = InertialRegressor(robot).parameters()
    arrays = {
        "time": shown.time,
        **{name: feedforward(model, shown)[:, joint] for name, model in compared.items()},
        "parameters": np.stack([truth, chosen.nominal, chosen.parameters]),
    }
    return Result(findings(numbers), numbers, arrays)


def findings(numbers: dict[str, Any]) -> list[Finding]:
    """The claims, and what came out."""
    rows = numbers["rows"]
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
    most = [level for level in numbers["levels"] if improvements(numbers, level).min() >= FACTOR]
    impossible = sum(row["impossible"] > 0 for row in rows)
    everything = numbers["told"][-1]
    both = numbers["told"][0]
    result += [
        Finding(
            "most sensor noise of the sweep at which the error falls tenfold in every case",
            "not given",
            f"{number(max(most))} times that of the table" if most else "none",
        ),
        judged(
            "estimates of bodies that can exist",
            "not given",
            f"{sum(row['consistent'] for row in rows)} of {len(rows)}; plain least squares: "
            f"{len(rows) - impossible} of {len(rows)}",
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
    return result


EXPERIMENT = Experiment(
    module="eval.papers.mistry2010.identification",
    title="Inertial parameters without contact forces",
    about=(
        "The paper points to its reference [13] for estimating inertial parameters in the reduced "
        "space, where contact forces do not appear, and shows no data. Here it is done with a "
        "biped whose nominal link masses and centres of mass are wrong by up to 30 %."
    ),
    run=run,
    show=show,
)
