"""The gait on the pendulum that it thinks it walks: a point mass over feet that go where told."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fbid_gym import robots
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.biped import PATTERNS, STAND, FlatFootGait, FlatGaitMemory, biped_gait
from fbid_gym.motions.gait.command import no_command
from fbid_gym.motions.gait.flat_feet import walk
from fbid_gym.motions.target import standing_target
from fbid_gym.quantities import DynamicsTerms, Target
from tests.motions.conftest import heading_of, hold_foot_rates
from tests.pairs import pairs

TICK = 0.004


def turned(angle: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rotations about the vertical."""
    return Rotation.from_euler("z", angle[:, None]).as_matrix()


@dataclass
class Pendulums:
    """N pendulums that walk."""

    gait: FlatFootGait
    heading: np.ndarray
    tick: float = TICK
    slope: tuple[float, float] = (0.0, 0.0)
    com: np.ndarray = field(init=False)
    velocity: np.ndarray = field(init=False)
    feet: np.ndarray = field(init=False)
    rotation: np.ndarray = field(init=False)
    body: np.ndarray = field(init=False)
    memory: FlatGaitMemory = field(init=False)
    target: Target = field(init=False)
    offset: np.ndarray = field(init=False)  # from the centre of mass to where it shall be

    def __post_init__(self) -> None:
        count, upright = len(self.heading), turned(self.heading)
        beside = np.zeros((2, 3))
        beside[:, 1] = 0.5 * self.gait.width * self.gait.left
        self.com, self.velocity = np.zeros((count, 3)), np.zeros((count, 3))
        self.feet = np.matvec(upright[:, None], beside)
        self.feet[..., 2] = self.floor(self.feet)
        self.rotation = upright[:, None] @ self.gait.level
        self.body = self.heading.copy()
        self.memory = FlatGaitMemory.standing(self.heading, self.feet)
        self.target = standing_target(self.terms, self.gait.home)

    @property
    def terms(self) -> DynamicsTerms:
        """Of a point mass with feet."""
        count = len(self.com)
        zero = np.zeros((count, 0))
        return DynamicsTerms(
            mass_matrix=zero[None],
            bias=zero,
            base_position=self.com,
            world_from_base=turned(self.body),
            world_from_trunk=turned(self.body),
            com=self.com,
            com_velocity=self.velocity,
            foot_position=self.feet,
            world_from_foot=self.rotation,
            foot_velocity=np.zeros((count, 2, 6)),
            foot_jacobian=np.zeros((count, 2, 6, 0)),
            foot_bias=np.zeros((count, 2, 6)),
        )

    def step(
        self,
        velocity: np.ndarray,
        shift: np.ndarray | None = None,
        rate: np.ndarray | None = None,
        ground: np.ndarray | None = None,
    ) -> Target:
        """Go on by a tick with commanded velocities (N, 3)."""
        count = len(self.com)
        force = np.zeros((count, len(self.gait.points), 3))
        touches = (self.feet[..., 2] <= self.floor(self.feet) + 1e-12)[:, self.gait.foot_of_point]
        force[..., 2] = np.where(touches, 2.0 * self.gait.load, 0.0)
        command = no_command(count, 2)
        command.velocity[:] = velocity
        if shift is not None:
            command.shift[:] = shift[:, None]
        if rate is not None:
            command.rate[:] = rate
        if ground is not None:
            command.ground[:] = ground[:, None]
        walk(self.gait, command, self.terms, force, self.tick, self.memory, self.target)
        target = Target(*(value.copy() for value in self.target))
        self.offset = target.com[:, :2] - self.com[:, :2]
        omega = self.gait.omega
        cosine, sine = np.cosh(omega * self.tick), np.sinh(omega * self.tick)
        pressure = self.memory.pressure
        away = self.com[:, :2] - pressure
        com = pressure + away * cosine + self.velocity[:, :2] / omega * sine
        self.velocity[:, :2] = away * omega * sine + self.velocity[:, :2] * cosine
        self.com[:, :2] = com
        self.feet, self.rotation = target.foot_position.copy(), target.world_from_foot.copy()
        self.feet[..., 2] = np.maximum(self.feet[..., 2], self.floor(self.feet))
        self.body = heading_of(target)
        return target

    def floor(self, places: np.ndarray) -> np.ndarray:
        """Height of the ground at places (..., 3)."""
        return places[..., :2] @ np.array(self.slope)

    def ahead(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (N, 2) along the bodies' headings."""
        return np.vecmat(vectors, turned(self.body)[:, :2, :2])


@pytest.fixture(params=pairs(PATTERNS, ["biped", "humanoid"], 1), ids="-".join)
def gait(request):
    name, robot = request.param
    return biped_gait(robots.load(robot), name)


def commands(gait: FlatFootGait, count: int, seed: int = 0) -> np.ndarray:
    """(count, 3) velocities, in the gait's own units: widths of the feet per pendulum time."""
    rng = np.random.default_rng(seed)
    unit = gait.width * gait.omega
    return rng.uniform(-1.0, 1.0, (count, 3)) * [0.5 * unit, 0.2 * unit, 0.1 * gait.omega]


def ticks(gait: FlatFootGait, steps: int, tick: float = TICK) -> int:
    return round(steps * (gait.single + gait.double) / tick)


def test_it_walks_and_turns_as_commanded(gait):
    straight, count = commands(gait, 12), ticks(gait, 20)
    straight[:, 2] = 0.0
    walkers, total = Pendulums(gait, np.linspace(-3.0, 3.0, 12)), np.zeros((12, 2))
    for tick in range(ticks(gait, 12) + count):
        walkers.step(straight)
        total += walkers.ahead(walkers.velocity[:, :2]) * (tick >= ticks(gait, 12))
    np.testing.assert_allclose(total / count, straight[:, :2], atol=0.03 * gait.width * gait.omega)
    velocity, walkers, count = commands(gait, 6), Pendulums(gait, np.zeros(6)), ticks(gait, 10)
    for _ in range(count):
        target = walkers.step(velocity)
    # Short of what the rate takes to come.
    ramp = 0.5 * velocity[:, 2] ** 2 / gait.agility[2]
    turn = velocity[:, 2] * count * TICK - np.sign(velocity[:, 2]) * ramp
    most = np.abs(velocity[:, 2]).max()
    np.testing.assert_allclose(heading_of(target), turn, atol=most * TICK)
    feet = np.arctan2(walkers.rotation[:, :, 1, 0], walkers.rotation[:, :, 0, 0])
    assert np.abs(feet - turn[:, None]).max() < 2.0 * most


def test_centre_of_pressure_stays_in_the_soles(gait):
    velocity = commands(gait, 16, seed=1)
    walkers = Pendulums(gait, np.linspace(-3.0, 3.0, 16))
    walkers.velocity[:, :2] = 0.1 * gait.width * gait.omega
    for tick in range(ticks(gait, 8)):
        feet, rotation = walkers.feet.copy(), walkers.rotation.copy()
        target = walkers.step(velocity if tick > 30 else 0.0 * velocity)
        for i in range(16):
            stands = target.planted[i]
            frame = rotation[i] @ gait.level.mT
            corners = np.concatenate(
                [
                    feet[i, f, :2] + gait.points[gait.foot_of_point == f] @ frame[f, :2, :2].T
                    for f in range(2)
                    if stands[f]
                ]
            )
            # Every direction in which the centre of pressure is farther out than all corners
            # would show that it has left the hull.
            angles = np.linspace(0.0, 2.0 * np.pi, 90)
            out = np.stack([np.cos(angles), np.sin(angles)])
            assert (walkers.memory.pressure[i] @ out <= (corners @ out).max(axis=0) + 1e-9).all()


def test_centre_of_pressure_does_not_jump_but_for_new_feet(gait):
    velocity = commands(gait, 8, seed=2)
    walkers = Pendulums(gait, np.zeros(8))
    walkers.step(0.0 * velocity)
    last, fastest = walkers.memory.pressure.copy(), 0.0
    for tick in range(ticks(gait, 16)):
        moving = ticks(gait, 2) < tick < ticks(gait, 10)
        walkers.step(velocity if moving else 0.0 * velocity)
        pressure = walkers.memory.pressure.copy()
        fastest = max(fastest, np.linalg.norm(pressure - last, axis=1).max())
        last = pressure
    # A whole stride in a tenth of the double support would be ten times as much as it takes.
    assert fastest < 5.0 * gait.width * TICK / gait.double


def test_a_foot_does_not_jump_when_the_command_does(gait):
    velocity = commands(gait, 8, seed=5)
    fastest = []
    for flips in (False, True):
        walkers, most = Pendulums(gait, np.zeros(8)), 0.0
        for tick in range(ticks(gait, 16)):
            before, turned_before = walkers.feet.copy(), walkers.rotation.copy()
            # In every third step, at any share of it.
            sign = -1.0 if flips and tick * TICK / (gait.single + gait.double) % 3.1 > 1.55 else 1.0
            walkers.step(sign * velocity)
            if tick > ticks(gait, 3):
                way = np.linalg.norm((walkers.feet - before)[..., :2], axis=-1).max()
                most = np.maximum(most, [way, np.abs(walkers.rotation - turned_before).max()])
        fastest.append(most)
    assert (fastest[1] < 2.0 * fastest[0]).all()


def test_a_swinging_foot_has_the_rates_of_its_way(gait):
    walkers = Pendulums(gait, np.zeros(1))
    velocity = np.array([0.2 * gait.width * gait.omega, 0.0, 0.0])
    rows = [walkers.step(velocity) for _ in range(ticks(gait, 12))][ticks(gait, 6) :]
    for row in rows:  # a foot is damped towards this share of the rate of its level way
        row.foot_velocity[..., :2] /= gait.trail
    hold_foot_rates(rows, TICK, 0.03)  # the foothold moves as the error of xi does


def test_setting_out_is_without_jumps(gait):
    aside = np.array([0.4 * gait.sole[0], 0.1 * gait.width])
    for stands in (20, ticks(gait, 3)):
        walkers = Pendulums(gait, np.zeros(1))
        for _ in range(stands):
            walkers.com[0, :2], walkers.velocity[:] = aside, 0.0
            walkers.step(np.zeros(3))
        pressure, offset = walkers.memory.pressure.copy(), walkers.offset
        np.testing.assert_allclose(walkers.offset[0], -aside, atol=1e-9)
        walkers.com[0, :2], walkers.velocity[:] = aside, 0.0
        for _ in range(round(gait.settle / TICK) + 1):
            walkers.step(np.array([0.1 * gait.width * gait.omega, 0.0, 0.0]))
            moved = np.linalg.norm(walkers.memory.pressure - pressure)
            assert moved < 5.0 * gait.width * TICK / gait.settle
            faded = np.linalg.norm(walkers.offset - offset)
            assert faded < 5.0 * gait.width * TICK / gait.settle
            offset, pressure = walkers.offset, walkers.memory.pressure.copy()
        assert not offset.any()


def test_it_stops_and_stands(gait):
    velocity = commands(gait, 8, seed=3)
    walkers = Pendulums(gait, np.zeros(8))
    for tick in range(ticks(gait, 24)):
        target = walkers.step(velocity if tick < ticks(gait, 10) else 0.0 * velocity)
    assert (walkers.memory.phase == STAND).all()
    assert target.planted.all()
    assert (target.cycle == 0.0).all()
    np.testing.assert_allclose(walkers.velocity, 0.0, atol=0.01 * gait.width * gait.omega)


def test_it_steps_to_catch_a_fall(gait):
    walkers = Pendulums(gait, np.zeros(16))
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    # Where it falls to is beyond the soles: standing cannot hold it.
    far = gait.omega * np.array([1.3 * gait.sole[0] / 0.8, 0.6 * gait.width])
    walkers.velocity[:, :2] = far * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    stepped = np.zeros(16, bool)
    for _ in range(ticks(gait, 14)):
        stepped |= walkers.step(np.zeros(3)).planted.sum(axis=1) == 1
    assert stepped[np.abs(np.cos(angle)) > 0.9].all()
    np.testing.assert_allclose(walkers.velocity, 0.0, atol=0.01 * gait.width * gait.omega)


def test_feet_neither_cross_nor_overreach(gait):
    walkers = Pendulums(gait, np.zeros(32))
    rng = np.random.default_rng(4)
    walkers.velocity[:, :2] = rng.normal(size=(32, 2)) * gait.omega * gait.width
    clipped = False
    for _ in range(ticks(gait, 4)):
        target = walkers.step(np.array([0.1, 0.0, 0.0]))
        carrier, every = walkers.memory.carrier, np.arange(32)
        way = target.foothold[every, 1 - carrier, :2] - walkers.feet[every, carrier, :2]
        way = np.vecmat(way, turned(heading_of(target))[:, :2, :2])[~target.planted.all(axis=1)]
        side = -gait.left[carrier][~target.planted.all(axis=1)]
        assert (np.abs(way[:, 0]) <= gait.longest + 1e-9).all()
        assert (side * way[:, 1] >= gait.least_apart - 1e-9).all()
        assert (side * way[:, 1] <= gait.most_apart + 1e-9).all()
        clipped |= target.clipped.any()
    assert clipped


def test_heading_does_not_matter(gait):
    velocity, angle = commands(gait, 5), 1.9
    here, there = Pendulums(gait, np.zeros(5)), Pendulums(gait, np.full(5, angle))
    rotation = turned(np.array([angle]))[0]
    for _ in range(ticks(gait, 5)):
        a, b = here.step(velocity), there.step(velocity)
    pressure = here.memory.pressure @ rotation[:2, :2].T
    np.testing.assert_allclose(pressure, there.memory.pressure, atol=1e-8)
    np.testing.assert_allclose(a.foot_position @ rotation.T, b.foot_position, atol=1e-8)
    np.testing.assert_allclose(rotation @ a.world_from_foot, b.world_from_foot, atol=1e-8)
    np.testing.assert_allclose(a.cycle, b.cycle, atol=1e-12)


def test_velocities_are_gathered_at_the_agility_and_end_at_the_top(gait):
    walkers, before = Pendulums(gait, np.zeros(2)), np.zeros(2)
    velocity = 2.0 * gait.top * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    for _ in range(ticks(gait, 20)):
        walkers.step(velocity)
        change, before = walkers.memory.velocity[:, 0] - before, walkers.memory.velocity[:, 0] * 1.0
        assert (np.abs(change) <= gait.agility[0] * TICK * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(before, [gait.top, -gait.top])


def test_a_robot_four_times_as_long_walks_half_as_fast(gait):
    apart = ("least_apart", "most_apart")
    lengths = ("height", "crouch", "width", *apart, "longest", "lift", "roll")
    lengths += ("sole", "points")
    times = ("single", "double", "settle", "top", "start")  # velocities grow as times do
    large = gait._replace(
        sense=gait.sense._replace(time=2.0 * gait.sense.time, level=16.0 * gait.sense.level),
        omega=gait.omega / 2.0,
        agility=gait.agility * [1.0, 1.0, 0.25],
        sink=2.0 * gait.sink,
        **{name: 4.0 * getattr(gait, name) for name in lengths},
        **{name: 2.0 * getattr(gait, name) for name in times},
    )
    velocity = commands(gait, 5)
    small, tall = Pendulums(gait, np.zeros(5)), Pendulums(large, np.zeros(5), tick=2.0 * TICK)
    for _ in range(ticks(gait, 5)):
        a, b = small.step(velocity), tall.step(velocity * [2.0, 2.0, 0.5])
    np.testing.assert_allclose(4.0 * small.memory.pressure, tall.memory.pressure, atol=1e-8)
    np.testing.assert_allclose(4.0 * a.foothold, b.foothold, atol=1e-8)
    np.testing.assert_allclose(a.com_acceleration, b.com_acceleration, atol=1e-7)


def test_steps_come_as_often_and_land_where_they_are_asked_to(gait):
    rate, velocity = np.array([0.8, 1.0, 1.25]), np.array([0.2 * gait.width * gait.omega, 0.0, 0.0])
    walkers = Pendulums(gait, np.zeros(3))
    landed, before = np.zeros(3), walkers.memory.carrier.copy()
    count = ticks(gait, 40)
    for _ in range(count):
        walkers.step(velocity, rate=rate)
        landed += walkers.memory.carrier != before
        before = walkers.memory.carrier.copy()
    period = (gait.single + gait.double) / rate
    np.testing.assert_allclose(landed, count * TICK / period, rtol=0.08)

    walkers, step = Pendulums(gait, np.zeros(3)), 0.3 * gait.lift
    shift = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.05]]) * gait.width
    while (target := walkers.step(velocity, shift=shift)).planted.all():
        pass
    foot = 1 - walkers.memory.carrier[0]
    moved = target.foothold[:, foot, :2] - target.foothold[0, foot, :2]
    np.testing.assert_allclose(moved, shift, atol=1e-9)
    ground, highest = np.array([np.nan, np.nan, step]), np.zeros(3)
    for _ in range(round(0.9 * gait.single / TICK)):
        target = walkers.step(velocity, shift=shift, ground=ground)
        highest = np.maximum(highest, target.foot_position[:, :, 2].max(axis=1))
    np.testing.assert_allclose(target.foothold[:, foot, 2], [0.0, 0.0, step], atol=1e-12)
    np.testing.assert_allclose(highest - [0.0, 0.0, step], gait.lift, rtol=0.02)


