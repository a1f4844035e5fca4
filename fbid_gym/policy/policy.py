"""A trained policy as data: observation normalisation and a small network, in plain NumPy.

An exported policy is one safetensors file: its arrays, and what it is for as JSON in the metadata.
Loading it runs no code from the file and needs no deep learning library.

    policy = Policy.load("runs/BipedBalance-v0-base_acceleration-s3")
    actions = policy(observations)          # (N, O) -> (N, A)
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fbid_gym.bundles import save_bundle
from fbid_gym.checks import check_finite, check_plain, check_positive, real_numbers
from fbid_gym.errors import InvalidValueError, NonFiniteError, PolicyFileError, ShapeError
from fbid_gym.options import Choice
from fbid_gym.policy.card import Card
from fbid_gym.policy.policy_file import FORMAT, place_of, read_policy


def _within(x: np.ndarray, most: float) -> np.ndarray:
    return np.minimum(np.maximum(x, -most), most)


ACTIVATIONS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0),
    "elu": lambda x: np.maximum(x, 0) + np.expm1(np.minimum(x, 0)),
}

OUTPUTS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "clip": lambda x: _within(x, 1.0),
    "tanh": np.tanh,
}
"""Outputs that keep actions within [-1, 1]: PPO's are cut off, SAC's squashed."""


@dataclass(frozen=True, eq=False)
class Policy:
    """A deterministic policy: normalise, clip, network, keep within the action limits.

    Computes what `predict(..., deterministic=True)` of stable-baselines3's PPO and SAC behind
    `VecNormalize` computes. Widths: O observations, A actions, L layers. Its fields are the entries
    of its file, and their types what is read there.
    """

    env_id: str
    """Id of the environment the policy was trained for."""
    env_args: Mapping[str, Any]
    """Arguments it was made with: `gym.make(env_id, **env_args)`."""
    mean: np.ndarray
    """(O,) float64, subtracted from an observation."""
    variance: np.ndarray
    """(O,) float64: an observation is divided by sqrt(variance + epsilon)."""
    weights: tuple[np.ndarray, ...]
    """L arrays, float32, each (outputs, inputs)."""
    biases: tuple[np.ndarray, ...]
    """L arrays, float32, each (outputs,)."""
    activation: str = "tanh"
    """After every layer but the last: one of `ACTIVATIONS`."""
    output: str = "clip"
    """After the last: one of `OUTPUTS`."""
    clip: float = 10.0
    """Normalised observations are clipped to [-clip, clip]."""
    epsilon: float = 1e-8
    """Added to the variance."""
    trained_steps: int = 0
    """Environment steps of training, over all robots."""
    algorithm: str = "ppo"
    """Algorithm that trained it; no number depends on it."""
    versions: Mapping[str, Any] = field(default_factory=dict)
    """Versions of the software that trained it."""
    card: Card | None = None
    """Of a policy that comes with the package."""
    source: str = "policy"
    """Where it came from, for error messages."""

    def __post_init__(self) -> None:
        """Check that the arrays fit together, and keep read-only copies of them.

        Raises:
            InvalidValueError: an id or algorithm that is no text, an id that names a module to
                import, a clip or epsilon that is not positive.
            UnknownOptionError: the activation is not in `ACTIVATIONS`, or the output in `OUTPUTS`.
            ShapeError: an array does not fit the one before it.
            NonFiniteError: an array holds NaN or infinity.
        """
        Choice(ACTIVATIONS).check("activation", self.activation)
        Choice(OUTPUTS).check("output", self.output)
        for name in ("env_id", "algorithm"):
            if not isinstance(getattr(self, name), str):
                raise InvalidValueError(name, getattr(self, name), "text")
        if ":" in self.env_id:  # Gymnasium imports what stands before it
            expected = "the id alone of a registered environment; --register MODULE imports yours"
            raise InvalidValueError("env_id", self.env_id, expected)
        check_positive(clip=self.clip, epsilon=self.epsilon)
        if not self.weights or len(self.weights) != len(self.biases):
            raise ShapeError(
                "weights", (len(self.weights),), f"one per bias ({len(self.biases)}), at least one"
            )
        mean = _frozen("normalisation.mean", self.mean, (None,), np.float64)
        width = mean.shape[0]
        variance = _frozen("normalisation.variance", self.variance, (width,), np.float64)
        weights, biases = [], []
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            weights.append(_frozen(f"layers.{k}.weight", weight, (None, width), np.float32))
            width = weights[-1].shape[0]
            biases.append(_frozen(f"layers.{k}.bias", bias, (width,), np.float32))
        frozen = {"mean": mean, "variance": variance}
        vars(self).update(frozen, weights=tuple(weights), biases=tuple(biases))

    @cached_property
    def _spread(self) -> np.ndarray:
        return np.sqrt(self.variance + self.epsilon)

    @property
    def observation_size(self) -> int:
        """O, the number of observations it takes."""
        return self.mean.shape[0]

    @property
    def leads(self) -> bool:
        """Whether its environment observes more after what the policy sees: for a critic."""
        return str(self.env_args.get("observation")).startswith("measured")

    @property
    def action_size(self) -> int:
        """A, the number of actions it gives."""
        return self.biases[-1].shape[0]

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action for each observation.

        Args:
            observation: (N, O), as the environment gives it (not normalised); of one for robots
                also with what follows for a critic.

        Returns:
            (N, A) float32, in [-1, 1]. The same input gives the same output; matrix products may
            round differently for another N.

        Raises:
            ShapeError: the observations are not (N, O).
            InvalidValueError: they are not numbers.
            NonFiniteError: one of them is NaN or infinite.
        """
        expected = f"numbers of shape (N, {self.observation_size})"
        observation = real_numbers("observation", observation, expected)
        if self.leads and observation.ndim == 2:
            observation = observation[:, : self.observation_size]
        if observation.ndim != 2 or observation.shape[1] != self.observation_size:
            raise ShapeError(
                "observation", observation.shape, f"(N, {self.observation_size}) for {self.source}"
            )
        check_finite("observation", observation)
        x = _within((observation - self.mean) / self._spread, self.clip).astype(np.float32)
        activate = ACTIVATIONS[self.activation]
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = activate(x @ weight.T + bias)
        return OUTPUTS[self.output](x @ self.weights[-1].T + self.biases[-1])

    def check(
        self,
        *,
        env_id: str | None = None,
        observation_size: int | None = None,
        action_size: int | None = None,
    ) -> None:
        """Check that the policy fits an environment; what is None is not checked.

        Raises PolicyFileError for one that was made for another, and names both.
        """
        if self.leads and observation_size is not None:
            observation_size = min(observation_size, self.observation_size)
        for name, found, expected in (
            ("env_id", self.env_id, env_id),
            ("observation_size", self.observation_size, observation_size),
            ("action_size", self.action_size, action_size),
        ):
            if expected is not None and found != expected:
                raise PolicyFileError(
                    f"{self.source}: the policy has {name} {found!r}. "
                    f"Expected {expected!r}, that of this environment."
                )

    def save(self, file: str | Path) -> None:
        """Write a file such as "mine.safetensors", replacing an earlier one as a whole.

        Raises:
            InvalidValueError: `file` is a folder, or `env_args` or `versions` cannot be written as
                JSON. Nothing is written then.
        """
        check_plain("env_args", self.env_args)
        data = {
            **{name: getattr(self, name) for name in _ENTRIES},
            "format": FORMAT,
            "env_args": dict(self.env_args),
            "versions": dict(self.versions),
            "card": msgspec.to_builtins(self.card),
        }
        tensors = {"normalisation.mean": self.mean, "normalisation.variance": self.variance}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            tensors[f"layers.{k}.weight"], tensors[f"layers.{k}.bias"] = weight, bias
        save_bundle(Path(file), data, tensors)

    @classmethod
    def load(cls, path: str | Path) -> "Policy":
        """Read a file, the policy of a run folder, or one that is `shipped:NAME`.

        Folders with a `policy.json`, as policies were before, are read as well.

        Raises:
            PolicyFileError: missing, truncated, corrupt or of an unknown format; names the file,
                what it found and what it expected.
            UnknownOptionError: no policy of that name is shipped.
        """
        file, (data, tensors) = read_policy(place_of(path))
        layers = range(sum(name.endswith(".weight") for name in tensors))
        weights, biases = ([f"layers.{k}.{x}" for k in layers] for x in ("weight", "bias"))
        names = ("normalisation.mean", "normalisation.variance", *weights, *biases)
        for kind, held, known in (("tensor", tensors, names), ("entry", data, _ENTRIES)):
            if odd := sorted(held.keys() ^ set(known)):
                raise PolicyFileError(
                    f"{file}: {kind} {odd[0]!r} is missing or unknown. Expected {', '.join(known)}."
                )
        for name, tensor in tensors.items():
            if tensor.dtype.kind != "f":
                found = f"{file}: tensor {name!r} is {tensor.dtype}"
                raise PolicyFileError(f"{found}. Expected floats.")
        arrays = {
            "mean": tensors["normalisation.mean"],
            "variance": tensors["normalisation.variance"],
            "weights": tuple(tensors[name] for name in weights),
            "biases": tuple(tensors[name] for name in biases),
        }
        try:
            return msgspec.convert({**data, **arrays, "source": str(file)}, cls)
        except msgspec.ValidationError as reason:
            raise PolicyFileError(f"{file}: {reason}") from reason


_ARRAYS = ("mean", "variance", "weights", "biases")
_ENTRIES = tuple(f.name for f in fields(Policy) if f.name not in (*_ARRAYS, "source"))
"""Fields of a policy that its file has as JSON."""


def _frozen(name: str, array: np.ndarray, shape: tuple[int | None, ...], dtype: type) -> np.ndarray:
    """Return a read-only copy, checked: None in `shape` stands for any length but zero."""
    array = np.array(array, dtype=dtype)
    fits = array.ndim == len(shape) and all(
        (want is None and have > 0) or want == have
        for want, have in zip(shape, array.shape, strict=False)
    )
    if not fits:
        wanted = ", ".join("any" if want is None else str(want) for want in shape)
        raise ShapeError(name, array.shape, f"({wanted})")
    check_finite(name, array)
    if name == "normalisation.variance" and (array < 0).any():
        raise NonFiniteError(
            "square root of " + name, tuple(int(i) for i in np.argwhere(array < 0)[0])
        )
    array.setflags(write=False)
    return array
