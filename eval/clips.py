"""Clips of robots side by side on a page: labelled, started together."""

import base64
import io
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from PIL import Image

from eval.video import Clip
from eval.wording import capital
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.overlays import LABELS

STARTS = (
    "document.querySelectorAll('.clips').forEach(group=>{"
    "const clips=[...group.querySelectorAll('video')];"
    "const together=()=>clips.forEach(clip=>{clip.currentTime=0;clip.play()});"
    "group.querySelector('button').onclick=together;"
    "if(!matchMedia('(prefers-reduced-motion: reduce)').matches)"
    "new IntersectionObserver((seen,watch)=>{"
    "if(seen.some(one=>one.isIntersecting)){watch.disconnect();together()}}).observe(group)})"
)
"""Script of a page with clips: those side by side start together, once they are seen."""


class Shown(NamedTuple):
    """A clip on a page, with what stands above it."""

    name: str
    colour: int
    note: str
    clip: Clip


def side_by_side(clips: Sequence[Shown], env_id: str) -> str:
    """Return the clips of an environment as HTML, with a button that starts them together."""
    blocks = "".join(map(_block, clips))
    return (
        f'<figure class="wide clips"><div class="grid2">{blocks}</div>'
        '<button type="button">Play together from the start</button>'
        f"<figcaption>{legend(env_id)}</figcaption></figure>"
    )


def legend(env_id: str) -> str:
    """Say what is drawn over our robots; other environments draw themselves as they like."""
    return f"Drawn over the robots: {'; '.join(LABELS.values())}." if env_id in ENVIRONMENTS else ""


def fate(clip: Clip) -> str:
    """Say whether the robot stayed up."""
    return "stays up" if clip.ended is None else f"falls after {clip.ended:.1f} s"


def _block(shown: Shown) -> str:
    film = base64.b64encode(shown.clip.mp4()).decode()
    return (
        f'<div class="clip"><p class="c{shown.colour}"><span class="layer">'
        f"{escape(capital(shown.name))}</span> <small>{escape(shown.note)}</small></p>"
        f'<video muted loop playsinline controls poster="{_poster(shown.clip)}" '
        f'src="data:video/mp4;base64,{film}"></video></div>'
    )


def _poster(clip: Clip) -> str:
    """Return the picture from the middle as an address: what stands there before the clip runs."""
    content = io.BytesIO()
    Image.fromarray(clip.frames[len(clip.frames) // 2]).save(content, "JPEG", quality=70)
    return f"data:image/jpeg;base64,{base64.b64encode(content.getvalue()).decode()}"
