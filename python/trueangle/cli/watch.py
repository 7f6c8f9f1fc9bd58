"""``trueangle watch``: a running joint against its model, window by window."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..support.files import PAGE, PICTURE
from ..support.plainresult import json_text
from .options import add_shared, errors_in, refuse_given
from .parser import Input, Output, declare
from .plot import save_picture
from .robots import add_robot, joint_asked, joints_asked, refuse_joint
from .signal_options import (
    SOURCES,
    add_signals,
    add_source_options,
    reading_options,
    source_argument,
    source_options,
)
from .values import turns

if TYPE_CHECKING:
    from ..model.batches import ReadingBatch
    from ..model.model import HarmonicModel
    from ..model.monitor import WatchedWindow

HELP = "watch a running joint against its model; status 3 where an alarm was raised"
EXAMPLE = "trueangle watch joint.csv -m joint_a.json --every 1turn"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add(
        "log SOURCE",
        source_argument,
        "log with a reference and an indicated angle, or with the error; or lines as they "
        f"arrive, from {SOURCES}",
    )
    add("-m --model MODEL", Input, "model file, also of a robot (--joint)", required=True)
    add(
        "--every 1turn",
        turns,
        "travel of a window, in turns of the output (default: 1turn)",
        default=1.0,
    )
    add(
        "--shift S",
        float,
        "shift to detect, in standard deviations of a window (default: %(default)g)",
        default=1.0,
    )
    add(
        "--run-length N",
        float,
        "windows until a false alarm, on average (default: %(default)g)",
        default=465.0,
    )
    add_source_options(parser)
    add_signals(parser)
    add_robot(parser)
    add_shared(parser, "errors-in")
    add(
        "--plot FILE",
        Output.of(PICTURE),
        "draw the charts of all windows, at the end (needs trueangle[plot])",
    )
    add(
        "--report FILE",
        Output.of(PAGE),
        "write a page with the alarms and charts of all windows, at the end",
    )
    add("--json", bool, "print one object per window and line")


def run(args: argparse.Namespace) -> int:
    """Feed the windows, print each."""
    from ..model.monitor import Monitor

    joint, args = _of_joint(args)
    model, columns = joint_asked(args.model, joint)
    watched = Monitor(model, every=args.every, shift=args.shift, run_length=args.run_length)
    alarmed, kept = False, []
    for batch in _batches(args, model, columns):
        for window in watched.windows_of(*batch):
            alarmed |= window.alarm
            if args.plot is not None or args.report is not None:
                kept.append(window)
            print(_line(window, model, args), flush=True)
    if (n := watched.windows) < watched.baseline:
        told = f"only {n} windows; the baseline needs {watched.baseline}: record longer"
        print(f"trueangle: warning: {told}, or lower --every", file=sys.stderr)
    if kept and args.plot is not None:
        from ..plots.controlcharts import watched_windows

        save_picture(watched_windows(kept, model.period, errors_in(args)), args.plot)
    if kept and args.report is not None:
        from ..reports.watched import WatchReport

        WatchReport(kept, model.period, errors_in=errors_in(args)).save(args.report)
    # Exit status where an alarm was raised.
    return 3 if alarmed else 0


def _of_joint(args: argparse.Namespace) -> tuple[str | None, argparse.Namespace]:
    """The joint of a robot that is watched, if it is one, and the arguments as for it alone."""
    if args.robot is not None or any(entry[0] is not None for entry in args.signal or ()):
        asked = joints_asked(args)
        joints = asked[1] if asked is not None else []
        if len(joints) != 1:
            names = ", ".join(joint.name for joint in joints)
            raise ArgumentError(f"one joint is watched at a time: --joint NAME, one of {names}")
        return joints[0].name, joints[0].args
    if args.joint and len(args.joint) > 1:
        raise ArgumentError(f"one joint is watched at a time, got {', '.join(args.joint)}")
    joint = args.joint[0] if args.joint else None
    refuse_joint(joint, (args.model,))
    return joint, args


def _batches(
    args: argparse.Namespace, model: HarmonicModel, columns: Mapping[str, Any]
) -> Iterator[ReadingBatch]:
    from ..model.batches import read_batches
    from ..recording.watched import watched_batches

    options: Any = reading_options(args)
    options["signals"] = {**columns, **(options["signals"] or {})} or None
    if isinstance(args.log, Input):
        refuse_given(
            args, ("baud", "dbc", "pattern", "send"), "is for lines that arrive: SOURCE is a file"
        )
        return read_batches(Path(args.log), model, options)
    return watched_batches(args.log, model, options, source_options(args, [args.log]))


def _line(window: WatchedWindow, model: HarmonicModel, args: argparse.Namespace) -> str:
    """One window in one line."""
    from .._core import Monitor
    from ..support.angles import arcsec
    from ..support.display_units import error_unit

    scale = arcsec(1.0, model.period)
    if args.json:
        return json_text(window.plain(scale))
    largest = max(window.orders, key=lambda row: row.amplitude)
    size = scale * largest.amplitude
    shown = error_unit(errors_in(args), size, model.period)
    change = f"change {window.statistic:.2f}, alarm from {window.limit:.2f}"
    if window.window <= Monitor.BASELINE:
        change = f"baseline {window.window} of {Monitor.BASELINE}"
    text = f"window {window.window:5d}  order {largest.order:g} is off by "
    text += f"{shown.text(size)}; {change}"
    return f"{text}  ALARM {shown.spoken(window.because)}" if window.alarm else text
