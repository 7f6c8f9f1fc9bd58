"""``trueangle plot``: the picture of a model, or of runs with the model fitted to them."""

from __future__ import annotations

import argparse
import io
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, cast

from ..errors import ArgumentError
from ..support.files import PICTURE, written_atomically
from ..support.layout import laid_out
from ..support.plainresult import json_text
from .options import add_joint, add_shared, errors_in, refuse_given
from .parser import Input, Output, declare
from .robots import model_asked, refuse_joint
from .values import declared_shafts, orders_by_shaft

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HELP = "draw the error over the angle, of a model or of runs with their fit"
EXAMPLE = "trueangle plot joint_a.csv -o joint_a.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("files MODEL|RUNS...", Input, "a model file (.json), or files of readings")
    add(
        "-o --output FILE",
        Output.of(PICTURE),
        "the picture to write: PNG, SVG or PDF, by its ending",
        required=True,
    )
    add(
        "--kind",
        ("errors", "spectrum", "phases", "residuals"),
        "of runs: errors over the angle (default), amplitudes of the orders, phases over the "
        "runs, or what the fit leaves",
        default="errors",
    )
    add_shared(parser, "orders", "run")
    add_joint(parser)
    add("--joint NAME", str, "joint to take from the model file of a robot")
    add_shared(parser, "errors-in")
    add("--json", bool, "print the plotted data as JSON")


def run(args: argparse.Namespace) -> int:
    """Draw, write, and print what the picture shows."""
    import matplotlib as mpl

    from ..plots.canvas import text_alternative

    mpl.use("Agg")  # a file is written: no window is needed
    axes = _of_model(args) if args.files[0].lower().endswith(".json") else _of_runs(args)
    save_picture(axes, args.output)
    shows = text_alternative(axes)
    if args.json:
        print(json_text({"output": args.output, "shows": shows}))
    else:
        print(laid_out([shows, f"saved {args.output}"]))
    return 0


def _of_model(args: argparse.Namespace) -> Axes:
    from ..plots.drawnreadings import model_error

    if len(args.files) > 1 or args.kind != "errors":
        raise ArgumentError(
            "one model has one picture: give one file and leave --kind out, or give the runs"
        )
    of_runs = ("gear_ratio", "shaft", "signal", "counts_per_turn_reference", "periods_per_turn")
    says = "is of a picture of runs, and this is of a model"
    refuse_given(args, (*of_runs, "run", "topic", "facets", "unit_from"), says)
    if args.orders != "auto":
        raise ArgumentError(f"--orders {says}")
    refuse_joint(args.joint, args.files)
    return model_error(model_asked(args.files[0], args.joint), errors_in=errors_in(args))


def _of_runs(args: argparse.Namespace) -> Axes:
    from ..fitting.fit import fit
    from ..plots import fit_plot
    from .run_lists import read_selected_runs

    refuse_given(args, ("joint",), "is of the model file of a robot, and these are runs")
    args.runs = args.files
    found = fit(
        read_selected_runs(args),
        orders=orders_by_shaft(args.orders, declared_shafts(args.shaft)),
        gear_ratio=args.gear_ratio,
        fixed_member=args.fixed_member,
        shafts=declared_shafts(args.shaft),
    )
    return fit_plot(found, args.kind, errors_in=errors_in(args))


def save_picture(drawn: Axes | Figure, path: str) -> None:
    """Write a picture whole or not at all, in the format of its ending (PNG without one)."""
    ending = Path(path).suffix.lower()
    kind = ending[1:] if ending in PICTURE.endings else "png"
    figure = drawn if hasattr(drawn, "savefig") else drawn.get_figure(root=True)
    assert figure is not None
    written = io.BytesIO()
    figure.savefig(written, format=kind)
    with written_atomically(path, kind=PICTURE) as file:
        cast(TextIO, file).buffer.write(written.getvalue())
