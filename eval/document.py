"""A self-contained HTML page: nothing of it comes from elsewhere, and only its own script runs."""

import base64
import hashlib
from html import escape
from pathlib import Path


def document(title: str, body: str, *, style: str = "", script: str = "") -> str:
    """Lay out a page.

    Args:
        title: of the window, plain text.
        body: HTML.
        style: CSS, after that of all pages.
        script: JavaScript, after the body; no other runs, wherever in the page it stands.
    """
    css = (Path(__file__).parent / "style.css").read_text() + style
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    scripts = f"'sha256-{digest}'" if script else "'none'"
    policy = (
        f"default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; "
        f"script-src {scripts}; base-uri 'none'; form-action 'none'"
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{css}</style>\n</head>\n<body>\n<main>\n"
        + body
        + "\n</main>\n"
        + (f"<script>{script}</script>\n" if script else "")
        + "</body>\n</html>\n"
    )
