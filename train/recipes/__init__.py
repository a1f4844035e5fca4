"""Recipes of training: the TOML files beside this one, chosen by environment id.

A recipe gives other defaults to `train.ppo` and the other algorithms where those of `TrainConfig`
do not do; the command line has priority over both. Environments that no recipe names are trained by
the defaults.

    envs = ["fbid_gym/QuadrupedWalk-v0"]     # which it is for
    num_envs = 512                           # or total_steps, stagger, torch_threads
    [ppo]                                    # of PPOConfig, where PPO learns
    [sac]                                    # of SACConfig, where SAC learns; [crossq] likewise
    [eval]                                   # of EvaluationConfig
    [[exceptions]]                           # other values, for action layers with such options,
    layers = [{ action_layer = "joint_position", layer_options = { reference = "home" } }]
    ppo = { log_std_init = -0.7 }
    [[exceptions]]                           # for an algorithm, or for some of the environments;
    algorithm = "sac"                        # of several of these, where all hold
    num_envs = 64

`train.recipes.zoo` says the same to RL Zoo.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from fbid_gym.errors import RunError, UnknownOptionError
from train.runs.config import ALGORITHMS, EvaluationConfig, TrainConfig

FOLDER = Path(__file__).parent
NONE = "none"
"""Stands for the defaults where a recipe is asked for by name."""

SETTINGS = ("total_steps", "num_envs", "stagger", "torch_threads", *ALGORITHMS, "eval")
"""Fields of `TrainConfig` that a recipe may set."""


@dataclass(frozen=True)
class Recipe:
    """Other defaults than those of `TrainConfig`."""

    name: str  # of its file
    envs: tuple[str, ...]  # environment ids that it is for
    # By field of `TrainConfig`; "ppo", "sac", "crossq" and "eval" hold settings in turn.
    settings: dict[str, Any]
    # Further settings, each with one or more of what it is for: "layers", each its "action_layer",
    # and "layer_options" where it takes such; "algorithm"; "envs".
    exceptions: tuple[dict[str, Any], ...]

    def settings_for(
        self, env_id: str, algorithm: str, action_layer: str, layer_options: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the settings for an environment, an algorithm and a layer with its options."""
        found = dict(self.settings)
        for exception in self.exceptions:
            layers = exception.get("layers")
            if (
                env_id in exception.get("envs", (env_id,))
                and exception.get("algorithm", algorithm) == algorithm
                and (layers is None or any(_fits(x, action_layer, layer_options) for x in layers))
            ):
                found = merged(found, _settings_of(exception))
        return {k: v for k, v in found.items() if k not in ALGORITHMS or k == algorithm}


@cache
def recipes(folder: Path = FOLDER) -> dict[str, Recipe]:
    """Return the recipes of a folder by name.

    Raises:
        RunError: a file that is no TOML, or two recipes for one environment.
        UnknownOptionError: a setting that there is not.
    """
    found = {path.stem: _read(path) for path in sorted(folder.glob("*.toml"))}
    by_env: dict[str, str] = {}
    for recipe in found.values():
        for env in recipe.envs:
            if env in by_env:
                raise RunError(f"{folder}: {by_env[env]} and {recipe.name} are both for {env}.")
            by_env[env] = recipe.name
    return found


def recipe_for(env_id: str, name: str | None = None, folder: Path = FOLDER) -> Recipe:
    """Return the recipe of an environment, or that of a name.

    Args:
        env_id: the environment; one that no recipe names gets the defaults.
        name: of a recipe, whatever it is for; "none" for the defaults.
        folder: where the recipes are.

    Raises:
        UnknownOptionError: no recipe of this name.
    """
    known = recipes(folder)
    if name is None:
        name = next((its.name for its in known.values() if env_id in its.envs), NONE)
    if name == NONE:
        return Recipe(NONE, (), {}, ())
    if name not in known:
        raise UnknownOptionError("recipe", name, [*known, NONE])
    return known[name]


