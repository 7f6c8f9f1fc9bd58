"""``trueangle report``: one self-contained page from calibration runs."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..support.deadline import with_deadline
from ..support.files import PDF, REPORT
from ..support.plainresult import json_text
from .options import add_joint, add_shared, errors_in, refuse_given
from .parser import Input, Output, declare
from .robots import add_robot, each_joint, joints_asked
from .values import declared_shafts, orders_by_shaft

if TYPE_CHECKING:
    from .robots import JointAsked

HELP = "write a report on calibration runs: one HTML page, or a PDF"
EXAMPLE = "trueangle report joint_a.csv --simulation joint.toml -o report.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("runs RUNS...", Input, "calibration runs, CSV or Parquet")
    add(
        "-o --output FILE",
        Output.of(REPORT),
        "the report to write: HTML, or PDF where the name ends so",
        required=True,
    )
    add("--simulation FILE", Input, "diagnose the runs with this simulation")
    add_shared(parser, "orders", "run")
    add_joint(parser)
    add_robot(parser)
    add("--title", str, "heading of the report")
    add(
        "--model MODEL",
        Input,
        "describe this model: its data, its limits and the residual of the runs; a "
        "certificate adds the values as left to those as found",
    )
    add(
        "--certificate IDENTITY",
        Input,
        "write a calibration certificate (PDF); this TOML file gives the item, the "
        "laboratory and the type B uncertainties",
    )
    add("--positions N", int, "nominal positions of a certificate (default: 36)")
    add("--fleet", bool, "compare the units with each other, as trueangle fleet does, on one page")
    add(
        "--by",
        ("unit", "run"),
        "what identifies a unit of --fleet (default: the column unit; without one, the runs)",
    )
    add("--permitted-arcsec E", float, "with --fleet: largest permitted error")
    add_shared(parser, "errors-in")
    add("--pdf FILE", Output.of(PDF), "print it to a PDF too, by an installed browser")
    add_shared(parser, "progress")
    add("--json", bool, "print the report's numbers as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the report."""
    if args.fleet:
        return _fleet(args)
    refuse_given(args, ("permitted_arcsec", "by"), "is of a report on a fleet: add --fleet")
    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    if args.certificate is not None and args.pdf is not None:
        raise ArgumentError("--pdf prints a report; a certificate is a PDF itself: give it by -o")
    made = _made(args, args.output)
    if args.pdf is not None:
        made.save_pdf(args.pdf)
    if args.json:
        print(json_text(made.content, indent=2))
    else:
        print(args.output)
    return 0


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """A page of all joints: a table in front, and a section for each."""
    from ..reports.robot import RobotReport

    if args.certificate is not None or args.pdf is not None or args.model is not None:
        raise ArgumentError(
            "--certificate, --pdf and --model are of one joint: omit --robot and name its "
            "columns with --signal ROLE=NAME"
        )

    def work(joint: JointAsked) -> Any:
        return _made(joint.args, None, title=joint.name)

    found, _ = each_joint(joints, work)
    made = RobotReport(args.title or f"Angle error of {name or 'a robot'}", found, errors_in(args))
    made.save(args.output)
    if args.json:
        print(json_text(made.to_dict(), indent=2))
    else:
        print(f"{made.summary()}\n\n{args.output}")
    return 0


def _fleet(args: argparse.Namespace) -> int:
    """A page of all units: who needs what, patterns, spread, dates."""
    from ..reports.fleet import FleetReport
    from .fleet import requested_fleet

    single = ("certificate", "pdf", "model", "simulation", "robot", "joint", "positions", "run")
    refuse_given(args, single, "is of one joint, and --fleet is a report on many units")
    args.by = args.by or "unit"
    args.orders = None if args.orders == "auto" else args.orders
    title = args.title or "Angle error of a fleet"
    found = requested_fleet(args, permitted_arcsec=args.permitted_arcsec)
    made = FleetReport(found, title, errors_in(args))
    made.save(args.output)
    print(made.fleet.to_json() if args.json else f"{made.summary()}\n\n{args.output}")
    return 0


def _made(args: argparse.Namespace, path: str | None, title: str | None = None) -> Any:
    """The report or certificate that is requested, written to ``path``."""
    from ..reports import report
    from .run_lists import read_selected_runs

    runs = read_selected_runs(args)
    simulation = None
    if args.simulation is not None:
        from ..simulation import load_simulation

        simulation = load_simulation(args.simulation)
    known = declared_shafts(args.shaft) if simulation is None else simulation.joint.shafts
    with with_deadline(style=args.progress):
        return report(
            runs,
            path,
            simulation=simulation,
            orders=orders_by_shaft(args.orders, known),
            gear_ratio=args.gear_ratio,
            fixed_member=args.fixed_member,
            shafts=declared_shafts(args.shaft),
            title=title or args.title,
            certificate=args.certificate,
            positions=args.positions,
            model=args.model,
            errors_in=errors_in(args),
        )
