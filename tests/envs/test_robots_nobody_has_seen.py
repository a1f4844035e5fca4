"""Robots of the zoo stand by a zero action, whatever their legs and feet."""

import pytest

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.policy_step import Step
from fbid_gym.envs.verdict import survival
from fbid_gym.robots import zoo
from tests.batches import started, upright
from tests.pairs import pairs

# On soles with five joints a leg, two, four and six of them, 1.3 to 4.4 kg: closed chains that can
# hardly move in some directions, and not at all in others.
CHAINS = (2, 20, 29, 32)
# Two legs of four and five joints on soles: what such legs cannot do at home, they can hardly do
# when they have moved a little.
TWO_SOLES = (2, 3, 20, 27)
# Feet so light that what holds them in the air would hold no robot up, on three to seven joints.
LIGHT_FEET = (1, 16, 22, 25, 26, 29, 30, 35)


def stand(seed: int, layer: str, **options: str) -> tuple[EnvBatch, Step]:
    """Let two robots of the zoo stand for five seconds."""
    given = {"robot": zoo.built(zoo.draw(seed)), "task": "balance", "push_force": (0.0, 0.0)}
    batch = started(given | {"action_layer": layer, "layer_options": options}, 2)
    return batch, upright(batch, 5)[-1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "layer"), pairs(CHAINS, ["base_acceleration", "joint_acceleration"], 1)
)
def test_closed_chains_stand(seed, layer):
    _, step = stand(seed, layer)
    # Of the weight; and of gravity what is asked of feet that hold each other: the base is led back
    # by springs in directions, too, in which no joint of these legs moves it.
    assert step.info["layer_residual"].max() < (0.5 if layer == "base_acceleration" else 5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", TWO_SOLES)
def test_two_soles_stand_by_the_papers_law(seed):
    stand(seed, "base_acceleration", contact_limits="none")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "layer"), pairs(LIGHT_FEET, ["joint_position", "task_space_position"], 1)
)
def test_kinematics_hold_a_robot_up(seed, layer):
    batch, _ = stand(seed, layer)
    home = batch.robot.home_qpos[2]
    assert batch.simulation.qpos[:, 2] == pytest.approx(home, rel=0.01)


@pytest.mark.parametrize("layer", ["base_acceleration", "com_wrench"])
def test_a_biped_of_five_joints_a_leg_walks(layer):
    """Its ankles do not roll: a force to the side and a moment ahead exclude each other."""
    arguments = ENVIRONMENTS["fbid_gym/BipedWalk-v0"] | {"action_layer": layer}
    assert survival(zoo.built(zoo.draw(2)), arguments) >= 0.9