def config_for(
    env_id: str,
    action_layer: str,
    layer_options: Mapping[str, Any] | None = None,
    name: str | None = None,
    folder: Path = FOLDER,
    *,
    algorithm: str = "ppo",
) -> TrainConfig:
    """Return the configuration of a training as the recipe has it.

    The name and the folder are those of `recipe_for`.

    Raises:
        FbidError: no such recipe or algorithm, or values of it that are not valid.
    """
    if algorithm not in tuple(ALGORITHMS):  # whatever a file says it is
        raise UnknownOptionError("algorithm", algorithm, ALGORITHMS)
    given = dict(layer_options or {})
    recipe = recipe_for(env_id, name, folder)
    settings = recipe.settings_for(env_id, algorithm, action_layer, given)
    own = settings.pop(algorithm, {})
    parts: dict[str, Any] = {
        algorithm: ALGORITHMS[algorithm](**own),
        "eval": EvaluationConfig(**settings.pop("eval", {})),
    }
    parts |= {"env": env_id, "action_layer": action_layer, "layer_options": given}
    try:
        return TrainConfig(algorithm=algorithm, **settings, **parts)
    except TypeError as error:
        raise RunError(f"recipe {recipe.name!r}: {error}.") from error


def check(where: str, settings: Mapping[str, Any], valid: Mapping[str, Any]) -> None:
    """Raise UnknownOptionError for settings that are none of `valid`, a nested dictionary."""
    for key, value in settings.items():
        if key not in valid:
            raise UnknownOptionError(f"setting of {where}", key, valid)
        if isinstance(valid[key], Mapping):
            if not isinstance(value, Mapping):
                raise RunError(f"{where}: {key} is {value!r}. Expected a table.")
            check(where, value, valid[key])


def _read(path: Path) -> Recipe:
    try:
        data = tomllib.loads(path.read_text())
    except tomllib.TOMLDecodeError as error:
        raise RunError(f"{path}: is no TOML: {error}.") from error
    envs, exceptions, valid = data.pop("envs", []), data.pop("exceptions", []), valid_settings()
    _check_envs(path, envs)
    if not isinstance(exceptions, list) or not all(isinstance(one, dict) for one in exceptions):
        raise RunError(f"{path}: exceptions is {exceptions!r}. Expected [[exceptions]] tables.")
    check(f"recipe {path.stem!r}", data, valid)
    for exception in exceptions:
        layers, learns = exception.get("layers"), exception.get("algorithm")
        _check_envs(path, exception.get("envs", []))
        of_all = not {"algorithm", "envs"} & exception.keys()
        if (of_all or layers is not None) and (
            not isinstance(layers, list) or not all(map(_is_layer, layers))
        ):
            raise RunError(
                f"{path}: an exception for layers {layers!r}. Expected a list of tables, an "
                "action_layer in each, and a table of layer_options where it takes such."
            )
        if learns not in (None, *ALGORITHMS):
            raise UnknownOptionError(f"algorithm of recipe {path.stem!r}", learns, ALGORITHMS)
        check(f"recipe {path.stem!r}", _settings_of(exception), valid)
    return Recipe(path.stem, tuple(envs), data, tuple(exceptions))


def _check_envs(path: Path, envs: Any) -> None:
    if not isinstance(envs, list) or not all(isinstance(env, str) for env in envs):
        raise RunError(f"{path}: envs is {envs!r}. Expected a list of environment ids.")


def valid_settings() -> dict[str, Any]:
    """Return the names of all settings, nested."""
    parts = {**ALGORITHMS, "eval": EvaluationConfig}
    return {
        name: {item.name: "" for item in fields(parts[name])} if name in parts else ""
        for name in SETTINGS
    }


def _is_layer(layer: Any) -> bool:
    return (
        isinstance(layer, dict)
        and isinstance(layer.get("action_layer"), str)
        and isinstance(layer.get("layer_options", {}), dict)
    )


def merged(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of two nested dictionaries; where both have one, the other's."""
    found = dict(one)
    for name, value in other.items():
        known = found.get(name)
        both = isinstance(value, Mapping) and isinstance(known, Mapping)
        found[name] = merged(known, value) if both else value  # type: ignore[arg-type]
    return found


def _fits(layer: Mapping[str, Any], action_layer: str, options: Mapping[str, Any]) -> bool:
    wanted = layer.get("layer_options", {})
    same = all(options.get(name) == value for name, value in wanted.items())
    return layer["action_layer"] == action_layer and same


def _settings_of(exception: Mapping[str, Any]) -> dict[str, Any]:
    of = ("layers", "algorithm", "envs")
    return {name: value for name, value in exception.items() if name not in of}
