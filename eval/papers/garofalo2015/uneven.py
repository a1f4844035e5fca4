"""Beyond [G15]: one foot on a block, higher and sloped."""

from dataclasses import dataclass

import mujoco
import numpy as np

from eval.papers.camera import Camera
from eval.papers.experiment import Measured, Numbers, Setting, experiment
from eval.papers.garofalo2015.balancer import COLOUR, Balancer
from eval.papers.garofalo2015.bout import Blow, balancing, blow_numbers, stay, struck
from eval.papers.garofalo2015.pendulum import PendulumBlow, add_pendulum
from eval.papers.trial import Trial, simulate
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics
from fbid_gym.dynamics.frames import rotation_vector, skew
from fbid_gym.robots import Robot, load

START, SECONDS = 1.5, 6.0
_HALF = (0.16, 0.09)
"""m, half the length and width of the block's top."""

_ROUNDS, _POSTURE = 60, 0.004


@dataclass(frozen=True)
class Block:
    """A block under the right foot; the left one stands on the floor."""

    name: str  # of the case
    height: float = 0.0  # m, of the block's top under the middle of the foot
    slope: float = 0.0  # rad, toes up
    bank: float = 0.0  # rad, outer edge down

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) world from the block's axes."""
        turn, quaternion = np.empty(9), np.empty(4)
        mujoco.mju_euler2Quat(quaternion, np.array([self.bank, -self.slope, 0.0]), "XYZ")
        mujoco.mju_quat2Mat(turn, quaternion)
        return turn.reshape(3, 3)


BLOCKS = (
    Block("level"),
    Block("5 cm higher", 0.05),
    Block("10 cm higher", 0.10),
    Block("sloped by 10°", 0.02, np.radians(10.0)),
    Block("banked by 10°", 0.02, 0.0, np.radians(10.0)),
    Block("5 cm higher, sloped and banked by 8°", 0.05, np.radians(8.0), np.radians(8.0)),
)


def stance(robot: Robot, block: Block) -> np.ndarray:
    """Return a configuration (nq,) that stands there, centre of mass over the middle of the feet.

    Gauss-Newton on the poses of the soles, the centre of mass, the base's orientation, and, weakly,
    the home posture.
    """
    qpos, still, dynamics = robot.home_qpos.copy(), np.zeros((1, robot.nv)), MuJoCoDynamics(robot)
    home = dynamics.terms(qpos[None], still)
    soles, turns = _soles(robot, home), np.stack([np.eye(3), block.rotation])
    com = home.com[0] + [0.0, 0.0, 0.3 * block.height]
    soles[1, 2] += block.height
    for _ in range(_ROUNDS):
        terms = dynamics.terms(qpos[None], still)
        now, rotation = _soles(robot, terms), terms.world_from_foot[0]
        jacobian = terms.foot_jacobian[0].copy()
        jacobian[:, :3] -= skew(now - terms.foot_position[0]) @ jacobian[:, 3:]
        # The linear rows of M are the mass times the centre of mass's Jacobian.
        of_com = terms.mass_matrix[0, :3] / robot.mass
        spin = np.pad(terms.world_from_base[0], [(0, 0), (3, robot.num_joints)])
        rows = [*jacobian, of_com, spin, _POSTURE * np.eye(robot.nv)[6:]]
        errors = [
            *np.concatenate([soles - now, rotation_vector(turns @ rotation.mT)], axis=1),
            com - terms.com[0],
            rotation_vector(terms.world_from_base[0].T),
            _POSTURE * (robot.home_qpos[7:] - qpos[7:]),
        ]
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(errors), rcond=None)[0]
        mujoco.mj_integratePos(robot.model, qpos, step, 1.0)
        qpos[7:] = np.clip(qpos[7:], *robot.joint_range.T)
    return qpos


def _soles(robot: Robot, terms: DynamicsTerms) -> np.ndarray:
    """Middle of each foot's contact points, on the sole: (F, 3) m, world."""
    radius = np.array([[foot.radius] for foot in robot.feet])
    return terms.foot_position[0] + radius * ([0.0, 0.0, 1.0] - terms.world_from_foot[0, :, :, 2])


def world(robot: Robot, block: Block, start: np.ndarray, pendulum: PendulumBlow) -> mujoco.MjModel:
    """Return the robot's world with the pendulum and the block under the right foot."""
    spec = robot.spec.copy()
    add_pendulum(spec, robot, pendulum)
    if block.height or block.slope or block.bank:
        terms = MuJoCoDynamics(robot).terms(start[None], np.zeros((1, robot.nv)))
        left, right = _soles(robot, terms)
        top = right - [0.0, 0.0, left[2]]
        half = np.array([*_HALF, 0.5 * max(block.height, 0.04)])
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, block.rotation.ravel())
        spec.worldbody.add_geom(
            name="block",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=top - half[2] * block.rotation[:, 2],
            quat=quaternion,
            size=half,
            contype=1,
            conaffinity=0,
            rgba=[0.55, 0.45, 0.35, 1.0],
        )
    return spec.compile()


@experiment(
    "Left open: one foot on a block",
    """The right foot stands higher, sloped or banked, the left one on the floor; then the paper's
    blow, from either side.""",
    minutes=0.6,
)
def uneven(setting: Setting) -> Measured:
    """Hit each balancer from both sides on each block."""
    robot, pendulum = load("humanoid"), PendulumBlow()
    blocks = {block.name: block for block in setting.pick(BLOCKS, (BLOCKS[0], BLOCKS[-1]))}
    sides = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    blow = Blow(START, sides, np.full(2, pendulum.energy))
    rows: list[Numbers] = []
    images = []
    for ground, block in zip(setting.each(blocks), blocks.values(), strict=True):
        start = stance(robot, block)
        turned = np.tile(np.eye(3), (2, robot.num_points, 1, 1))
        turned[:, robot.feet[0].num_points :] = block.rotation
        model = world(robot, block, start, pendulum)
        trial = Trial(
            robot, balancing(start, stay(start[7:], turned)), SECONDS, 2, every=5,
            world=model, disturb=struck(pendulum, blow),
        )  # fmt: skip
        for name in COLOUR:
            log = simulate(trial, Balancer(robot, name))
            before = log["com"][np.flatnonzero(log.time < START)[-1]]
            offset = {"offset": float(np.linalg.norm(before, axis=1).max())}
            for side in range(2):
                case = {"ground": ground, "name": name, "side": side}
                rows.append(case | offset | blow_numbers(log, START, side))
        camera = Camera(robot, 224, 320, 150.0, -10.0, model=model, nearer=1.0)
        images += camera.draw([(log["qpos"][0, 0].astype(float), np.zeros(3), "")])
    stood = {n: sum(r["fell"] is None for r in rows if r["name"] == n) for n in COLOUR}
    return {"rows": rows}, {
        **{"images": images, "stood": stood, "cases": 2 * len(blocks)},
        "told": {
            ground: [
                told([r for r in rows if (r["ground"], r["name"]) == (ground, n)]) for n in COLOUR
            ]
            for ground in blocks
        },
    }


def told(rows: list[Numbers]) -> str:
    """Write what became of robots that were hit."""
    fallen = sum(r["fell"] is not None for r in rows)
    if fallen:
        return f"{fallen} of {len(rows)} fall"
    com, hip = max(r["com"][1] for r in rows), max(r["rotation"][0] for r in rows)
    return f"{1e3 * com:.0f} mm, {hip:.3f} rad"
