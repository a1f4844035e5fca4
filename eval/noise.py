r"""How much torque the noise of exploration is, layer by layer, and what noise makes them alike.

python -m eval.noise --env fbid_gym/QuadrupedWalk-v0 --layers base_acceleration joint_position

PPO explores by normal noise on the actions. The same noise is another torque through another
layer; this measures it about the zero action, and says which `--ppo.log-std-init` makes that of
the first layer with every other one.
"""

import math
import sys
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.table import Table

from eval.wording import number
from fbid_gym.actions import LAYERS
from fbid_gym.checks import check_choices
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Whole, check_fields
from train.command import run_command
from train.environments import make_envs
from train.recipes import config_for

WARM_UP = (7, 18, 29, 40, 51)
"""Policy steps by the zero action before the noisy one: different phases of a gait."""


@dataclass(frozen=True)
class NoiseConfig:
    """Print how much torque the noise of exploration is, layer by layer."""

    env: str = "fbid_gym/QuadrupedWalk-v0"
    """Environment id."""
    layers: tuple[str, ...] = ("base_acceleration", "joint_position")
    """Action layers; the others are matched with the first."""
    robots: Annotated[int, Whole(2, 65_536)] = 128
    """Side by side, each with noise of its own."""
    seed: Annotated[int, Whole(0, 2**31)] = 0
    """Of robots and noise."""


def noise_torque(env_id: str, layer: str, std: float, robots: int, seed: int) -> float:
    """Return the torque, root mean square over joints, that noise on the actions adds, N m.

    Two groups of the same robots go the same way by the zero action; in the last policy step the
    actions of one group have noise. It has no mean, so the squares of what it adds add up.

    Args:
        env_id: Gymnasium id of an environment that reports `torque_rms`.
        layer: action layer.
        std: standard deviation of the noise.
        robots: how many.
        seed: of robots and noise.

    Raises:
        InvalidValueError: the environment reports no torques.
    """
    rng = np.random.default_rng(seed)
    added = []
    for steps in WARM_UP:
        squares = []
        for scale in (0.0, std):
            envs = make_envs(env_id, {"action_layer": layer}, robots)
            envs.reset(seed=seed)
            still = np.zeros(envs.action_space.shape or (robots, 0), dtype=np.float32)
            for _ in range(steps):
                envs.step(still)
            noise = scale * rng.standard_normal(still.shape)
            info = envs.step(np.clip(noise, -1.0, 1.0).astype(np.float32))[4]
            envs.close()
            if "torque_rms" not in info:
                raise InvalidValueError("env", env_id, "an environment that reports torque_rms")
            squares.append(np.mean(np.square(info["torque_rms"])))
        added.append(squares[1] - squares[0])
    return math.sqrt(max(float(np.mean(added)), 0.0))


def main(config: NoiseConfig) -> None:
    """Measure and print."""
    check_fields(config)
    check_choices("action layer", config.layers, LAYERS)
    table = Table("layer", "log_std_init", "torque, N m", "log_std_init for that of the first")
    first = math.nan
    for layer in config.layers:
        usual = config_for(config.env, layer).ppo
        assert usual is not None
        std = math.exp(usual.log_std_init)
        torque = noise_torque(config.env, layer, std, config.robots, config.seed)
        first = torque if math.isnan(first) else first
        matched = usual.log_std_init + math.log(first / torque)
        table.add_row(layer, str(usual.log_std_init), number(torque), f"{matched:.2f}")
    Console().print(table)


if __name__ == "__main__":
    sys.exit(run_command("eval.noise", NoiseConfig, main, about=__doc__))
