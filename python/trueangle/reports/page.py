"""The page: content and figures in templates, one HTML file that needs no network; printed too."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

from ..errors import ArgumentError, MissingExtraError
from ..plots.pagechart import run_swatch
from ..support.files import PAGE, PDF, FileKind, check_output, external_output, written_atomically
from ..support.plainresult import ShownResult
from . import wording
from .wording import Numbers

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES = Path(__file__).parent / "templates"

#: Names that browsers with Chromium's printing go by.
_BROWSERS: Final = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
_TIMEOUT_S: Final = 120
#: Of the browser.
_OPTIONS = ("headless", "disable-gpu", "no-pdf-header-footer", "virtual-time-budget=20000")


def rendered_report(content: dict[str, Any], figures: dict[str, dict[str, Any]]) -> str:
    """A report as HTML: style, script, content and figures inside."""
    made = _template_environment()
    from markupsafe import Markup

    made.globals |= {"show": Numbers(content), "wording": wording, "swatch": run_swatch}
    return made.get_template("report.html.j2").render(
        c=content,
        figures=figures,
        result_json=Markup(_embedded(content)),
        style=Markup((_TEMPLATES / "report.css").read_text("utf-8")),
        script=Markup((_TEMPLATES / "report.js").read_text("utf-8")),
    )


def _template_environment() -> Environment:
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
            "reports need matplotlib and jinja2: pip install 'trueangle[report]'"
        ) from None
    return Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def filled_template(template: str, **values: Any) -> str:
    """A template with its values and the report's style."""
    style = (_TEMPLATES / "report.css").read_text("utf-8")
    text: str = _template_environment().get_template(template).render(style=style, **values)
    return text


class Page(ShownResult):
    """A result that is a page: one HTML file that needs no network.

    A class defines by ``_written`` what the page holds.
    """

    #: What it is written as.
    _kind: ClassVar[FileKind] = PAGE

    @cached_property
    def html(self) -> str:
        """One file that needs no network.

        Raises
        ------
        MissingExtraError
            jinja2 or matplotlib is not installed.
        """
        # Names of files may hold bytes that are no text.
        return self._written().encode("utf-8", "replace").decode("utf-8")

    def _written(self) -> str:
        """The page, again."""
        raise NotImplementedError

    @property
    def _hashes(self) -> list[str]:
        """Of the files that it was made from; it replaces none."""
        return []

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page, complete or not at all.

        Raises
        ------
        FileError
            An ending of another format, a place that no file is written to, a file that it was
            made from.
        """
        check_output(path, self._kind)
        html = self.html
        with written_atomically(path, kind=self._kind, hashes=self._hashes) as file:
            file.write(html)


def _embedded(value: Any) -> str:
    """JSON that cannot end the script element it is in."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def find_browser() -> str | None:
    """Path of an installed browser that can print, or None."""
    return next((found for name in _BROWSERS if (found := shutil.which(name))), None)


def print_pdf(html: str, path: str | PathLike[str], browser: str | None = None) -> None:
    """Print a page to ``path``; complete or not at all.

    Raises
    ------
    ArgumentError
        No browser is installed, or it did not print.
    """
    program = browser or find_browser()
    if program is None or shutil.which(program) is None:
        raise ArgumentError(
            f"a PDF needs an installed browser ({', '.join(_BROWSERS[:3])} ...): install one, "
            "or open the HTML report and print it"
        )
    with external_output(check_output(path, PDF)) as printed:
        folder = printed.parent
        page = folder / "report.html"
        page.write_text(html, encoding="utf-8")
        options = [*_OPTIONS, f"user-data-dir={Path(folder, 'profile')}", f"print-to-pdf={printed}"]
        # A browser that runs as root (containers, CI) refuses its own sandbox.
        options += ["no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
        # The fragment makes the page lay itself out for paper from the start.
        address = f"{page.resolve().as_uri()}#print"
        command = [program, *(f"--{option}" for option in options), address]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            raise ArgumentError(f"{program} did not print within {_TIMEOUT_S} s") from None
        if not printed.is_file():
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise ArgumentError(f"{program} did not print: {last}")
