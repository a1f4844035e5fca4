"""The configuration of a training run: one frozen dataclass, and its JSON."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from fbid_gym.checks import check_plain
from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.options import Choice, Each, Number, Whole, check_fields


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


_LARGE = 2**53  # beyond, floats that count skip numbers
_WIDEST = 65_536  # units of a layer
_MOST_STEPS = 100_000_000  # of an iteration
MOST_TRANSITIONS = 10_000_000
"""That a replay buffer may hold: some 5 GB."""

SEED = Whole(0, 2**32 - 1)
Seed = Annotated[int, SEED]
Count = Annotated[int, Whole(1, _LARGE)]
Steps = Annotated[int, Whole(0, _LARGE)]
Robots = Annotated[int, Whole(1, 65_536)]
Share = Annotated[float, Number(0.0, 1.0)]
Widths = Annotated[tuple[int, ...], Each(Whole(1, _WIDEST), least=0)]
Activation = Annotated[Literal["tanh", "relu", "elu"], Choice(("tanh", "relu", "elu"))]


@dataclass(frozen=True)
class LearnerConfig:
    """Hyperparameters of every algorithm."""

    learning_rate: Share = 3e-4
    """Of Adam, for all that is learnt, at the first step."""
    learning_rate_end: Share | None = None
    """Of Adam, at the last of `total_steps`; it changes evenly. None: constant. With it a run whose
    `total_steps` are raised goes on with the rate of the longer run."""
    gamma: Share = 0.99
    """Discount per policy step."""
    log_std_init: Annotated[float, Number(-10.0, 2.0)] = -2.0
    """Logarithm of the initial standard deviation of the actions, whose range is [-1, 1]. Robots
    that stand without a policy are shaken down by more noise than this before they learn."""
    hidden: Widths = (64, 64)
    """Widths of the hidden layers, of the policy and of the value networks."""
    activation: Activation = "tanh"
    """After each hidden layer."""
    clip_observation: Annotated[float, Number(1e-3, 1e6)] = 10.0
    """Observations are scaled to unit variance, then clipped to this."""
    expected_reward: Share = 0.0
    """Reward of a policy step that the value networks take for granted before they have learnt
    anything: they begin with what that sums up to. Rewards lie in [0, 1]; robots that do well from
    the start have returns that are large and hardly differ, and a network that begins at zero
    takes long to come near them."""
    normalise_reward: bool = False
    """Divide rewards by the running standard deviation of their discounted sum. Rewards lie in
    [0, 1] whatever the layer, so there is no scale to take out, and the running one would differ
    from run to run."""

    def __post_init__(self) -> None:
        """Check every value by itself; `TrainConfig` checks them together."""
        check_fields(self, type(self).__name__.removesuffix("Config").lower() + ".{}")


@dataclass(frozen=True)
class PPOConfig(LearnerConfig):
    """Hyperparameters of PPO, the same for every action layer."""

    n_steps: Count = 64
    """Policy steps of each robot per iteration."""
    batch_size: Annotated[int, Whole(2, _LARGE)] = 1024
    """Samples per gradient step, at most num_envs * n_steps and a divisor of that."""
    n_epochs: Annotated[int, Whole(1, 10_000)] = 5
    """Passes over the samples of an iteration."""
    gae_lambda: Share = 0.95
    """Of generalised advantage estimation."""
    clip_range: Annotated[float, Number(1e-6, 1.0)] = 0.2
    """Bound on the change of an action's probability ratio."""
    ent_coef: Share = 0.0
    """Weight of the entropy bonus."""
    vf_coef: Annotated[float, Number(0.0, 10.0)] = 0.5
    """Weight of the value loss."""
    max_grad_norm: Annotated[float, Number(1e-6, 1e6)] = 0.5
    """Gradients longer than this are shortened to it."""
    target_kl: Annotated[float, Number(1e-12, 1e6)] | None = 0.02
    """Stop the passes of an iteration once the policy moved 1.5 times this far. None: never. With
    it the length of a step does not depend on how a layer scales its actions."""
    symmetric: bool = False
    """Make the policy symmetric: to a mirrored observation it answers with the mirrored action. For
    robots whose left side mirrors the right, and hidden layers of even widths."""


