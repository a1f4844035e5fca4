r"""The recipes for RL Zoo: `python -m train.recipes.zoo` writes `hyperparams/ppo.yml`.

    python -m rl_zoo3.train --algo ppo --env fbid_gym/QuadrupedWalk-v0 --gym-packages fbid_gym \
        --conf-file hyperparams/ppo.yml

One entry per environment that a recipe is for, through the layer that `train.ppo` takes by
default; the learning rate of RL Zoo falls to zero or is constant. `PPOConfig.expected_reward` it
cannot be told, so its value networks begin at zero.
"""

from pathlib import Path

from fbid_gym.errors import InvalidValueError
from train.recipes import config_for, recipes
from train.runs.config import TrainConfig
from train.runs.files import write

PATH = Path(__file__).parents[2] / "hyperparams" / "ppo.yml"

_ACTIVATIONS = {"tanh": "nn.Tanh", "relu": "nn.ReLU", "elu": "nn.ELU"}
_HEADER = "# Written by `python -m train.recipes.zoo` from train/recipes: change them there.\n"


def entry(config: TrainConfig) -> str:
    """Return the YAML of one environment.

    Raises:
        InvalidValueError: a learning rate that ends elsewhere than RL Zoo can say.
    """
    ppo = config.ppo
    if ppo.learning_rate_end not in (None, 0.0):
        raise InvalidValueError(
            "ppo.learning_rate_end", ppo.learning_rate_end, "0 or None, for RL Zoo"
        )
    rate = f"lin_{ppo.learning_rate}" if ppo.learning_rate_end == 0.0 else f"{ppo.learning_rate}"
    normalise = {"norm_reward": ppo.normalise_reward, "clip_obs": ppo.clip_observation}
    layers = ", ".join(map(str, ppo.hidden))
    policy = (
        f"dict(log_std_init={ppo.log_std_init}, activation_fn={_ACTIVATIONS[ppo.activation]}, "
        f"net_arch=[{layers}])"
    )
    values = {
        "normalize": f'"{normalise}"',
        "n_envs": config.num_envs,
        "n_timesteps": config.total_steps,
        "policy": "MlpPolicy",
        "n_steps": ppo.n_steps,
        "batch_size": config.batch_size,
        "n_epochs": ppo.n_epochs,
        "learning_rate": rate,
        "gamma": ppo.gamma,
        "gae_lambda": ppo.gae_lambda,
        "clip_range": ppo.clip_range,
        "ent_coef": ppo.ent_coef,
        "vf_coef": ppo.vf_coef,
        "max_grad_norm": ppo.max_grad_norm,
        "target_kl": "null" if ppo.target_kl is None else ppo.target_kl,
        "policy_kwargs": f'"{policy}"',
        "env_kwargs": f"{{action_layer: {config.action_layer}}}",
    }
    return f"{config.env}:\n" + "".join(f"  {name}: {value}\n" for name, value in values.items())


def text() -> str:
    """Return `hyperparams/ppo.yml`."""
    envs = sorted(env for recipe in recipes().values() for env in recipe.envs)
    entries = [entry(config_for(env, TrainConfig.action_layer)) for env in envs]
    return _HEADER + "\n" + "\n".join(entries)


if __name__ == "__main__":
    write(PATH, text())
