"""What [G15] leaves open: one foot on a block, higher and sloped."""

import sys
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Experiment, Result, Setting, main
from eval.papers.garofalo2015.balancer import BALANCERS, Goal, balancer
from eval.papers.garofalo2015.bout import Blow, Bout, Record
from eval.papers.garofalo2015.bout import run as fight
from eval.papers.garofalo2015.measures import blow_numbers
from eval.papers.garofalo2015.pendulum import Pendulum, add_pendulum
from eval.papers.parts import Finding, frames, judged, table, text
from fbid_gym.control.balance import resting_target
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.robots import Robot, load

START, SECONDS = 1.5, 6.0
_HALF = (0.16, 0.09)
"""m, half the length and width of the block's top."""

_ROUNDS, _POSTURE = 60, 0.004


@dataclass(frozen=True)
class Ground:
    """A block under the right foot; the left one stands on the floor.

    Attributes:
        name: of the case.
        height: m, of the block's top under the middle of the foot.
        slope: rad, toes up.
        bank: rad, outer edge down.
    """

    name: str
    height: float = 0.0
    slope: float = 0.0
    bank: float = 0.0

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) world from the block's axes."""
        turn, quaternion = np.empty(9), np.empty(4)
        mujoco.mju_euler2Quat(quaternion, np.array([self.bank, -self.slope, 0.0]), "XYZ")
        mujoco.mju_quat2Mat(turn, quaternion)
        return turn.reshape(3, 3)


GROUNDS = (
    Ground("level"),
    Ground("5 cm higher", 0.05),
    Ground("10 cm higher", 0.10),
    Ground("sloped by 10°", 0.02, np.radians(10.0)),
    Ground("banked by 10°", 0.02, 0.0, np.radians(10.0)),
    Ground("5 cm higher, sloped and banked by 8°", 0.05, np.radians(8.0), np.radians(8.0)),
)


def stance(robot: Robot, ground: Ground) -> np.ndarray:
    """Return a configuration (nq,) that stands there, centre of mass over the middle of the feet.

    Gauss-Newton on the poses of the feet, the centre of mass, the base's orientation, and, weakly,
    the home posture.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.home_qpos
    mujoco.mj_fwdPosition(model, data)
    left, right = (foot.body for foot in robot.feet)
    goals = {body: (_sole(robot, data, k), np.eye(3)) for k, body in enumerate((left, right))}
    goals[right] = (goals[right][0] + [0.0, 0.0, ground.height], ground.rotation)
    middle = 0.5 * (goals[left][0] + goals[right][0])
    com = data.subtree_com[robot.base_body] + [0.0, 0.0, 0.3 * ground.height]
    com[:2] += middle[:2] - 0.5 * (_sole(robot, data, 0) + _sole(robot, data, 1))[:2]
    for _ in range(_ROUNDS):
        mujoco.mj_fwdPosition(model, data)
        rows, errors = [], []
        for k, (body, (place, rotation)) in enumerate(goals.items()):
            linear, angular = np.zeros((2, 3, robot.nv))
            sole = _sole(robot, data, k)
            mujoco.mj_jac(model, data, linear, angular, sole, body)
            rows += [linear, angular]
            errors += [place - sole, _turn(rotation @ data.xmat[body].reshape(3, 3).T)]
        linear, angular = np.zeros((2, 3, robot.nv))
        mujoco.mj_jacSubtreeCom(model, data, linear, robot.base_body)
        mujoco.mj_jacBody(model, data, None, angular, robot.base_body)
        rows += [linear, angular, _POSTURE * np.eye(robot.nv)[6:]]
        errors += [
            com - data.subtree_com[robot.base_body],
            _turn(data.xmat[robot.base_body].reshape(3, 3).T),
            _POSTURE * (robot.home_qpos[7:] - data.qpos[7:]),
        ]
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(errors), rcond=None)[0]
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        data.qpos[7:] = np.clip(data.qpos[7:], *robot.joint_range.T)
    return np.array(data.qpos)


def _sole(robot: Robot, data: mujoco.MjData, foot: int) -> np.ndarray:
    """Middle of a foot's contact points, on the sole, world."""
    own = robot.feet[foot]
    centre = own.points.mean(axis=0) - [0.0, 0.0, own.radius]
    return np.asarray(data.xpos[own.body] + data.xmat[own.body].reshape(3, 3) @ centre)


