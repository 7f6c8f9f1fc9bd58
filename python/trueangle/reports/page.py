"""The page: content and figures set into one HTML file that needs no network."""

from __future__ import annotations

import base64
import gzip
import json
from functools import lru_cache
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MissingExtraError
from ..support.files import PAGE, check_output, written_atomically
from ..support.plainresult import Shown
from . import charts, wording
from .numbers import Numbers

if TYPE_CHECKING:
    from jinja2 import Environment

    from .composition import Report

__all__ = [
    "Page",
    "bokeh_library",
    "filled_template",
    "rendered_report",
    "report_templates",
    "template_environment",
]

_TEMPLATES = Path(__file__).parent / "templates"


#: Signs of the code that end or escape something in HTML, and those that stand for them.
_SIGNS = str.maketrans("<>&", "[]:")


def rendered_report(report: Report, framed: bool = False) -> str:
    """The report as HTML: style, scripts, plotting library, content and figures inside.

    ``framed`` in a page that holds the library, it takes that one.
    """
    made = template_environment()
    from markupsafe import Markup

    numbers = Numbers(report.content)
    made.globals |= {"show": numbers, "wording": wording, "swatch": charts.run_swatch}
    content = report.content
    return made.get_template("report.html.j2").render(
        c=content,
        figures=report.figures,
        result_json=Markup(_embedded(content)),
        figures_packed=Markup(_packed(json.dumps(_live(report.figures), separators=(",", ":")))),
        still=Markup,
        style=Markup((_TEMPLATES / "report.css").read_text("utf-8")),
        script=Markup((_TEMPLATES / "report.js").read_text("utf-8")),
        library=Markup("" if framed else bokeh_library()),
    )


def _live(figures: dict[str, Any]) -> dict[str, Any]:
    """What the script draws: all but the stills, which the page holds itself."""
    return {
        name: figure
        | {"charts": [{k: v for k, v in c.items() if k != "still"} for c in figure["charts"]]}
        for name, figure in figures.items()
    }


def template_environment() -> Environment:
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


def filled_template(template: str, **values: Any) -> str:
    """A template with its values and the report's style, as text that UTF-8 holds."""
    style = (_TEMPLATES / "report.css").read_text("utf-8")
    text = template_environment().get_template(template).render(style=style, **values)
    return text.encode("utf-8", "replace").decode("utf-8")


class Page(Shown):
    """A result that is a page: one HTML file that needs no network."""

    @property
    def html(self) -> str:
        """The page."""
        raise NotImplementedError

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page, complete or not at all.

        Raises
        ------
        FileError
            An ending of another format, a place that no file is written to.
        """
        check_output(path, PAGE)
        html = self.html
        with written_atomically(path, kind=PAGE) as file:
            file.write(html)


def report_templates() -> Path:
    """Where the templates lie, and what they include."""
    return _TEMPLATES


def _embedded(value: Any) -> str:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


@lru_cache(maxsize=1)
def bokeh_library() -> str:
    """The charting library, compressed; without its widgets, tables and typesetting."""
    found = find_spec("bokeh")  # Its Python takes half a second to import, and is not needed.
    if found is None or found.origin is None:
        raise MissingExtraError("reports need bokeh and jinja2: pip install 'trueangle[report]'")
    script = Path(found.origin).parent / "server" / "static" / "js" / "bokeh.min.js"
    return _packed(script.read_text("utf-8"))


def _packed(text: str) -> str:
    """Text as the page's script unpacks it: length and gzip, in base 85 without signs of HTML."""
    packed = gzip.compress(text.encode("utf-8"), 9, mtime=0)
    whole = len(packed).to_bytes(4, "big") + packed
    return base64.b85encode(whole, pad=True).decode("ascii").translate(_SIGNS)
