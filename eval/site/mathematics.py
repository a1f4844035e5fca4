r"""Formulas as MathML, made as the site is built: browsers draw it without a script or a font.

Pages write them as code hosts read them: `$x$` in a line, `$$ ... $$` between lines. Arithmatex
finds them; what it leaves, `\(x\)` in a `span` and `\[x\]` in a `div`, is translated here.
"""

import html
import re

from latex2mathml.converter import convert

_FOUND = re.compile(r'<(span|div) class="arithmatex">\s*\\[(\[](.*?)\\[)\]]\s*</\1>', re.DOTALL)


def with_mathml(page: str) -> str:
    """Return a page's HTML with its formulas as MathML."""
    return _FOUND.sub(_mathml, page)


def _mathml(found: re.Match[str]) -> str:
    block = found[1] == "div"
    return convert(html.unescape(found[2]).strip(), display="block" if block else "inline")
