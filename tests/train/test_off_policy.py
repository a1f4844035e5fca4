"""SAC and CrossQ through the loop of PPO: their own are replay buffer and squashed action."""

import copy
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import stand_in

from fbid_gym.bundles import save_bundle
from fbid_gym.errors import FbidError, RunError
from train import replay, training
from train.learner import build
from train.runs.config import CrossQConfig, EvaluationConfig, SACConfig
from train.runs.folder import RunFolder
from train.runs.reading import load

QUIET = EvaluationConfig(every=0)
CONFIGS = {"sac": SACConfig, "crossq": CrossQConfig}


def _train(folder, algorithm="sac", **changes):
    return stand_in.train(folder, algorithm=algorithm, **changes)


def _learner(config):
    return build(config, stand_in.make("", num_envs=8, seed=1, num_threads=1))


def _buffer(folder, algorithm):
    """The replay buffer of a run."""
    learner = _learner(stand_in.config(folder, algorithm=algorithm))
    data = stand_in.checkpoint(folder).data
    buffer, files = learner.replay_buffer, data["counters"]["replay"]
    replay.restore(folder / "replay", buffer, data["steps"] // 8, files)
    return buffer


@pytest.fixture(scope="module", params=CONFIGS)
def algorithm(request):
    return request.param


@pytest.fixture(scope="module")
def straight(tmp_path_factory, algorithm):
    """A run of 6 iterations, never interrupted; its buffer holds the last 50 of 96 rows."""
    return _train(tmp_path_factory.mktemp("straight") / "run", algorithm)


def test_run_folder_is_that_of_ppo_with_the_replay_buffer(straight, algorithm):
    names = {path.name for path in straight.iterdir()} - {".lock"}
    assert names == stand_in.FILES | {"replay"}
    progress = stand_in.rows(straight / "progress.csv")
    assert [int(row["steps"]) for row in progress] == [128, 256, 384, 512, 640, 768]
    first, *others = ([float(value) for value in row.values()] for row in progress)
    assert np.isnan(first).sum() == 4 and np.isfinite(others).all()  # nothing learnt before 200
    config = json.loads((straight / "config.json").read_text())
    assert config["algorithm"] == algorithm and "ppo" not in config
    run = load(straight)
    assert run.layer == f"force, {algorithm.upper()}" and run.policy.output == "tanh"


@pytest.mark.slow
def test_killed_twice_and_resumed_is_the_same_run(straight, algorithm, tmp_path):
    """Once before anything is learnt, once when the buffer is full; files are left behind."""
    stand_in.train_and_die(tmp_path, 16 * 2 + 3, algorithm=algorithm)
    (tmp_path / "replay" / "000000000032-000000000040.safetensors").write_bytes(b"half")
    stand_in.train_and_die(tmp_path, 16 * 3 + 15, algorithm=algorithm)
    assert stand_in.checkpoint(tmp_path).data["steps"] == 512
    _train(tmp_path, algorithm)
    stand_in.assert_same_run(straight, tmp_path)
    one, other = _buffer(straight, algorithm), _buffer(tmp_path, algorithm)
    assert (one.pos, one.full) == (other.pos, other.full) == (96 % 50, True)
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    files = {path.name for path in (tmp_path / "replay").iterdir()}
    assert files == {path.name for path in (straight / "replay").iterdir()}


@pytest.mark.slow
def test_training_learns(tmp_path, algorithm):
    own = CONFIGS[algorithm](
        n_steps=16, gradient_steps=2, batch_size=64, learning_starts=256, policy_starts=512,
        learning_rate=3e-3, hidden=(16, 16), gamma=0.95,
    )  # fmt: skip
    every = EvaluationConfig(every=4096, episodes=64)
    _train(tmp_path, algorithm, total_steps=4096, num_envs=16, eval=every, **{algorithm: own})
    first, last = stand_in.curve(tmp_path / "evaluations.csv")
    assert float(last["survival"]) > float(first["survival"]) + 0.25


def test_a_learner_begins_with_the_noise_and_the_value_that_it_is_told(tmp_path, algorithm):
    own = CONFIGS[algorithm](
        gamma=0.9, expected_reward=0.5, log_std_init=-1.5, ent_coef=0.02, n_steps=4
    )
    learner = _learner(stand_in.config(tmp_path, algorithm=algorithm, **{algorithm: own}))
    observation = learner.policy.obs_to_tensor(np.ones((5, 3), np.float32))[0]
    _, log_std, _ = learner.actor.get_action_dist_params(observation)
    np.testing.assert_array_equal(log_std.detach(), -1.5)
    assert learner.log_ent_coef.exp().item() == pytest.approx(0.02)
    assert learner.target_entropy == -2.0  # of two actions
    slow = {"sac": ("critic_target",), "crossq": ()}[algorithm]
    for critic in (learner.critic, *(getattr(learner, name) for name in slow)):
        for value in critic(observation, learner.actor(observation)):
            np.testing.assert_allclose(value.detach(), 5.0, rtol=1e-6)


def test_the_policy_waits_for_the_value_networks(tmp_path, algorithm):
    """Until `policy_starts` it is the zero action, whatever the value networks learn."""
    usual = stand_in.config(tmp_path, algorithm=algorithm, eval=QUIET)
    own = replace(usual.hyperparameters, policy_starts=300)
    last = {"sac": 4, "crossq": 7}[algorithm]  # of the value networks' modules
    for steps, moves in ((256, False), (384, True)):
        config = replace(usual, total_steps=steps, **{algorithm: own})
        folder = training.main(config, stand_in.make)
        state = stand_in.checkpoint(folder).tensors
        assert state[f"network.critic.qf0.{last}.weight"].any()
        assert state["network.actor.mu.weight"].any() == moves


def test_a_damaged_buffer_is_one_error_and_nothing_is_lost(straight, algorithm, tmp_path):
    """So is a checkpoint, with a digest that fits, which names other rows."""

    def refused(message):
        before = {path: path.read_bytes() for path in run.rglob("*.*")}
        with pytest.raises(RunError, match=message):
            _train(run, algorithm, total_steps=1024)
        assert {path: path.read_bytes() for path in before} == before

    run = shutil.copytree(straight, tmp_path / "run")
    file = sorted((run / "replay").iterdir())[0]
    whole, bundle = file.read_bytes(), stand_in.checkpoint(run)
    for content in (whole[:-9], whole[:-9] + b"\x01" + whole[-8:]):
        file.write_bytes(content)
        refused(f"{file.name}: corrupt, or not the file that the checkpoint was saved with")
    file.unlink()
    refused(rf"{file.name}: cannot be read \(No such file")
    file.write_bytes(whole)
    for forge, message in (
        (lambda files: files.pop(), "Expected 46 to 96"),
        (lambda files: files[0].update(first=-1), "Expected 46 to 96"),
        (lambda files: files[0].update(last="x"), "Expected 46 to 96"),
        (lambda files: files[0].pop("last"), "does not say which files"),
    ):
        forged = copy.deepcopy(bundle.data)
        forge(forged["counters"]["replay"])
        save_bundle(run / "checkpoint.safetensors", forged, bundle.tensors)
        refused(message)


def test_runs_and_checkpoints_of_another_algorithm_are_refused(straight, algorithm, tmp_path):
    ppo = stand_in.train(tmp_path / "ppo", total_steps=128, eval=QUIET)
    with pytest.raises(RunError) as caught:
        _train(ppo, algorithm, total_steps=128, eval=QUIET)
    words = f'algorithm "{algorithm}" instead of "ppo". Choose another --out'
    assert words in str(caught.value) and "gamma" not in str(caught.value)
    shutil.copytree(straight, tmp_path / "other")
    shutil.copy(ppo / "checkpoint.safetensors", tmp_path / "other")
    with pytest.raises(RunError, match=rf"is a checkpoint of ppo\. Expected {algorithm}"):
        _train(tmp_path / "other", algorithm)


def test_a_buffer_on_disk_holds_what_it_holds_in_memory(tmp_path, monkeypatch):
    """Whatever was added between two checkpoints: less than a row's file, or more than the buffer.

    What is on the disk is bounded, and what is there already is not written again.
    """
    monkeypatch.setattr(replay, "_FILE_BYTES", 2000)  # several files a checkpoint
    config = stand_in.config(tmp_path, algorithm="sac")
    draw, files, rows = np.random.default_rng(0), [], 0
    buffer, folder = _learner(config).replay_buffer, RunFolder.of(tmp_path).replay
    for added in (3, 0, 17, 40, 1, 120, 49, 50, 51):
        for _ in range(added):
            states = draw.normal(size=(2, 8, 3)).astype(np.float32)
            infos = [{"TimeLimit.truncated": bool(draw.integers(2))} for _ in range(8)]
            buffer.add(*states, draw.normal(size=(8, 2)), draw.random(8), draw.random(8), infos)
        rows += added
        there = {path: path.stat().st_mtime_ns for path in folder.glob("*")}
        files = replay.append(folder, buffer, rows, files)
        assert all(path.stat().st_mtime_ns == time for path, time in there.items())
        replay.forget(folder, files)
        assert len(list(folder.iterdir())) == len(files)
        assert files[-1]["last"] - files[0]["first"] <= 50 + 10
        again = _learner(config).replay_buffer
        replay.restore(folder, again, rows, json.loads(json.dumps(files)))
        assert (again.pos, again.full) == (buffer.pos, buffer.full)
        for name in ("observations", "next_observations", "actions", "rewards", "timeouts"):
            np.testing.assert_array_equal(getattr(again, name), getattr(buffer, name))
    with pytest.raises(FbidError, match=r"observations is float32 .* Expected float32 \(\d+, 4"):
        other = build(config, stand_in.make("", num_envs=4, seed=1, num_threads=1)).replay_buffer
        other.buffer_size = buffer.buffer_size
        replay.restore(folder, other, rows, files)
