"""What is made of the code on the pages of the action layers."""

from pathlib import PurePosixPath

from eval.site.pictures import CAPTION
from fbid_gym.actions import LAYERS, WALKING_LAYERS, Footholds, walking_options
from fbid_gym.actions.contact_options import ContactOptions, WalkingContact
from fbid_gym.envs.__main__ import meanings, table
from fbid_gym.options import options_of

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
    """Return the tables of a layer's options, on a motion and on a gait."""
    on_motion = meanings(ContactOptions) | meanings(LAYERS[name])
    on_gait = meanings(ContactOptions) | {
        option: said
        for build in (WalkingContact, Footholds.of, WALKING_LAYERS[name])
        for option, said in meanings(build).items()
        if said != "As in `ContactOptions`."
    }
    return "\n\n".join(
        [
            "### Where robots stand or follow a motion",
            table(options_of(LAYERS[name]), on_motion),
            "### On a gait: task `walk`",
            table(walking_options(name), on_gait),
        ]
    )
