"""A robot that diverges ends its own episode; the others do not notice, and nobody else hears."""

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from tests.batches import begun
from tests.pairs import pairs

BIPED = next(iter(ENVIRONMENTS))
CASES = [(layer, {}) for layer in LAYERS] + [
    ("base_acceleration", {"layer_options": {"contact_limits": "none"}}),
    ("base_acceleration", {"layer_options": {"contacts": "measured"}}),
    # Another simulation of MuJoCo's, which could have its own word to say.
    ("com_wrench", {"randomisation": {"model_mass": 0.1}}),
]


# Entries of the second robot, what is put there, and before which step.
BREAKAGES = [("qvel", ..., *how) for how in ((np.nan, 3), (1e4, 3), (1e12, 0))]
BREAKAGES += [("qpos", 9, np.nan, 3)]


@pytest.mark.parametrize(
    ("layer", "options", "field", "entry", "size", "when"), pairs(CASES, BREAKAGES, 1)
)
def test_the_others_do_not_notice(
    layer, options, field, entry, size, when, rng, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    arguments = {"num_envs": 3, "action_layer": layer, **options}
    broken, whole = (gym.make_vec(BIPED, **arguments) for _ in range(2))
    before = broken.reset(seed=0)[0]
    whole.reset(seed=0)
    others = [0, 2]
    for step in range(6):
        action = rng.uniform(-0.2, 0.2, broken.action_space.shape)
        if step == when:
            getattr(broken.chunks.batches[0].simulation, field)[1, entry] = size
        ours, theirs = broken.step(action), whole.step(action)
        for value, expected in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(value[others], expected[others])
        for key in theirs[4]:
            np.testing.assert_array_equal(ours[4][key][others], theirs[4][key][others])
        observation, reward, terminated, truncated, info = ours
        if step == when:
            assert info["termination"].tolist() == [0, 2, 0]
            assert terminated.tolist() == [False, True, False] and not truncated.any()
            assert reward[1] == 0.0
            assert all(info[key][1] == 0.0 for key in info if key.startswith("reward_"))
            np.testing.assert_array_equal(observation[1], before[1])  # the last good one
        assert broken.observation_space.contains(observation)
        for key, value in info.items():
            if value.dtype != object:
                assert np.isfinite(value).all(), key
        before = observation
    # It was reset, and lives on.
    assert not terminated.any() and (reward > 0.0).all()
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_each_interface_reports_it():
    scalar = gym.make(BIPED, action_layer="torque")
    first, _ = scalar.reset(seed=0)
    scalar.unwrapped.batch.simulation.qvel[:] = np.nan
    observation, reward, terminated, truncated, info = scalar.step(np.zeros(16, np.float32))
    assert (reward, terminated, truncated, info["termination"]) == (0.0, True, False, 2)
    np.testing.assert_array_equal(observation, first)

    envs = fbid_gym.make_sb3(BIPED, 2, seed=0, action_layer="torque")
    first = envs.reset()
    envs.chunks.batches[0].simulation.qvel[1] = 1e5
    observation, reward, done, infos = envs.step(np.zeros((2, 16)))
    assert done.tolist() == [False, True] and reward[1] == 0.0
    assert infos[1]["termination"] == 2 and not infos[1]["TimeLimit.truncated"]
    np.testing.assert_array_equal(infos[1]["terminal_observation"], first[1])
    assert (observation[1] != first[1]).any()


@pytest.mark.slow
def test_the_hardest_legal_actions_are_no_divergence(rng):
    """Full torque back and forth throws robots about, but that is a fall, not a breakdown."""
    for name in list(ENVIRONMENTS)[::3]:
        env = begun(name, 16, action_layer="torque", autoreset_mode="SAME_STEP")
        falls = 0
        for _ in range(60):
            action = rng.choice([-1.0, 1.0], env.action_space.shape)
            *_, info = env.step(action)
            if "final_info" in info:
                reasons = info["final_info"]["termination"][info["_final_info"]]
                assert (reasons == 1).all()
                falls += len(reasons)
        assert falls > 16


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_its_metrics_are_the_last_that_it_had(mode):
    """Not those of the home pose in which it waits: who diverges has not walked for nothing."""
    env = begun("fbid_gym/QuadrupedWalk-v0", 2, action_layer="torque", autoreset_mode=mode)
    nothing = np.zeros(env.action_space.shape)
    for _ in range(5):
        *_, before = env.step(nothing)
    again = begun("fbid_gym/QuadrupedWalk-v0", 2, 1, action_layer="torque")
    again.chunks.load_state_dict(env.chunks.state_dict())
    for each in (env, again):
        each.chunks.batches[0].simulation.qvel[1] = np.nan
        *_, info = each.step(nothing)
        info = info.get("final_info", info)
        for name in ("distance", "cost_of_transport", "velocity_error", "torque_rms"):
            assert info[name][1] == before[name][1] > 0.0, name
        assert info["distance"][0] > before["distance"][0]
