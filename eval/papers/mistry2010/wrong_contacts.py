"""[M10] III-B.6: wrong beliefs about contacts degrade tracking but do not blow up."""

from collections.abc import Callable

import numpy as np

from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.log import Log
from eval.papers.mistry2010.controllers import JointController, PdGains, base_returning, following
from eval.papers.mistry2010.laws import ESTIMATED, Law, limited, measured, orthogonal, posed
from eval.papers.trial import RATES, Trial, simulate
from fbid_gym.actions.contact_options import ContactBelief, contact_belief
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import MotionTable, stepping
from fbid_gym.quantities import RobotState, Target
from fbid_gym.robots import Robot, load

LATE = (-200, -100, -50, -20, 0, 20, 50, 100, 200)
"""ms by which the controller switches contacts later than planned."""

FRICTION = (0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1, 0.05)
GAINS, BASE = (2.0, 0.5), 1.0
"""Hz and damping ratio; Hz of eq. (20), critically damped."""

OURS = "eq. (15)"
COLOURS = {
    OURS: 0,
    "eq. (15), limited": 2,
    "eq. (8), measured force": 3,
    "eq. (8), previous torque": 4,
}


def laws(robot: Robot) -> dict[str, Law]:
    """Return what is compared, by name."""
    return dict(
        zip(COLOURS, (orthogonal(), limited(robot), measured(robot), ESTIMATED), strict=True)
    )


def shifted(robot: Robot, motion: MotionTable, late: np.ndarray, rest: np.ndarray) -> ContactBelief:
    """Believe in the contacts that were planned `late` (N,) ms ago; the last K in `rest` (K, P)."""
    points = motion.rows.planted[:, contact_geometry(robot).foot_of_point]
    ticks = np.round(late * RATES.control / 1000).astype(int)

    def belief(state: RobotState, reference: Target) -> np.ndarray:
        moving = points[(state.tick[: len(ticks)] - ticks) % len(points)]
        return np.concatenate([moving, rest])

    return belief


def slippery(friction: np.ndarray) -> Callable[[Simulation], None]:
    """Give every robot's soles a friction of its own, (N,)."""

    def prepare(simulation: Simulation) -> None:
        simulation.batch.expand("geom_friction")[:, :, 0] = friction[:, None]

    return prepare


def _summary(log: Log, robot: Robot) -> Numbers:
    asked = np.abs(np.where(log.up[:, :, None], log["feedforward"] + log["feedback"], 0.0))
    return {
        "error": float(np.nanmean(log.rms_of_joints(log.error))),
        "torque": float(np.nanmean(log.rms_of_joints(log["torque"]))),
        "peak": float((asked / robot.torque_limit).max()),
        "up": float(log.survived.mean()),
        "finite": bool(np.isfinite(log["feedforward"]).all()),
    }


def _static(robot: Robot, count: int) -> Numbers:
    """Eq. (15) at random states with every number of points believed down: how large is tau?"""
    rng, points = np.random.default_rng(5), robot.num_points
    qpos = np.tile(robot.home_qpos, (count, 1))
    joints = qpos[:, 7:] + rng.normal(size=(count, robot.num_joints)) * 0.4
    qpos[:, 7:] = np.clip(joints, *robot.joint_range.T)
    qpos[:, 3], qpos[:, 4:7] = 1.0, 0.15 * rng.normal(size=(count, 3))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qvel, command = (size * rng.normal(size=(count, robot.nv)) for size in (1.0, 3.0))
    down = rng.integers(0, points + 1, count)
    order = rng.permuted(np.tile(np.arange(points), (count, 1)), axis=1)
    asked, _ = posed(robot, qpos, qvel, command, order < down[:, None])
    torque = orthogonal_inverse_dynamics(*asked).torque
    by_count = [np.abs(torque).max(axis=1)[down == k] for k in range(points + 1)]
    return {
        "finite": bool(np.isfinite(torque).all()),
        "median": [float(np.median(part)) for part in by_count],
        "largest": [float(part.max()) for part in by_count],
        "states": count,
    }


@experiment(
    "Claim: wrong contact beliefs degrade tracking but never blow up",
    """The biped steps in place while the controller switches contacts early or late, believes for
    ever in both feet, one or none, or stands on ground that is more slippery than any contact it
    believes in.""",
    minutes=2.5,
)
def claim_wrong_contacts(setting: Setting) -> Measured:
    """Step in place with wrong beliefs, on slippery ground; then random states and beliefs."""
    robot = load("biped")
    motion, geometry = stepping(robot), contact_geometry(robot)
    seconds, each = setting.pick(12.0, 4.0), setting.pick(4, 2)
    starts = np.arange(each) * motion.seconds / each
    late, friction = setting.pick(LATE, (-100, 0, 100)), setting.pick(FRICTION, (0.8, 0.2))
    left = np.array([name == "left" for name in robot.foot_names])[geometry.foot_of_point]
    fixed = {"both feet down": left | True, "left foot down": left, "right foot down": ~left}
    fixed["no foot down"] = left & False
    forever = np.repeat(np.array(list(fixed.values())), each, axis=0)
    delays = [f"{d:+d} ms" if d else "as planned" for d in late]
    slips = [f"friction {value:g}" for value in friction]
    # Every belief and every start in one batch, then every friction.
    wrong = shifted(robot, motion, np.repeat(late, each), forever)
    planned = contact_belief("planned", robot, RATES.control)
    cases: dict[str, tuple[list[str], ContactBelief, Numbers]] = {
        "beliefs": ([*delays, *fixed], wrong, {}),
        "slip": (slips, planned, {"prepare": slippery(np.repeat(friction, each))}),
    }
    gains, desire = PdGains.of(robot, *GAINS), base_returning(robot, BASE)
    rows: list[Numbers] = []
    for name, case in setting.each([(name, case) for name in COLOURS for case in cases]):
        labels, belief, options = cases[case]
        count = each * len(labels)
        start = np.resize(starts, count)
        trial = Trial(robot, following(motion), seconds, count, start, every=5, **options)
        law = laws(robot)[name]
        log = simulate(trial, JointController(robot, gains, law, belief, desire))
        for label, some in zip(labels, log.groups(each), strict=True):
            rows.append({"law": name, "belief": label, **_summary(some, robot)})
    static, ours = _static(robot, setting.pick(4000, 500)), [r for r in rows if r["law"] == OURS]
    numbers = {
        "rows": rows, "late": list(late), "friction": list(friction), "fixed": list(fixed),
        "static": static, "each": each,
    }  # fmt: skip
    return numbers, {
        **{"COLOURS": COLOURS, "of": {r["belief"]: r for r in ours}},
        "wrong": [r for r in ours if r["belief"] != "as planned"],
        "worst": max(ours, key=lambda r: r["error"]),
        "peak": max(r["peak"] for r in ours),
        "finite": all(r["finite"] for r in ours) and static["finite"],
        "by_delay": [r for r in rows if r["belief"] in delays],
        "by_friction": [r for r in rows if r["belief"] in slips],
    }
