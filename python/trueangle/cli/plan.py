"""``trueangle plan``: positions that keep the wanted orders apart."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from ..selfcalibration import PLANNED
from ..support.files import SIMULATION
from .options import add_shared, given, refuse_given
from .parser import Input, Output, declare
from .signal_options import add_signals
from .values import angle, arc, declared_shafts, names, orders_by_shaft, parse_orders, seconds

if TYPE_CHECKING:
    from ..fleets.unitplan import UnitPlan
    from ..planning.result import ArcPlan, CalibrationPlan, SelfPlan

HELP = "propose calibration positions that keep the wanted orders apart"
EXAMPLE = "trueangle plan --gear-ratio 100 --positions 36 --mounts 2"

#: Degrees over which an uncertainty is wanted where no arc is stated.
WHOLE_TURN = (0.0, 360.0)

#: What is of one kind of plan alone: whole turns, an arc, no reference, after a diagnosis.
OF_TURNS = ("positions", "mounts", "reference", "tilts", "tilt_arcsec")
OF_ARC = ("readings", "runs", "both_directions", "apart")
OF_SELF = ("count", "angles", "speed_ratio", "start_speed", "rate")
OF_AFTER = (
    *("between", "limits", "seeds", "within", "output", "signal", "counts_per_turn"),
    *("counts_per_turn_reference", "topic", "facets", "unit_from", "periods_per_turn"),
)
_OF_OTHERS = (
    *("gear_ratio", "shaft", *OF_TURNS, "orders", "noise_arcsec", "std_arcsec", "arc", *OF_ARC),
    *("uncertainty", "prior", "self_method", *OF_SELF),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_shared(parser, "gear-ratio", "fixed-member", "shaft")
    add = partial(declare, parser)
    add("--positions N", int, "positions per mount (default: 36)")
    add("--mounts J", int, "times that the reference is clamped, turned each time (default: 2)")
    add(
        "--reference",
        ("polygon", "off-null", "encoder"),
        "polygon: remount it; off-null: read the autocollimator at tilts instead; "
        "encoder: a free reference encoder (default: polygon)",
    )
    add("--tilt-arcsec U", float, "off-null: largest tilt to both sides (default: 1200)")
    add("--tilts T", int, "off-null: tilts per face of the polygon (default: 2)")
    add("--orders 1-17,202", str, "or output:1-3;motor:1,2 (default: 1-17 and the gear's own)")
    add("--noise-arcsec S", float, "scatter of one reading")
    add("--std-arcsec U", float, "standard error wanted: gives the readings")
    of_arc = partial(declare, parser.add_argument_group("a joint that cannot turn once"))
    of_arc(
        "--arc START:STOP",
        arc,
        "degrees; where to read on this arc (--arc=-135:135 where it starts below zero)",
    )
    of_arc("--readings N", int, "readings to spend (default: 60)")
    of_arc("--runs R", int, "runs, each with a separate zero (default: 1)")
    of_arc("--both-directions", bool, "read every place from either side")
    of_arc("--apart DEG", float, "least distance of two places (default: none)")
    of_arc(
        "--uncertainty U",
        angle,
        "wanted at every place (k = 2), such as 2arcsec or 0.01deg: gives the readings "
        "(without --arc, over the whole turn)",
    )
    of_arc(
        "--prior FLEET.json",
        Input,
        "a unit like those of this fleet: how few readings are enough for --uncertainty, or "
        "what --readings are enough for",
    )
    add("--json", bool, "print the plan as JSON")
    _add_after_arguments(parser)
    _add_self_arguments(parser)


def _add_self_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of ``--self``."""
    add = partial(declare, parser.add_argument_group("without a reference"))
    add(
        "--self METHOD",
        PLANNED,
        f"plan a calibration without a reference: {', '.join(PLANNED)}",
        dest="self_method",
    )
    add(
        "--simulation FILE",
        Input,
        "simulation file whose heads, shifts, coast and noise are planned with",
    )
    add("--count N", int, "heads or shifts (default: 3)")
    add("--angles 0,90,180", str, "angles of heads or shifts that are there")
    add("--speed-ratio R", float, "start speed over end speed (default: 5)")
    add("--start-speed F", float, "turns per second at the start")
    add("--rate HZ", float, "readings per second")


def run(args: argparse.Namespace) -> int:
    """Print the plan."""
    if args.after is not None:
        return _run_after(args)
    orders = _output_orders(args)
    refuse_given(args, OF_AFTER, "is of plans after a diagnosis: add --after RUNS")
    if args.self_method is None:
        of_self = (*OF_SELF, "simulation")
        refuse_given(args, of_self, "is of plans without a reference: add --self METHOD")
    plan = _planned(args, orders)
    print(plan.to_json() if args.json else plan.summary())
    return 0


def _output_orders(args: argparse.Namespace) -> tuple[float, ...] | None:
    """Orders of ``--orders``, those of other shafts in cycles of the output."""
    if args.orders is None:
        refuse_given(args, ("shaft",), "is of orders of that shaft: add --orders NAME:1,2")
        return None
    further = declared_shafts(args.shaft)
    found = orders_by_shaft(args.orders, further)
    if not isinstance(found, Mapping):
        return parse_orders(args.orders)
    from ..joint.shafts import resolve_orders

    shafts = resolve_orders(found, args.gear_ratio, args.fixed_member, further)
    return tuple(sorted({k * shaft.cycles_per_turn for shaft in shafts for k in shaft.orders}))