@dataclass(frozen=True)
class OffPolicyConfig(LearnerConfig):
    """Hyperparameters of SAC and CrossQ, the same for every action layer."""

    n_steps: Count = 16
    """Policy steps of each robot per iteration. An iteration is what is logged and can be stopped
    after; how often is learnt is `gradient_steps`."""
    gradient_steps: Annotated[int, Whole(1, 1_000_000)] = 16
    """Gradient steps after each policy step of all robots."""
    batch_size: Annotated[int, Whole(2, 1_000_000)] = 256
    """Transitions per gradient step, drawn from the replay buffer."""
    buffer_size: Annotated[int, Whole(1, MOST_TRANSITIONS)] = 300_000
    """Transitions that the replay buffer holds, over all robots: the latest. The run folder keeps
    them, too: some 560 bytes each of a quadruped."""
    learning_starts: Steps = 2_000
    """Environment steps, over all robots, before the value networks learn. The policy acts from
    the beginning: actions drawn evenly from all there are would only show robots that fall."""
    policy_starts: Steps = 10_000
    """Environment steps, over all robots, before the policy learns. Where it begins well, with the
    zero action, value networks that know little yet would lead it away at once."""
    ent_coef: Annotated[float, Number(1e-9, 1e3)] = 0.001
    """Temperature at the beginning: what a nat of entropy is worth in rewards. It is then learnt,
    so that the entropy becomes `target_entropy`. Rewards lie in [0, 1] and differ by hundredths
    where robots walk by a zero action: with 0.01 the noise grew until it was nearly all there is,
    before the value networks knew what it costs."""
    target_entropy: Annotated[float, Number(-10.0, 0.69)] = -1.0
    """Nats per action. -1: a standard deviation of about 0.09."""
    hidden: Widths = (128, 128)
    """Widths of the hidden layers, of the policy and of SAC's value networks."""
    activation: Activation = "relu"
    """After each hidden layer."""


@dataclass(frozen=True)
class SACConfig(OffPolicyConfig):
    """Hyperparameters of SAC. Rewards and noise are as in PPO."""

    tau: Annotated[float, Number(1e-6, 1.0)] = 0.005
    """Share of the value networks that their slow copies take over in each gradient step."""


@dataclass(frozen=True)
class CrossQConfig(OffPolicyConfig):
    """Hyperparameters of CrossQ. Rewards and noise are as in PPO."""

    policy_delay: Count = 3
    """Gradient steps of the value networks to one of the policy and of the temperature."""
    value_hidden: Widths = (256, 256)
    """Widths of the hidden layers of the value networks; `hidden` is the policy's."""


Hyperparameters = PPOConfig | SACConfig | CrossQConfig
ALGORITHMS: dict[str, type[Hyperparameters]] = {
    "ppo": PPOConfig,
    "sac": SACConfig,
    "crossq": CrossQConfig,
}
"""Algorithm -> its hyperparameters: the field of `TrainConfig` of the same name."""
SAME_NAMES = {
    "ppo": ("n_steps", "n_epochs", "gamma", "gae_lambda", "clip_range", "ent_coef", "vf_coef",
            "max_grad_norm", "target_kl"),
    "sac": ("batch_size", "buffer_size", "gamma", "tau"),
    "crossq": ("batch_size", "buffer_size", "gamma", "policy_delay"),
}  # fmt: skip
"""Algorithm -> hyperparameters that stable-baselines3 calls so as well, and takes as they are."""


@dataclass(frozen=True)
class EvaluationConfig:
    """Periodic evaluation of the deterministic policy on an environment of its own."""

    every: Steps = 100_000
    """Training steps between evaluations; also one before training and one after. 0: none."""
    episodes: Robots = 32
    """Episodes per evaluation, side by side."""
    seed: Seed = 10_000
    """The same for every evaluation of every run, so that all meet the same pushes."""

    def __post_init__(self) -> None:
        """Check every value."""
        check_fields(self, "eval.{}")


