"""Options that several commands share, and what is made of them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ..errors import ArgumentError
from ..support.deadline import STYLES
from ..support.display_units import ERROR_UNITS, ErrorsIn
from ..support.files import MODEL, RUNS
from .paths import Output
from .signal_options import add_signals


def add_model_output(parser: argparse.ArgumentParser) -> None:
    """The model that a command writes."""
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=Output.of(MODEL),
        metavar="MODEL",
        help="model file to write",
    )


def add_runs_output(parser: argparse.ArgumentParser) -> None:
    """The runs that a command writes."""
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=Output.of(RUNS),
        metavar="RUNS",
        help="CSV file to write",
    )


def add_joint(parser: argparse.ArgumentParser) -> None:
    """Options that tell what joint the readings are of; shared by several commands."""
    from ..joint.members import FIXED_MEMBERS

    parser.add_argument("--gear-ratio", type=float, metavar="R", help="motor turns per output turn")
    parser.add_argument(
        "--fixed-member",
        choices=FIXED_MEMBERS,
        default="circular_spline",
        help="of the strain wave gear (default: circular_spline)",
    )
    parser.add_argument(
        "--shaft",
        action="append",
        metavar="NAME=CYCLES",
        help="further shaft and its turns per output turn, as worm=144 (may be repeated)",
    )
    add_signals(parser)


def add_argument_choice(parser: argparse.ArgumentParser) -> None:
    """The angle that errors are a function of; shared by several commands."""
    parser.add_argument(
        "--argument",
        choices=("auto", "reference", "indicated"),
        default="auto",
        help="angle that the error is a function of (default: the true one, unless the "
        "reference has an arbitrary zero in every run)",
    )


def add_nuisance(parser: argparse.ArgumentParser) -> None:
    """What is fitted jointly with the pattern; shared by several commands."""
    parser.add_argument(
        "--nuisance",
        default="none",
        metavar="auto|none|LIST",
        help="fit jointly with the pattern, and keep out of the model: ramp, direction, velocity, "
        "drift (a list with commas), or those that lower the held-out error (auto); default: none",
    )
    parser.add_argument(
        "--reference-orders",
        metavar="50,100",
        help="orders that the reference itself makes: fitted jointly with the pattern, not "
        "retained; with a phase of their own in every run where it was mounted anew",
    )


def add_covariance(parser: argparse.ArgumentParser) -> None:
    """How standard errors are taken; shared by several commands."""
    parser.add_argument(
        "--covariance",
        choices=("auto", "white", "cluster", "hac"),
        default="auto",
        help="standard errors of independent readings (white), by the scatter between runs "
        "(cluster) or between segments of readings (hac); default: white unless correlation "
        "is found",
    )


def add_orders(parser: argparse.ArgumentParser) -> None:
    """Orders of a fit."""
    parser.add_argument(
        "--orders",
        default="auto",
        help="auto (default: by evidence), 1-17, output:1-3;motor:1,2",
    )


def add_labels(parser: argparse.ArgumentParser) -> None:
    """Which runs of the files are used."""
    parser.add_argument(
        "--run",
        action="append",
        metavar="GLOB",
        help="use the runs of this label only, or of those that match (fwd-*)",
    )


def add_progress(parser: argparse.ArgumentParser) -> None:
    """How work that takes its time says where it is."""
    parser.add_argument(
        "--progress",
        choices=STYLES,
        default="auto",
        help="on stderr after one second (default: text on a terminal, nothing elsewhere)",
    )


def add_errors_in(parser: argparse.ArgumentParser) -> None:
    """Declare ``--errors-in``; shared by every command that prints errors."""
    parser.add_argument(
        "--errors-in",
        choices=ERROR_UNITS,
        default="auto",
        help="unit of errors in what is printed for people (default: arcsec, or deg where "
        "errors are that large; JSON is in arcsec always)",
    )


def errors_in(args: argparse.Namespace) -> ErrorsIn:
    """What a summary takes: the name, or the counts of a turn where they are given."""
    counts: float | None = getattr(args, "counts_per_turn", None)
    if args.errors_in == "count" and counts is not None:
        return counts
    return str(args.errors_in)


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
