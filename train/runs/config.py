"""What a training run is: one frozen dataclass, and its JSON."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from fbid_gym.errors import InvalidValueError


def parse_object(text: str) -> dict[str, Any]:
    """Read a JSON object; ValueError if the text is none."""
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(value, dict):
        raise ValueError(f"{text!r} is not a JSON object")
    return value


JsonObject = Annotated[
    dict[str, Any],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="JSON",
        instance_from_str=lambda texts: parse_object(texts[0]),
        is_instance=lambda value: isinstance(value, dict),
        str_from_instance=lambda value: [json.dumps(value)],
    ),
]
"""A dictionary given on the command line as JSON, such as '{"push_force": [50, 50]}'."""


@dataclass(frozen=True)
class PPOConfig:
    """Hyperparameters of PPO, the same for every action layer."""

    n_steps: int = 64
    """Policy steps of each robot per iteration."""
    batch_size: int = 1024
    """Samples per gradient step, at most num_envs * n_steps and a divisor of that."""
    n_epochs: int = 5
    """Passes over the samples of an iteration."""
    learning_rate: float = 3e-4
    """Of Adam, at the first step."""
    learning_rate_end: float | None = None
    """Of Adam, at the last of `total_steps`; it changes evenly. None: constant. With it a run whose
    `total_steps` are raised goes on with the rate of the longer run."""
    gamma: float = 0.99
    """Discount per policy step."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip_range: float = 0.2
    """Bound on the change of an action's probability ratio."""
    ent_coef: float = 0.0
    """Weight of the entropy bonus."""
    vf_coef: float = 0.5
    """Weight of the value loss."""
    max_grad_norm: float = 0.5
    """Gradients longer than this are shortened to it."""
    target_kl: float | None = 0.02
    """Stop the passes of an iteration once the policy moved 1.5 times this far. None: never. With
    it the length of a step does not depend on how a layer scales its actions."""
    log_std_init: float = -2.0
    """Logarithm of the initial standard deviation of the actions, whose range is [-1, 1]. Robots
    that stand without a policy are shaken down by more noise than this before they learn."""
    hidden: tuple[int, ...] = (64, 64)
    """Widths of the hidden layers, of the policy and of the value network."""
    activation: Literal["tanh", "relu", "elu"] = "tanh"
    """After each hidden layer."""
    clip_observation: float = 10.0
    """Observations are scaled to unit variance, then clipped to this."""
    expected_reward: float = 0.0
    """Reward of a policy step that the value network takes for granted before it has learnt
    anything: it begins with what that sums up to. Rewards lie in [0, 1]; robots that do well from
    the start have returns that are large and hardly differ, and a network that begins at zero
    takes long to come near them."""
    normalise_reward: bool = False
    """Divide rewards by the running standard deviation of their discounted sum. Rewards lie in
    [0, 1] whatever the layer, so there is no scale to take out, and the running one would differ
    from run to run."""


@dataclass(frozen=True)
class EvaluationConfig:
    """Periodic evaluation of the deterministic policy on an environment of its own."""

    every: int = 100_000
    """Training steps between evaluations; also one before training and one after. 0: none."""
    episodes: int = 32
    """Episodes per evaluation, side by side."""
    seed: int = 10_000
    """The same for every evaluation of every run, so that all meet the same pushes."""


