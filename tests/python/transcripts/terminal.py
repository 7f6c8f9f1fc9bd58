"""A terminal in a folder: the commands of a transcript, and what it shows of each."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import trueangle
from trueangle.cli import main

from .views import figure_lines, file_lines

COLUMNS = 100

#: What is another at every run: whose text it is stands in its place.
ALTERS = (
    (re.compile(r"\b[0-9a-f]{64}\b"), "SHA256"),
    (re.compile(r"\b20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)"), "NOW"),
    (re.compile(r"[\d,]+ rows/s"), "SPEED rows/s"),
    (re.compile(r"seconds [\d.e+-]+(?=, (?:complete|rows_per_second))"), "seconds TIME"),
    (re.compile(r"rows_per_second [\d.e+-]+"), "SPEED"),
    (re.compile(r"(readings in )[\d.]+( s| ms| min)"), r"\1TIME"),
    (re.compile(r"[\d.]+ million readings per second"), "SPEED"),
    (re.compile(rf"\b{re.escape(trueangle.__version__)}\b"), "VERSION"),
)


def ran(arguments: list[str], folder: Path, columns: int) -> tuple[int, str, str]:
    """Status of a command in ``folder``, and what it prints and tells at so many columns."""
    told, warned = io.StringIO(), io.StringIO()
    before, width = os.getcwd(), os.environ.get("COLUMNS")
    os.chdir(folder)
    os.environ["COLUMNS"] = str(columns)
    try:
        with contextlib.redirect_stdout(told), contextlib.redirect_stderr(warned):
            try:
                status = main(arguments)
            except SystemExit as left:
                status = int(left.code or 0)
    finally:
        os.chdir(before)
        os.environ.pop("COLUMNS")
        if width is not None:
            os.environ["COLUMNS"] = width
    return status, told.getvalue(), warned.getvalue()


class Terminal:
    """Runs the commands of one transcript, one after the other, in one folder.

    ``trueangle ...`` is the command itself, in this process. ``show FILE`` shows what a file
    holds (`views`), ``figures`` what the pictures drawn since show, and ``hide KEY=VALUE ...``
    writes ``hidden.toml``: what ``believed.toml`` believes, and one effect beside it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._figures: list[str] = []

    def lines(self, command: str) -> list[str]:
        """What the terminal shows of a command; a status other than 0 at the end, as ``[1]``."""
        program, *arguments = shlex.split(command)
        run = {"trueangle": self._trueangle, "show": self._show, "figures": self._drawn,
               "hide": self._hide}[program]  # fmt: skip
        return self._settled(run(arguments))

    def _settled(self, text: str) -> list[str]:
        text = text.replace(f"{self.folder}{os.sep}", "").replace(str(self.folder), ".")
        for pattern, name in ALTERS:
            text = pattern.sub(name, text)
        return [line.rstrip() for line in text.splitlines()]

    def _trueangle(self, arguments: list[str]) -> str:
        with self._kept(), warnings.catch_warnings():
            warnings.simplefilter("default")  # as a command has them: here, warnings are errors
            status, text, warned = ran(arguments, self.folder, COLUMNS)
        if "--json" in arguments:
            objects = text.splitlines() if arguments[0] == "watch" else [text] if text else []
            text = "".join(f"{line}\n" for each in objects for line in file_lines(each, ".json"))
        return text + warned + (f"[{status}]" if status else "")

    def _show(self, arguments: list[str]) -> str:
        path = self.folder / arguments[0]
        return "\n".join(file_lines(path.read_text(encoding="utf-8"), path.suffix))

    def _drawn(self, arguments: list[str]) -> str:
        text, self._figures = "\n".join(self._figures), []
        return text

    def _hide(self, arguments: list[str]) -> str:
        believed = (self.folder / "believed.toml").read_text(encoding="utf-8")
        effect = "\n".join(["", "[[effect]]", *arguments, ""])
        (self.folder / "hidden.toml").write_text(believed + effect, encoding="utf-8")
        return ""

    @contextlib.contextmanager
    def _kept(self) -> Iterator[None]:
        """Lines on every figure that is saved are kept; no runs are planned."""
        from matplotlib.figure import Figure

        from trueangle.diagnosis.result import Diagnosis

        save, planned = Figure.savefig, Diagnosis.next_runs

        def kept(figure: Figure, *args: Any, **kwargs: Any) -> None:
            self._figures += figure_lines(figure)
            save(figure, *args, **kwargs)

        Figure.savefig = kept  # type: ignore[method-assign]
        # Seconds each; `plan --after` shows one.
        Diagnosis.next_runs = None  # type: ignore[assignment]
        try:
            yield
        finally:
            Figure.savefig = save  # type: ignore[method-assign]
            Diagnosis.next_runs = planned  # type: ignore[method-assign]
