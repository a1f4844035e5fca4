"""The gait of point feet, on robots that are carried over the ground by hand."""

import math

import numpy as np
import pytest

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.motions.gait.command import no_command
from fbid_gym.motions.gait.point_feet import walk
from fbid_gym.motions.gait.quadruped import PointFootGait, PointGaitMemory, quadruped_gait
from fbid_gym.motions.target import standing_target
from fbid_gym.quantities import DynamicsTerms, Target
from fbid_gym.robots import Robot, load
from fbid_gym.robots.built_in import QUADRUPED
from tests.dogs import dog
from tests.motions.conftest import heading_of, hold_foot_rates
from tests.pairs import pairs

TICK = 0.002
ROBOT = load("quadruped")
GAIT = quadruped_gait(ROBOT)
FORCE = ROBOT.weight / 4.0


def home(count: int = 1, robot: Robot = ROBOT) -> DynamicsTerms:
    """Robots that stand at home, at rest."""
    qpos = np.tile(robot.home_qpos, (count, 1))
    return MuJoCoDynamics(robot).terms(qpos, np.zeros((count, robot.nv)))


def rows(values, chosen):
    """Some robots of a tuple."""
    return type(values)(*(value[chosen].copy() for value in values))


def walked(gait, command, terms, force, memory) -> Target:
    """What robots shall do that go on by one tick; the memory is updated."""
    target = standing_target(terms, gait.home)
    walk(gait, command, terms, force, TICK, memory, target)
    return target


