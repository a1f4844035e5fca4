"""One episode as a small H.264 clip, with the pushes captioned."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import imageio_ffmpeg
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fbid_gym.errors import InvalidValueError
from train.episodes import Actor

WIDTH, HEIGHT = 640, 480


@dataclass(frozen=True)
class Clip:
    """A recorded episode."""

    frames: list[np.ndarray]  # (HEIGHT, WIDTH, 3) uint8 each
    fps: float
    pushes: np.ndarray
    """(T, 3) N, force on the robot at each policy step; zeros where the task reports none."""
    ended: float | None
    """Time at which the robot fell or diverged, s. None if it reached the end of the clip."""

    def mp4(self) -> bytes:
        """Encode as H.264, see `encoded`."""
        return encoded(self.frames, self.fps)


def encoded(frames: list[np.ndarray], fps: float, quality: int = 27) -> bytes:
    """Encode pictures (height, width, 3) uint8, of even sizes, as H.264, which every browser plays.

    The quality is x264's constant rate factor: lower is better and larger.
    """
    height, width, _ = frames[0].shape
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(path),
            (width, height),
            fps=fps,
            codec="libx264",
            quality=None,
            macro_block_size=2,
            output_params=["-crf", str(quality), "-preset", "slow", "-movflags", "+faststart"],
        )
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
        writer.close()
        return path.read_bytes()


def record(
    env: gym.Env[Any, Any],
    actor: Actor,
    seed: int,
    seconds: float,
    title: str = "",
    fps: float = 25.0,
) -> Clip:
    """Play one episode and draw it. After a fall the last picture stays, so clips run in step.

    The metadata's `render_fps` of the scalar environment is the policy rate, as Gymnasium's own
    video wrapper takes it to be; the clip has at most `fps` pictures per second, and is shorter
    where the episode reaches its time limit. The title is written in the upper corner.

    Raises:
        InvalidValueError: the environment draws no pictures.
    """
    if env.render_mode != "rgb_array":
        raise InvalidValueError("render_mode", env.render_mode, "'rgb_array'")
    rate = float(env.metadata["render_fps"])
    every = max(1, round(rate / fps))
    observation, _ = env.reset(seed=seed)
    frames: list[np.ndarray] = []
    pushes: list[np.ndarray] = []
    ended: float | None = None
    truncated = False
    last: Any = None
    for step in range(max(1, round(seconds * rate))):
        if ended is None:
            action = actor(np.asarray(observation)[None])[0]
            observation, _, terminated, truncated, info = env.step(action)
            pushes.append(np.asarray(info.get("push", np.zeros(3)), dtype=float))
            if terminated or step % every == 0:
                last = env.render()
            if terminated:
                ended = (step + 1) / rate
        if step % every == 0:
            frames.append(_annotate(last, title, step / rate, pushes[-1], ended))
        if ended is None and truncated:
            break
    return Clip(frames, rate / every, np.array(pushes).reshape(-1, 3), ended)


def _annotate(
    picture: np.ndarray, title: str, time: float, push: np.ndarray, ended: float | None
) -> np.ndarray:
    image = Image.fromarray(np.asarray(picture, dtype=np.uint8))
    if image.size != (WIDTH, HEIGHT):
        image = image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(image, "RGBA")
    if title:
        label(draw, (14, 14), title, (20, 24, 32, 190))
    strength = float(np.linalg.norm(push))
    if ended is not None:
        label(draw, (14, HEIGHT - 44), f"fell after {ended:.1f} s", (176, 42, 48, 230))
    elif strength > 0:
        label(draw, (14, HEIGHT - 44), f"push {strength:.0f} N", (196, 90, 8, 230))
    clock = f"{time:.1f} s"
    width = draw.textlength(clock, font=ImageFont.load_default(20))
    label(draw, (WIDTH - 30 - int(width), 14), clock, (20, 24, 32, 140))
    return np.asarray(image)


def label(
    draw: ImageDraw.ImageDraw,
    corner: tuple[int, int],
    text: str,
    colour: tuple[int, int, int, int],
    size: int = 20,
) -> None:
    """Write on a plate of a colour; `size` is of the letters, pixels."""
    x, y = corner
    font, high, beside = ImageFont.load_default(size), 1.5 * size, 0.4 * size
    width = draw.textlength(text, font=font)
    draw.rounded_rectangle((x, y, x + width + 2 * beside, y + high), 0.3 * size, fill=colour)
    draw.text((x + beside, y + high / 2), text, font=font, fill=(255, 255, 255, 255), anchor="lm")
