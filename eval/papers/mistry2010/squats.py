"""[M10] figures 3 to 5: the squat/bow under PD alone and under PD with inverse dynamics."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Measured, Numbers, Setting, experiment, row
from eval.papers.mistry2010.controllers import JointController, PdGains, following
from eval.papers.mistry2010.laws import Law, limited, measured, orthogonal, rivals
from eval.papers.trial import Trial, simulate
from eval.papers.wrong_models import believing, wrong_model
from eval.wording import number
from fbid_gym.motions import squat_bow
from fbid_gym.robots import Robot, load

JOINTS = {"hip": "left_hip_pitch", "knee": "left_knee", "ankle": "left_ankle_pitch"}
ZETAS = (0.3, 0.5, 1.0)
HERTZ = (1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
"""The sweep of the gains of PD alone: natural frequencies in stance, and damping ratios."""

SOFT = (1.6, 0.5)
"""Hz and damping ratio at which PD alone errs in the slow motion about as the paper's PD does."""

WRONG, MODELS = (0.02, 0.05), 5
"""Largest relative errors of the masses and centres of mass of wrong models, and how many each."""

EVERY = 5
"""Control ticks from one logged tick to the next."""

PD, FF, BEST = "PD, soft gains", "PD+FF, soft gains", "PD, best gains"
SHOWN = ((PD, "PD, soft", 5), (BEST, "PD, best", 1), (FF, "PD+FF, soft", 0))
RIVALS = (
    ("force from the previous torque", "previous torque", 4),
    ("measured force, 10 ms late", "measured, 10 ms late", 3),
    ("measured force, ideal sensor", "measured, ideal", 2),
    (FF, "PD+FF", 0),
)
"""Name, label and colour of the controllers whose curves are drawn."""


def joint_columns(robot: Robot) -> list[int]:
    """Return the places of the joints that the paper shows."""
    return [robot.joint_names.index(name) for name in JOINTS.values()]


def measure(speed: float, moments: Sequence[float], setting: Setting) -> Measured:
    """Run the sweep of the gains, then each controller on its own, then wrong models."""
    robot = load("biped")
    motion = squat_bow(robot, speed=speed)
    seconds = motion.seconds * setting.pick(1.0, 0.2 if speed < 2 else 0.4)
    trial = Trial(robot, following(motion), seconds, every=EVERY)
    joints = joint_columns(robot)
    pairs = setting.pick(
        [(f, z) for z in ZETAS for f in HERTZ], [(f, z) for z in (0.3, 1.0) for f in HERTZ[1::2]]
    )
    sweeps: dict[str, list[Numbers]] = {}
    many, gains = replace(trial, num_robots=len(pairs)), PdGains.of(robot, *np.array(pairs).T)
    for name in setting.each(("alone", "both"), 0.45):
        law = orthogonal() if name == "both" else None
        log = simulate(many, JointController(robot, gains, law))
        rms = log.rms(log.error)[:, joints]
        sweeps[name] = [
            {"hertz": f, "zeta": z, "fell": log.fall(k), "rms": rms[k].tolist()}
            for k, (f, z) in enumerate(pairs)
        ]
    standing = [row for row in sweeps["alone"] if row["fell"] is None]
    best = min(standing or sweeps["alone"], key=lambda row: sum(row["rms"]))
    soft, stiff = PdGains.of(robot, *SOFT), PdGains.of(robot, best["hertz"], best["zeta"])
    ideal, late, previous = rivals(robot).items()
    noisy = measured(robot, noise=5.0, cutoff_hz=20.0)
    compared: dict[str, tuple[PdGains, Law | None]] = {
        BEST: (stiff, None),
        PD: (soft, None),
        FF: (soft, orthogonal()),
        "PD+FF, gains of best PD": (stiff, orthogonal()),
        "PD+FF with limited forces": (soft, limited(robot)),
        ideal[0]: (soft, ideal[1]),
        "measured force, 5 N noise, 20 Hz filter": (soft, noisy),
        late[0]: (soft, late[1]),
        previous[0]: (soft, previous[1]),
    }
    rows, logs = [], {}
    for name in setting.each(compared, 0.9):
        log = logs[name] = simulate(trial, JointController(robot, *compared[name]))
        torque = log.rms(log["torque"]).mean()
        rms, feedback = log.rms(log.error)[0, joints], log.rms(log["feedback"]).mean() / torque
        row_of = {"name": name, "rms": rms.tolist(), "torque": float(torque)}
        rows.append(row_of | {"feedback": float(feedback), "fell": log.fall()})
    numbers = {"speed": speed, "seconds": seconds, "rows": rows, **sweeps, "best": best}
    numbers["wrong"] = _wrong(trial, soft, setting.pick(MODELS, 2))

    longest = max(logs.values(), key=lambda log: len(log.time))
    at = dict(zip(JOINTS, joints, strict=True))
    zeta = setting.pick(0.5, 1.0)
    of_zeta = {name: [r for r in sweep if r["zeta"] == zeta] for name, sweep in sweeps.items()}
    errors = {
        name: [1e3 * r["rms"][1] if r["fell"] is None else np.nan for r in some]
        for name, some in of_zeta.items()
    }
    return numbers, {
        **{label: row(rows, name=n) for label, n in (("ours", FF), ("stiff", BEST), ("soft", PD))},
        "angles": {
            label: [("desired", 7, longest, longest["target"][:, 0, k])]
            + [(n, colour, logs[of], logs[of]["qpos"][:, 0, 7 + k]) for of, n, colour in SHOWN]
            for label, k in at.items()
        },
        "errors": {
            label: [(n, c, logs[of], 1e3 * logs[of].error[:, 0, k]) for of, n, c in RIVALS]
            for label, k in at.items()
        },
        "hertz": [r["hertz"] for r in of_zeta["alone"]],
        "knee": [("PD", 1, errors["alone"]), ("PD+FF", 0, errors["both"])],
        "pictures": Camera(robot).strip(logs[FF], moments),
        "falling": Camera(robot).strip(logs[PD], 0.25 * np.arange(7)),
        **{"triple": triple, "error": error, "soft_gains": SOFT},
    }


