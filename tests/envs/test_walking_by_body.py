"""Walking without a policy, by the layers that say how the body moves."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots import zoo
from fbid_gym.tasks.body import FALLEN_HEIGHT
from fbid_gym.tasks.walk import MOST_LOWERED
from tests.batches import Watched, outcome_of, started, upright
from tests.pairs import pairs

LAYERS = ("base_acceleration", "com_wrench")
WALKS = {"go1": "Quadruped", "biped": "Biped", "humanoid": "Humanoid"}
# Of the zoo: quadrupeds on points whose legs have five and six joints, so that they can turn about
# their ends.
SPARE_JOINTS = (42, 47)


def walking(like, layer, count, **arguments):
    """Robots that walk as one of WALKS does, each to its own commands, without pushes."""
    known = {"robot": like, "action_layer": layer, "push_force": (0.0, 0.0)} | arguments
    return started(ENVIRONMENTS[f"fbid_gym/{WALKS[like]}Walk-v0"] | known, count)


@pytest.mark.parametrize("robot", WALKS)
@pytest.mark.parametrize("layer", LAYERS)
def test_a_zero_action_walks_upright(robot, layer):
    batch = walking(robot, layer, 4)
    vertical = batch.observation_names.index("up direction z (base frame)")
    for step in upright(batch, 5):
        assert (step.observation[:, vertical] > np.cos(0.5)).all()


@pytest.mark.parametrize("robot", ["g1", "biped", "5"])
def test_robots_on_soles_walk_fast(robot):
    """At 0.8 m/s, told at once: twice as fast as a sole can balance the swing of a leg."""
    own = zoo.built(zoo.draw(int(robot))) if robot.isdecimal() else robots.load(robot)
    height = Stance.of(own).home_com[2]
    ahead = (0.8 / np.sqrt(own.gravity * height),) * 2
    still = {"sideways_range": (0.0, 0.0), "turning_range": (0.0, 0.0), "gait": "brisk_walk"}
    told = {"forward_range": ahead, "command_interval": (99.0, 99.0)}
    batch = walking("biped", LAYERS[0], 6, robot=own, **told, **still)
    batch._plan["command"][:, :, 0] = 0.8  # nobody is to stand
    gone = [step.info["distance"] for step in upright(batch, 7)]
    assert (gone[-1] - gone[3 * batch.rates.policy] > 0.7 * 4.0).all()


@pytest.mark.parametrize(("robot", "layer"), pairs(["go1", "biped"], LAYERS, 1))
def test_robots_walk_as_much_lower_as_they_are_told(robot, layer):
    share = 0.9 * MOST_LOWERED
    batch = walking(robot, layer, 4, lowered_range=(share, share))
    step = upright(batch, 3)[-1]
    task = batch.task
    told = share * task.body.stance.home_com[2]
    asked = task.gait.constants.height - told
    assert step.info["height_command"] == pytest.approx(asked, abs=0.05 * told)
    assert step.info["height"] == pytest.approx(asked, abs=0.1 * told)


def test_a_robot_that_its_gait_has_lower_has_not_fallen():
    """The small quadruped stands on legs that are nearly straight, and paces on bent ones."""
    batch = walking("go1", "base_acceleration", 16, robot="quadruped", gait="pace")
    body, asked = batch.task.body, batch.task.gait.height
    least, size = np.inf, body.size - body.lowered
    assert asked < 0.8 * body.home_height
    assert size == pytest.approx(asked + body.size - body.home_height)
    zero = np.zeros((16, len(batch.action_names)))
    for _ in range(5 * batch.rates.policy):
        assert not batch.step(zero).terminated.any()
        least = min(least, outcome_of(batch).posture.base[:, 2].min())
    # So low that, measured by how it stands, it would lie.
    assert FALLEN_HEIGHT * size < least < FALLEN_HEIGHT * body.size


@pytest.mark.parametrize("share", [0.0, MOST_LOWERED])
def test_a_robot_has_fallen_where_it_is_much_lower_than_asked(share):
    batch = walking("go1", "joint_position", 200, lowered_range=(0.0, share))
    body = batch.task.body
    asked = batch.task.gait.height - share * body.stance.home_com[2]
    outcome = outcome_of(batch)
    height = np.linspace(0.5, 0.7, 200) * asked
    base = outcome.terms.base_position.copy()
    base[:, 2] += height - outcome.posture.base[:, 2]
    upright = np.tile(np.eye(3), (200, 1, 1))
    terms = outcome.terms._replace(base_position=base, world_from_trunk=upright)
    found = body.posture(outcome.state, terms).fallen
    above = body.size - body.home_height
    np.testing.assert_array_equal(found, height + above < FALLEN_HEIGHT * (asked + above))
    assert found.any() and not found.all()


@pytest.mark.parametrize(("seed", "layer"), pairs(SPARE_JOINTS, LAYERS, 1))
def test_legs_with_joints_to_spare_walk_and_keep_their_posture(seed, layer):
    batch = walking("go1", layer, 4, robot=zoo.built(zoo.draw(seed)))
    home = batch.robot.home_qpos[7:]
    upright(batch, 5)
    assert np.abs(batch.simulation.qpos[:, 7:] - home).max() < 1.2


@pytest.mark.parametrize(
    ("robot", "options", "share", "layer"),
    # In a trot two feet lift as two others land, and their ramps run at the same time.
    pairs([("biped", {}, 0.1), ("go1", {"contact_ramp": 0.048}, 0.15)], LAYERS, 1),
)
def test_with_a_ramp_the_torque_goes_through_touchdown_and_lift_off(robot, options, share, layer):
    batch = walking(robot, layer, 4, layer_options=options)
    batch.loop.layer = seen = Watched(batch.layer)
    upright(batch, 3)
    planted, torque, ticks = np.array(seen.planted), np.array(seen.torques), seen.law.ramp.ticks
    sudden = np.array([memory["ramp_law"] for memory in seen.memories])
    switched = (planted[1:] != planted[:-1]).any(axis=2)
    down = (planted[1:] & ~planted[:-1]).any(axis=2)
    assert down.sum() > 10
    assert switched.sum() > down.sum() + 10
    # What is left of the last switch goes on fading, and nothing else happens.
    added = np.abs(torque - sudden)
    change, jump = np.abs(np.diff(torque, axis=0)), np.abs(np.diff(sudden, axis=0))
    assert (change[switched] <= added.max() / ticks + 1e-9).all()
    assert change[switched].max() < share * jump[switched].max()
    # Nothing is added for ever: a ramp's time after the last switch the law has its own way.
    quiet = np.lib.stride_tricks.sliding_window_view(~switched, ticks, axis=0).all(axis=-1)
    np.testing.assert_array_equal(added[ticks:][quiet], 0.0)
