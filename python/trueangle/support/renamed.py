"""Modules under the names they had before: found for one more release, with a warning.

`RENAMED` is the one list; what lies in a room that moved is found by the room's line. The finder
stands behind all others, so that an import of what there is never comes here.
"""

from __future__ import annotations

import sys
import warnings
from types import ModuleType
from typing import Any, Final

#: Former module or room, and where it is now; the longest that fits counts.
RENAMED: Final = {
    "aliasing": "runs.aliasing",
    "angles": "support.angles",
    "bench": "cli.benchmarks",
    "blas": "support.blas",
    "checks": "runs.checks",
    "columns": "formats.columns",
    "correction": "model",
    "decoding": "support.decoding",
    "distributions": "support.distributions",
    "errorunits": "support.display_units",
    "estimation.estimate": "estimation.quantity",
    "explanations": "joint.gear",
    "files": "support.files",
    "fitting.travel": "runs.travel",
    "joining": "runs.joining",
    "labelled": "support.labelled",
    "logs.ahead": "formats.ahead",
    "logs.checksum": "formats.checksum",
    "modelfile": "model.file",
    "modelsummary": "model.model",
    "modeltext": "model.writing",
    "moments": "estimation.moments",
    "momentsfit": "estimation.momentsfit",
    "orders": "fitting.orders",
    "pace": "support.deadline",
    "paperstudy": "cli.paperstudy",
    "paperstudy.report": "cli.demo",
    "plainresult": "support.plainresult",
    "powersums": "support.powersums",
    "provenance": "runs.provenance",
    "quantiles": "support.quantiles",
    "readings": "runs.readings",
    "records": "model.records",
    "reference": "estimation.reference",
    "regression": "estimation",
    "runcsv": "runs.writing",
    "runfiles": "runs.files",
    "runtables": "runs.tables",
    "shafts": "joint.shafts",
    "signals": "support.signals",
    "sklearn": "fitting.sklearn",
    "spanguard": "model.evaluation",
    "step": "model.step",
    "suggestions": "support.suggestions",
    "terms": "model.terms",
    "turns": "support.unit_periods",
    "units": "runs.follows",
    "validity": "model.validity",
}

_PACKAGE: Final = "trueangle"


def moved_name(name: str) -> str | None:
    """Where the module ``trueangle.`` + ``name`` is now; None where it never was."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        room = RENAMED.get(".".join(parts[:cut]))
        if room is not None:
            return ".".join([room, *parts[cut:]])
    return None


def renamed_attribute(module: str, now: str, name: str) -> Any:
    """What the former module ``module``, which is a room now, held: the attribute of ``now``."""
    if name.startswith("__"):
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    from importlib import import_module

    try:
        found = getattr(import_module(now), name)
    except AttributeError:
        raise AttributeError(f"module {module!r} has no attribute {name!r}") from None
    _warn(f"{module}.{name}", f"{now}.{name}")
    return found


def _held(now: ModuleType, name: str) -> Any:
    # ``__path__`` of a room would find its modules a second time, under their former names.
    if name.startswith("__"):
        raise AttributeError(name)
    return getattr(now, name)


def _warn(before: str, now: str) -> None:
    warnings.warn(
        f"{before} is now {now}; the former name goes with the next release",
        DeprecationWarning,
        stacklevel=4,
    )


class _Finder:
    """Finds former modules; a loader of its own."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        room, _, inner = name.partition(".")
        now = moved_name(inner) if room == _PACKAGE and inner else None
        if now is None:
            return None
        from importlib.machinery import ModuleSpec

        # A room's modules are asked for through the room: it has to look like a package.
        loader: Any = self
        return ModuleSpec(name, loader, loader_state=f"{_PACKAGE}.{now}", is_package=True)

    def create_module(self, spec: Any) -> ModuleType:
        from importlib import import_module

        now = import_module(spec.loader_state)
        module = ModuleType(spec.name, now.__doc__)
        module.__dict__.update(
            (key, value) for key, value in vars(now).items() if not key.startswith("__")
        )
        if hasattr(now, "__all__"):
            module.__dict__["__all__"] = now.__all__
        module.__dict__["__getattr__"] = lambda name: _held(now, name)
        _warn(spec.name, spec.loader_state)
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing is left to do."""


def install_former_names() -> None:
    """Let imports of former names find what they name."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
