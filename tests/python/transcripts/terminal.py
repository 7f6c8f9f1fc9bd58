"""A terminal in a folder: the commands of a transcript, and what it shows of each."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import trueangle
from trueangle import planning, plots
from trueangle.cli import main
from trueangle.export import TARGETS

from . import groups, specimens
from .arguments import argument_lines
from .asked import Asked
from .charts import chart_lines
from .figures import figure_lines
from .views import file_lines, markup_lines, pdf_lines

COLUMNS = 100

#: What is another at every run: whose text it is stands in its place.
ALTERS = (
    (re.compile(r"\b[0-9a-f]{64}\b"), "SHA256"),
    (re.compile(r"\b20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)"), "NOW"),
    (re.compile(r"\bwritten 20\d\d-\d\d-\d\d\b"), "written TODAY"),
    (re.compile(r"\{[0-9a-f-]{36}\}"), "{TOKEN}"),
    (re.compile(r"[\d,]+ rows/s"), "SPEED rows/s"),
    (re.compile(r"seconds [\d.e+-]+(?=, (?:complete|rows_per_second))"), "seconds TIME"),
    (re.compile(r"rows_per_second [\d.e+-]+"), "SPEED"),
    (re.compile(r"(readings in )[\d.]+( s| ms| min)"), r"\1TIME"),
    (re.compile(r"[\d.]+ million readings per second"), "SPEED"),
    (re.compile(rf"\b{re.escape(trueangle.__version__)}\b"), "VERSION"),
    (re.compile(r"(numpy|[Pp]ython) \d+\.\d[\w.+]*"), r"\1 VERSION"),
    (re.compile(r"(system |VERSION, )(Linux|Darwin|Windows) \w+"), r"\1SYSTEM"),
)


def ran(arguments: list[str], folder: Path, columns: int) -> tuple[int, str, str]:
    """Status of a command in ``folder``, and what it prints and tells at so many columns."""
    told, warned = io.StringIO(), io.StringIO()
    with (
        _within(folder, columns),
        contextlib.redirect_stdout(told),
        contextlib.redirect_stderr(warned),
    ):
        try:
            status = main(arguments)
        except SystemExit as left:
            status = int(left.code or 0)
    return status, told.getvalue(), warned.getvalue()


@contextlib.contextmanager
def _within(folder: Path, columns: int) -> Iterator[None]:
    """In a folder, on a terminal of so many columns."""
    before, width = os.getcwd(), os.environ.get("COLUMNS")
    os.chdir(folder)
    os.environ["COLUMNS"] = str(columns)
    try:
        yield
    finally:
        os.chdir(before)
        os.environ.pop("COLUMNS")
        if width is not None:
            os.environ["COLUMNS"] = width


class Terminal:
    """Runs the commands of one transcript, one after the other, in one folder.

    ``trueangle ...`` is the command itself, in this process, and ``python ...`` a line of Python:
    what it gives, draws, warns of or raises. ``show FILE [PATTERN]`` shows what a file holds
    (`views`), or what of it matches, ``markup FILE [PATTERN]`` what its tags say beside its words,
    ``charts FILE`` what a page draws (`charts`), ``figures`` what the pictures drawn since show
    (`figures`), ``targets`` what an export can be asked for. ``write FILE LINE ...`` writes a
    small file (``\\t`` and ``\\xff`` are what they are in Python), and ``hide KEY=VALUE ...``
    ``hidden.toml``: what ``believed.toml`` believes, and
    one effect beside it. ``options`` tells every argument of every command, ``asked ...`` what
    each further option changes (`asked`). `specimens` and `groups` are what pages are shown of.
    Further commands follow after ``&&``.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._figures: list[str] = []
        self._known: set[str] = set()
        self._names: dict[str, Any] = {"__name__": "transcript", "np": np, "plots": plots}
        self._names |= {"groups": groups, "planning": planning, "specimens": specimens}
        self._names |= {"ta": trueangle}

    def lines(self, command: str) -> list[str]:
        """What the terminal shows of a command; a status other than 0 at the end, as ``[1]``."""
        program, _, rest = command.partition(" ")
        if program == "python":
            return self._settled(self._python(rest))
        run = {
            "asked": self._asked, "charts": self._charts, "figures": self._drawn,
            "hide": self._hide, "markup": self._markup, "options": self._options,
            "show": self._show,
            "targets": self._targets, "trueangle": self._trueangle, "write": self._write,
        }  # fmt: skip
        found: list[str] = []
        for part in command.split(" && "):
            program, *arguments = shlex.split(part)
            silent = arguments[-2:] == [">", "/dev/null"]
            text = run[program](arguments[:-2] if silent else arguments)
            found += [] if silent else self._settled(text)
        return found

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
        path, wanted = self.folder / arguments[0], " ".join(arguments[1:])
        if path.suffix == ".pdf":
            return "\n".join(pdf_lines(path.read_bytes()))
        if path.suffix == ".fmu":
            with zipfile.ZipFile(path) as unit:
                text = unit.read("modelDescription.xml").decode()
        else:
            text = path.read_text(encoding="utf-8")
        lines = file_lines(text, path.suffix)
        return "\n".join(line for line in lines if re.search(wanted, line))

    def _charts(self, arguments: list[str]) -> str:
        return "\n".join(chart_lines((self.folder / arguments[0]).read_text(encoding="utf-8")))

    def _markup(self, arguments: list[str]) -> str:
        path, wanted = self.folder / arguments[0], " ".join(arguments[1:])
        lines = markup_lines(path.read_text(encoding="utf-8"))
        return "\n".join(line for line in lines if re.search(wanted, line))

    def _targets(self, arguments: list[str]) -> str:
        lines = []
        for target in TARGETS.values():
            lines += [f"{target.name}: {target.what}; {target.sign}, {target.argument}"]
            lines += [f"  {target.kind.what} ({', '.join(target.kind.endings)})"]
            lines += [
                f"  {name}: {option.help}; {getattr(option.values, '__name__', option.values)}, "
                f"{option.default!r}"
                for name, option in target.options.items()
            ]
        return "\n".join(lines)

    def _drawn(self, arguments: list[str]) -> str:
        text, self._figures = "\n".join(self._figures), []
        return text

    def _hide(self, arguments: list[str]) -> str:
        believed = (self.folder / "believed.toml").read_text(encoding="utf-8")
        effect = "\n".join(["", "[[effect]]", *arguments, ""])
        (self.folder / "hidden.toml").write_text(believed + effect, encoding="utf-8")
        return ""

    def _write(self, arguments: list[str]) -> str:
        name, *lines = arguments
        text = "".join(f"{line}\n" for line in lines)
        data = text.encode("utf-8")
        if "\\" in text:
            data = text.encode("latin-1").decode("unicode_escape").encode("latin-1")
        (self.folder / name).write_bytes(data)
        return ""

    def _options(self, _: list[str]) -> str:
        return "\n".join(argument_lines())

    def _asked(self, arguments: list[str]) -> str:
        return "\n".join(Asked(self.lines, self.folder, self._known).lines(arguments))

    def _python(self, code: str) -> str:
        """A statement, or an expression with what it gives: a text, a picture, a value."""
        from matplotlib import pyplot
        from matplotlib.axes import Axes

        with (
            _within(self.folder, COLUMNS),
            self._kept(),
            warnings.catch_warnings(record=True) as warned,
        ):
            warnings.simplefilter("always")
            try:
                found = self._value(code)
            except (trueangle.TrueAngleError, OSError, TypeError, ValueError) as error:
                lines = [f"{type(error).__name__}: {error}"]
            else:
                figure = found.get_figure(root=True) if isinstance(found, Axes) else found
                if hasattr(figure, "savefig"):
                    lines = [*figure_lines(figure)]
                else:
                    lines = [] if found is None else [f"{found}"]
        pyplot.close("all")
        return "\n".join([*(f"{w.category.__name__}: {w.message}" for w in warned), *lines])

    def _value(self, code: str) -> Any:
        try:
            expression = compile(code, "transcript", "eval")
        except SyntaxError:
            exec(compile(code, "transcript", "exec"), self._names)
            return None
        return eval(expression, self._names)

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
