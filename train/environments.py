"""Environments as episodes are played in them: many at a time, or one that draws itself."""

import importlib
import importlib.util
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.vector import VectorEnv

from fbid_gym.envs import ENVIRONMENTS  # with fbid_gym itself, which registers them
from fbid_gym.envs.overlays import EVERYTHING
from fbid_gym.errors import FbidError, InvalidValueError, RunError, UnknownOptionError
from fbid_gym.robots import several
from train.runs.config import parse_object, threads_for


def register(modules: Iterable[str]) -> None:
    """Import modules that register environments: those that the user has named, and no others.

    Args:
        modules: their names, or paths of files that end in ".py".

    Raises:
        FbidError: one that cannot be imported.
    """
    for module in modules:
        if module.endswith(".py"):
            run_file(Path(module))
        else:
            _import("register", module)


def parse_env_args(text: str) -> dict[str, Any]:
    """Read environment arguments given as a JSON object; InvalidValueError for others."""
    try:
        return parse_object(text)
    except ValueError as error:
        expected = f'a JSON object such as {{"push_force": [80, 80]}} ({error})'
        raise InvalidValueError("env_args", text, expected) from error


def run_file(file: Path) -> None:
    """Run a file of the user's, which registers what it holds.

    Raises:
        FbidError: of its own; or RunError, in one line, whatever else it raises.
    """
    if file.suffix != ".py" or not file.is_file():
        raise InvalidValueError("file", str(file), "the path of a Python file")
    name = f"run_{file.stem}"  # not that of a library that the file may be about
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look themselves up there
    try:
        spec.loader.exec_module(module)
    except FbidError:
        raise
    except Exception as error:
        said = " ".join(str(error).split())
        raise RunError(f"{file}: cannot be run: {type(error).__name__}: {said}") from error


def make_envs(env_id: str, env_args: Mapping[str, Any], num_envs: int) -> VectorEnv:
    """Make a vector environment; Gymnasium's own errors become one `FbidError`.

    Raises:
        UnknownOptionError: no such id.
        InvalidValueError: arguments the environment does not take; or the id names a module, as in
            "module:id", that cannot be imported.
    """
    options = _own_arguments(env_args)
    if env_id in ENVIRONMENTS:
        options.setdefault("num_threads", threads_for(num_envs))
    return _make(lambda: gym.make_vec(env_id, num_envs=num_envs, **options), env_id, env_args)


def make_env(env_id: str, env_args: Mapping[str, Any]) -> gym.Env[Any, Any]:
    """Make one environment that renders, with the layer's forces and plans drawn over it.

    Of several `robots` it has the first.
    `render_options` among the arguments say otherwise. Raises as `make_envs`.
    """
    options = {**first_alone(_own_arguments(env_args)), "render_mode": "rgb_array"}
    if env_id in ENVIRONMENTS:
        options.setdefault("render_options", asdict(EVERYTHING))
    return _make(lambda: gym.make(env_id, **options), env_id, env_args)


def first_alone(env_args: Mapping[str, Any]) -> dict[str, Any]:
    """Return an environment's arguments with the first of its robots, where these are several."""
    rest = {name: value for name, value in env_args.items() if name != "robots"}
    return rest | ({"robot": several(env_args["robots"])[0]} if "robots" in env_args else {})


def _import(name: str, module: str) -> None:
    try:
        importlib.import_module(module)
    except FbidError:
        raise
    except (ImportError, TypeError, ValueError) as error:
        raise InvalidValueError(name, module, f"a module that can be imported ({error})") from error


def _own_arguments(env_args: Mapping[str, Any]) -> dict[str, Any]:
    for name in ("id", "num_envs"):
        if name in env_args:
            raise InvalidValueError("environment arguments", dict(env_args), f"no {name!r}")
    return dict(env_args)


def _make(build: Any, env_id: str, env_args: Mapping[str, Any]) -> Any:
    module, named, _ = env_id.partition(":")
    if named:  # as Gymnasium would
        _import("module of the environment", module)
    try:
        return build()
    except gym.error.UnregisteredEnv as error:
        raise UnknownOptionError("environment", env_id, ENVIRONMENTS) from error
    except FbidError:  # says it better, although it is a TypeError or a ValueError, too
        raise
    except (TypeError, gym.error.Error) as error:
        if isinstance(error, TypeError) and "unexpected keyword" not in str(error):
            raise
        raise InvalidValueError(
            "environment arguments", dict(env_args), f"what {env_id} takes ({error})"
        ) from error


def step_seconds(envs: VectorEnv | gym.Env[Any, Any]) -> float:
    """Duration of one policy step, s: pictures are drawn once per step and play in real time."""
    return 1.0 / float(envs.metadata["render_fps"])
