r"""Film policies, on their own robot or on many, side by side in one picture that moves.

All have the same seed, so that what draws on it is the same for all, such as commands and pushes.

python -m eval.grid shipped:any-quadruped --robots go1 quadruped zoo:quadruped:1000-1009 \
    --out any_robot.webp
python -m eval.grid shipped:QuadrupedWalk-v1/base_acceleration \
    shipped:QuadrupedWalk-v1/joint_position --out layers.webp
"""

import io
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console

from eval.rollout import filmed, load_player
from eval.transfer import distinct
from eval.video import HEIGHT, WIDTH, Clip, encoded
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number, Whole
from fbid_gym.robots import Robot, several
from train.command import run_command
from train.environments import parse_env_args
from train.progress import progress
from train.runs.files import check_output, write


@dataclass(frozen=True)
class GridConfig:
    """Film policies, on their own robot or on many, side by side."""

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders, exported policies or `shipped:NAME`."""
    out: Path
    """The film: .webp, which pages show as a picture, or .mp4."""
    seconds: Annotated[float, Number(0.1, 600.0, "s")] = 6.0
    """Length, s."""
    robots: tuple[str, ...] = ()
    """Built-in robots, paths of files, "menagerie:NAME", or "zoo:quadruped:1000-1009"; each policy
    is filmed on each. Default: on its own, the first where it learnt with several."""
    columns: Annotated[int, Whole(1, 100)] = 4
    """Films in a row."""
    width: Annotated[int, Whole(16, WIDTH)] = 240
    """Of each picture, pixels."""
    fps: Annotated[float, Number(0.1, 50.0, "1/s")] = 12.5
    """Pictures per second, at most."""
    seed: Annotated[int, Whole(0, 2**63)] = 0
    """Of every episode."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object; they replace those of the policy."""


def run(config: GridConfig) -> None:
    """Do what the command line asks."""
    console = Console()
    check_output(config.out, "out", tuple(_ENCODE))
    if not config.sources:
        raise InvalidValueError("sources", "()", "at least one policy")
    env_args = {"render_options": {}} | parse_env_args(config.env_args)  # nothing drawn over them
    robots = several(config.robots) if config.robots else (None,)
    both = list(product(config.sources, robots))
    titles = distinct([_title(*pair, len(config.sources)) for pair in both])
    clips = dict[str, Clip]()
    with progress(console, "films") as tell:
        for title, (source, robot) in zip(titles, both, strict=True):
            player = load_player(source, env_args, robot)
            clips[title] = filmed(player, config.seed, config.seconds, "", config.fps)
            tell(len(clips), len(both), title)
    size = config.width // 2 * 2, config.width * HEIGHT // WIDTH // 2 * 2
    frames = tiled({title: clip.frames for title, clip in clips.items()}, size, config.columns)
    film = _ENCODE[config.out.suffix.lower()](frames, min(clip.fps for clip in clips.values()))
    write(config.out, film)
    fell = [title for title, clip in clips.items() if clip.ended is not None]
    console.print(f"{len(clips) - len(fell)} of {len(clips)} stay up", highlight=False)
    if fell:
        console.print(f"fallen: {', '.join(fell)}", markup=False, highlight=False)
    console.print(f"wrote {config.out}, {len(film) / 1e6:.1f} MB", markup=False, highlight=False)


def _title(source: Path, robot: Robot | None, sources: int) -> str:
    """Name who is filmed: the policy where there are several, the robot where it is given."""
    said = [source.name] if robot is None or sources > 1 else []
    if robot is not None:
        said += [robot.name, f"{robot.mass:.3g} kg", f"{robot.num_joints} joints"]
    return ", ".join(said)


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
