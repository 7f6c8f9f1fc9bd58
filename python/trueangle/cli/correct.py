"""``trueangle correct``: logs in, the same logs with the corrected angle out."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, TrueAngleError
from ..support.display_units import ErrorsIn, error_unit
from ..support.plainresult import json_text
from ..support.suggestions import did_you_mean, listed_names
from .ending import own_interrupts
from .options import add_shared, errors_in
from .parser import Input, ModelInput, declare
from .robots import add_robot, joints_asked
from .signal_options import add_signals, signals_by_joint

if TYPE_CHECKING:
    from ..logs.batch import BatchReport, LogReport

#: Logs that failed, or wait, that are reported by name.
_TOLD = 5

HELP = "correct the indicated angles of logs with a saved model"
EXAMPLE = "trueangle correct logs/*.parquet -m joint_a.json -o corrected/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add(
        "logs LOG...",
        Input,
        "logs or folders of them: Parquet, Arrow, CSV, HDF5, MATLAB v7.3, ROS bags, MCAP, MDF4",
    )
    add(
        "-m --model [JOINT=]FILE",
        ModelInput,
        "model file written by trueangle fit, also of a whole robot; with several joints one "
        "of each, or one of all",
        required=True,
        many=True,
    )
    add("-o --output OUT", str, "file to write; a folder for several")
    add("--in-place", bool, "replace every log by its corrected copy once that is verified")
    add(
        "--column [JOINT=]NAME",
        str,
        "column of the angle (default: indicated_*, of a joint JOINT_indicated_* or the like)",
        many=True,
    )
    add(
        "--unit",
        ("deg", "rad", "turn", "count", "arcsec", "arcmin"),
        "unit of the angle (default: the ending of its name, else the model's)",
    )
    add("--counts-per-turn N", float, "counts in one turn of the output, for an angle in counts")
    add_signals(parser, counts=False, runs=False, reference=False, channels=False)
    add(
        "--output-topic NAME",
        str,
        "topic that takes the corrected positions (default: TOPIC_corrected; the topic "
        "itself replaces them)",
    )
    add(
        "--scheduler tcp://HOST:PORT",
        str,
        "Dask scheduler whose workers share the files: every log on one of them",
    )
    add(
        "--progress",
        ("auto", "text", "json", "none"),
        "progress on stderr (default: text on a terminal; one JSON object a line with --json)",
        default="auto",
    )
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")
    add_robot(parser)


def run(args: argparse.Namespace) -> int:
    """Correct every log."""
    import sys

    from ..logs.batch import correct_logs

    own_interrupts()
    progress = args.progress
    if progress == "auto" and args.json and sys.stderr.isatty():
        progress = "json"
    named = any(role == "indicated" for _, role, _, _ in args.signal or ())
    if named and (args.column or args.unit):
        option = "--column" if args.column else "--unit"
        print(
            f"trueangle: error: {option} and --signal indicated=NAME:UNIT name the same column; "
            "give one",
            file=sys.stderr,
        )
        return 2
    models: dict[Any, Any] = by_joint(args.model, "--model")
    signals, single = _columns_of_joints(models, args)
    result = correct_logs(
        args.logs,
        models.get(None, models),
        args.output,
        in_place=args.in_place,
        column=_columns(args.column, single),
        signals=signals,
        unit=args.unit,
        counts_per_turn=args.counts_per_turn,
        topic=args.topic,
        output_topic=args.output_topic,
        scheduler=args.scheduler,
        progress=progress,
        report=(lambda log: None) if args.json else (lambda log: _print(log, errors_in(args))),
    )
    if args.json:
        print(json_text(result.to_dict()))
    else:
        _total(result)
    return _status(result)


def _columns_of_joints(
    models: dict[Any, Any], args: argparse.Namespace
) -> tuple[dict[str, Any] | None, bool]:
    """Columns of the log's joints, and whether it has one; ``models`` lose joints that it lacks."""
    from ..model.robot import is_robot_file, load_robot

    single = None in models
    whole = single and is_robot_file(models[None])
    if not whole and args.robot is None and not args.joint:
        return signals_by_joint(args.signal, single), single
    if single and not whole:
        raise ArgumentError(
            f"--robot and --joint need models of several joints: {models[None]} is that of one; "
            "give -m ROBOT.json, or -m JOINT=FILE of each"
        )
    known = list(load_robot(models[None]) if whole else models)
    for joint in args.joint or ():
        if joint not in known:
            raise ArgumentError(
                f"--joint {joint}: it has no model; the joints are "
                f"{listed_names(known)}{did_you_mean(joint, known)}"
            )
    if args.robot is None:
        signals_by_joint(args.signal, single=False)  # that of a joint has its name before it
    if args.joint and whole:
        models.update(load_robot(models.pop(None)))
    for joint in known if args.joint else ():
        if joint not in args.joint:
            del models[joint]
    asked = joints_asked(args) if args.robot is not None or args.signal else None
    named = {joint.name: joint.signals for joint in (asked[1] if asked is not None else ())}
    if whole:
        robot = load_robot(args.model[0])
        named = {j: {**robot.signals.get(j, {}), **named.get(j, {})} for j in known}
    kept = args.joint or known
    return {joint: columns for joint, columns in named.items() if joint in kept} or None, False


