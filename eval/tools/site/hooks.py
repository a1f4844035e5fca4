r"""Hooks that MkDocs calls as it builds the site: the version, pages made of the code, formulas.

Browsers draw MathML without a script or a font. Pages write it as code hosts read it: `$x$` in a
line, `$$ ... $$` between lines. Arithmatex finds that; what it leaves, `\(x\)` in a `span` and
`\[x\]` in a `div`, is translated here.
"""

import html
import re
from importlib.metadata import version
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from eval.tools.site.environments import EnvironmentClip
from eval.tools.site.pages import EXAMPLES, pages
from eval.tools.site.pictures import FOLDER
from fbid_gym.envs import ENVIRONMENTS

_FOUND = re.compile(r'<(span|div) class="arithmatex">\s*\\[(\[](.*?)\\[)\]]\s*</\1>', re.DOTALL)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Tell the theme the version."""
    config.extra["version"] = version("fbid_gym")
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add pages made of the code, examples, and what has been drawn; it does without, too."""
    for name, text in pages().items():
        files.append(File.generated(config, name, content=text))
    for path in sorted(EXAMPLES.rglob("*.py")):
        files.append(File.generated(config, str(path), abs_src_path=str(path.resolve())))
    current = {EnvironmentClip.of(env_id).file for env_id in ENVIRONMENTS}
    for path in sorted(FOLDER.rglob("*.*")):
        if path.suffix == ".svg" or path.name in current:  # not clips of policies that are gone
            name = path.relative_to(FOLDER).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path.resolve())))
    return files


def on_page_content(text: str, **_: Any) -> str:
    """Return a page's HTML with its formulas as MathML."""
    return _FOUND.sub(_mathml, text)


def _mathml(found: re.Match[str]) -> str:
    block = found[1] == "div"
    return convert(html.unescape(found[2]).strip(), display="block" if block else "inline")
