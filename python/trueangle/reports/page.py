"""The page: content and figures set into one HTML file that needs no network."""

from __future__ import annotations

import base64
import gzip
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MissingExtraError
from . import charts, wording

if TYPE_CHECKING:
    from .composition import Report

__all__ = ["formatted", "lookup", "render"]

#: Stands where there is no number.
NONE = "\u2013"

_TEMPLATES = Path(__file__).parent / "templates"


def render(report: Report) -> str:
    """The report as HTML: style, scripts, plotting library, content and figures inside."""
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
        from markupsafe import Markup
    except ImportError:
        raise MissingExtraError(
            "reports need bokeh and jinja2: pip install 'trueangle[report]'"
        ) from None
    content = report.content

    def number(path: str, digits: int = 2, unit: str = "") -> Any:
        """A value of the content as text, marked with where it stands."""
        text = formatted(lookup(content, path), digits)
        mark = Markup('<span class="n" data-path="{}" data-digits="{}">{}</span>')
        return mark.format(path, digits, text) + (f"\u00a0{unit}" if unit and text != NONE else "")

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"n": number, "wording": wording, "swatch": charts.swatch}
    return environment.get_template("report.html.j2").render(
        c=content,
        figures=report.figures,
        result_json=Markup(_embedded(content)),
        figures_packed=Markup(_packed(json.dumps(report.figures, separators=(",", ":")))),
        style=Markup((_TEMPLATES / "report.css").read_text("utf-8")),
        script=Markup((_TEMPLATES / "report.js").read_text("utf-8")),
        library=Markup(_library()),
    )


def lookup(content: Any, path: str) -> Any:
    """The value at ``path``: keys and list indices joined by dots.

    Examples
    --------
    >>> lookup({"runs": [{"readings": 36}]}, "runs.0.readings")
    36
    """
    for key in path.split("."):
        content = content[int(key)] if isinstance(content, list) else content[key]
    return content


def formatted(value: float | None, digits: int) -> str:
    r"""A number as the page shows it; a dash for none.

    Examples
    --------
    >>> formatted(-0.004, 2), formatted(None, 2)
    ('0.00', '\u2013')
    """
    if value is None:
        return NONE
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def _embedded(value: Any) -> str:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


@lru_cache(maxsize=1)
def _library() -> str:
    """The charting library, compressed; without its widgets, tables and typesetting."""
    try:
        import bokeh
    except ImportError:
        raise MissingExtraError(
            "reports need bokeh and jinja2: pip install 'trueangle[report]'"
        ) from None
    script = Path(bokeh.__file__).parent / "server" / "static" / "js" / "bokeh.min.js"
    return _packed(script.read_text("utf-8"))


def _packed(text: str) -> str:
    """Text as the page's script unpacks it: gzip in base64."""
    return base64.b64encode(gzip.compress(text.encode("utf-8"), 9, mtime=0)).decode("ascii")
