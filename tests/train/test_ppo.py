import copy
import functools
import json
import resource
import shutil
import signal

import numpy as np
import pytest
import stand_in

import train.ppo
import train.training
from fbid_gym.bundles import save_bundle
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from tests.batches import assert_same
from train.runs.config import ALGORITHMS, EvaluationConfig, PPOConfig


def test_run_folder_is_complete(straight):
    assert {path.name for path in straight.iterdir()} - {".lock"} == stand_in.FILES
    progress = stand_in.rows(straight / "progress.csv")
    assert [int(row["steps"]) for row in progress] == [128, 256, 384, 512, 640, 768]
    assert all(np.isfinite(float(value)) for row in progress[1:] for value in row.values())
    wall = [float(row["wall_seconds"]) for row in progress]
    assert wall == sorted(wall) and wall[0] > 0
    evaluations = stand_in.rows(straight / "evaluations.csv")
    assert [int(row["steps"]) for row in evaluations] == [0, 384, 640, 768]
    assert list(evaluations[0]) == [
        *("steps", "wall_seconds", "episodes", "return_mean", "return_std", "return_q25"),
        *("return_q75", "length_mean", "survival", "velocity_error"),
        *("turning_error", "slip", "cost_of_transport"),
    ]


def test_policies_are_those_of_the_end_and_of_the_best_evaluation(straight):
    rows = stand_in.rows(straight / "evaluations.csv")
    best = max(rows, key=lambda row: float(row["return_mean"]))
    assert Policy.load(straight).trained_steps == 768
    assert Policy.load(straight / "policy_best.safetensors").trained_steps == int(best["steps"])
    policy = Policy.load(straight)
    policy.check(env_id="stand-in/PointMasses-v0", observation_size=3, action_size=2)
    assert policy.env_args == {"action_layer": "force"}


@pytest.mark.slow
def test_killed_twice_and_resumed_is_the_same_run(straight, tmp_path):
    """Once in the fourth iteration, two steps after a checkpoint; once in the sixth."""
    stand_in.train_and_die(tmp_path, 16 * 3 + 2)
    assert len(stand_in.curve(tmp_path / "progress.csv")) == 3
    assert stand_in.checkpoint(tmp_path).data["steps"] == 256
    with (tmp_path / "progress.csv").open("a") as file:
        file.write("512,0.1,12")  # a row cut short
    stand_in.train_and_die(tmp_path, 16 * 3 + 15)
    assert stand_in.checkpoint(tmp_path).data["steps"] == 512
    stand_in.train(tmp_path)
    stand_in.assert_same_run(straight, tmp_path)


