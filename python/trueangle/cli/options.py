"""Options that several commands share, and what is made of them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, Final

from ..errors import ArgumentError
from ..joint import FIXED_MEMBERS
from ..support.deadline import STYLES
from ..support.display_units import ERROR_UNITS, ErrorsIn
from ..support.files import MODEL, RUNS
from ..support.plainresult import json_text
from .parser import Kind, Output, declare
from .signal_options import add_signals

#: Options that several commands share, by the names under which commands take them.
_SHARED: Final[dict[str, tuple[str, Kind, str, dict[str, Any]]]] = {
    "model-output": (
        "-o --output MODEL",
        Output.of(MODEL),
        "model file to write",
        {"required": True},
    ),
    "runs-output": ("-o --output RUNS", Output.of(RUNS), "CSV file to write", {"required": True}),
    "gear-ratio": ("--gear-ratio R", float, "motor turns per output turn", {}),
    "fixed-member": (
        "--fixed-member",
        FIXED_MEMBERS,
        "fixed member of the strain wave gear (default: circular_spline)",
        {"default": "circular_spline"},
    ),
    "shaft": (
        "--shaft NAME=CYCLES",
        str,
        "further shaft and its turns per output turn, as worm=144 (may be repeated)",
        {"many": True},
    ),
    "argument": (
        "--argument",
        ("auto", "reference", "indicated"),
        "angle that the error is a function of (default: the true one, unless the "
        "reference has an arbitrary zero in every run)",
        {"default": "auto"},
    ),
    "nuisance": (
        "--nuisance auto|none|LIST",
        str,
        "fit jointly with the pattern, and keep out of the model: ramp, direction, velocity, "
        "drift (a list with commas), or those that lower the held-out error (auto); default: none",
        {"default": "none"},
    ),
    "reference-orders": (
        "--reference-orders 50,100",
        str,
        "orders of the reference's own error: fitted jointly with the pattern and "
        "not retained; with a new phase in every run where the reference was mounted again",
        {},
    ),
    "covariance": (
        "--covariance",
        ("auto", "white", "cluster", "correlated"),
        "standard errors of independent readings (white), by the scatter between runs "
        "(cluster) or of noise that is correlated in time (correlated). Default: cluster for "
        "three runs and more; else white, or correlated where that has the greater evidence",
        {"default": "auto"},
    ),
    "orders": (
        "--orders",
        str,
        "auto (default: by evidence), 1-17, output:1-3;motor:1,2",
        {"default": "auto"},
    ),
    "run": (
        "--run GLOB",
        str,
        "use the runs of this label only, or of those that match (fwd-*); '!LABEL': all but these",
        {"many": True},
    ),
    "progress": (
        "--progress",
        STYLES,
        "progress on stderr after one second (default: text on a terminal, nothing elsewhere)",
        {"default": "auto"},
    ),
    "errors-in": (
        "--errors-in",
        ERROR_UNITS,
        "unit of errors in what is printed for people (default: arcsec, or deg where "
        "errors are that large; JSON is in arcsec always)",
        {"default": "auto"},
    ),
}


def add_shared(parser: argparse.ArgumentParser, *names: str) -> None:
    """Declare options that several commands share, in this order."""
    for name in names:
        spelled, kind, told, more = _SHARED[name]
        declare(parser, spelled, kind, told, **more)


def add_joint(parser: argparse.ArgumentParser) -> None:
    """Options that state which joint the readings are of, and where they are."""
    add_shared(parser, "gear-ratio", "fixed-member", "shaft")
    add_signals(parser)


def errors_in(args: argparse.Namespace) -> ErrorsIn:
    """What a summary takes: the name, or the counts of a turn where they are given."""
    asked = str(getattr(args, "errors_in", "auto"))
    counts: float | None = getattr(args, "counts_per_turn", None)
    return counts if asked == "count" and counts is not None else asked


def show(
    args: argparse.Namespace, result: Any, saved: str | None = None, named: str | None = None
) -> None:
    """Print a result for people, and where it was saved, or as JSON for ``--json``.

    JSON on one line names the file as ``named``; without a name it is indented.
    """
    if not args.json:
        print(result.summary(errors_in(args)))
        if saved is not None:
            corrects = named == "model" and bool(result.model.shafts or result.model.channels)
            print(f"\nsaved {saved}" + f"; next: trueangle correct LOG -m {saved}" * corrects)
    elif named is not None:
        print(json_text({named: saved, **result.to_dict()}))
    else:
        print(result.to_json())


def given(args: argparse.Namespace, *names: str, **renamed: str) -> dict[str, Any]:
    """The options that were given, by the names under which a function takes them."""
    renamed |= {name: name for name in names}
    return {to: getattr(args, name) for to, name in renamed.items() if vars(args)[name] is not None}


def refuse_given(args: argparse.Namespace, options: Sequence[str], because: str) -> None:
    """Refuse options that the others leave without a meaning.

    Raises
    ------
    ArgumentError
        The first of ``options``, by their names in ``args``, that was given.
    """
    for name in options:
        value = getattr(args, name)
        if value is not None and value is not False:
            option = name.removesuffix("_method").replace("_", "-")  # --self is a word of Python
            raise ArgumentError(f"--{option} {because}")