@dataclass(frozen=True)
class TrainConfig:
    """One training run. A run with an equal configuration is the same run, and is continued."""

    algorithm: Annotated[str, tyro.conf.Suppress] = "ppo"
    """Algorithm, one of `ALGORITHMS`. On the command line it is the program that is run."""
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
    robots: tuple[str, ...] = ()
    """Train on several robots, so many environments of each: built-in ones, files, or drawn ones,
    "zoo:quadruped:0-15". With --env-args '{"observation": "body"}' they need not have as many
    joints."""
    start: str | None = None
    """Begin with a policy instead of the zero action: a run folder, an exported policy or
    "shipped:NAME", for as many observations and actions and of the same network."""
    seed: Seed = 0
    """Seed of the initial network, the exploration and the robots."""
    total_steps: Count = 1_000_000
    """Environment steps, over all robots, rounded up to whole iterations. May be raised later:
    a finished run then continues."""
    num_envs: Robots = 64
    """Robots side by side."""
    num_threads: Annotated[int, Whole(0, 1024)] = 0
    """Threads stepping the robots. 0: one per core this process may use. May be another later."""
    stagger: bool = True
    """Truncate the robots' first episodes, evenly spread, so that those to come do not begin and
    end together: once an episode a learner would see nothing but beginnings."""
    torch_threads: Annotated[int, Whole(0, 1024)] = 0
    """Threads of torch while it learns. 0: as many as step the robots. Another number rounds sums
    differently: a run that is continued keeps the one it began with."""
    checkpoint_every: Steps = 20_000
    """Environment steps between checkpoints. 0: only at the end and when interrupted."""
    out: Path | None = None
    """Run folder. Default: runs/<env>-<layer>-s<seed>, with the algorithm where it is not PPO."""
    overwrite: bool = False
    """Start anew where the run folder holds a run."""
    track: bool = False
    """Also send the learning curve to Weights & Biases."""
    ppo: tyro.conf.AvoidSubcommands[PPOConfig | None] = None
    """Hyperparameters of PPO; None where something else learns."""
    sac: tyro.conf.AvoidSubcommands[SACConfig | None] = None
    """Hyperparameters of SAC; None where something else learns."""
    crossq: tyro.conf.AvoidSubcommands[CrossQConfig | None] = None
    """Hyperparameters of CrossQ; None where something else learns."""
    eval: EvaluationConfig = field(default_factory=EvaluationConfig)
    """Periodic evaluation."""

    def __post_init__(self) -> None:
        """Check every value that can be checked without an environment.

        Raises:
            InvalidValueError: names the value and what is valid.
        """
        if self.algorithm not in tuple(ALGORITHMS):  # whatever a file says it is
            raise UnknownOptionError("algorithm", self.algorithm, ALGORITHMS)
        for name in ALGORITHMS.keys() - {self.algorithm}:
            if getattr(self, name) is not None:
                raise InvalidValueError(
                    "hyperparameters", name, f"those of {self.algorithm!r} alone"
                )
        if getattr(self, self.algorithm) is None:
            object.__setattr__(self, self.algorithm, ALGORITHMS[self.algorithm]())
        check_fields(self)
        self._check_together()
        for name in ("layer_options", "env_args"):
            check_plain(name, getattr(self, name))
            try:
                json.dumps(getattr(self, name), allow_nan=False)
            except (TypeError, ValueError) as error:
                raise InvalidValueError(
                    name, getattr(self, name), f"values JSON can hold ({error})"
                ) from error
        own = {"env_id", "id", "action_layer", "layer_options", "seed", "num_envs", "num_threads"}
        if self.robot is not None and self.robots:
            raise InvalidValueError("robots", self.robots, "none beside --robot, which is one")
        own |= {name for name in ("robot", "robots") if getattr(self, name)}
        taken = sorted(own & set(self.env_args))
        if taken:
            raise InvalidValueError(
                "env_args", self.env_args, f"no {taken[0]!r}, which has an option of its own"
            )

    def _check_together(self) -> None:
        """Check conditions on several values."""
        own = self.hyperparameters
        if isinstance(own, OffPolicyConfig):
            least, most = self.iteration_steps, MOST_TRANSITIONS
            if not least <= own.buffer_size <= most:
                between = f"a number from num_envs * {self.algorithm}.n_steps = {least} to {most}"
                raise InvalidValueError(f"{self.algorithm}.buffer_size", own.buffer_size, between)
            return
        if own.symmetric and any(width % 2 for width in own.hidden):
            raise InvalidValueError("ppo.hidden", own.hidden, "even widths, with ppo.symmetric")
        if self.iteration_steps < 2:
            raise InvalidValueError(
                "ppo.n_steps", own.n_steps, "num_envs * ppo.n_steps of at least 2"
            )
        if self.iteration_steps > _MOST_STEPS:
            expected = f"num_envs * ppo.n_steps of at most {_MOST_STEPS:,}; all are kept"
            raise InvalidValueError("ppo.n_steps", own.n_steps, expected)
        if self.iteration_steps % self.batch_size:
            raise InvalidValueError(
                "ppo.batch_size",
                own.batch_size,
                f"a divisor of num_envs * ppo.n_steps = {self.iteration_steps}, or more than that",
            )

    @property
    def hyperparameters(self) -> Hyperparameters:
        """Those of the algorithm."""
        found: Hyperparameters = getattr(self, self.algorithm)
        return found

    @property
    def as_they_are(self) -> dict[str, Any]:
        """Those that stable-baselines3 takes as they are."""
        return {name: getattr(self.hyperparameters, name) for name in SAME_NAMES[self.algorithm]}

    @property
    def folder(self) -> Path:
        """The run folder."""
        if self.out is not None:
            return self.out
        name = self.env.rpartition("/")[2]
        learns = "" if self.algorithm == "ppo" else f"-{self.algorithm}"
        return Path("runs") / f"{name}-{self.action_layer}{learns}-s{self.seed}"

    @property
    def threads(self) -> int:
        """Threads stepping the robots, resolved."""
        return self.num_threads or threads_for(self.num_envs)

    @property
    def learning_threads(self) -> int:
        """Threads of torch while it learns, resolved."""
        return self.torch_threads or self.threads

    @property
    def iteration_steps(self) -> int:
        """Environment steps per iteration, over all robots."""
        return self.num_envs * self.hyperparameters.n_steps

    @property
    def batch_size(self) -> int:
        """Samples per gradient step, resolved: PPO has those of an iteration to draw from."""
        size = self.hyperparameters.batch_size
        return min(size, self.iteration_steps) if self.algorithm == "ppo" else size

    def make_args(self) -> dict[str, Any]:
        """Return the arguments of the environment: `gym.make(config.env, **config.make_args())`."""
        options = {"layer_options": self.layer_options} if self.layer_options else {}
        return {"action_layer": self.action_layer, **options, **self.env_args}

    def to_json(self) -> dict[str, Any]:
        """Return the resolved configuration as written to `config.json`."""
        data = asdict(self)
        # A robot of its own is named among the environment's arguments, see `train.runs.robots`.
        for name in ("env", "out", "overwrite", "track", "robot", "feet", "robots"):
            del data[name]
        for name in ALGORITHMS.keys() - {self.algorithm}:
            del data[name]
        data = {"env_id": self.env, **data, "env_args": self.make_args()}
        data |= {"num_threads": self.threads, "torch_threads": self.learning_threads}
        return json.loads(json.dumps(data))


