"""The pendulum of [G15] figure 1: a point mass that hits the hip of a robot.

The bob is a body of the simulation beside the robot. It is let go at the lowest point of its swing,
a few millimetres from the hip, where its rope carries its weight and nothing else: it flies level,
with the energy of the fall behind it. (A rope of 2 m pulls it aside with a hundredth of its weight
during the contact.) When the two have parted it is caught, so that it hits once.

It touches nothing but a massless sphere about the centre of mass of the robot's base, so that the
blow has no moment about that point, whatever its direction. There is no friction between the two.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot

BOB = "pendulum_bob"
"""Name of the bob's body and geom."""

TARGET = "pendulum_target"
"""Name of the sphere that it hits."""

_LAYER = 1 << 20  # of contacts; nothing else is in it
_GAP = 0.005  # m, between bob and target when it is let go
_ROPE = 2.5  # m, as drawn
_STIFF = 0.99  # share of the contact's reference acceleration that MuJoCo realises
_BOB = f"""
<mujoco><worldbody><body name="bob" pos="0 0 {{below!r}}" gravcomp="1">
  <freejoint/>
  <inertial pos="0 0 0" mass="{{mass!r}}" diaginertia="{{inertia!r}} {{inertia!r}} {{inertia!r}}"/>
  <geom name="rope" type="cylinder" fromto="0 0 0 0 0 {_ROPE}" size="0.004" mass="0"
    contype="0" conaffinity="0" group="2" rgba="0.3 0.3 0.32 1"/>
  <geom name="bob" size="{{radius!r}}" contype="{_LAYER}" conaffinity="0" condim="1" priority="1"
    solref="{{spring}}" solimp="{_STIFF} {_STIFF} 0.001 0.5 2" rgba="0.75 0.2 0.12 1"/>
</body></worldbody></mujoco>"""


class PendulumBlow(NamedTuple):
    """The blow. Defaults are [G15]'s where it has a number.

    Its contact is a spring and a damper, given by what they do: how long they touch and how the bob
    bounces. [G15] says neither. The linear momentum that it measures, 14.5 kg m/s, is more than the
    13.2 kg m/s that the bob brings, so it bounced; 0.15 is the bounce that gives our humanoid this
    momentum. How long they touch hardly matters up to 50 ms.
    """

    mass: float = 5.0  # kg
    energy: float = 17.4  # J, at the impact
    radius: float = 0.05  # m, of the bob
    target_radius: float = 0.15  # m, of the sphere on the robot: half the width of the hips
    bounce: float = 0.15  # speed at which the two part over that at which they meet, 0.14 to 0.9
    contact_seconds: float = 0.02  # s from touch to parting

    @property
    def solref(self) -> tuple[float, float]:
        """Spring and damper of the contact: MuJoCo takes a negative pair per unit of mass."""
        ratio = _damping_ratio(self.bounce)
        frequency = float(_phase(ratio) / np.sqrt(1.0 - ratio**2)) / self.contact_seconds
        return -(frequency**2), -2.0 * ratio * frequency


def world_with_pendulum(robot: Robot, pendulum: PendulumBlow) -> mujoco.MjModel:
    """Return the robot's world with the bob in it.

    The robot is first in every list, so `Simulation(robot, ..., world=...)` takes it.
    """
    spec = robot.spec.copy()
    add_pendulum(spec, robot, pendulum)
    return spec.compile()


def add_pendulum(spec: mujoco.MjSpec, robot: Robot, pendulum: PendulumBlow) -> None:
    """Add target and bob to a copy of the robot's spec; the bob is parked below the ground."""
    base = next(body for body in spec.bodies if body.id == robot.base_body)
    own = {"contype": 0, "conaffinity": _LAYER, "mass": 0.0, "group": 4}
    size, centre = [pendulum.target_radius, 0, 0], robot.model.body_ipos[robot.base_body]
    base.add_geom(name=TARGET, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, pos=centre, **own)
    numbers = pendulum._asdict() | {
        "below": -10.0 * float(robot.home_qpos[2]),
        "inertia": 0.4 * pendulum.mass * pendulum.radius**2,
        "spring": "{!r} {!r}".format(*pendulum.solref),
    }
    bob = mujoco.MjSpec.from_string(_BOB.format(**numbers))
    spec.attach(bob, frame=spec.worldbody.add_frame(), prefix="pendulum_")


class Bob:
    """The bobs of N simulations."""

    def __init__(self, simulation: Simulation, pendulum: PendulumBlow) -> None:
        """Take hold of the bobs of a simulation in a `world_with_pendulum`."""
        robot, model = simulation.robot, simulation.model
        joint = model.body_jntadr[model.body(BOB).id]
        place, rate = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        self._pendulum, self._base = pendulum, robot.base_body
        self._parked = np.array(model.qpos0[place : place + 3])
        self._met = np.zeros(simulation.num_robots, bool)
        self._centre = np.array(robot.model.body_ipos[robot.base_body])
        self._xpos, self._xmat = simulation.batch.bind("xpos"), simulation.batch.bind("xmat")
        self.position = simulation.batch.bind("qpos")[:, place : place + 3]
        """(N, 3) m, world, live."""
        self.velocity = simulation.batch.bind("qvel")[:, rate : rate + 3]
        """(N, 3) m/s, world, live."""

    def target(self) -> np.ndarray:
        """Return where the bobs are to hit: (N, 3) m, world, centre of the sphere."""
        rotation = self._xmat[:, self._base].reshape(-1, 3, 3)
        return self._xpos[:, self._base] + rotation @ self._centre

    def swing(self, robots: np.ndarray, direction: np.ndarray, energy: np.ndarray) -> None:
        """Let bobs go, so that they hit within a few milliseconds.

        Args:
            robots: (K,) whose.
            direction: (K, 3) unit vectors, horizontal, world, in which they fly.
            energy: (K,) J at the impact.
        """
        pendulum = self._pendulum
        reach = pendulum.target_radius + pendulum.radius + _GAP
        self.position[robots] = self.target()[robots] - reach * direction
        speed = np.sqrt(2.0 * energy / pendulum.mass)
        self.velocity[robots] = speed[:, None] * direction
        self._met[robots] = False

    def catch(self) -> None:
        """Take away the bobs that have hit and parted. Call once a control tick."""
        away = np.linalg.norm(self.position - self.target(), axis=1)
        inside = away < self._pendulum.target_radius + self._pendulum.radius
        gone = self._met & ~inside
        self.position[gone], self.velocity[gone] = self._parked, 0.0
        self._met = inside


def _phase(ratio: np.ndarray | float) -> np.ndarray | float:
    """Damped phase, rad, at which spring and damper of a contact stop pushing."""
    root = np.sqrt(1.0 - np.square(ratio))
    return np.arctan2(2.0 * ratio * root, 2.0 * np.square(ratio) - 1.0)


def _damping_ratio(bounce: float) -> float:
    """Damping ratio of a contact that pushes only and whose bodies part at `bounce` of the speed.

    Of x'' + 2 z x' + x = 0 from x = 0, until x + 2 z x' = 0. With critical damping that is 0.135.
    """
    ratios = np.linspace(1e-3, 0.999, 2000)
    bounces = np.exp(-ratios / np.sqrt(1.0 - ratios**2) * _phase(ratios))
    return float(np.interp(-bounce, -bounces, ratios))
