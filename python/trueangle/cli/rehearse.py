"""``trueangle rehearse``: which causes planned runs would show, and from which size on."""

from __future__ import annotations

import argparse
from functools import partial

from ..support.deadline import ending_early
from ..support.files import PICTURE
from .options import add_shared
from .parser import Input, Output, declare
from .plot import save_picture
from .values import names, seconds

HELP = "find the least size of each cause that a diagnosis of planned runs would name"
EXAMPLE = "trueangle rehearse joint.toml --within 5min --plot detection.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add(
        "simulation SIMULATION",
        Input,
        "simulation file (TOML) with the joint, its noise and the planned runs",
    )
    add("--causes A,B", names, "causes to hide (default: all)")
    add("--seeds N", int, "trials of a cause at most (default 20)", default=20)
    add("--seed N", int, "of the random numbers (default 0)", default=0)
    add("--within TIME", seconds, "give what was found in that time, as 60s, 5min or seconds")
    add("--workers N", int, "processes side by side (default: every core)")
    add("--plot FILE", Output.of(PICTURE), "write the picture as well")
    add_shared(parser, "progress")
    add("--json", bool, "print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the rehearsal."""
    from ..rehearsal import rehearse
    from ..simulation import load_simulation

    sim = load_simulation(args.simulation)
    with ending_early() as interruption:
        result = rehearse(
            sim,
            causes=args.causes,
            seeds=args.seeds,
            seed=args.seed,
            within=args.within,
            workers=args.workers,
            progress=args.progress,
        )
    if args.plot and not interruption.happened:
        save_picture(result.plot(), args.plot)
    print(result.to_json() if args.json else result.summary())
    if interruption.happened:
        told = "the account so far is incomplete"
        raise KeyboardInterrupt(told + (f", and {args.plot} not written" if args.plot else ""))
    return 0
