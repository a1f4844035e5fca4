"""The pages of the site that are made of the code, and those of docs/ that leave gaps for it."""

import importlib
import re
from pathlib import Path

from eval.tools.site import environments
from eval.tools.site.pictures import CAPTION, FOLDER
from fbid_gym.actions import LAYERS, Additions, layer_choices
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import BodyOptions
from fbid_gym.envs.page import meanings, option_table

DOCS, EXAMPLES = Path("docs"), Path("examples")
OUTSIDE = {"../SECURITY.md": "security.md", "../CHANGELOG.md": "changelog.md"}
"""Files of the repository that are pages, too: as pages under docs/ link to them -> their names."""

REFERENCE: dict[str, tuple[str, tuple[str, ...]]] = {
    "fbid_gym": ("fbid_gym", ()),
    "envs": ("Environments", ("robot_env", "vector_env", "sb3")),
    "runtime": ("Runtime", ("config", "randomisation", "control_loop", "rates")),
    "tasks": ("Tasks", ("walk_measures",)),
    "actions": (
        "Action layers",
        (*LAYERS, "law", "pendulum", "gains", "contact_options", "ranges", "joint_gains"),
    ),
    "motions": ("Motions", ()),
    "control": ("Control laws", ("body_law", "momentum_balance", "balancers")),
    "dynamics": ("Dynamics", ("contacts", "stance")),
    "robots": ("Robots", ()),
    "quantities": ("Quantities", ()),
    "options": ("Options", ()),
    "policy": ("Policies", ()),
    "errors": ("Errors", ()),
}
"""A package -> the title of its page, and its modules beside those that its public names are of."""


def reference(package: str) -> str:
    """Return the page of a package of the library, for mkdocstrings."""
    name = package if package == "fbid_gym" else f"fbid_gym.{package}"
    title, more = REFERENCE[package]
    public = getattr(importlib.import_module(name), "__all__", ())
    homes = [name, *(_home(name, each) for each in public if package != "fbid_gym")]
    own = [home for home in dict.fromkeys(homes) if home.startswith(name)]
    modules = dict.fromkeys([*own, *(f"{name}.{module}" for module in more)])
    return "\n\n".join([f"# {title}", *map(_module, modules)]) + "\n"


def _module(name: str) -> str:
    """A module and its members; of a package those that are its own, and links to the others."""
    public = getattr(importlib.import_module(name), "__all__", None)
    options = ["show_root_heading: false", "show_root_toc_entry: false"]
    parts = [f"## `{name}`"]
    if public is not None:
        own = [each for each in public if _home(name, each) == name]
        options.append(f"members: [{', '.join(own)}]" if own else "members: false")
        links = [f"[`{each}`][{_home(name, each)}.{each}]" for each in public]
        parts.append(f"Public: {', '.join(links)}.")
    lines = "\n".join(f"      {option}" for option in options)
    return "\n\n".join([*parts, f"::: {name}\n    options:\n{lines}\n"])


def _home(module: str, name: str) -> str:
    """Find where a public name is defined; data are at home where they are named."""
    home: str = getattr(getattr(importlib.import_module(module), name), "__module__", module)
    return home if home.startswith("fbid_gym") else module


def layer(text: str, name: str, drawn: bool) -> str:
    """Fill the marks of a layer's page: the picture, if there is one, and the table of options."""
    shown = f"![A push on a zero action of {name}]({name}.svg)\n\n{CAPTION.format(f'`{name}`')}"
    every = (BodyOptions, ContactOptions, Additions.of, LAYERS[name])
    said = {option: words for build in every for option, words in meanings(build).items()}
    text = text.replace("<!-- picture -->", shown if drawn else "")
    return text.replace("<!-- options -->", option_table(layer_choices(name), said))


def examples(text: str, folder: Path) -> str:
    """Put the code of each example, to which its heading links, below what is said of it."""

    def section(found: re.Match[str]) -> str:
        title, name, said = found.groups()
        code = (folder / name).read_text(encoding="utf-8").strip()
        return f"## {title}\n\n{said.strip()}\n\n`examples/{name}`\n\n```python\n{code}\n```\n\n"

    heading = r"^## \[(.+?)\]\(\.\./examples/(\w+\.py)\)\n\n(.*?)(?=^## |\Z)"
    return re.sub(heading, section, text, flags=re.M | re.S)


def pages() -> dict[str, str]:
    """Return the pages by their names: those of the code, and those of docs/ that it completes."""
    clips = {path.name for path in FOLDER.rglob("*.mp4")}
    found = {f"environments/{name}": text for name, text in environments.pages(clips).items()}
    found |= {f"api/{package}.md": reference(package) for package in REFERENCE}
    for link, name in OUTSIDE.items():
        found[name] = (DOCS / link).read_text("utf-8").replace("](docs/", "](")
    for path in sorted(DOCS.rglob("*.md")):
        name, text = path.relative_to(DOCS).as_posix(), path.read_text("utf-8")
        if name == "examples.md":
            text = examples(text, EXAMPLES)
        if path.parent.name == "layers" and path.stem in LAYERS:
            text = layer(text, path.stem, (FOLDER / "layers" / f"{path.stem}.svg").exists())
        for link, here in OUTSIDE.items():
            text = text.replace(f"]({link})", f"]({here})")
        text = text.replace("](../examples/", "](examples/")  # files of the site, too
        found[name] = text
    return found