def test_feet_aim_at_the_plane_on_which_they_stood(gait):
    slope = np.array([0.06, -0.03])
    heading = np.linspace(-3.0, 3.0, 6)
    level = Pendulums(gait, heading)
    walkers = Pendulums(gait, heading, slope=(slope[0], slope[1]))
    velocity = np.array([0.5 * gait.width * gait.omega, 0.0, 0.0])
    for _ in range(ticks(gait, 12)):
        walkers.step(velocity)
        level.step(velocity)
    for _ in range(ticks(gait, 2)):
        target, flat = walkers.step(velocity), level.step(velocity)
        # 10 % short of the slope at most, for what draws it to level.
        near = 0.1 * np.linalg.norm(slope) * gait.longest
        np.testing.assert_allclose(
            target.foothold[..., 2], walkers.floor(target.foothold), atol=near
        )
        np.testing.assert_allclose(
            target.qpos[:, 2], walkers.floor(walkers.com) + gait.height, atol=near
        )
        # A foot that is late tells of the ground where it then is: less than a tick above it.
        late = gait.sink * TICK
        np.testing.assert_allclose(flat.foothold[..., 2], 0.0, atol=late)
        np.testing.assert_allclose(flat.qpos[:, 2], gait.height, atol=late)


def test_robots_that_cannot_walk_on_two_flat_feet_are_refused():
    with pytest.raises(RobotError, match="'quadruped' has 4 feet. Expected two flat feet"):
        biped_gait(robots.load("quadruped"))
    biped = robots.load("biped")
    for corners in (("toe_in",), ("toe_in", "heel_in")):
        feet = {side: [f"{side}_{corner}" for corner in corners] for side in ("left", "right")}
        robot = robots.Robot.from_mjcf(biped.spec.copy(), feet, name="edge", home=biped.home_qpos)
        with pytest.raises(RobotError, match="foot 'left' of 'edge' span no area. Expected two"):
            biped_gait(robot)


def test_soles_that_are_not_the_same_on_all_sides_are_as_far_apart_as_at_home(tmp_path):
    """TALOS's public file has such soles: the mean of its points is not the middle of a sole."""
    text = robots.load("biped").spec.to_xml()
    for side, y in (("left", -0.03), ("right", 0.03)):
        heel = f'<geom name="{side}_heel_out"'
        assert text.count(heel) == 1
        text = text.replace(heel, f'<geom class="sole" pos="-0.11 {y} -0.053"/>{heel}')
    (file := tmp_path / "biped.xml").write_text(text)
    robot = robots.Robot.load(file)
    gait, points = biped_gait(robot), robot.points_at_home
    right, left = (points[gait.foot_of_point == foot, 1] for foot in np.argsort(gait.left))
    gap = left.min() - right.max() - gait.longest / 60
    np.testing.assert_allclose(gait.width - gait.least_apart, gap, atol=1e-9)
    for foot in range(2):  # the centre of pressure stays on the sole
        its = gait.points[gait.foot_of_point == foot]
        assert (gait.sole <= np.minimum(its.max(axis=0), -its.min(axis=0)) + 1e-9).all()