@dataclass(frozen=True)
class TrainConfig:
    """One training run. A run with an equal configuration is the same run, and is continued."""

    env: str = "fbid_gym/BipedBalance-v0"
    """Environment id."""
    action_layer: str = "base_acceleration"
    """Action layer the policy acts through."""
    layer_options: JsonObject = field(default_factory=dict)
    """Options of the action layer, as JSON: '{"contact_limits": "none"}'."""
    env_args: JsonObject = field(default_factory=dict)
    """Further arguments of the environment, as JSON: '{"push_force": [50, 150]}'."""
    robot: str | None = None
    """Instead of the environment's: a built-in robot, or your own: an MJCF, a URDF, a robot.toml
    or a robot.zip. The run folder keeps it."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    seed: int = 0
    """Seed of the initial network, the exploration and the robots."""
    total_steps: int = 1_000_000
    """Environment steps, over all robots, rounded up to whole iterations. May be raised later:
    a finished run then continues."""
    num_envs: int = 64
    """Robots side by side."""
    num_threads: int = 0
    """Threads stepping the robots. 0: one per core this process may use. May be another later."""
    torch_threads: int = 1
    """Threads of torch. Another number rounds sums differently, so it is part of the run."""
    checkpoint_every: int = 20_000
    """Environment steps between checkpoints. 0: only at the end and when interrupted."""
    out: Path | None = None
    """Run folder. Default: runs/<env>-<layer>-s<seed>."""
    overwrite: bool = False
    """Start anew where the run folder holds a run."""
    ppo: PPOConfig = field(default_factory=PPOConfig)
    """Hyperparameters."""
    eval: EvaluationConfig = field(default_factory=EvaluationConfig)
    """Periodic evaluation."""

    def __post_init__(self) -> None:
        """Check every value that can be checked without an environment.

        Raises:
            InvalidValueError: names the value and what is valid.
        """
        for name, (least, most) in _WHOLE.items():
            value = _at(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                too_large = isinstance(value, int) and value > most
                expected = f"an integer of at {f'most {most:,}' if too_large else f'least {least}'}"
                raise InvalidValueError(name, value, expected)
        for name, (low, high) in _RANGES.items():
            value = _at(self, name)
            if not low <= value <= high:
                raise InvalidValueError(name, value, f"a number from {low} to {high}")
        if self.ppo.target_kl is not None and not self.ppo.target_kl > 0:
            raise InvalidValueError(
                "ppo.target_kl", self.ppo.target_kl, "a positive number or None"
            )
        end = self.ppo.learning_rate_end
        if end is not None and not 0.0 <= end <= 1.0:
            raise InvalidValueError("ppo.learning_rate_end", end, "a number from 0 to 1 or None")
        if any(not 1 <= width <= _WIDEST for width in self.ppo.hidden):
            expected = f"positive widths of at most {_WIDEST:,}"
            raise InvalidValueError("ppo.hidden", self.ppo.hidden, expected)
        if self.iteration_steps < 2:
            raise InvalidValueError(
                "ppo.n_steps", self.ppo.n_steps, "num_envs * ppo.n_steps of at least 2"
            )
        if self.iteration_steps > _MOST_STEPS:
            expected = f"num_envs * ppo.n_steps of at most {_MOST_STEPS:,}; all are kept"
            raise InvalidValueError("ppo.n_steps", self.ppo.n_steps, expected)
        if self.iteration_steps % self.batch_size:
            raise InvalidValueError(
                "ppo.batch_size",
                self.ppo.batch_size,
                f"a divisor of num_envs * ppo.n_steps = {self.iteration_steps}, or more than that",
            )
        for name in ("layer_options", "env_args"):
            try:
                json.dumps(getattr(self, name), allow_nan=False)
            except (TypeError, ValueError) as error:
                raise InvalidValueError(
                    name, getattr(self, name), f"values JSON can hold ({error})"
                ) from error
        own = {"env_id", "id", "action_layer", "layer_options", "seed", "num_envs", "num_threads"}
        taken = sorted((own | ({"robot"} if self.robot else set())) & set(self.env_args))
        if taken:
            raise InvalidValueError(
                "env_args", self.env_args, f"no {taken[0]!r}, which has an option of its own"
            )

    @property
    def folder(self) -> Path:
        """The run folder."""
        if self.out is not None:
            return self.out
        name = self.env.rpartition("/")[2]
        return Path("runs") / f"{name}-{self.action_layer}-s{self.seed}"

    @property
    def threads(self) -> int:
        """Threads stepping the robots, resolved."""
        return self.num_threads or min(cores(), self.num_envs)

    @property
    def iteration_steps(self) -> int:
        """Environment steps per iteration, over all robots."""
        return self.num_envs * self.ppo.n_steps

    @property
    def batch_size(self) -> int:
        """Samples per gradient step, resolved."""
        return min(self.ppo.batch_size, self.iteration_steps)

    def make_args(self) -> dict[str, Any]:
        """Return the arguments of the environment: `gym.make(config.env, **config.make_args())`."""
        options = {"layer_options": self.layer_options} if self.layer_options else {}
        return {"action_layer": self.action_layer, **options, **self.env_args}

    def to_json(self) -> dict[str, Any]:
        """Return the resolved configuration as written to `config.json`."""
        data = asdict(self)
        # A robot of its own is named among the environment's arguments, see `train.runs.robots`.
        for name in ("env", "out", "overwrite", "robot", "feet"):
            del data[name]
        data = {"env_id": self.env, **data, "env_args": self.make_args()}
        data["num_threads"] = self.threads
        return json.loads(json.dumps(data))


_LARGE = 2**53  # beyond, floats that count skip numbers
_WHOLE = {
    "seed": (0, 2**32 - 1), "total_steps": (1, _LARGE), "num_envs": (1, 65_536),
    "num_threads": (0, 1024), "torch_threads": (1, 1024), "checkpoint_every": (0, _LARGE),
    "ppo.n_steps": (1, _LARGE), "ppo.batch_size": (2, _LARGE), "ppo.n_epochs": (1, 10_000),
    "eval.every": (0, _LARGE), "eval.episodes": (1, 65_536), "eval.seed": (0, 2**32 - 1),
}  # fmt: skip
_WIDEST = 65_536  # units of a layer
_MOST_STEPS = 100_000_000  # of an iteration
_RANGES = {
    "ppo.learning_rate": (0.0, 1.0), "ppo.gamma": (0.0, 1.0), "ppo.gae_lambda": (0.0, 1.0),
    "ppo.clip_range": (1e-6, 1.0), "ppo.ent_coef": (0.0, 1.0), "ppo.vf_coef": (0.0, 10.0),
    "ppo.max_grad_norm": (1e-6, 1e6), "ppo.log_std_init": (-10.0, 2.0),
    "ppo.clip_observation": (1e-3, 1e6), "ppo.expected_reward": (0.0, 1.0),
}  # fmt: skip


def cores() -> int:
    """Cores this process may use; where the platform does not say, those there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _at(config: object, path: str) -> Any:
    for name in path.split("."):
        config = getattr(config, name)
    return config
