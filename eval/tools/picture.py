"""The picture in the README, the same with what the layers see, and one of every kind of ground.

python -m eval.tools.picture docs/robots.jpg
python -m eval.tools.picture docs/overlays.jpg overlays
python -m eval.tools.picture docs/terrain.jpg terrain
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from PIL import Image

from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.overlays import EVERYTHING, RenderOptions, size_of
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.options import Choice
from fbid_gym.robots import ROBOTS, load
from fbid_gym.robots.terrain import LEVELLED
from train.command import run_command
from train.runs.files import check_output

_STEPS_INTO_PUSH = 7
_WEIGHT_SHARE = 0.25
_WIDTH = 400  # pixels: what a robot needs of the frame
_DIFFICULTY = 0.75
_AWAY, _FAR_AWAY = 4.5, 18.0  # of the camera, in the robot's size
_SEED = 2473  # an episode in which all face the camera and are pushed from the side


def frame_of_push(robot: str, shown: RenderOptions) -> np.ndarray:
    """Draw a robot that balances through a push without a policy: (H, 400, 3) uint8."""
    force = _WEIGHT_SHARE * load(robot).weight
    env = RobotEnv(
        robot,
        action_layer="base_acceleration",
        render_mode="rgb_array",
        render_options=asdict(shown),
        push_force=(force, force),
    )
    env.reset(seed=_SEED)
    still = np.zeros(6)
    pushed = 0
    while pushed < _STEPS_INTO_PUSH:
        info = env.step(still)[4]
        pushed += bool(np.any(info["push"]))
    frame = np.asarray(env.render())
    env.close()
    margin = (frame.shape[1] - _WIDTH) // 2
    return frame[:, margin : margin + _WIDTH]


def frame_of_ground(terrain: str) -> np.ndarray:
    """Draw a robot where it begins to walk, and the ground around it: (240, 320, 3) uint8."""
    away = size_of(Stance.of(load("go1"))) * (_FAR_AWAY if terrain == "mixed" else _AWAY)
    place: dict[str, Any] = {"task": "walk", "terrain": terrain, "difficulty": _DIFFICULTY}
    camera = {"distance": away, "elevation": -25.0}
    drawn = {"width": 320, "height": 240, "default_camera_config": camera}
    env = RobotEnv("go1", **place, render_mode="rgb_array", **drawn)
    env.reset(seed=_SEED)
    frame = np.asarray(env.render())
    env.close()
    return frame


def in_rows(frames: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """Put frames of one size into rows of so many."""
    rows = [frames[first : first + columns] for first in range(0, len(frames), columns)]
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def _pushed(shown: RenderOptions) -> np.ndarray:
    return in_rows([frame_of_push(robot, shown) for robot in ROBOTS], len(ROBOTS))


PICTURES: dict[str, Callable[[], np.ndarray]] = {
    "robots": lambda: _pushed(RenderOptions()),
    "overlays": lambda: _pushed(EVERYTHING),
    "terrain": lambda: in_rows([frame_of_ground(terrain) for terrain in LEVELLED], 3),
}


@dataclass(frozen=True)
class PictureConfig:
    """Draw a picture of the documentation."""

    path: tyro.conf.Positional[Path]
    """Where to."""
    kind: Annotated[tyro.conf.Positional[str], Choice(PICTURES, "picture")] = "robots"
    """The robots, each pushed; with what their layers see; or every kind of ground."""


def main(config: PictureConfig) -> None:
    """Draw, and write."""
    check_output(config.path, "path", (".jpg", ".png"))
    Image.fromarray(PICTURES[config.kind]()).save(config.path, quality=88)


if __name__ == "__main__":
    sys.exit(run_command("eval.tools.picture", PictureConfig, main, about=__doc__))
