"""A small study of two environments, and run folders that are made up."""

import json
from pathlib import Path

from eval.study.results import Settings
from train.runs.folder import RunFolder
from train.runs.study import Study, read_study

STUDY = """
seeds = [0, 1]
total_steps = 1000
[[arms]]
name = "one"
env = "fbid_gym/QuadrupedWalk-v0"
action_layer = "torque"
[[arms]]
name = "other"
env = "fbid_gym/BipedSquat-v0"
action_layer = "torque"
seeds = [0]
"""
# Both arms in one environment, with both seeds.
ALIKE = STUDY.replace("BipedSquat", "QuadrupedWalk").replace("seeds = [0]\n", "")
COLUMNS = ("steps,wall_seconds,episodes,return_mean,return_std,return_q25,return_q75,length_mean,"
           "survival,velocity_error\n")  # fmt: skip


FEW = Settings(samples=200)


def written(folder: Path, text: str = STUDY) -> Study:
    """A study in a file `mine.toml`, of whose runs nothing has begun."""
    (folder / "mine.toml").write_text(text)
    return read_study(folder / "mine.toml", folder / "out")


def fill(cell, height, error, until=1000, policy=None):
    """What a training leaves that has got so far; the policy is of its end."""
    folder = RunFolder.of(cell.config.folder)
    folder.path.mkdir(parents=True)
    folder.config.write_text(json.dumps(cell.config.to_json()))
    folder.evaluations.write_text(
        f"{COLUMNS}0,0,8,{height},1,{height - 1},{height + 1},50,0.5,{2 * error}\n"
        f"1000,9,8,{2 * height},1,{height - 1},{height + 1},50,1.0,{error}\n"
    )
    folder.progress.write_text(f"steps,return_mean\n400,nan\n800,{height / 2}\n{until},{height}\n")
    if policy is not None:
        policy.save(folder.policy)
        folder.versions.write_text("{}")
