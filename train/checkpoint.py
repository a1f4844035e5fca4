"""The exact state of a training run between two iterations, as arrays and JSON.

The next iteration depends on: the network and its optimisers, the normalisation statistics,
the last observation, the robots, and three global random generators (torch draws the actions,
NumPy shuffles the samples), and what `Algorithm.arrays` adds. What its log depends on: the last
episodes and the counters. A replay buffer is kept by `train.replay`.
"""

import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from fbid_gym.bundles import Tensors, load_bundle, save_bundle
from fbid_gym.checks import is_number
from fbid_gym.envs.sb3 import SB3VecEnv
from fbid_gym.errors import RunError
from train.algorithms import ALGORITHMS
from train.learner import moments, normaliser, robots
from train.runs.config import algorithm_of

FORMAT = 2
_MANY = 2**62
_WORDS = 624  # of NumPy's Mersenne twister
_TABLES = ("progress", "evaluations")
_MISFIT = (KeyError, ValueError, RuntimeError, TypeError, IndexError, AttributeError, OverflowError)


def save(file: Path, algorithm: str, learner: BaseAlgorithm, counters: Mapping[str, Any]) -> None:
    """Write a checkpoint of a learner between two iterations, in place of the one before.

    The counters are JSON values to store along.
    """
    tensors, state = _capture(algorithm, learner)
    head = {"format": FORMAT, "algorithm": algorithm}
    save_bundle(file, {**head, **state, "counters": dict(counters)}, tensors)


def restore(file: Path, algorithm: str, learner: BaseAlgorithm) -> dict[str, Any]:
    """Put a checkpoint into a learner of the same configuration; return the counters of `save`.

    Raises:
        RunError: missing, truncated, corrupt, or from another network or environment; names the
            file.
    """
    state, tensors = load_bundle(file, RunError)
    if state.get("format") != FORMAT:
        raise RunError(f"{file}: format is {state.get('format')!r}. Expected {FORMAT}.")
    learnt = algorithm_of(state)
    if learnt != algorithm:
        raise RunError(f"{file}: is a checkpoint of {learnt}. Expected {algorithm}.")
    try:
        _check_counters(state)
        _put_back(algorithm, learner, tensors, state)
        return dict(state["counters"])
    except _MISFIT as reason:
        raise RunError(
            f"{file}: does not fit this run: {type(reason).__name__}: {reason}. "
            "Expected a checkpoint of the same network and environment."
        ) from reason


def _check_counters(state: Mapping[str, Any]) -> None:
    """Raise an error for numbers that no training has; a generator off its array reads memory."""
    numpy_state, counters = state["rng_numpy"], state["counters"]
    whole = {
        "steps": (state["steps"], _MANY),
        "updates": (state["updates"], _MANY),
        "falls": (counters["falls"], _MANY),
        "rng_numpy.pos": (numpy_state["pos"], _WORDS),
        "rng_numpy.has_gauss": (numpy_state["has_gauss"], 1),
        **{f"bytes.{name}": (counters["bytes"][name], _MANY) for name in _TABLES},
    }
    for name, (value, most) in whole.items():
        if type(value) is not int or not 0 <= value <= most:
            raise ValueError(f"{name} is {value!r}, not a whole number from 0 to {most}")
    numbers = {name: state[name] for name in ("obs_count", "return_count")}
    for name, value in {**numbers, "wall_seconds": counters["wall_seconds"]}.items():
        if not is_number(value) or not 0.0 <= value < np.inf:
            raise ValueError(f"{name} is {value!r}, not a number of at least 0")
    best = counters["best_return"]
    if best is not None and not (is_number(best) and abs(best) < np.inf):
        raise ValueError(f"best_return is {best!r}, no number")


