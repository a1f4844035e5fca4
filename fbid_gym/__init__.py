"""Gymnasium environments for floating-base robots with exchangeable action layers."""

import os
import sys
from typing import TYPE_CHECKING, Any

if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    # MuJoCo chooses its renderer when it is imported, and its default needs a display.
    os.environ.setdefault("MUJOCO_GL", "egl")

from fbid_gym.envs import register
from fbid_gym.errors import FbidError

if TYPE_CHECKING:
    from fbid_gym.envs.sb3 import make_sb3

__all__ = ["FbidError", "make_sb3"]

register()


def __getattr__(name: str) -> Any:
    # stable-baselines3 brings torch: seconds that only those who train with it should wait for.
    if name == "make_sb3":
        try:
            from fbid_gym.envs.sb3 import make_sb3
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] not in ("stable_baselines3", "torch"):
                raise
            raise FbidError(
                f"make_sb3 needs {error.name}, which is not installed. It comes with the extra "
                "'train': pip install 'fbid_gym[train]'."
            ) from error
        return make_sb3
    raise AttributeError(f"module 'fbid_gym' has no attribute {name!r}")
