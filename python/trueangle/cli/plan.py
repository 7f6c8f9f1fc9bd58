"""``trueangle plan``: positions that keep the wanted orders apart."""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..selfcalibration.methods import PLANNED
from ..support.files import SIMULATION
from .options import refuse_given
from .parser import declare
from .paths import Input, Output
from .signal_options import add_signals
from .values import angle, arc, names, parse_orders, seconds

if TYPE_CHECKING:
    from ..fleets.unitplan import UnitPlan
    from ..planning.result import ArcPlan, CalibrationPlan, SelfPlan

HELP = "propose calibration positions that keep the wanted orders apart"
EXAMPLE = "trueangle plan --gear-ratio 100 --positions 36 --mounts 2"

#: Arcsec to which a polygon is tilted where nothing is stated.
TILT = 1200.0
#: What is of plans for whole turns alone.
OF_TURNS = ("positions", "mounts", "reference", "tilts", "tilt_arcsec")

#: Degrees over which an uncertainty is wanted where no arc is stated.
WHOLE_TURN = (0.0, 360.0)

#: What is of other plans.
_OTHERS = (
    *("gear_ratio", "positions", "mounts", "reference", "tilts", "tilt_arcsec", "orders"),
    *("noise_arcsec", "std_arcsec", "arc", "readings", "runs", "both_directions", "apart"),
    *("uncertainty", "prior", "self_method", "count", "angles", "speed_ratio", "start_speed"),
    "rate",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("--gear-ratio R", float, "motor turns per output turn")
    add(
        "--fixed-member",
        ("circular_spline", "flexspline", "none"),
        "the fixed member of the gear (default: %(default)s)",
        default="circular_spline",
    )
    add("--positions N", int, "positions per mount (default: 36)")
    add("--mounts J", int, "mounts of the artefact (default: 2)")
    add(
        "--reference",
        ("polygon", "off-null", "encoder"),
        "polygon: remount it; off-null: read the autocollimator at tilts instead; "
        "encoder: a free reference encoder (default: polygon)",
    )
    add("--tilt-arcsec U", float, f"off-null: largest tilt to both sides (default: {TILT:g})")
    add("--tilts T", int, "off-null: tilts per facet (default: 2)")
    add("--orders 1-17,202", str, "orders wanted (default: 1-17 and the gear's own)")
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
    add_after_arguments(parser)
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
    add("--speed-ratio R", float, "start over end speed (5)")
    add("--start-speed F", float, "turns per second at the start")
    add("--rate HZ", float, "readings per second")


def run(args: argparse.Namespace) -> int:
    """Print the plan."""
    orders = None if args.orders is None else parse_orders(args.orders)
    if args.after is not None:
        return _run_after(args)
    refuse_without_after(args)
    if args.self_method is None:
        of_self = ("count", "angles", "speed_ratio", "start_speed", "rate", "simulation")
        refuse_given(args, of_self, "is of plans without a reference: add --self METHOD")
    plan = _planned(args, orders)
    print(plan.to_json() if args.json else plan.summary())
    return 0


def _planned(
    args: argparse.Namespace, orders: tuple[float, ...] | None
) -> CalibrationPlan | ArcPlan | UnitPlan | SelfPlan:
    """The plan that is requested: without a reference, of a unit, an arc or whole turns."""
    from ..planning import plan as planning

    if args.self_method is not None:
        return _of_self(args, orders)
    if args.prior is not None:
        return _of_unit(args, orders)
    if args.arc is not None or args.uncertainty is not None:
        return _of_arc(args, orders)
    of_arc = ("readings", "runs", "both_directions", "apart")
    refuse_given(args, of_arc, "is of plans for an arc: add --arc START:STOP")
    common = {
        "fixed_member": args.fixed_member,
        "orders": orders,
        "noise": args.noise_arcsec,
        "standard_error": args.std_arcsec,
    }
    if args.reference != "off-null":
        refuse_given(args, ("tilts", "tilt_arcsec"), "goes with --reference off-null")
    if args.reference in ("encoder", "off-null"):
        refuse_given(args, ("mounts",), f"is of a polygon, not of --reference {args.reference}")
    if args.reference == "encoder":
        return planning.plan_encoder(args.gear_ratio, args.positions, **common)
    positions = 36 if args.positions is None else args.positions
    if args.reference == "off-null":
        return planning.plan_tilts(
            args.gear_ratio,
            positions,
            2 if args.tilts is None else args.tilts,
            tilt_arcsec=TILT if args.tilt_arcsec is None else args.tilt_arcsec,
            **common,
        )
    mounts = 2 if args.mounts is None else args.mounts
    return planning.plan_mounts(args.gear_ratio, positions, mounts, **common)


def _of_arc(args: argparse.Namespace, orders: tuple[float, ...] | None) -> ArcPlan:
    from ..planning.arc import plan_arc

    refuse_given(args, OF_TURNS, "is of plans for whole turns: it has --readings")
    refuse_given(args, ("gear_ratio",), "is of plans for whole turns: name its orders by --orders")
    start, stop = WHOLE_TURN if args.arc is None else args.arc
    return plan_arc(
        start,
        stop,
        orders,
        readings=args.readings,
        runs=1 if args.runs is None else args.runs,
        both_directions=args.both_directions,
        apart=0.0 if args.apart is None else args.apart,
        noise=args.noise_arcsec,
        standard_error=args.std_arcsec,
        uncertainty=args.uncertainty,
    )


def _of_unit(args: argparse.Namespace, orders: tuple[float, ...] | None) -> UnitPlan:
    from ..fleets import load_fleet, plan_unit

    others = (*OF_TURNS, "gear_ratio", "runs", "both_directions", "apart", "std_arcsec")
    refuse_given(args, others, "does not go with --prior; leave one of them out")
    if (args.uncertainty is None) == (args.readings is None):
        raise ArgumentError(
            "--prior needs what the readings are for, --uncertainty 2arcsec, or how many there "
            "are, --readings N; one of them"
        )
    start, stop = WHOLE_TURN if args.arc is None else args.arc
    return plan_unit(
        load_fleet(args.prior),
        start,
        stop,
        orders,
        uncertainty=args.uncertainty,
        readings=args.readings,
        noise=args.noise_arcsec,
    )


def _of_self(args: argparse.Namespace, orders: tuple[float, ...] | None) -> SelfPlan:
    from ..planning.selfplan import plan_self

    others = (
        *(*OF_TURNS, "arc", "readings", "runs", "both_directions", "apart"),
        *("uncertainty", "prior"),
    )
    refuse_given(args, others, "is of plans with a reference: leave it or --self out")
    told = {
        "orders": orders,
        "count": args.count,
        "angles": None if args.angles is None else _angles(args.angles),
        "speed_ratio": args.speed_ratio,
        "start_speed": args.start_speed,
        "rate": args.rate,
        "gear_ratio": args.gear_ratio,
        "noise": args.noise_arcsec,
        "standard_error": args.std_arcsec,
    }
    given = {name: value for name, value in told.items() if value is not None}
    if args.simulation is not None:
        from ..planning.selfplan import designed_selfplan
        from ..simulation import load_simulation

        given = designed_selfplan(load_simulation(args.simulation), args.self_method) | given
    return plan_self(args.self_method, **given)


def _angles(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) < 2 or not all(map(math.isfinite, found)):
        raise ArgumentError(f"--angles: two angles or more in degrees, such as 0,90, got {text!r}")
    return found


def add_after_arguments(parser: argparse.ArgumentParser) -> None:
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
    from ..rehearsal.after import SEEDS, WITHIN, plan_after
    from ..simulation import load_simulation
    from .run_lists import read_checked_runs

    if args.simulation is None:
        raise ArgumentError("--after needs the assumed joint: add --simulation FILE")
    refuse_given(args, _OTHERS, "does not go with --after; leave one of them out")
    args.runs = args.after
    plan = plan_after(
        read_checked_runs(args),
        load_simulation(args.simulation),
        between=args.between,
        limits=None if args.limits is None else load_limits(args.limits),
        seeds=SEEDS if args.seeds is None else args.seeds,
        within=WITHIN if args.within is None else args.within,
        progress="auto",
    )
    print(plan.to_json() if args.json else plan.summary(), flush=True)
    if args.output is not None:
        if not plan.runs:
            raise ArgumentError(
                f"no run within the limits adds information: {args.output} is not written"
            )
        plan.save(args.output)
    return 0


def refuse_without_after(args: argparse.Namespace) -> None:
    """Refuse options that are of ``--after`` only."""
    after = [
        *("between", "limits", "seeds", "within", "output"),
        *("signal", "counts_per_turn", "counts_per_turn_reference"),
        *("topic", "facets", "unit_from", "periods_per_turn"),
    ]
    refuse_given(args, after, "is of plans after a diagnosis: add --after RUNS")
