"""Feet that slip: how much friction the law counts on then, and whether robots stay up by it."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.control.grip import ANY, LEAST, GripModel, notice_slip
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import RobotState

HZ = 250
GO1 = Path(__file__).parents[2] / "assets" / "go1.xml"


class Standing:
    """A robot whose feet all carry, each at a velocity of its own."""

    def __init__(self, name: str, softness: float = 0.0, *, notices: bool = True) -> None:
        stance = Stance.of(robot := robots.load(name))
        self.rate, self.gravity = stance.falling_rate, robot.gravity
        self.model = GripModel.of(self.rate, self.gravity, 1.0 / HZ, softness, notices=notices)
        self.geometry = contact_geometry(robot)
        self.velocity = np.zeros((1, robot.num_feet, 6))
        self.terms = stance.terms._replace(foot_velocity=self.velocity)
        self.load = np.zeros((1, robot.num_points, 3))
        self.load[..., 2] = robot.weight / robot.num_points
        self.allowed, self.grip = np.zeros((1, robot.num_feet)), np.ones(1)

    def after(self, seconds: float, active: bool = True) -> float:
        state = RobotState(np.empty((1, 0)), np.empty((1, 0)), self.load, np.zeros(1, np.int64))
        stands, terms = np.full(self.load.shape[:2], active), self.terms
        for _ in range(round(seconds * HZ)):
            own = self.model, self.geometry, self.gravity, state, terms, stands, self.allowed
            notice_slip(*own, self.grip)
        return float(self.grip[0])


@pytest.mark.parametrize("name", ["go1", "humanoid"])
def test_a_foot_that_slips_lowers_it_and_one_that_creeps_does_not(name: str) -> None:
    robot = Standing(name)
    robot.velocity[0, 1, :2] = np.array([0.06, 0.078]) * robot.gravity / robot.rate
    assert robot.after(1.0) == 1.0
    robot.velocity[0, 1, :2] *= 5.0
    losing = 0.15 / robot.rate
    found, slid = 1.0, 0
    while found > LEAST and slid < HZ:
        slid += 1
        found = robot.after(1.0 / HZ)
        assert found == pytest.approx(max(np.exp(-slid / HZ / losing), LEAST), rel=1e-9)
    assert found == LEAST
    robot.velocity[:] = 0.0
    rising = 1.0 - (1.0 - LEAST) * (1.0 - robot.rate / 12.0 / HZ) ** (2 * HZ)
    assert robot.after(2.0) == pytest.approx(rising, rel=1e-9)


@pytest.mark.parametrize("softness", [0.008, 0.02])
def test_feet_that_land_slip_if_they_stop_more_slowly_than_contacts_stop_them(
    softness: float,
) -> None:
    for times, slips in ((1.0, False), (4.0, True)):
        robot = Standing("go1", softness)
        robot.allowed[:] = ANY
        robot.velocity[..., 0] = 10.0 * robot.model.speed
        for _ in range(20):
            robot.after(1.0 / HZ)
            robot.velocity *= np.exp(-1.0 / HZ / (times * softness))
        assert (robot.grip < 1.0) == slips
        robot.velocity[..., 0] = 10.0 * robot.model.speed  # no foot that has landed gains speed
        assert robot.after(0.02) < 0.9


def test_only_feet_that_shall_stand_and_carry_slip() -> None:
    for carries, stands in ((True, False), (False, True)):
        robot = Standing("go1")
        robot.velocity[..., 0] = 1.0
        robot.load *= carries
        assert robot.after(1.0, stands) == 1.0
    robot = Standing("go1", notices=False)
    robot.velocity[..., 0] = 1.0
    assert robot.after(1.0) == 1.0


def test_a_sole_that_tips_about_its_edge_does_not_slip(rng: np.random.Generator) -> None:
    robot = Standing("humanoid")
    foot, spin = 0, rng.normal(size=3) * [0.0, 5.0, 0.0]
    points = np.flatnonzero(robot.geometry.foot_of_point == foot)
    toes = points[robot.geometry.offset[points, 0] > 0.0]
    arm = robot.terms.world_from_foot[0, foot] @ robot.geometry.offset[toes].mean(axis=0)
    weight = robot.load.sum()
    robot.load[:] = 0.0
    robot.load[0, toes, 2] = weight / len(toes)
    robot.velocity[0, foot] = *-np.cross(spin, arm), *spin
    assert np.abs(robot.velocity[0, foot, :3]).max() > 0.1
    assert robot.after(1.0) == 1.0
    robot.velocity[0, foot, :2] += 1.0
    assert robot.after(0.5) == LEAST


@pytest.mark.parametrize(
    ("task", "gait", "options", "expected"),
    [
        ("QuadrupedWalk", "trot", {}, 0.5),
        ("QuadrupedWalk", "pace", {"friction": 0.6}, 0.49 / 0.6),
        ("QuadrupedWalk", "bound", {"friction": 0.6}, 1.0),  # 0.74 of it
        ("QuadrupedWalk", "bound", {"initial_grip": 0.4}, 0.4),
        ("QuadrupedWalk", "trot", {"notice_slip": False}, 1.0),
        ("BipedWalk", "walk", {}, 1.0),
    ],
)
def test_a_law_begins_with_half_of_the_friction_or_as_much_as_its_gait_needs(
    task: str, gait: str, options: dict[str, float], expected: float
) -> None:
    with gym.make(
        f"fbid_gym/{task}-v0", gait=gait, action_layer="base_acceleration", layer_options=options
    ) as env:
        grip = env.unwrapped.batch.loop.memory["grip"]
    assert grip == pytest.approx(expected, abs=0.01)


def walk_on(friction: float, notices: bool) -> tuple[float, np.ndarray]:
    """Return the share that stays up on ground unknown to the law, and the grip of each."""
    env = gym.make_vec(
        "fbid_gym/QuadrupedWalk-v0", num_envs=32, action_layer="base_acceleration", gait="trot",
        randomisation={"friction": (friction, friction)}, forward_range=(-0.5, 0.5),
        autoreset_mode=gym.vector.AutoresetMode.DISABLED, layer_options={"notice_slip": notices},
    )  # fmt: skip
    env.reset(seed=0)
    alive = np.ones(32, bool)
    for _ in range(400):
        info, fallen = (out := env.step(np.zeros(env.action_space.shape)))[4], out[2]
        alive &= ~fallen
        if fallen.any():
            env.reset(options={"reset_mask": fallen})
    env.close()
    return alive.mean(), info["layer_grip"][alive]


@pytest.mark.slow
def test_robots_on_slippery_ground_stay_up_by_it() -> None:
    """A trot with pushes on ground of 0.4 and 0.3 of its friction."""
    good, noticed, unnoticed = walk_on(1.0, True), walk_on(0.4, True), walk_on(0.4, False)
    assert (unnoticed[1] == 1.0).all()
    assert min(good[0], good[1].mean()) > 0.9
    assert 0.3 < noticed[1].mean() < 0.8
    assert noticed[0] > unnoticed[0] + 0.25
    assert walk_on(0.3, True)[0] > walk_on(0.3, False)[0] + 0.5


@pytest.mark.slow
def test_creep_of_soft_feet_is_not_taken_for_slip() -> None:
    """By feet of 20 ms, MuJoCo's default, instead of 8, on good ground."""
    text = GO1.read_text().replace('solref="0.008', 'solref="0.02')
    feet = [f"{end}_{side}_foot" for end in ("front", "hind") for side in ("left", "right")]
    soft = robots.Robot.from_mjcf(text, feet)
    grip = []
    for told in (0.0, None):
        env = gym.make_vec(
            "fbid_gym/QuadrupedWalk-v1", num_envs=16, robot=soft, action_layer="base_acceleration",
            push_weights=(0.0, 0.0), randomisation={}, layer_options={"contact_time": told},
        )  # fmt: skip
        env.reset(seed=0)
        still = np.zeros(env.action_space.shape)
        grip.append(np.mean([env.step(still)[4]["layer_grip"] for _ in range(500)][400:]))
        env.close()
    assert 1.0 - grip[1] < 0.2 * (1.0 - grip[0])