_BEFORE: dict[str, Any] = {"algorithm": "ppo", "stagger": False, "start": None}


def completed(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Return a `config.json` with entries that older ones lack, as their runs had them."""
    whole = {**_BEFORE, **stored}
    if isinstance(whole.get("ppo"), Mapping):
        whole["ppo"] = {"symmetric": False, **whole["ppo"]}
    if isinstance(whole.get("env_args"), Mapping):
        whole["env_args"] = unusual(str(whole.get("env_id")), whole["env_args"])
    return whole


def unusual(env_id: str, env_args: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that an environment of ours does not have anyway, as JSON has them."""
    usual = json.loads(json.dumps(ENVIRONMENTS.get(env_id, {})))
    return {k: value for k, value in env_args.items() if k not in usual or usual[k] != value}


def algorithm_of(stored: Mapping[str, Any]) -> str:
    """Return the algorithm that a `config.json` or a checkpoint names."""
    return str(completed(stored)["algorithm"])


_LEAST_PER_THREAD = 32  # 20 robots walk faster on one thread than on two, 64 on two


def cores() -> int:
    """Cores this process may use; where the platform does not say, those there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads_for(num_envs: int) -> int:
    """Threads that step so many robots fastest: those with few of them wait for Python's lock."""
    return max(1, min(cores(), num_envs // _LEAST_PER_THREAD))
