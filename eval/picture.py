"""The picture in the README, and the same with what the layers see.

python -m eval.picture docs/robots.jpg
python -m eval.picture docs/overlays.jpg overlays
"""

import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
from PIL import Image

from fbid_gym.envs.overlays import EVERYTHING, RenderOptions
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.robots import ROBOTS, load

_STEPS_INTO_PUSH = 7
_WEIGHT_SHARE = 0.25
_WIDTH = 400  # pixels: what a robot needs of the frame
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


def main(path: Path, shown: RenderOptions) -> None:
    """Write the picture."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frames = [frame_of_push(robot, shown) for robot in ROBOTS]
    Image.fromarray(np.concatenate(frames, axis=1)).save(path, quality=88)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/robots.jpg")
    main(target, EVERYTHING if "overlays" in sys.argv[2:] else RenderOptions())
