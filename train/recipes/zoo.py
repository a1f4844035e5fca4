r"""The recipes for RL Zoo: `python -m train.recipes.zoo` writes `hyperparams`, a file an algorithm.

    python -m rl_zoo3.train --algo ppo --env fbid_gym/QuadrupedWalk-v0 --gym-packages fbid_gym \
        --conf-file hyperparams/ppo.yml

One entry per environment that a recipe is for, through the layer that `train.ppo` takes by
default; the learning rate of RL Zoo falls to zero or is constant. `expected_reward` it cannot be
told, so its value networks begin at zero; nor can its SAC and CrossQ be told `log_std_init` and
`policy_starts`, so these begin with more noise, and with random actions until `learning_starts`.
"""

import argparse
from pathlib import Path
from typing import Any

from fbid_gym.errors import InvalidValueError
from train.recipes import config_for, recipes
from train.runs.config import (
    ALGORITHMS,
    CrossQConfig,
    LearnerConfig,
    OffPolicyConfig,
    PPOConfig,
    TrainConfig,
)
from train.runs.files import write

FOLDER = Path(__file__).parents[2] / "hyperparams"

_ACTIVATIONS = {"tanh": "nn.Tanh", "relu": "nn.ReLU", "elu": "nn.ELU"}
_HEADER = "# Written by `python -m train.recipes.zoo` from train/recipes: change them there.\n"


def entry(config: TrainConfig) -> str:
    """Return the YAML of one environment.

    Raises:
        InvalidValueError: a learning rate that ends elsewhere than RL Zoo can say, a target entropy
            that it cannot, or a symmetric policy.
    """
    own = config.hyperparameters
    if own.learning_rate_end not in (None, 0.0):
        name = f"{config.algorithm}.learning_rate_end"
        raise InvalidValueError(name, own.learning_rate_end, "0 or None, for RL Zoo")
    rate = f"lin_{own.learning_rate}" if own.learning_rate_end == 0.0 else f"{own.learning_rate}"
    normalise = {"norm_reward": own.normalise_reward, "clip_obs": own.clip_observation}
    values = {
        "normalize": f'"{normalise}"',
        "n_envs": config.num_envs,
        "n_timesteps": config.total_steps,
        "policy": "MlpPolicy",
        **{name: "null" if value is None else value for name, value in config.as_they_are.items()},
        "batch_size": config.batch_size,
        **(_ppo(own) if isinstance(own, PPOConfig) else _off_policy(config.algorithm, own)),
        "learning_rate": rate,
        "env_kwargs": f"{{action_layer: {config.action_layer}}}",
    }
    return f"{config.env}:\n" + "".join(f"  {name}: {value}\n" for name, value in values.items())


def _ppo(own: PPOConfig) -> dict[str, Any]:
    if own.symmetric:
        raise InvalidValueError("ppo.symmetric", True, "false, for RL Zoo")
    return {"policy_kwargs": f'"dict(log_std_init={own.log_std_init}, {_network(own)})"'}


def _off_policy(algorithm: str, own: OffPolicyConfig) -> dict[str, Any]:
    if own.target_entropy != -1.0:
        raise InvalidValueError(f"{algorithm}.target_entropy", own.target_entropy, "-1, for RL Zoo")
    return {
        "train_freq": 1,
        "gradient_steps": own.gradient_steps,
        "learning_starts": own.learning_starts,
        "ent_coef": f"auto_{own.ent_coef}",
        "policy_kwargs": f'"dict({_network(own)})"',
    }


def _network(own: LearnerConfig) -> str:
    widths: Any = list(own.hidden)
    if isinstance(own, CrossQConfig):
        widths = f"dict(pi={widths}, qf={list(own.value_hidden)})"
    return f"activation_fn={_ACTIVATIONS[own.activation]}, net_arch={widths}"


def text(algorithm: str) -> str:
    """Return the YAML file of an algorithm."""
    envs = sorted(env for recipe in recipes().values() for env in recipe.envs)
    layer = TrainConfig.action_layer
    entries = [entry(config_for(env, layer, algorithm=algorithm)) for env in envs]
    return _HEADER + "\n" + "\n".join(entries)


if __name__ == "__main__":
    argparse.ArgumentParser("python -m train.recipes.zoo", description=__doc__).parse_args()
    for algorithm in ALGORITHMS:
        write(FOLDER / f"{algorithm}.yml", text(algorithm))
