"""A trained policy as data: observation normalisation and a small network, in plain NumPy.

An exported policy is a folder with `policy.json` (what it is for) and `policy.safetensors` (its
numbers). Loading it runs no code from the file and needs no deep learning library.

    policy = Policy.load("runs/BipedBalance-v0-base_acceleration-s3")
    actions = policy(observations)          # (N, O) -> (N, A)
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fbid_gym.bundles import load_bundle, present_bundle, save_bundle
from fbid_gym.checks import check_positive, is_number, real_numbers
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    PolicyFileError,
    ShapeError,
    UnknownOptionError,
)
from fbid_gym.options import Choice
from fbid_gym.policy.shipping import place_of

FORMAT = 2
READABLE = (1, FORMAT)
"""Formats that are read; of the first all are clipped and trained by PPO, and do not say so."""

_NAME = "policy"
_NETWORK = ("activation", "hidden", "output")  # in the JSON; the last since format 2


def _elu(x: np.ndarray) -> np.ndarray:
    return np.where(x > 0, x, np.expm1(np.minimum(x, 0)))


def _relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0)


ACTIVATIONS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "tanh": np.tanh,
    "relu": _relu,
    "elu": _elu,
}

OUTPUTS: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "clip": lambda x: np.clip(x, -1.0, 1.0),
    "tanh": np.tanh,
}
"""What keeps actions within [-1, 1]: PPO's are cut off there, SAC's squashed."""


@dataclass(frozen=True, eq=False)
class Policy:
    """A deterministic policy: normalise, clip, network, keep within the action limits.

    Computes what `predict(..., deterministic=True)` of stable-baselines3's PPO and SAC behind
    `VecNormalize` computes. Widths: O observations, A actions, L layers.
    """

    env_id: str
    """Id of the environment the policy was trained for."""
    env_args: Mapping[str, Any]
    """Arguments it was made with: `gym.make(env_id, **env_args)`."""
    mean: np.ndarray
    """(O,) float64: what is subtracted from an observation."""
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
    """What trained it; no number depends on it."""
    versions: Mapping[str, Any] = field(default_factory=dict)
    """Versions of what trained it."""
    source: str = "policy"
    """Where it came from, for error messages."""

    def __post_init__(self) -> None:
        """Check that the arrays fit together, and keep read-only copies of them.

        Raises:
            InvalidValueError: an id or algorithm that is no text, a clip or epsilon that is not
                positive.
            UnknownOptionError: the activation is not in `ACTIVATIONS`, or the output in `OUTPUTS`.
            ShapeError: an array does not fit the one before it.
            NonFiniteError: an array holds NaN or infinity.
        """
        Choice(ACTIVATIONS).check("activation", self.activation)
        Choice(OUTPUTS).check("output", self.output)
        for name in ("env_id", "algorithm"):
            if not isinstance(getattr(self, name), str):
                raise InvalidValueError(name, getattr(self, name), "text")
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
        for name, value in (
            ("mean", mean),
            ("variance", variance),
            ("weights", tuple(weights)),
            ("biases", tuple(biases)),
        ):
            object.__setattr__(self, name, value)

    @property
    def observation_size(self) -> int:
        """O, the number of observations it takes."""
        return self.mean.shape[0]

    @property
    def action_size(self) -> int:
        """A, the number of actions it gives."""
        return self.biases[-1].shape[0]

    @property
    def hidden(self) -> tuple[int, ...]:
        """Widths of the hidden layers."""
        return tuple(bias.shape[0] for bias in self.biases[:-1])

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Return the action for each observation.

        Args:
            observation: (N, O), as the environment gives it (not normalised).

        Returns:
            (N, A) float32, in [-1, 1]. The same input gives the same output; matrix products may
            round differently for another N.

        Raises:
            ShapeError: the observations are not (N, O).
            InvalidValueError: they are not numbers.
        """
        expected = f"numbers of shape (N, {self.observation_size})"
        observation = real_numbers("observation", observation, expected)
        if observation.ndim != 2 or observation.shape[1] != self.observation_size:
            raise ShapeError(
                "observation", observation.shape, f"(N, {self.observation_size}) for {self.source}"
            )
        scaled = (observation - self.mean) / np.sqrt(self.variance + self.epsilon)
        x = np.clip(scaled, -self.clip, self.clip).astype(np.float32)
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

        Raises:
            PolicyFileError: it was made for another environment, names both.
        """
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

    def save(self, folder: str | Path) -> None:
        """Write the policy folder, replacing an earlier one as a whole.

        Raises:
            InvalidValueError: the folder holds other things, or `env_args` or `versions` cannot
                be written as JSON. Nothing is written then.
        """
        data = {
            "format": FORMAT,
            "env_id": self.env_id,
            "env_args": dict(self.env_args),
            "observation_size": self.observation_size,
            "action_size": self.action_size,
            "network": {
                "activation": self.activation,
                "hidden": list(self.hidden),
                "output": self.output,
            },
            "normalisation": {"clip": self.clip, "epsilon": self.epsilon},
            "algorithm": self.algorithm,
            "trained_steps": self.trained_steps,
            "versions": dict(self.versions),
        }
        tensors = {"normalisation.mean": self.mean, "normalisation.variance": self.variance}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            tensors[f"layers.{k}.weight"], tensors[f"layers.{k}.bias"] = weight, bias
        save_bundle(Path(folder), _NAME, data, tensors)

    @classmethod
    def load(cls, path: str | Path) -> "Policy":
        """Read a policy folder, the `policy` folder of a run, or one that is `shipped:NAME`.

        Raises:
            PolicyFileError: missing, truncated, corrupt or of an unknown format; names the file,
                what it found and what it expected.
            UnknownOptionError: no policy of that name is shipped.
        """
        bundle = load_bundle(_policy_folder(place_of(path)), _NAME, PolicyFileError)
        found = bundle.data.get("format")
        if type(found) is not int or found not in READABLE:
            raise PolicyFileError(
                f"{bundle.data_file}: format is {found!r}. "
                f"Expected {' or '.join(map(str, READABLE))}."
            )
        sizes = _Sizes.read(bundle.data, bundle.data_file)
        sizes.check(bundle.tensors, bundle.tensor_file)
        tensors = bundle.tensors
        layers = range(len(sizes.widths) - 1)
        try:
            policy = cls(
                env_id=sizes.env_id,
                env_args=sizes.env_args,
                mean=tensors["normalisation.mean"],
                variance=tensors["normalisation.variance"],
                weights=tuple(tensors[f"layers.{k}.weight"] for k in layers),
                biases=tuple(tensors[f"layers.{k}.bias"] for k in layers),
                activation=sizes.activation,
                output=sizes.output,
                clip=sizes.clip,
                epsilon=sizes.epsilon,
                algorithm=sizes.algorithm,
                trained_steps=sizes.trained_steps,
                versions=sizes.versions,
                source=str(bundle.data_file.parent),
            )
        except FbidError as reason:
            named = isinstance(reason, UnknownOptionError)
            file = bundle.data_file if named else bundle.tensor_file
            raise PolicyFileError(f"{file}: {reason}") from reason
        bundle.check_digest(PolicyFileError)
        return policy


@dataclass(frozen=True)
class _Sizes:
    """What `policy.json` says, type-checked; `widths` runs from observations to actions."""

    env_id: str
    env_args: dict[str, Any]
    widths: tuple[int, ...]
    activation: str
    output: str
    clip: float
    epsilon: float
    algorithm: str
    trained_steps: int
    versions: dict[str, Any]

    @classmethod
    def read(cls, data: Mapping[str, Any], file: Path) -> "_Sizes":
        def get(key: str, kind: type | tuple[type, ...]) -> Any:
            value: Any = data
            for part in key.split("."):
                value = value.get(part) if isinstance(value, dict) else None
            # bool is an int to Python, but no size or number here may be one
            if not isinstance(value, kind) or isinstance(value, bool):
                expected = kind.__name__ if isinstance(kind, type) else "number"
                raise PolicyFileError(
                    f"{file}: {key} is {value!r}. Expected a value of type {expected}."
                )
            return value

        def size(key: str, value: Any) -> int:
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise PolicyFileError(f"{file}: {key} is {value!r}. Expected a positive integer.")
            return value

        def positive(key: str) -> float:
            value = get(key, (int, float))
            if not is_number(value) or not 0 < value < float("inf"):
                raise PolicyFileError(f"{file}: {key} is {value!r}. Expected a positive number.")
            return float(value)

        env_id = get("env_id", str)
        if ":" in env_id:  # Gymnasium imports what stands before it
            raise PolicyFileError(
                f"{file}: env_id is {env_id!r}, which names a module to import. Expected the id "
                "alone, of an environment that is registered; --register MODULE imports one of "
                "yours."
            )
        hidden = [size("network.hidden", value) for value in get("network.hidden", list)]
        known = _NETWORK if data["format"] > 1 else _NETWORK[:-1]
        unknown = sorted(data["network"].keys() - set(known))
        if unknown:
            raise PolicyFileError(
                f"{file}: network has {unknown[0]!r}. Expected {', '.join(known)} alone."
            )
        observations = size("observation_size", data.get("observation_size"))
        actions = size("action_size", data.get("action_size"))
        return cls(
            env_id=env_id,
            env_args=get("env_args", dict),
            widths=(observations, *hidden, actions),
            activation=get("network.activation", str),
            output=get("network.output", str) if data["format"] > 1 else "clip",
            clip=positive("normalisation.clip"),
            epsilon=positive("normalisation.epsilon"),
            algorithm=get("algorithm", str) if data["format"] > 1 else "ppo",
            trained_steps=get("trained_steps", int),
            versions=get("versions", dict),
        )

    def check(self, tensors: Mapping[str, np.ndarray], file: Path) -> None:
        """Raise where the tensors are not those the JSON describes."""
        expected: dict[str, tuple[int, ...]] = {
            "normalisation.mean": self.widths[:1],
            "normalisation.variance": self.widths[:1],
        }
        for k, (inputs, outputs) in enumerate(zip(self.widths, self.widths[1:], strict=False)):
            expected[f"layers.{k}.weight"] = (outputs, inputs)
            expected[f"layers.{k}.bias"] = (outputs,)
        missing = sorted(set(expected) - set(tensors))
        if missing:
            raise PolicyFileError(
                f"{file}: tensor {missing[0]!r} is missing. Expected {', '.join(expected)}."
            )
        for name, shape in expected.items():
            if tensors[name].shape != shape or tensors[name].dtype.kind != "f":
                raise PolicyFileError(
                    f"{file}: tensor {name!r} is {tensors[name].dtype} {tensors[name].shape}. "
                    f"Expected floats of shape {shape}, as {_NAME}.json says."
                )


def _policy_folder(path: Path) -> Path:
    """Find the policy in a policy folder, or in a run folder.

    Raises:
        PolicyFileError: there is neither.
    """
    if not path.exists() and present_bundle(path) == path:
        raise PolicyFileError(
            f"{path}: no such folder. Expected a policy folder ({_NAME}.json, "
            f"{_NAME}.safetensors) or a run folder with {_NAME}/."
        )
    if path.is_file():
        raise PolicyFileError(f"{path}: is a file. Expected the folder that holds the policy.")
    nested = path / _NAME
    if (path / f"{_NAME}.json").exists() or not path.exists():
        return path
    if nested.exists() or present_bundle(nested) != nested:
        return nested
    if (path / "config.json").exists():
        raise PolicyFileError(
            f"{path}: this run has exported no policy yet. Expected {_NAME}/ in it, which "
            "training writes at every evaluation and checkpoint."
        )
    raise PolicyFileError(
        f"{path}: no policy here. Expected {_NAME}.json and {_NAME}.safetensors, or a run folder "
        f"with {_NAME}/."
    )


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
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        raise NonFiniteError(name, tuple(int(i) for i in bad[0]))
    if name == "normalisation.variance" and (array < 0).any():
        raise NonFiniteError(
            "square root of " + name, tuple(int(i) for i in np.argwhere(array < 0)[0])
        )
    array.setflags(write=False)
    return array
