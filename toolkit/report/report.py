"""The report: one self-contained, offline HTML page about one mesh and its material cases."""

from __future__ import annotations

import base64
import hashlib
import logging
import os
from pathlib import Path

from ...converters.files import writing
from .content import ReportContent
from .data import payload
from .html import page
from .template import FOLDER, render

log = logging.getLogger(__name__)

# The viewer, in the order of its parts.
SCRIPTS = tuple(
    f"report_{part}.js"
    for part in (
        "tets", "cut", "scale", "camera", "marks", "view", "tools", "player", "controls", "reduced",
        "touch", "dial", "main",
    )
)  # fmt: skip


def write_report(path: str | os.PathLike[str], content: ReportContent) -> Path:
    """Write the page to ``path`` in one step and return it."""
    path = Path(path)
    page = report_page(content)
    path.parent.mkdir(parents=True, exist_ok=True)
    with writing(path) as partial:
        partial.write_text(page, encoding="utf-8", newline="\n")
    log.info("wrote %s (%.1f MB)", path, path.stat().st_size / 1e6)
    return path


def report_page(content: ReportContent) -> str:
    """The page as text: template, style, data, plotly and the viewer, no reference to outside."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    scripts = [_inline(get_plotlyjs()), _inline("".join(map(_text, SCRIPTS)))]
    return render(
        "report.html",
        **page(content),
        policy=_policy(scripts),
        # Ours, or made so that they cannot end their elements: not escaped again.
        style=Markup(_text("report.css")),
        data=Markup(payload(content)),
        plotly=Markup(scripts[0]),
        viewer=Markup(scripts[1]),
    )


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _inline(script: str) -> str:
    """Script text that cannot end its own element and hashes alike here and in a browser."""
    script = script.replace("\r\n", "\n").replace("\r", "\n").replace("\0", "�")
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def _policy(scripts: list[str]) -> str:
    """Content security policy: only these scripts run, and nothing is fetched from anywhere."""
    digests = (hashlib.sha256(text.encode()).digest() for text in scripts)
    allowed = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
