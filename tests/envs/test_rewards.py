"""Rewards and observations that people can change: laws of every task's tables."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import FbidError, UnknownOptionError
from fbid_gym.tasks import TASKS, Term, Walk, bell, register_reward_term, register_task
from fbid_gym.tasks.body import Units
from tests.batches import assert_same, begun, started

WALK = "fbid_gym/QuadrupedWalk-v0"
NAMES = [WALK, "fbid_gym/BipedBalance-v0"]
NAMES += [f"fbid_gym/Quadruped{task}-v0" for task in ("Crawl", "Terrain")]


pytestmark = pytest.mark.usefixtures("registries")


def on_the_way(name: str, **arguments: Any) -> EnvBatch:
    """Three robots that have gone a few steps by random actions."""
    given = {"action_layer": "joint_position", "height_scan": True} if "Terrain" in name else {}
    batch, rng = started(ENVIRONMENTS[name] | given | arguments, 3), np.random.default_rng(0)
    for _ in range(12):
        batch.step(rng.uniform(-0.1, 0.1, (3, len(batch.action_names))))
    return batch


def measured(batch: EnvBatch) -> Any:
    return batch.loop.measure(batch._outcome(batch._effort))


@pytest.mark.parametrize("name", NAMES)
def test_asking_twice_gives_the_same_and_changes_nothing(name: str) -> None:
    batch = on_the_way(name)
    before, answers = batch.state_dict(), []
    for _ in range(2):
        found = measured(batch)
        answer = {f"metric {k}": v.copy() for k, v in batch.task.metrics(found).items()}
        for key, term in batch.reward_terms.items():
            answer[f"term {key}"] = term.share(found).copy()
        for key, group in batch.observation_groups.items():
            answer[f"group {key}"] = group.function(found).copy()
        answers.append(answer)
    assert_same(*answers)
    assert_same(before, batch.state_dict())


@pytest.mark.parametrize("name", NAMES)
def test_terms_lie_between_zero_and_their_weights_which_scale_them(name: str) -> None:
    """Whatever the weights, the reward is their sum, and nothing else changes."""
    names = list(on_the_way(name).reward_terms)
    weights = {names[0]: 0.0, names[1]: 3.0}
    plain, other = on_the_way(name), on_the_way(name, reward_weights=weights)
    action = np.zeros((3, len(plain.action_names)))
    one, two = plain.step(action), other.step(action)
    np.testing.assert_array_equal(one.observation, two.observation)
    for key, term in plain.reward_terms.items():
        earned, weight = one.info[f"reward_{key}"], weights.get(key, term.weight)
        assert (earned >= 0.0).all() and (earned <= term.weight).all() and earned.any(), key
        np.testing.assert_allclose(two.info[f"reward_{key}"], earned / term.weight * weight)
    assert one.info.keys() == two.info.keys()
    for step in (one, two):
        terms = [value for key, value in step.info.items() if key.startswith("reward_")]
        np.testing.assert_allclose(step.reward, sum(terms))


@pytest.mark.parametrize("name", NAMES)
def test_a_scale_is_where_a_term_has_fallen_to_1_over_e(name: str) -> None:
    """A bell twice as wide is the fourth root; what a term multiplies it with stays."""
    batch = on_the_way(name)
    found = measured(batch)
    for key, term in batch.reward_terms.items():
        at = [term._replace(scale=term.scale * factor).share(found) for factor in (1, 2, 1e3)]
        flat = at[2]  # so wide that there is no bell
        assert term.scale is not None and (flat > 0.0).any(), key
        if key == "upright":
            assert (at[0] <= at[1]).all() and (at[1] <= flat).all() and (at[0] < flat).any()
            continue
        np.testing.assert_allclose(at[0], at[1] ** 4 / np.where(flat > 0, flat, 1) ** 3, rtol=1e-4)


def quiet(measured: Any, width: float) -> np.ndarray:
    return bell(measured.outcome.power, width * measured.units.weight * measured.units.speed)


def test_an_own_term_goes_wherever_environments_are_made() -> None:
    register_reward_term("walk", "quiet", quiet, 0.2, 0.5, "weight * sqrt(g h)")
    register_reward_term("walk", "alive", lambda found: np.ones(len(found.outcome.power)), 0.1)
    given = {"reward_weights": {"alive": 0.3}, "reward_scales": {"quiet": 0.1}}
    one, two = begun(WALK, **given), begun(WALK, 2, **given)
    three = fbid_gym.make_sb3(WALK, 2, seed=0, **given)
    three.reset()
    zero = np.zeros(one.action_space.shape)
    infos = one.step(zero)[-1], two.step(np.stack([zero, zero]))[-1]
    three.step(np.stack([zero, zero]))
    body = one.unwrapped.batch.task.body
    units = Units.of(body.robot, body.stance.home_com[2])
    expected = 0.2 * np.exp(-((infos[0]["power"] / (0.1 * units.weight * units.speed)) ** 2))
    assert 0.0 < expected < 0.2
    for found in (infos[0]["reward_quiet"], infos[1]["reward_quiet"][0]):
        assert found == pytest.approx(expected)
    assert three.last_info["reward_quiet"][0] == pytest.approx(expected)
    assert infos[1]["reward_alive"].tolist() == [0.3, 0.3]
    resolved = resolved_arguments(WALK, given)
    assert resolved["reward_weights"]["alive"] == 0.3 and resolved["reward_scales"]["quiet"] == 0.1
    assert "alive" not in resolved["reward_scales"]
    with pytest.raises(UnknownOptionError, match="'quiet'"):
        gym.make("fbid_gym/BipedBalance-v0", reward_weights={"quiet": 1.0})


def test_a_subclass_has_a_table_of_its_own() -> None:
    class Quiet(Walk):
        reward_terms = Walk.reward_terms | {"quiet": Term(quiet, 0.2, 0.5)}

    register_task("quiet_walk", Quiet.of)
    env = begun(WALK, task="quiet_walk", gait="pace", reward_weights={"quiet": 0.0})
    *_, info = env.step(np.zeros(env.action_space.shape))
    assert info["reward_quiet"] == 0.0 and info["reward_velocity"] > 0.0
    assert "quiet" not in Walk.reward_terms


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("run", "quiet", quiet, 0.1), "Unknown task 'run'.*walk"),
        (("walk", "velocity", quiet, 0.1), "name of reward term: 'velocity'.*turning"),
        (("walk", "quiet", 3.0, 0.1), "function of reward term 'quiet': 3.0"),
        (("walk", "quiet", quiet, 0.1, 0.0), "scale of reward term 'quiet': 0.0"),
    ],
)
def test_terms_that_are_refused(given: tuple[Any, ...], words: str) -> None:
    with pytest.raises(FbidError, match=words):
        register_reward_term(*given)
    assert not TASKS["walk"].own_terms


def test_an_own_term_that_answers_another_shape_is_refused() -> None:
    register_reward_term("walk", "quiet", lambda found: 1.0, 0.1)
    envs = begun(WALK, 2)
    with pytest.raises(FbidError, match=r"reward term 'quiet' of Walk has shape \(\)"):
        envs.step(np.zeros(envs.action_space.shape))