def _capture(algorithm: str, learner: BaseAlgorithm) -> tuple[Tensors, dict[str, Any]]:
    normalise = normaliser(learner)
    episodes = learner.ep_info_buffer
    assert episodes is not None and learner._last_obs is not None
    version, python_words, python_gauss = random.getstate()
    numpy_state = np.random.get_state(legacy=False)
    observation, discounted = moments(learner)
    tensors: Tensors = {
        "obs_mean": observation.mean,
        "obs_variance": observation.var,
        "return_mean": np.asarray(discounted.mean),
        "return_variance": np.asarray(discounted.var),
        "discounted_returns": normalise.returns,
        "last_obs": np.asarray(learner._last_obs),
        "last_episode_starts": np.asarray(learner._last_episode_starts),
        "episode_returns": np.array([float(e["r"]) for e in episodes], dtype=np.float64),
        "episode_lengths": np.array([int(e["l"]) for e in episodes], dtype=np.int64),
        "rng_torch": torch.get_rng_state().numpy(),
        "rng_numpy": np.asarray(numpy_state["state"]["key"]),
        "rng_python": np.array(python_words, dtype=np.int64),
    }
    for name, value in learner.policy.state_dict().items():
        tensors[f"network.{name}"] = value.detach().numpy()
    for optimiser, its in ALGORITHMS[algorithm].optimisers(learner).items():
        for index, averages in its.state_dict()["state"].items():
            for name, value in averages.items():
                tensors[f"{optimiser}.{index}.{name}"] = value.detach().numpy()
    for name, own in ALGORITHMS[algorithm].arrays(learner).items():
        tensors[f"learner.{name}"] = own
    for name, array in cast(SB3VecEnv, robots(learner)).state_dict().items():
        tensors[f"robots.{name}"] = np.asarray(array)
    state = {
        "steps": learner.num_timesteps,
        "updates": learner._n_updates,
        "obs_count": float(observation.count),
        "return_count": float(discounted.count),
        "rng_numpy": {
            "pos": int(numpy_state["state"]["pos"]),
            "has_gauss": int(numpy_state["has_gauss"]),
            "gauss": float(numpy_state["gauss"]),
        },
        "rng_python": {"version": version, "gauss": python_gauss},
    }
    return tensors, state


def _put_back(
    algorithm: str, learner: BaseAlgorithm, tensors: Tensors, state: Mapping[str, Any]
) -> None:
    normalise = normaliser(learner)
    learner.policy.load_state_dict(
        {name: torch.from_numpy(array) for name, array in _under(tensors, "network").items()}
    )
    for optimiser, its in ALGORITHMS[algorithm].optimisers(learner).items():
        averages: dict[int, dict[str, torch.Tensor]] = {}
        for key, array in _under(tensors, optimiser).items():
            index, _, name = key.partition(".")
            averages.setdefault(int(index), {})[name] = torch.from_numpy(array)
        groups = its.state_dict()["param_groups"]
        its.load_state_dict({"state": averages, "param_groups": groups})
    own = ALGORITHMS[algorithm].arrays(learner)
    sizes = {f"learner.{name}": array.shape for name, array in own.items()}
    sizes |= {"discounted_returns": (learner.n_envs,), "rng_numpy": (_WORDS,)}
    sizes["last_obs"] = (learner.n_envs, *(learner.observation_space.shape or ()))
    for name, size in sizes.items():
        if tensors[name].shape != size:
            raise ValueError(f"{name} is {tensors[name].shape}, not {size}")
    for name, array in own.items():
        array[...] = tensors[f"learner.{name}"]
    for name, statistics in zip(("obs", "return"), moments(learner), strict=True):
        mean, variance = tensors[f"{name}_mean"], tensors[f"{name}_variance"]
        if mean.shape != np.shape(statistics.mean) or variance.shape != mean.shape:
            raise ValueError(
                f"{name}_mean is {mean.shape} and {name}_variance {variance.shape}, "
                f"not {np.shape(statistics.mean)}"
            )
        statistics.mean, statistics.var = mean, variance
        statistics.count = float(state[f"{name}_count"])
    normalise.returns = tensors["discounted_returns"]
    learner._last_obs = tensors["last_obs"]
    learner._last_episode_starts = tensors["last_episode_starts"]
    learner.num_timesteps, learner._n_updates = int(state["steps"]), int(state["updates"])
    assert learner.ep_info_buffer is not None
    learner.ep_info_buffer.clear()
    learner.ep_info_buffer.extend(
        {"r": float(r), "l": int(n)}
        for r, n in zip(tensors["episode_returns"], tensors["episode_lengths"], strict=True)
    )
    cast(SB3VecEnv, robots(learner)).load_state_dict(_under(tensors, "robots"))

    # The generators last: nothing above may draw from them afterwards.
    numpy_state = state["rng_numpy"]
    np.random.set_state(
        {
            "bit_generator": "MT19937",
            "state": {"key": tensors["rng_numpy"], "pos": numpy_state["pos"]},
            "has_gauss": numpy_state["has_gauss"],
            "gauss": numpy_state["gauss"],
        }
    )
    python_state = state["rng_python"]
    words = tuple(int(word) for word in tensors["rng_python"])
    random.setstate((python_state["version"], words, python_state["gauss"]))
    torch.set_rng_state(torch.from_numpy(tensors["rng_torch"]))


def _under(tensors: Tensors, prefix: str) -> Tensors:
    """Return the tensors whose name starts with the prefix and a dot, without these."""
    start = prefix + "."
    return {k.removeprefix(start): v for k, v in tensors.items() if k.startswith(start)}
