"""The three balancers on simulated robots: they stand, take a push, and lose momentum as told."""

from collections.abc import Callable

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.control import (
    BalanceGains,
    ContactLimits,
    Distribution,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    distribute,
    resting_target,
    torque_map_garofalo2015,
    torque_map_inverse_dynamics,
    torque_map_ott2011,
)
from fbid_gym.dynamics import MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.simulation import Simulation
from fbid_gym.runtime.rates import Rates

HZ = 500
LIMITS = ContactLimits(0.7)
MAPS = {
    "ott2011": torque_map_ott2011,
    "garofalo2015": torque_map_garofalo2015,
    "inverse_dynamics": torque_map_inverse_dynamics,
}
# kg m^2 about x, y, z: momentum per angular velocity of the base, feet and centre of mass at rest
INERTIA = {
    "biped": (0.5, 0.4, 0.4),
    "quadruped": (0.003, 0.018, 0.018),
    "humanoid": (4.7, 3.6, 0.35),
    "go1": (0.041, 0.29, 0.38),
    "g1": (1.1, 0.69, 0.4),
}
CASES = [(robot, name) for robot in robots.ROBOTS for name in MAPS]
PUSHED = [("biped", name) for name in MAPS]
PUSHED += [("humanoid", "garofalo2015"), ("quadruped", "inverse_dynamics")]


def gains_of(robot: robots.Robot, name: str) -> BalanceGains:
    """1 Hz for the centre of mass, 1.2 Hz for the base."""
    frequencies = {"linear": 1.0, "rotation": 1.2}
    inertia = np.diag(INERTIA[robot.name])
    if name == "garofalo2015":
        # The quasi-static map turns the whole robot with its moment, not the base.
        rest = np.zeros((1, robot.nv))
        terms = MuJoCoDynamics(robot).terms(robot.home_qpos[None], rest)
        inertia = np.diag(np.diag(centroidal_terms(terms, rest).inertia[0]))
    gains = BalanceGains.from_frequencies(robot.mass, inertia, **frequencies)
    return gains.on_velocity(robot.mass, inertia) if name == "ott2011" else gains


def balancer(robot: robots.Robot, name: str) -> Callable[[Simulation], Distribution]:
    """A controller of one of the three kinds, that stands above the feet."""
    support, geometry = Stance.of(robot), contact_geometry(robot)
    gains = gains_of(robot, name)
    warm: list[np.ndarray] = []

    def step(simulation: Simulation) -> Distribution:
        terms, velocity = simulation.terms(), simulation.qvel
        body, contacts = centroidal_terms(terms, velocity), reduced_contacts(geometry, terms)
        frame = support.frame(terms)
        target = resting_target(
            frame.centre + np.matvec(frame.world_from_support, support.home_com),
            frame.world_from_support @ support.home_base_rotation,
        )
        pose = {"com": terms.com, "rotation": terms.world_from_base, "mass": body.mass}
        if name == "ott2011":
            wrench = desired_wrench_ott2011(
                gains,
                target,
                com_velocity=terms.com_velocity,
                angular_velocity=np.matvec(terms.world_from_base, velocity[:, 3:6]),
                **pose,
            )
        else:
            wrench = desired_wrench_garofalo2015(gains, target, momentum=body.momentum, **pose)
        posture = 40.0 * (robot.home_qpos[7:] - simulation.qpos[:, 7:]) - 12.0 * velocity[:, 6:]
        result = distribute(
            MAPS[name](terms, body, contacts, posture),
            wrench,
            LIMITS,
            to_com=body.to_com,
            point_map=contacts.point_map,
            weight=robot.weight,
            length=support.radius,
            torque_limit=robot.torque_limit,
            warm_start=warm[-1] if warm else None,
        )
        warm[:] = [result.warm_start]
        damping = robot.joint_damping * velocity[:, 6:]
        return result._replace(torque=result.torque + damping)

    return step


def simulate(robot, name, push, seconds, watch=None):
    """Push robots from all sides for 150 ms after 0.1 s; returns the simulation at the end."""
    count = len(push)
    simulation = Simulation(robot, count, Rates(1000, HZ, 50))
    simulation.place(
        np.arange(count), np.tile(robot.home_qpos, (count, 1)), np.zeros((count, robot.nv))
    )
    step = balancer(robot, name)
    for tick in range(int(seconds * HZ)):
        simulation.push(push * (50 <= tick < 125))
        result = step(simulation)
        if watch is not None:
            watch(tick, simulation, result)
        simulation.step(np.clip(result.torque, -robot.torque_limit, robot.torque_limit))
    return simulation


def from_all_sides(force, count=4):
    angle = 2.0 * np.pi * (np.arange(count) + 0.3) / count
    return force * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


@pytest.mark.parametrize(("robot_name", "name"), CASES)
def test_they_stand(robot_name, name):
    robot = robots.load(robot_name)
    residual = []
    simulation = simulate(
        robot, name, np.zeros((1, 3)), 0.6, lambda *now: residual.append(now[2].residual[0])
    )
    np.testing.assert_allclose(simulation.qpos[0, 7:], robot.home_qpos[7:], atol=5e-3)
    np.testing.assert_allclose(simulation.qvel, 0.0, atol=5e-3)
    assert max(residual) < 0.01


@pytest.mark.parametrize(("robot_name", "name"), PUSHED)
def test_they_take_a_push_and_come_back(robot_name, name):
    robot = robots.load(robot_name)
    simulation = simulate(robot, name, from_all_sides(0.15 * robot.weight), 2.2)
    terms, support = simulation.terms(), Stance.of(robot)
    frame = support.frame(terms)
    offset = np.matvec(frame.world_from_support.mT, terms.com - frame.centre) - support.home_com
    assert (np.abs(offset) < 0.02).all()
    assert (np.abs(terms.com_velocity) < 0.05).all()
    upright = frame.world_from_support @ support.home_base_rotation
    assert (np.abs(terms.world_from_base - upright) < 0.05).all()


@pytest.mark.parametrize("robot_name", ["biped", "humanoid"])
def test_momentum_obeys_eq_38_through_inverse_dynamics(robot_name):
    """The rate is wrench + weight: what was asked for is what the simulated momentum does."""
    robot = robots.load(robot_name)
    momenta, wanted = [], []

    def watch(tick, simulation, result):
        if tick >= 125:
            velocity = simulation.qvel
            momenta.append(centroidal_terms(simulation.terms(), velocity).momentum)
            wanted.append(result.wrench_desired - robot.weight * np.eye(6)[2])

    simulate(robot, "inverse_dynamics", from_all_sides(0.05 * robot.weight, 3), 0.75, watch)
    change = np.array(momenta)[1:] - np.array(momenta)[:-1]
    expected = np.array(wanted)[:-1] / HZ
    drift = np.abs(np.cumsum(change - expected, axis=0)).max(axis=(0, 1))
    size = np.abs(np.array(momenta)).max(axis=(0, 1))
    assert (drift[:2] < 0.05 * size[:2]).all()
    assert (drift[3:5] < 0.1 * size[3:5]).all()