def _planned(
    args: argparse.Namespace, orders: tuple[float, ...] | None
) -> CalibrationPlan | ArcPlan | UnitPlan | SelfPlan:
    """The plan that is requested: without a reference, of a unit, an arc or whole turns."""
    wanted = given(args, noise="noise_arcsec", standard_error="std_arcsec") | {"orders": orders}
    if args.self_method is not None:
        return _of_self(args, wanted)
    if args.prior is not None or args.arc is not None or args.uncertainty is not None:
        return _of_arc(args, wanted)
    refuse_given(args, OF_ARC, "is for an arc: add --arc START:STOP")
    from ..planning import plan as planning

    if args.reference != "off-null":
        refuse_given(args, ("tilts", "tilt_arcsec"), "goes with --reference off-null")
    if args.reference in ("encoder", "off-null"):
        refuse_given(args, ("mounts",), f"is of a polygon, not of --reference {args.reference}")
    plans: dict[str, Callable[..., CalibrationPlan]] = {
        "encoder": planning.plan_encoder,
        "off-null": planning.plan_tilts,
    }
    told = given(args, *set(OF_TURNS) - {"reference"}, fixed_member="fixed_member")
    return plans.get(args.reference, planning.plan_mounts)(args.gear_ratio, **told, **wanted)


def _of_arc(args: argparse.Namespace, wanted: dict[str, Any]) -> ArcPlan | UnitPlan:
    start, stop = WHOLE_TURN if args.arc is None else args.arc
    if args.prior is None:
        from ..planning.arc import plan_arc

        refuse_given(args, OF_TURNS, "is for whole turns; an arc has --readings")
        by_orders = "is for whole turns; name the orders of an arc by --orders"
        refuse_given(args, ("gear_ratio",), by_orders)
        return plan_arc(start, stop, **given(args, *OF_ARC, "uncertainty"), **wanted)
    from ..fleets import load_fleet, plan_unit

    others = (*OF_TURNS, "gear_ratio", "runs", "both_directions", "apart", "std_arcsec")
    refuse_given(args, others, "does not go with --prior; leave one of them out")
    if (args.uncertainty is None) == (args.readings is None):
        raise ArgumentError(
            "--prior needs what the readings are for, --uncertainty 2arcsec, or how many there "
            "are, --readings N; one of them"
        )
    told = given(args, "readings", "uncertainty")
    return plan_unit(load_fleet(args.prior), start, stop, **told, **wanted)


def _of_self(args: argparse.Namespace, wanted: dict[str, Any]) -> SelfPlan:
    from ..planning.selfplan import designed_selfplan, plan_self
    from ..simulation import load_simulation

    others = (*OF_TURNS, "arc", *OF_ARC, "uncertainty", "prior")
    refuse_given(args, others, "is of plans with a reference: leave it or --self out")
    told = given(args, *OF_SELF, "gear_ratio") | wanted
    if args.angles is not None:
        told["angles"] = _angles(args.angles)
    if args.orders is None:
        del told["orders"]
    if args.simulation is not None:
        told = designed_selfplan(load_simulation(args.simulation), args.self_method) | told
    return plan_self(args.self_method, **told)


def _angles(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or not all(map(math.isfinite, found)):
        raise ArgumentError(f"--angles: two angles or more in degrees, such as 0,90, got {text!r}")
    return found


def _add_after_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of ``--after``."""
    add = partial(declare, parser.add_argument_group("after a diagnosis with open questions"))
    add(
        "--after RUNS...",
        Input,
        "runs measured so far, to plan the next ones; --simulation gives the assumed joint",
    )
    add("--between A,B", names, "causes to distinguish (default: all that the diagnosis could not)")
    add(
        "--limits FILE",
        Input,
        "limits of a run: TOML, table [limits] with arc_deg, speed_deg_s, temperature_C, "
        "torque_Nm, gravity_Nm, mount_deg, current_A, samples, runs, reversals. Default: one turn "
        "or the arc measured so far, 1 to 60 deg/s, measured loads and temperatures",
    )
    add("--seeds N", int, "simulated diagnoses of each cause in question (default: 10)")
    add("--within TIME", seconds, "time that it may take (default: 10s)")
    declare(
        parser,
        "-o --output FILE",
        Output.of(SIMULATION),
        "write the runs as a simulation file, ready for simulate",
    )
    add_signals(parser)


def _run_after(args: argparse.Namespace) -> int:
    """Print the runs that show what the present ones could not, and write them."""
    from ..planning.limits import load_limits
    from ..rehearsal.after import plan_after
    from ..simulation import load_simulation
    from .run_lists import read_selected_runs

    if args.simulation is None:
        raise ArgumentError(
            "--after needs the assumed joint: --simulation FILE, as diagnose --extend writes"
        )
    refuse_given(args, _OF_OTHERS, "does not go with --after; leave one of them out")
    args.runs = args.after
    plan = plan_after(
        read_selected_runs(args),
        load_simulation(args.simulation),
        between=args.between,
        limits=None if args.limits is None else load_limits(args.limits),
        progress="auto",
        **given(args, "seeds", "within"),
    )
    print(plan.to_json() if args.json else plan.summary(), flush=True)
    if args.output is not None:
        if not plan.runs:
            raise ArgumentError(
                f"{args.output} is not written: no run found; allow wider limits or more time"
            )
        plan.save(args.output)
    return 0
