"""Start of an episode: a posture with small random offsets, facing anywhere."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fbid_gym.options import Number, check_fields
from fbid_gym.robots import Robot

Noise = Annotated[float, Number(0.0, 1.0)]


@dataclass(frozen=True)
class Start:
    """Random offsets from the posture in which an episode begins.

    Attributes:
        joint_noise: rad (m for slides), largest offset of each joint.
        velocity_noise: m/s and rad/s, largest offset of each coordinate's velocity.
    """

    joint_noise: Noise = 0.02
    velocity_noise: Noise = 0.05

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_fields(self)

    def draw(
        self, robot: Robot, qpos: np.ndarray, qvel: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw a state with a random heading about a posture.

        Args:
            robot: whose state.
            qpos: (nq,) posture, the base seen along the axes of the feet. Where it stands, and how
                high, is for the simulation to settle, since that depends on the terrain.
            qvel: (nv,) its velocity, along the same axes.
            rng: of this episode.

        Returns:
            qpos (nq,) and qvel (nv,).
        """
        heading = rng.uniform(-np.pi, np.pi)
        qpos, qvel = qpos.copy(), qvel.copy()
        qpos[3:7] = _turned(heading, qpos[3:7])
        noise = rng.uniform(-self.joint_noise, self.joint_noise, size=robot.num_joints)
        qpos[7:] = np.clip(qpos[7:] + noise, robot.joint_range[:, 0], robot.joint_range[:, 1])
        cosine, sine = np.cos(heading), np.sin(heading)
        qvel[:2] = cosine * qvel[0] - sine * qvel[1], sine * qvel[0] + cosine * qvel[1]
        qvel += rng.uniform(-self.velocity_noise, self.velocity_noise, size=robot.nv)
        return qpos, qvel


def _turned(heading: float, quaternion: np.ndarray) -> np.ndarray:
    """Turn an orientation (w, x, y, z) about the world's vertical by `heading` rad."""
    cosine, sine = np.cos(heading / 2.0), np.sin(heading / 2.0)
    w, x, y, z = quaternion
    return np.array(
        [cosine * w - sine * z, cosine * x - sine * y, cosine * y + sine * x, cosine * z + sine * w]
    )
