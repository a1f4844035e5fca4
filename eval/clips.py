"""Clips of robots side by side on a page: labelled, started together."""

from typing import NamedTuple

from eval.page.html import data, jpeg
from eval.video import Clip
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.overlays import LABELS


class Shown(NamedTuple):
    """A clip on a page, with what stands above it."""

    name: str
    colour: int
    note: str
    clip: Clip

    @property
    def film(self) -> str:
        """The clip as an address."""
        return data(self.clip.mp4(), "video/mp4")

    @property
    def poster(self) -> str:
        """Its first picture as an address: what stands there before the clip runs."""
        return data(jpeg(self.clip.frames[0]), "image/jpeg")


def legend(env_id: str) -> str:
    """Say what is drawn over our robots; other environments draw themselves as they like."""
    return f"Drawn over the robots: {'; '.join(LABELS.values())}." if env_id in ENVIRONMENTS else ""


def fate(clip: Clip) -> str:
    """Say whether the robot stayed up."""
    return "stays up" if clip.ended is None else f"falls after {clip.ended:.1f} s"