def _turn(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector of a rotation matrix, rad."""
    quaternion, vector = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector


def world(robot: Robot, ground: Ground, start: np.ndarray, pendulum: Pendulum) -> mujoco.MjModel:
    """Return the robot's world with the pendulum and the block under the right foot."""
    spec = robot.spec.copy()
    add_pendulum(spec, robot, pendulum)
    if ground.height or ground.slope or ground.bank:
        data = mujoco.MjData(robot.model)
        data.qpos[:] = start
        mujoco.mj_fwdPosition(robot.model, data)
        floor = _sole(robot, data, 0)[2]
        top = _sole(robot, data, 1) - [0.0, 0.0, floor]
        half = np.array([*_HALF, 0.5 * max(ground.height, 0.04)])
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, ground.rotation.ravel())
        spec.worldbody.add_geom(
            name="block",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=top - half[2] * ground.rotation[:, 2],
            quat=quaternion,
            size=half,
            contype=1,
            conaffinity=0,
            rgba=[0.55, 0.45, 0.35, 1.0],
        )
    return spec.compile()


def run(setting: Setting) -> Result:
    """Hit each balancer from both sides on each ground."""
    robot, pendulum = load("humanoid"), Pendulum()
    grounds = GROUNDS if not setting.quick else (GROUNDS[0], GROUNDS[-1])
    sides = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    blow = Blow(START, sides, np.full(2, pendulum.energy))
    parts = setting.progress.parts([f"{g.name}, {name}" for g in grounds for name in BALANCERS])
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for ground in grounds:
        start = stance(robot, ground)
        model = world(robot, ground, start, pendulum)
        turned = np.tile(np.eye(3), (2, robot.num_points, 1, 1))
        turned[:, robot.feet[0].num_points :] = ground.rotation

        def goal(
            time: float,
            first: DynamicsTerms,
            start: np.ndarray = start,
            turned: np.ndarray = turned,
        ) -> Goal:
            target = resting_target(first.com, first.base_rotation)
            return Goal(target, start[7:], contact_rotation=turned)

        for name in BALANCERS:
            bout = Bout(
                robot, SECONDS, 2, model, start, pendulum, blow, goal, every=5,
            )  # fmt: skip
            record = fight(bout, balancer(robot, name), parts[len(rows) // 2])
            for side in range(2):
                row = {"ground": ground.name, "name": name, "side": side}
                rows.append(row | rest(record) | blow_numbers(record, START, side))
        arrays[f"pose.{ground.name}"] = record.qpos[0, 0]
    return Result(findings(rows), {"rows": rows}, arrays)


def rest(record: Record) -> dict[str, Any]:
    """How still they stand before the blow: offset of the centre of mass, m."""
    before = np.flatnonzero(record.time < START)[-1]
    return {"offset": float(np.linalg.norm(record.com[before], axis=1).max())}


def findings(rows: list[dict[str, Any]]) -> list[Finding]:
    """Who stays up everywhere."""
    cases = len(rows) // len(BALANCERS)
    stood = {
        name: sum(row["fell"] is None for row in rows if row["name"] == name) for name in BALANCERS
    }
    return [
        judged(
            "The paper's blow on uneven ground, from either side: stays up in",
            "not given",
            ", ".join(f"{name}: {count} of {cases}" for name, count in stood.items()),
            "all cases",
            all(count == cases for count in stood.values()),
        )
    ]


def show(result: Result) -> str:
    """Draw the section."""
    rows, robot = result.numbers["rows"], load("humanoid")
    names = list(dict.fromkeys(row["ground"] for row in rows))
    cells = []
    for ground in names:
        line = [ground]
        for name in BALANCERS:
            own = [r for r in rows if r["ground"] == ground and r["name"] == name]
            fallen = [r for r in own if r["fell"] is not None]
            if fallen:
                line.append(f"{len(fallen)} of {len(own)} fall")
            else:
                com = max(r["com"][1] for r in own)
                hip = max(r["rotation"][0] for r in own)
                line.append(f"{1e3 * com:.0f} mm, {hip:.3f} rad")
        cells.append(line)
    images = []
    for ground in GROUNDS:
        pose = result.arrays.get(f"pose.{ground.name}")
        if pose is None:
            continue
        model = world(robot, ground, stance(robot, ground), Pendulum())
        with Camera(robot, 224, 320, 150.0, -10.0, model=model, nearer=1.0) as camera:
            images.append(camera.picture(pose.astype(float), np.zeros(3)))
    return "".join(
        (
            frames(images, "; ".join(names) + ".", "a humanoid stands with one foot on blocks"),
            table(
                ["right foot; largest error of centre of mass in y and hip about x", *BALANCERS],
                cells,
            ),
            text(
                "The balancers know where the ground is and which way it faces; friction cones "
                "stand on it. The wrench at the centre of mass does not care what the feet stand "
                "on, and neither do the errors."
            ),
        )
    )


EXPERIMENT = Experiment(
    module="eval.papers.garofalo2015.uneven",
    title="Left open: one foot on a block",
    about=(
        "The right foot stands higher, sloped or banked, the left one on the floor; then the "
        "paper's blow, from either side."
    ),
    run=run,
    show=show,
    minutes=0.6,
)

if __name__ == "__main__":
    sys.exit(main(EXPERIMENT))
