"""Printing a page to PDF by an installed browser."""

from __future__ import annotations

import os
import shutil
import subprocess
from os import PathLike
from pathlib import Path
from typing import Final

from ..errors import ArgumentError
from ..support.files import PDF, check_output, external_output

__all__ = ["find_browser", "print_pdf"]

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
    target = check_output(path, PDF)
    with external_output(target) as printed:
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
