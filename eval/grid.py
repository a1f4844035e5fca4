r"""Film a policy on many robots at once, side by side in one picture that moves.

python -m eval.grid shipped:any-quadruped --robots go1 quadruped zoo:quadruped:1000-1009 \
    --out any_robot.webp
"""

import io
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console

from eval.rollout import filmed, load_player
from eval.video import HEIGHT, WIDTH, encoded
from fbid_gym.options import Number, Whole
from fbid_gym.robots import several
from train.command import run_command
from train.environments import parse_env_args
from train.progress import progress
from train.runs.files import check_output, write


@dataclass(frozen=True)
class GridConfig:
    """Film a policy on many robots, side by side."""

    source: Annotated[Path, tyro.conf.Positional]
    """Run folder, exported policy or `shipped:NAME`."""
    robots: tuple[str, ...]
    """Built-in robots, paths of files, "menagerie:NAME", or "zoo:quadruped:1000-1009"."""
    out: Path
    """The film: .webp, which pages show as a picture, or .mp4."""
    seconds: Annotated[float, Number(0.1, 600.0, "s")] = 6.0
    """Length, s."""
    columns: Annotated[int, Whole(1, 100)] = 4
    """Robots in a row."""
    width: Annotated[int, Whole(16, WIDTH)] = 240
    """Of each picture, pixels."""
    fps: Annotated[float, Number(0.1, 50.0, "1/s")] = 12.5
    """Pictures per second, at most."""
    seed: Annotated[int, Whole(0, 2**63)] = 0
    """Of every robot's episode."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object; they replace those of the policy."""


def run(config: GridConfig) -> None:
    """Do what the command line asks."""
    console = Console()
    check_output(config.out, "out", tuple(_ENCODE))
    robots = several(config.robots)
    env_args = {"render_options": {}} | parse_env_args(config.env_args)  # nothing drawn over them
    clips = []
    with progress(console, "robots") as tell:
        for number, robot in enumerate(robots):
            player = load_player(config.source, env_args, robot)
            clips.append(filmed(player, config.seed, config.seconds, "", config.fps))
            tell(number + 1, len(robots), robot.name)
    size = config.width // 2 * 2, config.width * HEIGHT // WIDTH // 2 * 2
    titles = [f"{robot.name}, {robot.mass:.3g} kg, {robot.num_joints} joints" for robot in robots]
    films = dict(zip(titles, (clip.frames for clip in clips), strict=True))
    frames, encode = tiled(films, size, config.columns), _ENCODE[config.out.suffix.lower()]
    film = encode(frames, clips[0].fps)
    write(config.out, film)
    fell = [robot.name for robot, clip in zip(robots, clips, strict=True) if clip.ended is not None]
    console.print(f"{len(robots) - len(fell)} of {len(robots)} stay up", highlight=False)
    if fell:
        console.print(f"fallen: {', '.join(fell)}", markup=False, highlight=False)
    console.print(f"wrote {config.out}, {len(film) / 1e6:.1f} MB", markup=False, highlight=False)


def tiled(
    films: Mapping[str, list[np.ndarray]], size: tuple[int, int], columns: int
) -> list[np.ndarray]:
    """Return films side by side, row by row; one that ends before others stays at its last picture.

    `films` has pictures (height, width, 3) uint8 by title; `size` is the width and height of each
    film in the result.
    """
    columns = min(columns, len(films))
    rows, (width, height) = -(-len(films) // columns), size
    font, result = ImageFont.load_default(11), []
    for k in range(max(map(len, films.values()))):
        sheet = Image.new("RGB", (columns * width, rows * height), "white")
        draw = ImageDraw.Draw(sheet)
        for place, (title, film) in enumerate(films.items()):
            picture = Image.fromarray(film[min(k, len(film) - 1)])
            x, y = place % columns * width, place // columns * height
            sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (x, y))
            at, edge = (x + 6, y + 6), "white"  # also before a dark sky
            draw.text(at, title, "black", font, "lt", stroke_width=1, stroke_fill=edge)
        result.append(np.asarray(sheet))
    return result


def webp(frames: list[np.ndarray], fps: float, quality: int = 40) -> bytes:
    """Encode as an animated WebP that goes on for ever."""
    first, *rest = (Image.fromarray(frame) for frame in frames)
    packed = io.BytesIO()
    how = {"duration": round(1000.0 / fps), "loop": 0, "quality": quality, "method": 4}
    first.save(packed, "WEBP", save_all=True, append_images=rest, **how)
    return packed.getvalue()


_ENCODE = {".webp": webp, ".mp4": encoded}


if __name__ == "__main__":
    sys.exit(run_command("eval.grid", GridConfig, run, about=__doc__))
