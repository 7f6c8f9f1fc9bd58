"""``trueangle report``: one self-contained page from calibration runs."""

from __future__ import annotations

import argparse
import json

from ..errors import ArgumentError
from ..support.deadline import STYLES, paced
from ..support.files import PDF, REPORT
from .error_units import add_errors_in, errors_in
from .fit import add_joint
from .order_lists import declared_shafts, orders_by_shaft
from .paths import Input, Output

HELP = "write a report on calibration runs: one HTML page, or a PDF"
EXAMPLE = "trueangle report joint_a.csv --simulation joint.toml -o report.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("runs", nargs="+", type=Input, metavar="RUNS", help="calibration runs, CSV or Parquet")
    add(
        "-o",
        "--output",
        required=True,
        type=Output.of(REPORT),
        metavar="FILE",
        help="the report to write: HTML, or PDF where the name ends so",
    )
    add(
        "--simulation",
        type=Input,
        metavar="FILE",
        help="say what this simulation gets wrong, and why",
    )
    add("--orders", default="auto", help="auto (default: by evidence), 1-17, output:1-3;motor:1,2")
    add_joint(parser)
    add("--title", help="heading of the report")
    add(
        "--model",
        type=Input,
        metavar="MODEL",
        help="say of this model how it was made, what it is blind to and leaves of the runs",
    )
    add(
        "--certificate",
        type=Input,
        metavar="IDENTITY",
        help="write a calibration certificate (PDF) with what this TOML file says of the item, "
        "the laboratory and the type B uncertainties",
    )
    add("--positions", type=int, metavar="N", help="nominal positions of a certificate (36)")
    add_errors_in(parser)
    add(
        "--pdf",
        type=Output.of(PDF),
        metavar="FILE",
        help="print it to a PDF too, by an installed browser",
    )
    add(
        "--progress",
        choices=STYLES,
        default="auto",
        help="on stderr after one second (default: text on a terminal, nothing elsewhere)",
    )
    add("--json", action="store_true", help="print the report's numbers as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the report."""
    from ..reports import report
    from .run_lists import read_checked

    if args.certificate is not None and args.pdf is not None:
        raise ArgumentError("--pdf prints a report; a certificate is a PDF itself: give it by -o")
    runs = read_checked(args)
    simulation = None
    if args.simulation is not None:
        from ..simulation import load_simulation

        simulation = load_simulation(args.simulation)
    known = declared_shafts(args.shaft) if simulation is None else simulation.joint.shafts
    with paced(style=args.progress):
        made = report(
            runs,
            args.output,
            simulation=simulation,
            orders=orders_by_shaft(args.orders, known),
            gear_ratio=args.gear_ratio,
            fixed_member=args.fixed_member,
            shafts=declared_shafts(args.shaft),
            title=args.title,
            certificate=args.certificate,
            positions=args.positions,
            model=args.model,
            errors_in=errors_in(args),
        )
    if args.pdf is not None:
        made.save_pdf(args.pdf)
    if args.json:
        print(json.dumps(made.content, indent=2, allow_nan=False))
    else:
        print(args.output)
    return 0
