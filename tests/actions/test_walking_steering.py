"""What an action adds to that of a layer: footholds, the frequency of the gait, joint torques."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions import LAYERS, make_layer
from fbid_gym.actions.additions import Additions
from fbid_gym.dynamics.stance import Stance
from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.command import GaitCommand, Steering
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.target import MotionKind, planned_kind
from fbid_gym.quantities import RobotState, Target
from tests.actions.cases import state_at
from tests.batches import started

HZ = 250
GAIT = MotionKind(True, 6.0)


def held(robot):
    """A robot held by a hand, with its weight on its feet."""
    qpos = robot.home_qpos[None].copy()
    qpos[0, 3:7] = np.cos(0.3), 0.0, 0.0, np.sin(0.3)
    state, terms = state_at(robot, qpos)
    return terms, state.contact_force


def commanded(velocity, steering):
    """A command with this steering, on ground that is not known."""
    ground = np.full(steering.shift.shape[:2], np.nan)
    return GaitCommand(velocity, *steering, ground, np.zeros(len(velocity)))


def walked(gait, command, terms, force, memory):
    """What the gait asks for a tick later."""
    gait.advance(command, terms, force, memory)
    return Target(*(value.copy() for value in gait.target(memory)))


@pytest.mark.parametrize("name", ["go1", "biped"])
def test_the_action_moves_the_next_foothold_by_that_much(name):
    robot = robots.load(name)
    gait, (terms, force) = gait_of(robot, HZ), held(robot)
    footholds = Additions.of(robot, GAIT, footholds=True)
    scale = 0.2 * Stance.of(robot).home_com[2]
    np.testing.assert_allclose(footholds.feet, scale)
    action = np.tile([0.1, -0.05], robot.num_feet)[None]
    shifted, _ = footholds.split(action)
    still = Steering(np.zeros((1, robot.num_feet, 2)), np.ones(1))
    command, memory = np.array([[0.05, 0.0, 0.0]]), gait.memory(terms)
    compared = 0
    for _ in range(2 * HZ):
        copy = {key: value.copy() for key, value in memory.items()}
        here = walked(gait, commanded(command, still), terms, force, memory)
        there = walked(gait, commanded(command, shifted), terms, force, copy)
        for foot in np.flatnonzero(~here.planted[0] & ~here.clipped[0] & ~there.clipped[0]):
            way = (there.foothold - here.foothold)[0, foot, :2]
            half = np.arctan2(here.qpos[0, 6], here.qpos[0, 3])
            axis = np.array([np.cos(2 * half), np.sin(2 * half)])
            asked = scale * (0.1 * axis - 0.05 * np.array([-axis[1], axis[0]]))
            np.testing.assert_allclose(way, asked, atol=1e-9)
            compared += 1
    assert compared > 0


def test_the_step_rate_is_the_gaits_frequency():
    robot = robots.load("go1")
    gait, (terms, force) = gait_of(robot, HZ), held(robot)
    faster = Additions.of(robot, GAIT, step_rate=True)
    command, passed = np.array([[0.3, 0.0, 0.0]]), []
    for action in (0.0, 1.0, -1.0):
        memory, cycles = gait.memory(terms), []
        steering, _ = faster.split(np.array([[action]]))
        for _ in range(HZ // 2):
            target = walked(gait, commanded(command, steering), terms, force, memory)
            cycles.append(target.cycle[0])
        change = np.diff(cycles) % 1.0
        passed.append(np.median(change[change > 0.0]) * HZ)
    assert passed[1] / passed[0] == pytest.approx(1.2)
    assert passed[2] / passed[0] == pytest.approx(0.8)


@pytest.mark.parametrize("layer", LAYERS)
def test_the_action_is_the_layers_and_then_the_footholds(layer):
    robot = robots.load("go1")
    for footholds in (None, False, True):
        moved = layer in ("base_acceleration", "com_wrench") if footholds is None else footholds
        for rate in (False, True):
            options = {"footholds": footholds, "step_rate": rate}
            made, steers = make_layer(layer, robot, HZ, GAIT, options)
            assert len(steers.action_names) == 8 * moved + rate
            assert made.action_names
            (shift, rates), torque = steers.split(np.zeros((2, 8 * moved + rate)))
            assert torque is None and not shift.any() and (rates == 1.0).all()


def first_torque(layer, action, **options):
    """Torques of the first control tick of two robots, before limits; and their limits."""
    made = ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"]
    batch = started(made | {"action_layer": layer, "layer_options": options}, 2)
    where = batch.simulation.qpos.copy(), batch.simulation.qvel.copy()
    state = RobotState(*where, np.zeros((2, 4, 3)), np.zeros(2, np.int64))
    batch.loop.send(action[:, : len(batch.action_names)])
    terms = batch.simulation.terms
    return batch.loop.torque(0, state, terms, terms), batch.robot.torque_limit


@pytest.mark.parametrize("layer", LAYERS)
def test_residual_torques_are_added_to_those_of_any_layer(layer, rng):
    (made, plain), (_, more) = (
        make_layer(layer, robots.load("go1"), HZ, GAIT, {"residual_torque": share})
        for share in (0.0, 0.2)
    )
    own = len(made.action_names) + len(plain.action_names)
    assert len(more.action_names) == len(plain.action_names) + 12
    action = rng.uniform(-1.0, 1.0, (2, own + 12))
    without, limit = first_torque(layer, action)
    torque, _ = first_torque(layer, action, residual_torque=0.2)
    np.testing.assert_array_equal(torque, without + 0.2 * limit * action[:, own:])


@pytest.mark.parametrize("option", ["footholds", "step_rate"])
def test_what_is_planned_cannot_be_steered(option):
    robot = robots.load("go1")
    with pytest.raises(InvalidValueError, match=f"{option}: True. Expected False where no gait"):
        make_layer("base_acceleration", robot, HZ, planned_kind(robot), {option: True})
