"""Pages from Jinja2 templates: in HTML what is not ours is escaped, wherever it comes from.

A page is self-contained: it takes nothing from elsewhere, and runs its own script alone. The parts
that sections of several pages are made of are macros of `templates/parts.html`; those that Python
puts together stand here by name.
"""

import base64
import hashlib
import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from PIL import Image

from eval import wording
from eval.page.figures import STYLE
from train.runs.study import environment_name

STARTS = (Path(__file__).parent / "clips.js").read_text().replace("\n", "")
"""Script of a page with clips: those side by side start together, once they are seen."""


def data(content: bytes, kind: str) -> str:
    """Return content as an address that holds it, of a kind such as "image/jpeg"."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def digest(script: str) -> str:
    """Return the hash by which the policy of a page names its script."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def jpeg(image: np.ndarray) -> bytes:
    """Encode a picture, (H, W, 3) uint8."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=80)
    return buffer.getvalue()


_NAMES = "capital count duration form_of interval number percent span steps titled"
_KNOWN: dict[str, Callable[..., Any]] = {
    **{name: getattr(wording, name) for name in _NAMES.split()},
    **{"environment_name": environment_name, "data": data, "digest": digest},
    "json": lambda content: json.dumps(content, indent=1),
}
_TEMPLATES = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=jinja2.select_autoescape(("html",)),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_TEMPLATES.filters.update(_KNOWN)
_TEMPLATES.globals.update(_KNOWN, style=Markup(STYLE))
_PARTS: Any = _TEMPLATES.get_template("parts.html").module


def render(template: str, **content: Any) -> str:
    """Fill a template of `templates/`."""
    return _TEMPLATES.get_template(template).render(content)


def frames(images: Sequence[np.ndarray], caption: str, alternative: str) -> Markup:
    """Pictures (H, W, 3) uint8 of one size side by side; in words for who does not see them."""
    strip = data(jpeg(np.concatenate(list(images), axis=1)), "image/jpeg")
    return Markup(_PARTS.frames(strip, 11 * len(images), caption, alternative))


def video(mp4: bytes, caption: str) -> Markup:
    """A clip that plays when asked to."""
    return Markup(_PARTS.video(data(mp4, "video/mp4"), caption))
