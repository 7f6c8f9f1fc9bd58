"""``trueangle fit``: calibration runs in, a model file out; logs of any size in one pass."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from ..errors import ArgumentError
from .ending import own_interrupts
from .options import add_joint, add_shared, show
from .parser import Input, declare
from .robots import add_robot, each_joint, joints_asked, save_models, show_joints
from .signal_options import reading_options
from .values import declared_shafts, orders_by_shaft, parse_orders

if TYPE_CHECKING:
    from ..fitting.result import FitResult
    from ..fleets.result import Fleet
    from ..runs.run import CalibrationRun
    from .robots import JointAsked

HELP = "fit a harmonic model to calibration runs and save it"
EXAMPLE = "trueangle fit joint_a.csv -o joint_a.json --gear-ratio 100"

#: Readings, two numbers of 8 bytes each, that are read into runs: 256 MiB of them.
_READINGS: Final = (256 << 20) // 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add(
        "runs RUNS...",
        Input,
        "files of readings: CSV, Excel, Parquet, HDF5, MATLAB, numpy, ROS bags and others",
    )
    add_shared(parser, "model-output")
    add(
        "--orders",
        str,
        "auto (default: by evidence), 1-17, 1,4,8, or per shaft: output:1-3;motor:1,2",
        default="auto",
    )
    add_joint(parser)
    add_robot(parser)
    add_shared(parser, "argument", "covariance", "nuisance", "reference-orders")
    add(
        "--loss",
        ("auto", "linear", "huber", "tukey"),
        "auto (default): least squares without outliers, which are reported; linear: with "
        "all readings; huber, tukey: with weights that fall with the residual",
        default="auto",
    )
    add_shared(parser, "run")
    add(
        "--prior FLEET",
        Input,
        "fleet file (`trueangle fleet -o`): what units of the same design are like, so that "
        "ten readings may do",
    )
    add_one_pass(parser)
    add("--checksums", bool, "keep the sha256 of the files in the model, also of a fit in one pass")
    add_shared(parser, "errors-in")
    add("--json", bool, "print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Fit, save, print."""
    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    result = _fitted(args)
    result.model.save(args.output)
    show(args, result, args.output, named="model")
    return 0


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """Fit every joint; one file of all models."""
    from ..reports.robot import fitted_rank

    refuse_robot(args)
    runs: dict[str, Any] = {}

    def work(joint: JointAsked) -> Any:
        from .run_lists import read_selected_runs

        runs[joint.name] = read_selected_runs(joint.args)
        return _in_memory(joint.args, runs[joint.name])

    fits, failed = each_joint(joints, work)
    ranks = (fitted_rank(joint, runs[joint], fit) for joint, fit in {**fits, **failed}.items())
    save_models(args.output, name, joints, {joint: fit.model for joint, fit in fits.items()})
    show_joints(args, fits, ranks, f"Fit of {name or 'the robot'}", args.output)
    return 0


def _fitted(args: argparse.Namespace) -> FitResult:
    if args.prior is None and wants_one_pass(args):
        from ..logs.fitting import fit_logs

        orders = orders_by_shaft(args.orders, declared_shafts(args.shaft))
        return fit_logs(
            args.runs, orders, loss=args.loss, checksums=args.checksums, **log_options(args)
        )
    from .run_lists import read_selected_runs

    return _in_memory(args, read_selected_runs(args))


def _in_memory(args: argparse.Namespace, runs: list[CalibrationRun]) -> FitResult:
    from ..fitting.fit import fit

    if args.prior is not None and (args.one_pass or args.scheduler):
        option = "--one-pass" if args.one_pass else "--scheduler"
        raise ArgumentError(f"--prior goes with readings in memory: leave {option} out")
    return fit(
        runs,
        orders=orders_by_shaft(args.orders, declared_shafts(args.shaft)),
        gear_ratio=args.gear_ratio,
        fixed_member=args.fixed_member,
        argument=args.argument,
        loss=args.loss,
        covariance=args.covariance,
        nuisance=args.nuisance,
        reference_orders=parse_orders(args.reference_orders, "--reference-orders")
        if args.reference_orders
        else (),
        shafts=declared_shafts(args.shaft),
        prior=None if args.prior is None else _fleet(args.prior),
    )


def _fleet(path: str) -> Fleet:
    from ..fleets.file import load_fleet

    return load_fleet(path)


def add_one_pass(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of fits in one pass."""
    add = partial(declare, parser)
    add(
        "--one-pass",
        bool,
        "constant memory: sums of all readings, and some 65 000 of them where there are more "
        "than 2^20 (default: for more than 2^24, and with --scheduler)",
    )
    add(
        "--scheduler tcp://HOST:PORT",
        str,
        "Dask scheduler whose workers share the files: a log on each",
    )
    add(
        "--progress",
        ("auto", "text", "json", "none"),
        "progress of a fit in one pass, on stderr (default: text on a terminal)",
        default="auto",
    )


def wants_one_pass(args: argparse.Namespace) -> bool:
    """Whether the readings must or should not all be in memory.

    Raises
    ------
    ArgumentError
        An option that needs all readings.
    """
    asked = bool(args.one_pass or args.scheduler) or _is_large(args)
    if asked and (args.nuisance != "none" or args.reference_orders):
        raise ArgumentError(
            "--nuisance and --reference-orders need all readings: they do not go with logs in "
            "one pass"
        )
    if asked and (args.run or getattr(args, "loss", "auto") not in ("auto", "linear")):
        raise ArgumentError(
            "--run and the losses huber and tukey need all readings: they do not go with logs in "
            "one pass"
        )
    return asked


def refuse_robot(args: argparse.Namespace) -> None:
    """Refuse one pass over the logs of several joints.

    Raises
    ------
    ArgumentError
        It was requested.
    """
    if args.one_pass or args.scheduler:
        raise ArgumentError("--one-pass and --scheduler go with one joint: leave --robot out")


def _is_large(args: argparse.Namespace) -> bool:
    from ..runs.paths import find_logs, matched_paths

    paths = matched_paths(args.runs)
    if not all(path.is_file() or path.is_dir() for path in paths):
        return False  # a pipe is read once
    from ..logs.sources import logs_hold_at_most

    found = [path for path, _ in find_logs(paths)]
    return not logs_hold_at_most(found, _READINGS, args.topic)


def log_options(args: argparse.Namespace) -> dict[str, Any]:
    """Keywords of `trueangle.fit_logs` from the options of a command."""
    own_interrupts()
    reading = reading_options(args)
    if reading.pop("periods_per_turn") is not None:
        raise ArgumentError(
            "--periods-per-turn is for sine and cosine channels, which need all readings: leave "
            "--one-pass out"
        )
    return {
        "gear_ratio": args.gear_ratio,
        "fixed_member": args.fixed_member,
        "argument": args.argument,
        "covariance": args.covariance,
        **reading,
        "shafts": declared_shafts(args.shaft),
        "scheduler": args.scheduler,
        "progress": args.progress,
    }
