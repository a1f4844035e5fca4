r"""See who walks in another physics engine as well: policies of the package, and zero actions.

python -m eval.engines --out docs/engines.csv
python -m eval.engines QuadrupedWalk-v0/com_wrench runs/my_run --episodes 5
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from eval.engines.trial import Outcomes, in_bullet
from eval.rollout import Player, play_player
from fbid_gym.options import Number, Whole
from fbid_gym.policy import shipped
from fbid_gym.policy.policy_file import PREFIX
from train.command import run_command
from train.episodes import Episodes
from train.runs.files import check_output, write
from train.runs.reading import load
from train.runs.tables import to_csv

TASKS = ("QuadrupedWalk-v0", "BipedWalk-v0")  # whose shipped policies are played by default


@dataclass(frozen=True)
class EnginesConfig:
    """Play policies and zero actions in MuJoCo and in Bullet, the same episodes in both."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Names of shipped policies, or run folders. Default: the shipped ones that walk."""
    episodes: Annotated[int, Whole(1, 1000)] = 10
    """Of each."""
    seconds: Annotated[float, Number(0.1, 1000.0, "s")] = 10.0
    """Of an episode."""
    seed: Annotated[int, Whole(0, 2**31)] = 50_000
    """Of the first."""
    physics_hz: Annotated[int, Whole(1, 100_000, "Hz")] = 1000
    """Steps of Bullet; MuJoCo's are those of the environment."""
    armature: bool = True
    """Whether links have the inertia of their motors' rotors, which Bullet does not know."""
    zero_action: bool = True
    """Whether each is also played without its policy."""
    out: Path | None = None
    """A CSV of the table."""


def run(config: EnginesConfig) -> None:
    """Play them all, print a line for each, write the table."""
    check_output(config.out, "out", (".csv",))
    known = [each.name for each in shipped()]
    names = config.policies or [name for task in TASKS for name in known if name.startswith(task)]
    rows = []
    print(f"{'':58}survived         velocity error, m/s")
    print(f"{'':58}MuJoCo  Bullet   MuJoCo  Bullet")
    for name in names:
        found = load(Path(PREFIX + name if name in known else name))
        found = replace(found, robots=())  # one robot, that of the environment
        for trained in (True, False) if config.zero_action else (True,):
            player = Player.of(found, trained=trained, episode_seconds=config.seconds)
            ours = play_player(player, config.episodes, config.seed, config.episodes)
            theirs = in_bullet(
                player, config.episodes, config.seed, config.physics_hz, armature=config.armature
            )
            row = _row(name, trained, ours, theirs)
            rows.append(row)
            called = f"{name}, {row['actions']}"
            print(
                f"{called:58}{row['mujoco_survived']:6.0%}  {row['bullet_survived']:6.0%}   "
                f"{row['mujoco_velocity_error']:6.3f}  {row['bullet_velocity_error']:6.3f}",
                flush=True,
            )
    if config.out is not None:
        write(config.out, to_csv([*rows[0]], rows))


def _row(name: str, trained: bool, ours: Episodes, theirs: Outcomes) -> dict[str, object]:
    row: dict[str, object] = {
        "policy": name,
        "actions": "policy" if trained else "zero action",
        "episodes": len(ours.seconds),
    }
    for engine, found in (("mujoco", ours), ("bullet", theirs)):
        row |= {
            f"{engine}_survived": float(np.mean(found.survived)),
            f"{engine}_seconds": float(np.mean(found.seconds)),
            f"{engine}_velocity_error": float(np.mean(found.velocity_error)),
        }
    return row


if __name__ == "__main__":
    sys.exit(run_command("eval.engines", EnginesConfig, run))
