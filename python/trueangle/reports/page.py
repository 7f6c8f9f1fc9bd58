"""The page: content and figures set into one HTML file that needs no network."""

from __future__ import annotations

import base64
import gzip
import json
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MissingExtraError
from . import charts, wording
from .numbers import Numbers

if TYPE_CHECKING:
    from jinja2 import Environment

    from .composition import Report

__all__ = ["environment", "render", "templates"]

_TEMPLATES = Path(__file__).parent / "templates"


def render(report: Report) -> str:
    """The report as HTML: style, scripts, plotting library, content and figures inside."""
    made = environment()
    from markupsafe import Markup

    numbers = Numbers(report.content)
    made.globals |= {"show": numbers, "wording": wording, "swatch": charts.swatch}
    content = report.content
    return made.get_template("report.html.j2").render(
        c=content,
        figures=report.figures,
        result_json=Markup(_embedded(content)),
        figures_packed=Markup(_packed(json.dumps(report.figures, separators=(",", ":")))),
        style=Markup((_TEMPLATES / "report.css").read_text("utf-8")),
        script=Markup((_TEMPLATES / "report.js").read_text("utf-8")),
        library=Markup(_library()),
    )


def environment() -> Environment:
    """What sets contents into the templates.

    Raises
    ------
    MissingExtraError
        jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
    except ModuleNotFoundError:
        raise MissingExtraError(
            "reports need bokeh and jinja2: pip install 'trueangle[report]'"
        ) from None
    return Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def templates() -> Path:
    """Where the templates lie, and what they include."""
    return _TEMPLATES


def _embedded(value: Any) -> str:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


@lru_cache(maxsize=1)
def _library() -> str:
    """The charting library, compressed; without its widgets, tables and typesetting."""
    found = find_spec("bokeh")  # Its Python takes half a second to import, and is not needed.
    if found is None or found.origin is None:
        raise MissingExtraError("reports need bokeh and jinja2: pip install 'trueangle[report]'")
    script = Path(found.origin).parent / "server" / "static" / "js" / "bokeh.min.js"
    return _packed(script.read_text("utf-8"))


def _packed(text: str) -> str:
    """Text as the page's script unpacks it: gzip in base64."""
    return base64.b64encode(gzip.compress(text.encode("utf-8"), 9, mtime=0)).decode("ascii")
