"""Fits of logs too large for memory: options and output of the one-pass way."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..errorunits import error_unit
from .error_units import errors_in
from .order_lists import declared_shafts
from .signal_options import reading
from .terminal import own_interrupts

if TYPE_CHECKING:
    from ..logs.fitting import LogFit

__all__ = [
    "add_one_pass",
    "fit_in_one_pass",
    "printed_orders",
    "saved",
    "wants_one_pass",
]

#: Bytes of files from which on they are not read whole.
_LARGE = 256 << 20


def add_one_pass(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of fits in one pass."""
    add = parser.add_argument
    add(
        "--one-pass",
        action="store_true",
        help="constant memory, one pass, without setting wild readings aside: so for folders, "
        "a --scheduler, and more than 256 MiB",
    )
    add(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="Dask scheduler whose workers share the files: a log on each, in one pass",
    )
    add(
        "--progress",
        choices=("auto", "text", "json", "none"),
        default="auto",
        help="of a fit in one pass, on stderr (default: text on a terminal)",
    )


def wants_one_pass(args: argparse.Namespace) -> bool:
    """Whether the files must or should not be read whole.

    Raises
    ------
    ArgumentError
        An option that needs the readings twice.
    """
    paths = [Path(path) for path in args.runs]
    asked = bool(args.one_pass or args.scheduler)
    asked = asked or any(path.is_dir() for path in paths)
    if not asked:
        existing = [path for path in paths if path.is_file()]
        asked = sum(path.stat().st_size for path in existing) > _LARGE
    if asked and (args.nuisance != "none" or args.reference_orders):
        raise ArgumentError(
            "--nuisance and --reference-orders need the readings more than once: they do not go "
            "with logs in one pass"
        )
    if asked and (getattr(args, "run", None) or getattr(args, "loss", "auto") not in _LINEAR):
        raise ArgumentError(
            "--run and the losses huber and tukey need the readings more than once: they do "
            "not go with logs in one pass"
        )
    return asked


_LINEAR = ("auto", "linear")


def fit_in_one_pass(args: argparse.Namespace, orders: Any) -> LogFit:
    """Fit by the arguments of a command."""
    from ..logs.fitting import fit_logs

    own_interrupts()
    return fit_logs(
        args.runs,
        orders,
        gear_ratio=args.gear_ratio,
        fixed_member=args.fixed_member,
        argument="reference" if args.argument == "auto" else args.argument,
        covariance=args.covariance,
        **reading(args),
        shafts=declared_shafts(args.shaft),
        scheduler=args.scheduler,
        checksums=getattr(args, "checksums", False),
        progress=args.progress,
    )


def saved(args: argparse.Namespace, orders: Any) -> int:
    """Fit, save, print."""
    found = fit_in_one_pass(args, orders)
    found.model.save(args.output)
    if args.json:
        print(json.dumps({"model": args.output, **found.to_dict()}))
    else:
        print(found.summary(errors_in(args)))
        print(f"\nsaved {args.output}")
    return 0


def printed_orders(args: argparse.Namespace) -> int:
    """Print the evidence for every order of logs in one pass."""
    if args.orders is not None or args.method != "evidence" or args.reference_orders is not None:
        raise ArgumentError(
            "--orders, --method and --reference-orders do not go with logs in one pass"
        )
    from ..angles import arcsec

    found = fit_in_one_pass(args, None)
    result = found.to_dict()
    if args.json:
        renamed = {"samples": result["readings"], "noise_arcsec": result["residual_arcsec"]}
        print(json.dumps(renamed | {"runs": result["runs"], "orders": result["evidence"]}))
        return 0
    period = found.model.period
    residual = arcsec(found.residual_std, period)
    sizes = [residual, *(arcsec(row.amplitude, period) for row in found.table)]
    unit = error_unit(errors_in(args), max(sizes), period)
    print(f"{found.rows} readings, residual {unit.text(residual)}")
    for row in found.table:
        size, std = unit.pair(arcsec(row.amplitude, period), arcsec(row.std, period))
        print(
            f"  {row.shaft:<15} {row.order:5d}  {size:>10} +- {std:>7} {unit.name}, "
            f"{row.phase_deg:6.2f} deg  " + ("retained" if row.retained else row.reason)
        )
    return 0