def _wrong(trial: Trial, gains: PdGains, count: int) -> list[Numbers]:
    """Run PD+FF with wrong models of each size, all in one batch."""
    robot, rng = trial.robot, np.random.default_rng(20100503)
    models = [wrong_model(robot, size, rng) for size in WRONG for _ in range(count)]
    trial = replace(trial, num_robots=len(models), believe=believing(models))
    log = simulate(trial, JointController(robot, gains, orthogonal()))
    rows = []
    for size, some in zip(WRONG, log.groups(count), strict=True):
        rms = some.rms(some.error)[:, joint_columns(robot)]
        found = {"rms": np.median(rms, axis=0), "least": rms.min(axis=0), "most": rms.max(axis=0)}
        of_size = {"size": size, "models": count, "up": float(some.survived.mean())}
        rows.append(of_size | {name: value.tolist() for name, value in found.items()})
    return rows


def triple(values: Sequence[float]) -> str:
    """Write the errors of hip, knee and ankle."""
    return ", ".join(error(value) for value in values)


def error(value: float) -> str:
    """Write an RMS error in rad; what is smaller than 0.00005 is not told from zero."""
    return number(value, 2) if value >= 5e-5 else "< 0.00005"


@experiment(
    "Figures 3 and 4: a slow squat and bow",
    """A deep squat every 5 s with a bow every 10 s, 30 s in all, planned in the null space of the
    contacts; no balance controller. The gains of PD alone are the best of a sweep of natural
    frequencies from 1 to 10 Hz and damping ratios from 0.3 to 1.""",
)
def fig4_slow_squat(setting: Setting) -> Measured:
    """Run every controller over the slow motion."""
    return measure(1.0, (0.0, 2.5, 5.0, 7.5, 10.0, 17.5, 22.5), setting)


@experiment(
    "Figure 5: five times faster",
    """The same motion in 6 s: a squat a second, full extension of the knees at their joint limit
    from 4 s on. No balance controller.""",
)
def fig5_fast_squat(setting: Setting) -> Measured:
    """Run every controller over the fast motion."""
    return measure(5.0, (0.0, 0.5, 1.0, 1.5, 4.0, 4.5, 5.0), setting)
