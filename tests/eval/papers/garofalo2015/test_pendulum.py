"""The bob of [G15] figure 1: energy, momentum, bounce, and what it touches."""

import numpy as np
import pytest

from eval.papers.garofalo2015.pendulum import Bob, PendulumBlow, world_with_pendulum
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import load
from fbid_gym.runtime.rates import Rates

RATES = Rates(1000, 1000)
ENERGY = 17.4  # [G15] V


def scene(name, pendulum, count=1, height=0.0):
    """Robots at home, or `height` m above it, with a bob each."""
    robot = load(name)
    simulation = Simulation(robot, count, RATES, world=world_with_pendulum(robot, pendulum))
    still = np.zeros((count, robot.nv))
    simulation.place(np.arange(count), np.tile(robot.home_qpos, (count, 1)), still)
    simulation.qpos[:, 2] += height
    simulation.batch.forward()
    return simulation, Bob(simulation, pendulum)


def momentum_of(simulation):
    """(N, 3) kg m/s of the robots."""
    return simulation.robot.mass * simulation.terms().com_velocity


def speed_of(pendulum):
    """At the impact, m/s."""
    return np.sqrt(2.0 * pendulum.energy / pendulum.mass)


def energy_of(bob, pendulum):
    """(N,) J of the bobs."""
    return 0.5 * pendulum.mass * np.vecdot(bob.velocity, bob.velocity)


def test_defaults_are_the_papers():
    assert PendulumBlow().mass == 5.0 and PendulumBlow().energy == ENERGY
    assert speed_of(PendulumBlow()) == pytest.approx(np.sqrt(2 * 9.81 * 0.3547), rel=1e-3)  # 35 cm


@pytest.mark.parametrize("name", ["humanoid", "biped", "quadruped"])
def test_energy_at_the_impact_and_momentum_exchanged(name):
    """From eight sides, in the air: what one loses the other gets, to the integrator's error."""
    robot = load(name)
    scale = robot.mass / load("humanoid").mass
    reach = 0.15 if name != "quadruped" else 0.05
    pendulum = PendulumBlow(mass=5.0 * scale, energy=ENERGY * scale, target_radius=reach)
    simulation, bob = scene(name, pendulum, 8, height=0.5)
    angle = 2 * np.pi * np.arange(8) / 8
    direction = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    energy = np.full(8, pendulum.energy)
    bob.swing(np.arange(8), direction, energy)
    start, before, met = pendulum.mass * bob.velocity, energy_of(bob, pendulum), False
    for _ in range(60):
        simulation.step(np.zeros((8, robot.num_joints)))
        if not met:
            np.testing.assert_allclose(before, pendulum.energy, rtol=1e-9)
        before = energy_of(bob, pendulum)
        met |= (np.linalg.norm(bob.position - bob.target(), axis=1) < reach + pendulum.radius).any()
    assert met
    gained, lost = momentum_of(simulation), start - pendulum.mass * bob.velocity
    whole = pendulum.mass * speed_of(pendulum)
    np.testing.assert_allclose(gained[:, :2], lost[:, :2], atol=5e-3 * whole)
    along = np.vecdot(lost, direction) / whole
    assert (along > 0.6).all() and (along < 2.0).all()
    assert (energy_of(bob, pendulum) < pendulum.energy).all()
    np.testing.assert_allclose(bob.velocity[:, 2], 0.0, atol=0.05 * speed_of(pendulum))


@pytest.mark.parametrize("bounce", [0.2, 0.5, 0.8])
def test_the_bounce_and_the_duration_are_those_asked_for(bounce):
    """Speed at parting over speed at meeting, of the two bodies' points of contact."""
    pendulum = PendulumBlow(bounce=bounce, contact_seconds=0.03)
    simulation, bob = scene("humanoid", pendulum, height=0.5)
    side = np.array([[0.0, 1.0, 0.0]])
    bob.swing(np.arange(1), side, np.array([ENERGY]))
    rate, distance = [], []
    for _ in range(60):
        away = np.linalg.norm(bob.position - bob.target())
        distance.append(away)
        simulation.step(np.zeros((1, simulation.robot.num_joints)))
        rate.append((np.linalg.norm(bob.position - bob.target()) - away) * 1e3)
    closest = pendulum.target_radius + pendulum.radius
    inside = np.flatnonzero(np.array(distance) < closest)
    last = rate[inside[-1] + 2]
    assert last == pytest.approx(bounce * speed_of(pendulum), rel=0.1)
    # The spring-damper stops pushing a little before the surfaces part.
    assert 0.03 < 1e-3 * len(inside) < 0.06


def test_the_robot_in_stance_is_pushed_to_the_side_once():
    pendulum = PendulumBlow()
    simulation, bob = scene("humanoid", pendulum)
    robot = simulation.robot
    bob.swing(np.arange(1), np.array([[0.0, 1.0, 0.0]]), np.array([ENERGY]))
    peak = 0.0
    for _ in range(150):
        error = robot.home_qpos[7:] - simulation.qpos[:, 7:]
        torque = 500.0 * error - 10.0 * simulation.qvel[:, 6:]
        simulation.step(np.clip(torque, -robot.torque_limit, robot.torque_limit))
        peak = max(peak, momentum_of(simulation)[0, 1])
        bob.catch()
    assert 0.9 < peak / (pendulum.mass * speed_of(pendulum)) < 1.3
    # It has been caught: it hangs where it hung before, and does not come back.
    np.testing.assert_allclose(bob.velocity, 0.0, atol=1e-12)
    np.testing.assert_allclose(bob.position[0], [0.0, 0.0, -10.0 * robot.home_qpos[2]], atol=1e-9)


def test_it_touches_nothing_but_the_hip():
    """Shot along the floor through both feet, it meets nobody and keeps its speed."""
    pendulum = PendulumBlow()
    simulation, bob = scene("humanoid", pendulum)
    bob.position[0] = [0.0, -0.5, 0.04]
    bob.velocity[0] = [0.0, 2.0, 0.0]
    for _ in range(400):
        simulation.step(np.zeros((1, simulation.robot.num_joints)))
    np.testing.assert_allclose(bob.velocity[0], [0.0, 2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(bob.position[0], [0.0, 0.3, 0.04], atol=1e-9)