def by_joint(entries: Sequence[str], option: str) -> dict[str | None, str]:
    """``FILE`` or several ``JOINT=FILE`` as a mapping."""
    found: dict[str | None, str] = {}
    for entry in entries:
        joint, equals, value = entry.partition("=")
        key = joint if equals else None
        if not equals:
            value = entry
        if key in found or not value or key == "":
            raise ArgumentError(f"{option}: every joint once, as joint3=NAME, got {entry!r}")
        found[key] = value
    if None in found and len(found) > 1:
        raise ArgumentError(f"{option}: with several joints name them all, as joint3={found[None]}")
    return found


def _columns(entries: Sequence[str] | None, single: bool) -> Any:
    if not entries:
        return None
    if single:
        if len(entries) > 1:
            raise ArgumentError("--column: one model corrects one column; give --column once")
        return entries[0]
    return by_joint(entries, "--column")


def _print(log: LogReport, asked: ErrorsIn) -> None:
    if not log.is_done:
        return  # reported at the end, on stderr
    result = log.result
    if log.status == "done before":
        print(f"{log.log}: done before -> {log.output}")
        return
    print(
        f"{log.log}: {result['rows']} readings corrected at "
        f"{result['rows_per_second']:,.0f} rows/s -> {log.output}"
    )
    for joint in result["joints"]:
        rms, largest = joint["rms_correction_arcsec"], joint["max_abs_correction_arcsec"]
        unit = error_unit(asked, largest)
        text = (
            f"  {joint['corrected']}: correction {unit.text(rms)} rms, "
            f"{unit.number(largest)} max abs"
        )
        if joint["missing"]:
            text += f", {joint['missing']} missing kept"
        if joint["outside_span"]:
            text += f", {joint['outside_span']} outside the calibrated span, "
            text += "where no reading verifies it"
        print(text, flush=True)


def _total(result: BatchReport) -> None:
    """Print what became of all logs together, where there are several."""
    if len(result.logs) < 2:
        return
    done = [log for log in result.logs if log.status == "done"]
    before = sum(log.status == "done before" for log in result.logs)
    rows = sum(log.result["rows"] for log in done)
    print(
        f"{len(done)} of {len(result.logs)} logs corrected"
        + (f", {before} already" if before else "")
        + f": {rows} readings in {result.seconds:.1f} s",
        flush=True,
    )


def _status(result: BatchReport) -> int:
    """0, or an error that lists what is not done."""
    if result.is_done and not result.interrupted:
        return 0
    failed = [log for log in result.logs if log.error is not None]
    if len(result.logs) == 1 and failed and failed[0].error is not None:
        raise failed[0].error
    done = sum(log.is_done for log in result.logs)
    waiting = [str(log.log) for log in result.logs if log.status == "not started"]
    parts = [f"{done} of {len(result.logs)} logs are corrected and complete"]
    parts += [f"failed: {_told(log)}" for log in failed[:_TOLD]]
    if failed[_TOLD:]:
        parts.append(f"{len(failed) - _TOLD} more failed")
    if waiting:
        parts.append(f"not started: {listed_names(waiting, _TOLD)}")
    parts.append("run the same command again to go on")
    raise (KeyboardInterrupt if result.interrupted else TrueAngleError)("; ".join(parts))


def _told(log: LogReport) -> str:
    text = str(log.error)
    return text if str(log.log) in text else f"{log.log}: {text}"
