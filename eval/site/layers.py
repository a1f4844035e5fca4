"""What is made of the code on the pages of the action layers."""

from pathlib import PurePosixPath

from eval.site.pictures import CAPTION
from fbid_gym.actions import LAYERS, Footholds, layer_choices
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import BodyOptions
from fbid_gym.envs.page import meanings, option_table

OPTIONS, PICTURE = "<!-- options -->", "<!-- picture -->"
"""Marks on the pages: what stands there on the site is made as it is built."""


def filled(page: str, text: str, pictures: set[str]) -> str:
    """Return a page of docs/layers with its marks replaced.

    Args:
        page: such as "layers/torque.md".
        text: of the page.
        pictures: names of the layers of which there is one.
    """
    name = PurePosixPath(page).stem
    if name not in LAYERS:
        return text
    shown = f"![A push on a zero action of {name}]({name}.svg)\n\n{CAPTION.format(f'`{name}`')}"
    text = text.replace(PICTURE, shown if name in pictures else "")
    return text.replace(OPTIONS, options(name))


def options(name: str) -> str:
    """Return the table of a layer's options."""
    every = (BodyOptions, ContactOptions, Footholds.of, LAYERS[name])
    said = {option: words for build in every for option, words in meanings(build).items()}
    return option_table(layer_choices(name), said)
