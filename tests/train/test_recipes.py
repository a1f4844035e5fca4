import importlib.util
import re
import subprocess
import sys
from dataclasses import replace

import pytest

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError
from train.recipes import config_for, recipe_for, recipes, zoo
from train.runs.command_line import parse
from train.runs.config import ALGORITHMS, PPOConfig, SACConfig, TrainConfig

WALK = "fbid_gym/QuadrupedWalk-v0"


def _write(folder, text, name="mine"):
    (folder / f"{name}.toml").write_text(text)
    return folder


def test_every_environment_has_a_recipe():
    named = [env for recipe in recipes().values() for env in recipe.envs]
    assert sorted(named) == sorted(ENVIRONMENTS)


def test_the_environment_chooses_and_others_are_trained_by_the_defaults():
    for env in ("mine/Own-v0", *ENVIRONMENTS):
        expected = config_for(env, TrainConfig.action_layer)
        assert parse(["--env", env]) == expected
        assert (expected == TrainConfig(env=env)) == (env not in ENVIRONMENTS)
        assert parse(["--env", env, "--recipe", "none"]) == TrainConfig(env=env)
    assert parse([]) == config_for(TrainConfig.env, TrainConfig.action_layer)


def test_the_command_line_goes_before_the_recipe():
    config, usual = parse(["--env", WALK, "--ppo.gamma", "0.9"]), parse(["--env", WALK])
    assert config == replace(usual, ppo=replace(usual.ppo, gamma=0.9))


def test_an_exception_is_for_its_layer_with_its_options():
    layers = ("joint_position", {"reference": "home"}), ("torque",), ("joint_position",)
    for env in (WALK, "fbid_gym/QuadrupedWalk-v1"):
        home, torque, gait = (config_for(env, *layer).ppo for layer in layers)
        model = config_for(env, "base_acceleration").ppo
        assert home == torque != model and home.hidden == model.hidden
        assert home.log_std_init > gait.log_std_init
        assert (gait == model) == (env == WALK)  # version 1 has settings for either
    assert model.log_std_init > gait.log_std_init and model.gamma > gait.gamma


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[ppo]\nlr = 1.0", "Unknown setting 'lr' of recipe 'mine'. Valid choices: learning_rate"),
        ("seed = 3", "Unknown setting 'seed' of recipe 'mine'"),
        ("[[exceptions]]\nnum_envs = 3", "an exception for layers None. Expected a list"),
        ("num_envs = [", "is no TOML"),
        ("envs = 3", "envs is 3. Expected a list of environment ids."),
        ("[[exceptions]]\nenvs = 3", "envs is 3. Expected a list of environment ids."),
        ("[[exceptions]]\nalgorithm = 'sac'\nlayers = 3", "an exception for layers 3. Expected"),
    ],
)
def test_a_file_that_is_no_recipe_is_one_clear_error(tmp_path, text, message):
    with pytest.raises(FbidError, match=re.escape(message)):
        recipes(_write(tmp_path, text))


def test_an_unknown_recipe_names_those_that_there_are():
    with pytest.raises(FbidError, match="Unknown recipe 'run'. Valid choices: .*walk.*, none"):
        recipe_for(WALK, "run")
    with pytest.raises(FbidError, match="Unknown recipe 'run'"):
        parse(["--recipe", "run"])


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_rl_zoo_is_told_the_same(algorithm):
    assert (zoo.FOLDER / f"{algorithm}.yml").read_text() == zoo.text(algorithm)
    config = config_for(WALK, TrainConfig.action_layer, algorithm=algorithm)
    entry = zoo.entry(config)
    for name, value in (("n_envs", config.num_envs), ("batch_size", config.batch_size)):
        assert f"  {name}: {value}\n" in entry


def test_an_exception_may_be_for_an_algorithm_and_for_environments(tmp_path):
    """Alone, or together with a layer; settings of the other algorithm are left out."""
    text = f"""
    envs = ['{WALK}', 'mine/One-v0']
    num_envs = 512
    ppo = {{ gamma = 0.9 }}
    sac = {{ gamma = 0.8 }}
    [[exceptions]]
    algorithm = 'sac'
    num_envs = 32
    [[exceptions]]
    algorithm = 'sac'
    layers = [{{ action_layer = 'torque' }}]
    sac = {{ tau = 0.1 }}
    [[exceptions]]
    envs = ['mine/One-v0']
    num_envs = 9
    """
    folder = _write(tmp_path, text)
    ppo, sac, torque = (
        config_for(WALK, layer, folder=folder, algorithm=algorithm)
        for layer, algorithm in (("torque", "ppo"), ("com_wrench", "sac"), ("torque", "sac"))
    )
    assert (ppo.num_envs, ppo.ppo, ppo.sac) == (512, PPOConfig(gamma=0.9), None)
    assert (sac.num_envs, sac.ppo, sac.sac) == (32, None, SACConfig(gamma=0.8))
    assert torque.sac == SACConfig(gamma=0.8, tau=0.1)
    assert config_for("mine/One-v0", "torque", folder=folder).num_envs == 9


RL_ZOO = importlib.util.find_spec("rl_zoo3")


@pytest.mark.slow
@pytest.mark.skipif(RL_ZOO is None, reason="rl_zoo3 is not installed: pip install -e .[zoo]")
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_rl_zoo_trains_our_environments(tmp_path, algorithm):
    small = {"ppo": ("n_steps:16", "batch_size:64")}.get(
        algorithm, ("learning_starts:64", "buffer_size:1000", "gradient_steps:1")
    )
    done = subprocess.run(
        [
            *(sys.executable, "-m", "rl_zoo3.train", "--algo", algorithm, "--env", WALK),
            *("--gym-packages", "fbid_gym", "--conf-file", str(zoo.FOLDER / f"{algorithm}.yml")),
            *("--n-timesteps", "200", "--eval-freq", "-1", "--device", "cpu"),
            *("--log-folder", str(tmp_path), "--hyperparams", "n_envs:4", *small),
        ],
        cwd=zoo.FOLDER.parent,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob(f"{algorithm}/*/*QuadrupedWalk-v0.zip")), done.stdout