# TensorBoard writes from a thread of its own, which complains by itself.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_disk_that_fills_up_leaves_a_checkpoint_to_continue_from(straight, tmp_path):
    """Files may suddenly grow no further than a kilobyte: the table fits, a checkpoint does not."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill_up(*_):
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))

    before = signal.signal(signal.SIGUSR1, fill_up)
    message = "cannot be written .* last checkpoint stands; the same command continues it"
    try:
        with pytest.raises(RunError, match=message):
            config = stand_in.config(tmp_path)
            train.ppo.main(config, stand_in.make_dying(16 * 3 + 5, signal.SIGUSR1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGUSR1, before)
    assert stand_in.checkpoint(tmp_path).data["steps"] == 256
    stand_in.train(tmp_path)
    stand_in.assert_same_run(straight, tmp_path)


@pytest.mark.slow
def test_interrupted_with_control_c_is_the_same_run(straight, tmp_path):
    output = stand_in.train_and_die(tmp_path, 16 * 2 + 5, signal.SIGINT)
    assert "stops after this iteration" in output
    assert "stopped at step 384 of 768" in output and "The same command continues it" in output
    assert Policy.load(tmp_path).trained_steps == 384
    stand_in.train(tmp_path)
    stand_in.assert_same_run(straight, tmp_path)


def test_finished_run_is_left_as_it_is(straight, capsys):
    before = {path: path.read_bytes() for path in straight.glob("*.csv")}
    stand_in.train(straight)
    assert {path: path.read_bytes() for path in straight.glob("*.csv")} == before
    assert "already trained for 768 steps" in capsys.readouterr().out


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_longer_run_continues_a_finished_one(tmp_path, algorithm):
    for name, steps in (("a", 384), ("a", 768), ("b", 768)):
        quiet = {"total_steps": steps, "eval": EvaluationConfig(every=0)}
        stand_in.train(tmp_path / name, algorithm=algorithm, **quiet)
    assert_same(*(stand_in.checkpoint(tmp_path / name).tensors for name in "ab"))


def test_evaluation_does_not_disturb_the_training(straight, tmp_path):
    stand_in.train(tmp_path, eval=EvaluationConfig(every=0))
    assert_same(*(stand_in.checkpoint(run).tensors for run in (straight, tmp_path)))
    assert len((tmp_path / "evaluations.csv").read_text().splitlines()) == 1
    assert Policy.load(tmp_path).trained_steps == 768


def test_training_learns(tmp_path):
    """The stand-in can be learned: from falling in most episodes to surviving nearly all."""
    batches = {"n_steps": 16, "batch_size": 128, "hidden": (16, 16)}
    ppo = PPOConfig(**batches, learning_rate=3e-3, target_kl=None, log_std_init=-1.0)
    every = EvaluationConfig(every=8192, episodes=64)
    stand_in.train(tmp_path, total_steps=8192, num_envs=16, ppo=ppo, eval=every)
    first, last = stand_in.curve(tmp_path / "evaluations.csv")
    assert float(first["survival"]) < 0.5 and float(last["survival"]) > 0.85


FORGED = {
    **{"rng_numpy.pos": 625, "rng_numpy.has_gauss": 2, "rng_python.version": 7, "steps": -5},
    **{"updates": "many", "return_count": "2", "obs_count": 10**400, "counters.bytes.progress": -1},
    **{"counters.wall_seconds": None, "counters.best_return": "high"},
}


def test_forged_numbers_are_refused(straight, tmp_path):
    """With a digest that fits them."""
    run = shutil.copytree(straight, tmp_path / "run")
    bundle = stand_in.checkpoint(run)
    for path, value in FORGED.items():
        data = copy.deepcopy(bundle.data)
        *outer, last = path.split(".")
        functools.reduce(dict.__getitem__, outer, data)[last] = value
        save_bundle(run / "checkpoint.safetensors", data, bundle.tensors)
        before = {file: file.read_bytes() for file in run.rglob("*.*")}
        with pytest.raises(RunError, match=r"checkpoint\.safetensors: does not fit this run"):
            stand_in.train(run, total_steps=1024)
        assert {file: file.read_bytes() for file in before} == before, path


def test_diverged_training_says_so_and_keeps_its_checkpoint(tmp_path):
    quiet = EvaluationConfig(every=0)
    stand_in.train(tmp_path, total_steps=256, eval=quiet)

    def make(env_id, **arguments):
        env = stand_in.make(env_id, **arguments)
        step_wait = env.step_wait
        env.step_wait = lambda: (lambda o, r, d, i: (o, r * np.nan, d, i))(*step_wait())
        return env

    with pytest.raises(RunError, match=r"training diverged by step 384: .*checkpoint of step 256"):
        train.ppo.main(stand_in.config(tmp_path, eval=quiet), make)
    assert stand_in.checkpoint(tmp_path).data["steps"] == 256


@pytest.mark.slow
def test_robots_killed_and_resumed_are_the_same_run(tmp_path):
    """The environments themselves: their state, saved amid episodes, continues to the bit.

    Short episodes, so that robots fall and start anew before and after the kill.
    """
    changes = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "base_acceleration"}
    pushes = {"push_interval": [0.2, 0.3], "push_force": [1500, 1500]}
    changes |= {"env_args": pushes, "num_threads": 2}
    stand_in.train_and_die(tmp_path / "a", 16 * 3 + 5, real=True, **changes)
    for name in "ab":
        train.ppo.main(stand_in.config(tmp_path / name, **changes))
    stand_in.assert_same_run(tmp_path / "b", tmp_path / "a")
    rows = stand_in.rows(tmp_path / "a/progress.csv")
    assert int(rows[-1]["falls"]) > 0


def test_robots_resumed_on_another_number_of_threads_are_the_same_run(tmp_path):
    """Which thread steps a robot is no part of its state."""
    changes = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "joint_position", "num_envs": 5}
    own = {"episode_seconds": 0.5, "push_interval": [0.15, 0.3]}
    own |= {"randomisation": {"mass": 0.2, "friction": [0.5, 1.0]}}
    ppo = PPOConfig(n_steps=16, batch_size=40, n_epochs=1, hidden=(8,))
    changes |= {"env_args": own, "ppo": ppo, "eval": EvaluationConfig(every=160, episodes=3)}
    train.ppo.main(stand_in.config(tmp_path / "a", **changes, total_steps=160, num_threads=2))
    for name in "ab":
        train.ppo.main(stand_in.config(tmp_path / name, **changes, total_steps=320))
    stored = json.loads((tmp_path / "a/config.json").read_text())
    # Torch sums as it began.
    assert (stored["num_threads"], stored["torch_threads"]) == (1, 2)
    stand_in.assert_same_run(tmp_path / "b", tmp_path / "a")
