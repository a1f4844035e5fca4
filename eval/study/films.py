"""The clips of a page: the median run of each arm, and what learns nothing."""

from collections.abc import Callable
from dataclasses import replace

from eval.clips import Shown, fate
from eval.page.figures import colours_of
from eval.rollout import Player, filmed
from eval.study.results import RETURN, ArmFound, Findings
from fbid_gym.errors import FbidError
from train.progress import Tell

Clips = dict[tuple[str, str], Shown]
"""By environment and arm."""


def film(
    found: Findings, player_of: Callable[[str], Player], seconds: float, tell: Tell
) -> tuple[Clips, list[str]]:
    """Record the median run of each arm of which any is done, by its return.

    Args:
        found: the arms; where they have played fresh episodes, those count.
        player_of: who plays, by the name of a run.
        seconds: length of the clips.
        tell: is told how far it is.

    Returns:
        The clips; and why others are missing, a sentence each.
    """
    colour, clips, missing = colours_of(arm.name for arm in found.arms), Clips(), list[str]()
    done = [arm for arm in found.arms if arm.ready or arm.fresh]
    for k, arm in enumerate(done):
        name = _median(arm)
        tell(k, len(done), name)
        try:
            clip = filmed(player_of(name), found.settings.seed, seconds, "")
        except FbidError as error:  # the numbers stand without it
            missing.append(f"There is no clip of {name}: {error}")
            continue
        seed = next((cell.seed for cell in arm.cells if cell.name == name), None)
        who = arm.policy or ("" if seed is None else f"seed {seed}")
        note = f"{who}, {fate(clip)}".removeprefix(", ")
        clips[arm.env_id, arm.name] = Shown(arm.name, colour[arm.name], note, clip)
    # An episode may reach its time limit before the clip is over; a fallen robot's clip never does.
    for place, shown in clips.items():
        alike = (len(its.clip.frames) for (env_id, _), its in clips.items() if env_id == place[0])
        cut = replace(shown.clip, frames=shown.clip.frames[: min(alike)])
        clips[place] = shown._replace(clip=cut)
    return clips, missing


def _median(arm: ArmFound) -> str:
    """Return the name of the run in the middle, the lower of two."""
    each, runs = (arm.each, arm.counted) if arm.fresh is None else (arm.fresh.each, arm.fresh.runs)
    ranked = sorted(zip(each[RETURN.name], runs, strict=True))
    return ranked[(len(ranked) - 1) // 2][1]
