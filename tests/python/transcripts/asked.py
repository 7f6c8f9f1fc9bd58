"""What each option of a command changes: the call that it makes, what is printed, or a refusal.

A command turns words into calls of the Python interface. Of a command line that works, every
further option is given in turn; as soon as a call differs it is told and not made. An option
that leaves calls, output and files as they were is told as such: nobody may ask in vain.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import inspect
import pkgutil
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import trueangle
from trueangle.cli import build_parser
from trueangle.runs.run import CalibrationRun

#: The doors of the package through which commands go.
DOORS = (
    "cli.run_lists.read_runs", "runs.files.read_runs", "runs.checks.check.check", "fitting.fit.fit",
    "fitting.orders.select.select_orders", "logs.fitting.fit_logs", "export.comparison.compare",
    "logs.fitting.select_log_orders", "logs.batch.correct_logs", "runs.joining.join",
    "runs.joining.minus_simulated", "planning.plan.plan_mounts", "planning.plan.plan_tilts",
    "planning.plan.plan_encoder", "planning.arc.plan_arc", "planning.selfplan.plan_self",
    "fleets.plan_unit", "rehearsal.after.plan_after", "simulation.simulate", "diagnosis.diagnose",
    "rehearsal.rehearse", "reports.report", "fleets.fleet.fleet", "export.export_model",
    "export.import_model", "selfcalibration.calibrate.selfcal", "model.monitor.Monitor",
    "model.batches.read_batches", "plots.fit_plot",
    "plots.drawnreadings.model_error",
)  # fmt: skip

#: These hold a state, are read once or write: made anew, not kept.
ANEW = ("Monitor", "read_batches", "correct_logs", "export_model", "import_model", "report")

#: Files that are other bytes each time.
TIMED = (".fmu", ".pdf", ".svg")

#: Letters from which on a value is told by its kind.
LONG = 150

#: What is given to an option, by the end of its name; numbers and choices need none.
VALUES = {
    "angles": "0,120", "arc": "0:90", "between": "backlash,latency", "by": "run",
    "causes": "backlash", "certificate": "identity.toml", "column": "indicated_deg", "count": "4",
    "errors_in": "mrad", "every": "2turns", "reference": "off-null",
    "existing": "printer.cfg", "facets": "facets.csv", "head_angles": "0,119.2", "joint": "elbow",
    "into_joint": "knee", "limits": "limits.toml", "model": "other.json", "nuisance": "ramp",
    "periods_per_turn": "3",
    "option_bits": "12", "option_entries": "64", "option_counts_per_turn": "65536",
    "option_name": "corrected", "option_number": "f32", "orders": "1,2",
    "option_joint": "elbow", "output_topic": "/corrected", "prior": "fleet.json",
    "reference_orders": "50", "ripple": "1-2", "robot": "robot.toml", "run": "1",
    "scheduler": "tcp://h:1", "shaft": "worm=7", "signal": "torque=run", "simulated": "polygon.csv",
    "simulation": "believed.toml", "title": "Words", "topic": "/joints", "uncertainty": "2arcmin",
    "unit_from": "([a-z]+)", "within": "2min", "workers": "1", "after": "polygon.csv",
}  # fmt: skip


class _Changed(Exception):
    """A call differs from that without the option."""


class Asked:
    """Runs a command line as it is, then with each option that it does not have yet.

    ``known`` holds what was told of other lines of the command, which is not told again.
    """

    def __init__(self, run: Callable[[str], list[str]], folder: Path, known: set[str]) -> None:
        self._run, self._folder, self._known = run, folder, known
        self._calls: list[tuple[str, dict[str, str], Any]] = []
        self._told = ""
        self._at, self._depth, self._first = 0, 0, True

    def lines(self, words: list[str]) -> Iterator[str]:
        """The calls that it makes, and a line for each option."""
        with self._watched():
            before = self._asked(words)
            for name, arguments, _ in self._calls:
                yield f"{name} {_listed(arguments)}"
            self._first = False
            parser = build_parser(words[:1], words[:1]).commands[words[0]]
            for action in parser._actions:
                option = next(iter(action.option_strings[-1:]), "")
                if not option or {*action.option_strings} & {*words} or action.dest in UNASKED:
                    continue
                more = [option, *_values(action)]
                line = f"{' '.join(more)}: {self._change(words, more, before)}"
                # Of another line of the command it was told alike.
                if line.endswith(NOTHING) or f"{words[0]} {line}" not in self._known:
                    self._known.add(f"{words[0]} {line}")
                    yield line

    def _change(
        self, words: list[str], more: list[str], before: tuple[str, dict[str, bytes]]
    ) -> str:
        text, files = self._asked([*words, *more])
        if self._told:
            return self._told
        if text == before[0] and files == before[1]:
            return NOTHING
        ending = re.search(r"trueangle.*: error: .*\n\[\d\]$", text)
        if ending is not None:
            return f"refused: {' '.join(ending[0].split())}"
        new = sorted(name for name in files.keys() - before[1].keys())
        said = [f"writes {name}" for name in new]
        said += ["writes otherwise"] if any(files[n] != d for n, d in before[1].items()) else []
        said += ["prints otherwise"] if text != before[0] else []
        return " and ".join(said)

    def _asked(self, words: list[str]) -> tuple[str, dict[str, bytes]]:
        """What is printed and written; and nothing stays."""
        known = {path: path.read_bytes() for path in self._folder.iterdir() if path.is_file()}
        self._at, self._told = 0, ""
        text = "\n".join(self._run(shlex.join(["trueangle", *words])))
        files = {}
        for path in [path for path in self._folder.iterdir() if path.is_file()]:
            content = path.read_bytes()
            if known.get(path) != content:
                files[path.name] = b"" if path.suffix in TIMED else content
                if path.suffix == ".html":
                    files[path.name] = "\n".join(self._run(f"show {path.name}")).encode()
                path.unlink()
                if path in known:
                    path.write_bytes(known[path])
        return text, files

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        # What a module imports of a door while it is watched, it would keep.
        for module in pkgutil.walk_packages(trueangle.__path__, "trueangle."):
            with contextlib.suppress(ImportError):  # of an extra that is not here
                if module.name.rpartition(".")[2] != "__main__":
                    importlib.import_module(module.name)
        kept = []
        for door in DOORS:
            module, _, name = f"trueangle.{door}".rpartition(".")
            held = importlib.import_module(module)
            kept.append((held, name, getattr(held, name)))
        for held, name, function in kept:
            setattr(held, name, self._recorded(name, function))
        try:
            yield
        finally:
            for held, name, function in kept:
                setattr(held, name, function)

    def _recorded(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        signature = inspect.signature(function)

        def door(*args: Any, **kwargs: Any) -> Any:
            if self._depth:
                return function(*args, **kwargs)
            arguments = _spread(signature, args, kwargs)
            at, self._at = self._at, self._at + 1
            if self._first:
                self._calls.append((name, arguments, None))
            elif at >= len(self._calls) or self._calls[at][:2] != (name, arguments):
                self._told = self._difference(at, name, arguments)
                raise _Changed
            elif name not in ANEW:
                return self._calls[at][2]
            self._depth += 1
            try:
                found = function(*args, **kwargs)
            finally:
                self._depth -= 1
            self._calls[at] = (name, arguments, found)
            return found

        return door

    def _difference(self, at: int, name: str, arguments: dict[str, str]) -> str:
        if at >= len(self._calls) or self._calls[at][0] != name:
            return f"calls {name} {_listed(arguments)}"
        before = self._calls[at][1]
        return f"{name} {_listed({k: v for k, v in arguments.items() if before.get(k) != v})}"


#: What must not be said but for a reason.
NOTHING = "changes nothing"

#: Said by every command alike, and what another machine lacks: a PDF needs a browser.
UNASKED = ("help", "debug", "pdf")


def _spread(signature: inspect.Signature, args: Any, kwargs: Any) -> dict[str, str]:
    """Arguments by name, keywords of keywords too, that are not the default of the function."""
    bound = signature.bind(*args, **kwargs).arguments
    found: dict[str, str] = {}
    for name, value in bound.items():
        parameter = signature.parameters[name]
        if parameter.kind is parameter.VAR_KEYWORD:
            found |= {key: _text(one) for key, one in value.items() if one is not None}
        elif not callable(value) and _text(value) != _text(parameter.default):
            found[name] = _text(value)
    return found


def _text(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], CalibrationRun):
        return f"{len(value)} runs ({sum(float(run.indicated.sum()) for run in value):.6g})"
    if hasattr(value, "text") and callable(value.text):
        return f"{value} {value.text()}"
    return re.sub(r" at 0x[0-9a-f]+", "", repr(value))


def _listed(arguments: dict[str, str]) -> str:
    """Names and values; of long ones the kind."""
    told = {
        k: v if len(v) < LONG else f"({v.split('(')[0][:20]} ...)" for k, v in arguments.items()
    }
    return ", ".join(f"{name} {text}" for name, text in told.items()) or "as by default"


def _values(action: argparse.Action) -> list[str]:
    """Something that the option takes, and that is not its default."""
    if action.nargs == 0:
        return []
    if action.dest in VALUES:
        return [VALUES[action.dest]]
    if action.choices:
        return [str(next(c for c in action.choices if c != action.default))]
    kind = getattr(action.type, "__name__", "")
    if getattr(action.type, "output", False):
        endings = action.type("x").kind.endings  # type: ignore[misc]
        return [f"other{endings[0] if endings else ''}"]
    return ["3" if kind == "int" else "2.5"]
