"""``trueangle plan --after RUNS``: arguments and words of a plan that tells causes apart."""

from __future__ import annotations

import argparse

from ..errors import ArgumentError
from ..support.files import SIMULATION
from .options import refuse_given
from .paths import Input, Output
from .signal_options import add_signals
from .values import names, seconds

#: What is of other plans.
OTHERS = (
    *("gear_ratio", "positions", "mounts", "reference", "tilts", "tilt_arcsec", "orders"),
    *("noise_arcsec", "std_arcsec", "arc", "readings", "runs", "both_directions", "apart"),
    *("uncertainty", "prior", "self_method", "count", "angles", "speed_ratio", "start_speed"),
    "rate",
)


def add_after_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of ``--after``."""
    add = parser.add_argument_group("after a diagnosis that could not tell").add_argument
    add(
        "--after",
        nargs="+",
        type=Input,
        metavar="RUNS",
        help="the runs measured so far: which to measure next, with --simulation what is believed",
    )
    add(
        "--between",
        type=names,
        metavar="A,B",
        help="causes to tell apart (default: all that the diagnosis could not)",
    )
    add(
        "--limits",
        type=Input,
        metavar="FILE",
        help="what a run may be: TOML, table [limits] with arc_deg, speed_deg_s, temperature_C, "
        "torque_Nm, gravity_Nm, mount_deg, current_A, samples, runs, reversals (default: one turn "
        "or the arc measured so far, 1 to 60 deg/s, loads and temperatures as seen)",
    )
    add(
        "--seeds",
        type=int,
        metavar="N",
        help="simulated diagnoses of each cause in question (default: 10)",
    )
    add("--within", type=seconds, metavar="TIME", help="time that it may take (default: 10s)")
    parser.add_argument(
        "-o",
        "--output",
        type=Output.of(SIMULATION),
        metavar="FILE",
        help="write the runs as a simulation file, ready for simulate",
    )
    add_signals(parser)


def run_after(args: argparse.Namespace) -> int:
    """Print the runs that tell what those there are could not, and write them."""
    from ..planning.limits import load_limits
    from ..rehearsal.after import SEEDS, WITHIN, plan_after
    from ..simulation import load_simulation
    from .run_lists import read_checked_runs

    if args.simulation is None:
        raise ArgumentError("--after needs what is believed: add --simulation FILE")
    refuse_given(args, OTHERS, "does not go with --after; leave one of them out")
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
                f"no run within the limits tells more: {args.output} is not written"
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