class Ghost:
    """Robots whose feet go where they are told and whose bodies move as commanded."""

    def __init__(
        self,
        gait: PointFootGait,
        terms: DynamicsTerms,
        floor: float = 0.0,
        slope: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.gait, self.terms, self.floor, self.slope = gait, terms, floor, np.array(slope)
        count, feet = terms.foot_position.shape[:2]
        self.memory = PointGaitMemory.standing(np.zeros(count), terms.foot_position)
        self.command = no_command(count, feet)
        self.force = np.zeros((count, feet, 3))

    def tick(self) -> Target:
        """Go on by one tick; a foot that is not above the floor carries weight."""
        feet = self.terms.foot_position
        self.force[:, :, 2] = FORCE * (feet[:, :, 2] <= self.ground(feet) + 1e-9)
        target = walked(self.gait, self.command, self.terms, self.force, self.memory)
        feet = target.foot_position.copy()
        feet[:, :, 2] = np.maximum(feet[:, :, 2], self.ground(feet))
        velocity = target.com_velocity
        step = np.append(velocity[0, :2], velocity[0, :2] @ self.slope) * TICK
        facing = quaternion_to_matrix(target.qpos[:, 3:7])
        self.terms = self.terms._replace(
            world_from_base=facing,
            world_from_trunk=facing,
            foot_position=feet,
            base_position=self.terms.base_position + step,
            com=self.terms.com + step,
            com_velocity=velocity,
        )
        return target

    def ground(self, places: np.ndarray) -> np.ndarray:
        """Height of the floor at places (..., 3)."""
        return self.floor + places[..., :2] @ self.slope


def commanded(ghost: Ghost, *velocity: float) -> Ghost:
    """The same, told to go."""
    ghost.command.velocity[:] = velocity
    return ghost


def test_a_robot_that_is_told_to_stand_stands_still():
    ghost = Ghost(GAIT, home())
    before = ghost.terms.foot_position.copy()
    for _ in range(500):
        target = ghost.tick()
        assert target.planted.all() and (target.load == 1.0).all()
        assert not target.com_velocity.any() and not target.com_acceleration.any()
    assert np.abs(ghost.terms.foot_position - before).max() < 1e-12
    assert not ghost.memory.walking.any() and target.cycle == 0.0


def test_a_robot_that_is_pushed_far_enough_steps_though_told_to_stand():
    for share, steps in ((0.8, False), (1.2, True)):
        terms = home()
        middle = terms.foot_position[0, :, :2].mean(axis=0)
        away = share * GAIT.margin - math.hypot(*(terms.com[0, :2] - middle))
        velocity = np.array([[0.0, away * GAIT.omega, 0.0]])
        ghost = Ghost(GAIT, terms._replace(com_velocity=velocity))
        ghost.tick()
        assert ghost.memory.walking[0] == steps


def test_the_base_is_lowered_and_raised_at_a_limited_rate():
    ghost = Ghost(GAIT, home())
    upright = ghost.tick().qpos[0, 2]
    for asked in (0.05, 0.0):
        ghost.command.lowered[:] = asked
        heights = [ghost.tick().qpos[0, 2] for _ in range(round(0.05 / GAIT.bend / TICK) + 1)]
        assert heights[-1] == pytest.approx(upright - asked, abs=1e-12)
        assert np.abs(np.diff(heights)).max() == pytest.approx(GAIT.bend * TICK, rel=1e-6)


def test_starting_walking_and_stopping_are_without_jumps():
    ghost = commanded(Ghost(GAIT, home()), 0.2, 0.05, 0.3)
    last = ghost.tick()
    walked = False
    for tick in range(3000):
        if tick == 2000:
            commanded(ghost, 0.0, 0.0, 0.0)
        before = ghost.terms.foot_position.copy()
        target = ghost.tick()
        lifted = last.planted & ~target.planted
        # A foot lifts, and lands, without load and from where it is.
        assert (last.load[lifted] <= 1.1 * TICK / GAIT.unload).all()
        assert np.abs(target.foot_position - before).max() < 2.0 * TICK
        change = np.abs(target.load - last.load)[last.planted & target.planted]
        assert (change <= 1.001 * TICK / GAIT.unload).all()
        # The velocity that is followed changes at a limited rate, which is not in the target, and
        # turns with the heading, which is.
        rate = (target.com_velocity - last.com_velocity)[0, :2] / TICK
        assert np.hypot(*rate) < 1.01 * np.hypot(*GAIT.agility[:2])
        x, y, _ = target.qvel[0, 5] * target.com_velocity[0]
        np.testing.assert_allclose(target.com_acceleration[0], [-y, x, 0.0], atol=1e-12)
        walked |= bool(lifted.any())
        last = target
    # The ghost has come to rest with its feet below it.
    assert walked and not ghost.memory.walking.any()
    assert last.planted.all() and (last.load == 1.0).all()
    place = ghost.terms.foot_position[0, :, :2] - ghost.terms.base_position[0, :2]
    apart = (np.linalg.norm(way, axis=1) for way in (place, GAIT.place))
    np.testing.assert_allclose(*apart, rtol=0, atol=GAIT.astray)


def test_feet_land_where_they_were_told_and_stand_as_long_as_planned():
    ghost = commanded(Ghost(GAIT, home()), 0.3, 0.0, 0.0)
    landed, stood, last = 0, 0, ghost.tick()
    for tick in range(3000):
        target = ghost.tick()
        new = target.planted & ~last.planted
        if tick > 1000:
            feet = ghost.terms.foot_position[new]
            assert np.abs(feet - last.foothold[new]).max(initial=0.0) < 1e-3
            landed, stood = landed + new.sum(), stood + target.planted.mean()
        last = target
    cycles = 1999 * TICK / GAIT.schedule.period
    assert landed == pytest.approx(4 * cycles, abs=4)
    # It meets the ground a little before its swing is over: the last way is slow.
    assert stood / 1999 == pytest.approx(GAIT.schedule.duty, abs=0.05)
    # Where it passes over them, at the commanded speed, the feet are below their hips.
    assert np.abs(last.com_velocity[0] - [0.3, 0.0, 0.0]).max() < 1e-9


def test_a_swinging_foot_has_the_rates_of_its_way():
    ghost = commanded(Ghost(GAIT, home()), 0.3, 0.0, 0.0)
    rows = [ghost.tick() for _ in range(2000)][1000:]
    hold_foot_rates(rows, TICK, 0.02)  # the foothold moves on with the robot


def test_a_foot_that_finds_no_ground_reaches_down_and_then_stands():
    ghost = commanded(Ghost(GAIT, home()), 0.1, 0.0, 0.0)
    ghost.tick()
    ghost.floor = -0.02
    ghost.force[:] = 0.0
    reached, lowest = False, 0.0
    for _ in range(int(GAIT.schedule.period / TICK)):
        target = ghost.tick()
        low = target.foot_position[:, :, 2].min()
        reached |= bool((target.foot_velocity[:, :, 2] < 0.0).any() and low < -1e-3)
        lowest = min(lowest, low)
        if ghost.terms.foot_position[0, 0, 2] <= ghost.floor:
            break
    assert reached and lowest <= ghost.floor
    # While it reaches, the base comes down with it.
    assert target.qpos[0, 2] < GAIT.height + 0.25 * ghost.floor * 0.9
    assert ghost.tick().planted[0, 0]


def test_footholds_are_clipped_within_reach_and_lie_on_the_ground_that_is_known() -> None:
    ghost = commanded(Ghost(GAIT, home()), 0.1, 0.0, 0.0)
    while not (ghost.memory.mode == 1).any():
        ghost.tick()
    swinging = ghost.memory.mode == 1

    def target(**changes):
        command = ghost.command._replace(**changes)
        memory = rows(ghost.memory, slice(None))
        return walked(GAIT, command, ghost.terms, ghost.force, memory)

    near, far = target(), target(shift=np.full((1, 4, 2), 1.0))
    assert not near.clipped.any() and (far.clipped == swinging).all()
    assert np.abs(far.foothold - near.foothold)[swinging].max() > 0.02
    hip = ghost.terms.base_position + GAIT.hip
    distance = np.linalg.norm(far.foothold[0] - hip, axis=1)[swinging[0]]
    # The hips go on until the foot lands.
    assert (distance < GAIT.reach[swinging[0]] + 0.1 * GAIT.schedule.period).all()
    one, other, *_ = np.flatnonzero(ghost.memory.mode[0])
    ground = np.full((1, 4), np.nan)
    ground[0, one] = 0.03
    raised = target(ground=ground)
    assert raised.foothold[0, one, 2] == 0.03
    assert raised.foothold[0, other, 2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("velocity", "slope"),
    pairs([[0.2, 0.0, 0.0], [-0.1, 0.1, 0.0], [0.1, -0.05, 0.3]], [[0.25, 0.0], [-0.2, 0.15]], 1),
)
def test_feet_aim_at_the_plane_on_which_they_stood(slope, velocity):
    terms, steep = home(), np.linalg.norm(slope)
    feet = terms.foot_position.copy()
    feet[:, :, 2] += feet[:, :, :2] @ slope
    ghost = commanded(Ghost(GAIT, terms._replace(foot_position=feet), 0.0, slope), *velocity)
    for _ in range(round(6.0 * GAIT.schedule.period / TICK)):
        ghost.tick()
    for _ in range(round(GAIT.schedule.period / TICK)):
        target = ghost.tick()
        # 5 % short of the slope at most, for what draws it to level.
        reach = np.abs(GAIT.place).max() + 0.5 * GAIT.schedule.period * np.abs(velocity[:2]).max()
        aimed = target.foothold[~target.planted]
        assert np.abs(aimed[:, 2] - ghost.ground(aimed)).max(initial=0.0) < 0.05 * steep * reach
        above = target.qpos[0, 2] - ghost.ground(ghost.terms.base_position)
        assert above == pytest.approx(GAIT.height, abs=0.05 * steep * reach)


def test_level_ground_is_level_exactly():
    terms = home()
    terms.foot_position[:, :, 2] = 0.0
    ghost = commanded(Ghost(GAIT, terms), 0.2, 0.1, 0.3)
    for _ in range(800):
        target = ghost.tick()
        assert (target.foothold[:, :, 2] <= 1e-12).all()
        assert np.abs(target.foothold[ghost.memory.mode == 1][:, 2]).max(initial=0.0) < 1e-12
        assert target.qpos[0, 2] == pytest.approx(GAIT.height, abs=1e-12)


def test_feet_land_around_the_point_below_the_centre_of_mass():
    level = GAIT.place + home().base_position[0, :2]
    np.testing.assert_array_equal(level, home().foot_position[0, :, :2])  # where it is their middle
    spec = ROBOT.spec.copy()
    (trunk,) = (body for body in spec.bodies if body.name == ROBOT.model.body(ROBOT.base_body).name)
    trunk.ipos = trunk.ipos + [0.03, -0.01, 0.0]
    robot = Robot.from_mjcf(spec, QUADRUPED.feet, name="nose-heavy", home=QUADRUPED.home)
    gait, terms = quadruped_gait(robot), home(robot=robot)
    below = terms.com[0, :2] - terms.base_position[0, :2]
    assert below[0] > 0.01
    np.testing.assert_allclose(gait.place.mean(axis=0), below, atol=1e-9)
    np.testing.assert_allclose(gait.place - below, GAIT.place, atol=1e-9)
    ghost, landed = commanded(Ghost(gait, terms), 0.0, 0.0, 0.01), []
    for _ in range(round(4.0 * gait.schedule.period / TICK)):
        landed.append(ghost.tick().foot_position.mean(axis=(0, 1))[:2])
    # Over whole cycles, and whichever way it went.
    assert np.abs(landed[-1] - ghost.terms.com[0, :2]).max() < 0.002


def test_which_way_the_world_lies_does_not_matter():
    """Nor where the robot is in it; on a slope, which turns with it."""
    angle, moved, slope = 1.1, np.array([0.7, -2.0, 0.0]), np.array([0.1, -0.05])
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    terms = home()
    terms.foot_position[:, :, 2] += terms.foot_position[:, :, :2] @ slope
    steep = turn[:2, :2] @ slope
    up = np.array([0.0, 0.0, moved[:2] @ steep])  # the slope goes through the origin there, too
    turned = terms._replace(
        base_position=terms.base_position @ turn.T + moved + up,
        world_from_base=turn @ terms.world_from_base,
        world_from_trunk=turn @ terms.world_from_trunk,
        com=terms.com @ turn.T + moved + up,
        foot_position=terms.foot_position @ turn.T + moved + up,
    )
    here, there = Ghost(GAIT, terms, 0.0, slope), Ghost(GAIT, turned, 0.0, steep)
    there.memory = PointGaitMemory.standing(np.full(1, angle), turned.foot_position)
    for ghost in (here, there):
        commanded(ghost, 0.2, -0.1, 0.3)
    for _ in range(round(3.0 * GAIT.schedule.period / TICK)):
        one, other = here.tick(), there.tick()
        assert (one.planted == other.planted).all()
        assert heading_of(other) - heading_of(one) == pytest.approx([angle])
        for name in ("foot_position", "foothold", "com"):
            expected = getattr(one, name) @ turn.T + moved + up
            assert getattr(other, name) == pytest.approx(expected, abs=1e-8), name
        for name in ("foot_velocity", "foot_acceleration", "com_velocity", "com_acceleration"):
            expected = getattr(one, name)[..., :3] @ turn.T
            assert getattr(other, name)[..., :3] == pytest.approx(expected, abs=1e-6), name
        assert other.qvel[:, 3:] == pytest.approx(one.qvel[:, 3:])
        for name in ("load", "cycle"):
            assert getattr(other, name) == pytest.approx(getattr(one, name))


def test_a_robot_of_another_size_walks_alike_in_its_own_time():
    small, large, scale = quadruped_gait(dog(1.0)), quadruped_gait(dog(4.0)), 4.0
    time, speed = math.sqrt(scale), math.sqrt(scale)
    for name in ("astray", "margin", "height", "lift", "place", "hip", "reach"):
        assert getattr(large, name) == pytest.approx(scale * getattr(small, name), rel=1e-6)
    assert large.omega == pytest.approx(small.omega / time, rel=1e-6)
    for name in ("rest", "sink"):
        assert getattr(large, name) == pytest.approx(getattr(small, name) * speed, rel=1e-6)
    assert large.unload == pytest.approx(small.unload * time, rel=1e-6)
    assert large.touch == pytest.approx(small.touch * scale**3, rel=1e-6)
    assert large.agility == pytest.approx(small.agility / [1.0, 1.0, scale], rel=1e-6)
