"""The picture in the README: `python -m eval.picture docs/robots.jpg`."""

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
from PIL import Image

import fbid_gym  # noqa: F401  registers the environments

ROBOTS = ("fbid_gym/BipedBalance-v0", "fbid_gym/QuadrupedBalance-v0")
_STEPS_INTO_PUSH = 7
_WEIGHT_SHARE = 0.25


def frame_of_push(env_id: str) -> np.ndarray:
    """Draw a robot that balances through a push without a policy: (H, W, 3) uint8."""
    env = gym.make(env_id, action_layer="base_acceleration", render_mode="rgb_array")
    weight = env.unwrapped.batch.robot.weight
    force = _WEIGHT_SHARE * weight
    env.close()
    env = gym.make(
        env_id,
        action_layer="base_acceleration",
        render_mode="rgb_array",
        push_force=(force, force),
    )
    env.reset(seed=4)
    still = np.zeros(env.action_space.shape, np.float32)
    pushed = 0
    while pushed < _STEPS_INTO_PUSH:
        info = env.step(still)[4]
        pushed += bool(np.any(info["push"]))
    frame = np.asarray(env.render())
    env.close()
    return frame


def main(path: Path) -> None:
    """Write the picture."""
    path.parent.mkdir(parents=True, exist_ok=True)
    frames = [frame_of_push(env_id) for env_id in ROBOTS]
    Image.fromarray(np.concatenate(frames, axis=1)).save(path, quality=88)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/robots.jpg"))
