"""Hooks that MkDocs calls as it builds the site, see mkdocs.yml."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from eval.site import environments, examples, layers, reference
from eval.site.environments import Scene
from eval.site.mathematics import with_mathml
from eval.site.pictures import FOLDER
from fbid_gym.envs import ENVIRONMENTS

OUTSIDE = {"../SECURITY.md": "security.md", "../CHANGELOG.md": "changelog.md"}
"""Files of the repository that are pages, too: as pages under docs/ link to them -> their names."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Tell the theme the version."""
    config.extra["version"] = version("fbid_gym")
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made of the code, and what has been drawn; it does without, too."""
    current = {Scene.of(env_id).file for env_id in ENVIRONMENTS}
    drawn = [
        path
        for path in sorted(FOLDER.rglob("*"))
        if path.suffix == ".svg" or path.name in current  # not clips of policies that are gone
    ]
    for path in drawn:
        name = path.relative_to(FOLDER).as_posix()
        files.append(File.generated(config, name, abs_src_path=str(path.resolve())))
    for name, text in _made({path.name for path in drawn if path.suffix == ".mp4"}):
        files.append(File.generated(config, name, content=text))
    return files


def _made(clips: set[str]) -> Iterator[tuple[str, str]]:
    """Name and Markdown of each page that is not under docs/."""
    for name, text in environments.pages(clips).items():
        yield f"environments/{name}", text
    for name, text in reference.pages().items():
        yield f"api/{name}", text
    for link, name in OUTSIDE.items():
        yield name, Path("docs", link).read_text(encoding="utf-8")


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Fill in what pages leave to the code, and lead their links to where things are here."""
    name = page.file.src_uri
    if name.startswith("layers/"):
        drawn = {path.stem for path in (FOLDER / "layers").glob("*.svg")}
        markdown = layers.filled(name, markdown, drawn)
    if name == "examples.md":
        markdown = examples.filled(markdown, Path("examples"))
    for link, here in OUTSIDE.items():
        markdown = markdown.replace(f"]({link})", f"]({here})")
    return markdown


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Translate the formulas."""
    return with_mathml(html)
