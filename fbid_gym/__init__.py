"""Gymnasium environments for floating-base robots with exchangeable action layers."""

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    # MuJoCo chooses its renderer when it is imported, and its default needs a display.
    os.environ.setdefault("MUJOCO_GL", "egl")

from fbid_gym.errors import FbidError

if TYPE_CHECKING:
    from fbid_gym.envs.rsl_rl import make_rsl_rl as make_rsl_rl
    from fbid_gym.envs.sb3 import make_sb3

__all__ = ["FbidError", "make_sb3"]  # those that others bring are found by name

__version__: str

_EXTRAS = {"make_rsl_rl": ("rsl_rl", "clients"), "make_sb3": ("sb3", "train")}
"""Public name -> module in `envs`, and the extra of what that needs."""

try:
    from fbid_gym.envs import register
except ModuleNotFoundError as error:  # a robot that runs a policy needs no Gymnasium
    if (error.name or "").partition(".")[0] != "gymnasium":
        raise
else:
    register()


def __getattr__(name: str) -> Any:
    # These bring torch: seconds that only those who train with it should wait for.
    if name in _EXTRAS:
        module, extra = _EXTRAS[name]
        try:
            return getattr(importlib.import_module(f"fbid_gym.envs.{module}"), name)
        except ModuleNotFoundError as error:
            missing = (error.name or "").partition(".")[0]
            if missing not in ("stable_baselines3", "torch", "rsl_rl", "tensordict"):
                raise
            raise FbidError(
                f"{name} needs {missing}, which is not installed. It comes with the extra "
                f"{extra!r}: pip install 'fbid_gym[{extra}]'."
            ) from error
    if name == "__version__":
        from importlib.metadata import version

        return version("fbid_gym")
    raise AttributeError(f"module 'fbid_gym' has no attribute {name!r}")
