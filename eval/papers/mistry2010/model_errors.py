"""[M10] III-B.6: are kinematic projections more robust to a wrong inertia than weighted ones?"""

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import ESTIMATED, IN_METRIC, WEIGHTED, Law, measured, orthogonal
from eval.papers.trial import Trial, simulate
from eval.papers.wrong_models import believing_in
from fbid_gym.motions import periodic_squat
from fbid_gym.robots import Robot, load

SHARES = (0.0, 0.1, 0.2, 0.3, 0.4)
KINDS = ("mass", "centre of mass", "inertia", "all three")
GAINS = (2.0, 0.5)


def laws(robot: Robot) -> dict[str, Law]:
    """Return what is compared, by name."""
    return {
        "eq. (15)": orthogonal(),
        "eq. (7), least torque": WEIGHTED,
        "eq. (15) in the metric M": IN_METRIC,
        "eq. (8), measured force": measured(robot),
        "eq. (8), previous torque": ESTIMATED,
    }


def wrong(robot: Robot, kind: str, share: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Return inertial parameters with errors of up to `share` (N,), fields of MuJoCo's model.

    Of each body, mass and inertia are scaled by 1 ± share, and the centre of mass is moved along
    each axis by up to share times the body's radius of gyration. A wrong mass leaves the inertia
    about the centre of mass in proportion.
    """
    model, rng = robot.model, np.random.default_rng(seed)
    draws = rng.uniform(-1.0, 1.0, (3, len(share), model.nbody, 3))
    on = [kind in (one, KINDS[-1]) for one in KINDS[:-1]]
    mass, com, inertia = share[:, None, None] * draws * np.reshape(on, (3, 1, 1, 1))
    mass, inertia = 1.0 + mass[:, :, :1], 1.0 + inertia[:, :, :1]
    gyration = np.sqrt(model.body_inertia.sum(axis=1) / (2.0 * np.maximum(model.body_mass, 1e-9)))
    return {
        "body_mass": model.body_mass * mass[:, :, 0],
        "body_inertia": model.body_inertia * mass * inertia,
        "body_ipos": model.body_ipos + com * gyration[:, None],
    }


@experiment(
    "Claim: kinematic projections are more robust to a wrong inertia",
    """Controllers with wrong models of the biped, 0 to 40 % off in the links' masses, centres of
    mass (of the radius of gyration) and inertias, squat at 2 Hz. Eq. (15) against the routes
    through the inverse of the inertia matrix.""",
    minutes=3.0,
)
def claim_model_errors(setting: Setting) -> Measured:
    """Squat at 2 Hz with every law, every kind of error and every size."""
    robot, models = load("biped"), setting.pick(10, 4)
    share, kinds = np.repeat(SHARES, models), setting.pick(KINDS, KINDS[3:])
    motion, gains = following(periodic_squat(robot, frequency=2.0)), PdGains.of(robot, *GAINS)
    rows: list[Numbers] = []
    for kind, name in setting.each([(kind, name) for kind in kinds for name in laws(robot)]):
        trial = Trial(
            robot, motion, setting.pick(2.5, 1.5), len(share), every=5,
            believe=believing_in(wrong(robot, kind, share, 17)),
        )  # fmt: skip
        log = simulate(trial, JointController(robot, gains, laws(robot)[name]))
        of_size = (len(SHARES), models)
        error, torque = (log.rms_of_joints(x).reshape(of_size) for x in (log.error, log["torque"]))
        found = {
            "error": np.nanmedian(error, axis=1),
            "worst": np.nanmax(error, axis=1),
            "torque": np.nanmedian(torque, axis=1),
            "up": log.survived.reshape(of_size).mean(axis=1),
        }
        rows.append({"kind": kind, "law": name} | {k: v.tolist() for k, v in found.items()})
    return {"rows": rows, "models": models, "kinds": list(kinds)}, {
        "last": [row(rows, kind="all three", law=law) for law in laws(robot)],
        **{"shares": SHARES, "percents": [100 * share for share in SHARES]},
        "colours": {law: k for k, law in enumerate(laws(robot))},
    }
