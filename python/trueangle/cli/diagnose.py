"""``trueangle diagnose``: name what a simulation lacks."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..errors import ArgumentError
from ..files import MODEL, SIMULATION
from ..pace import STYLES, ending_early
from .durations import seconds
from .error_units import add_errors_in, errors_in
from .paths import Input, Output
from .signal_options import add_signals, reading, signals_by_joint

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis

#: `trueangle.joining.simulated.BY`, not imported for a help text.
BY = ("time", "angle")
HELP = "name the physical causes that a simulation of the joint lacks"
EXAMPLE = "trueangle diagnose runs.csv --simulation joint.toml --extend better.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("runs", nargs="+", type=Input, metavar="RUNS", help="calibration runs (CSV or Parquet)")
    add("--simulation", type=Input, metavar="FILE", help="simulation file (TOML)")
    add(
        "--simulated",
        type=Input,
        metavar="LOG",
        help="what another simulator (MuJoCo, Isaac, Gazebo, Simulink ...) says of the same "
        "motion: its true angle as reference, its encoder as indicated; the simulation and its "
        "extension stand on top of it. --signal simulated.ROLE=NAME[:UNIT] names its columns",
    )
    add(
        "--simulated-by",
        choices=BY,
        help="what joins the log to the readings (default: time where the motions are the same)",
    )
    add(
        "--extend",
        type=Output.of(SIMULATION),
        metavar="FILE",
        help="write the simulation extended by the findings",
    )
    add("--model", type=Input, metavar="FILE", help="correction model, to extend by the findings")
    add(
        "--corrected-model",
        type=Output.of(MODEL),
        metavar="FILE",
        help="write that extended correction model",
    )
    add_signals(parser)
    add(
        "--within",
        type=seconds,
        metavar="TIME",
        help="the best account in that time, as 10s, 2min or seconds; it says what is missing",
    )
    add(
        "--progress",
        choices=STYLES,
        default="auto",
        help="on stderr after one second (default: text on a terminal, nothing elsewhere)",
    )
    add_errors_in(parser)
    add("--json", action="store_true", help="print the diagnosis as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the diagnosis."""
    from ..diagnosis import diagnose
    from ..joining import minus_simulated
    from ..modelfile import load_model
    from ..simulation import load_simulation
    from .run_lists import read_checked

    if (args.model is None) != (args.corrected_model is None):
        raise ArgumentError(
            "--model FILE (the model to extend) and --corrected-model FILE (the one to write) "
            "belong together"
        )
    if args.simulation is None and args.simulated is None:
        raise ArgumentError("give --simulation FILE, or --simulated LOG, or both")
    if args.simulated is not None and args.model is not None:
        raise ArgumentError(
            "--model with --simulated: no correction model can hold what is known as a log only; "
            "leave --model out"
        )
    simulation = None if args.simulation is None else load_simulation(args.simulation)
    own = [entry for entry in args.signal or () if entry[0] == "simulated"]
    args.signal = [entry for entry in args.signal or () if entry[0] != "simulated"]
    runs = read_checked(args)
    simulated = None
    if args.simulated is not None:
        columns = (signals_by_joint(own, single=False) or {}).get("simulated")
        given = {**reading(args), "signals": columns}
        simulated = minus_simulated(runs, args.simulated, by=args.simulated_by, **given)
    with ending_early() as interruption:
        result = diagnose(
            runs, simulation, simulated=simulated, within=args.within, progress=args.progress
        )
    if interruption.happened:
        print(result.to_json() if args.json else result.summary(errors_in(args)))
        raise KeyboardInterrupt(_unwritten(args, result.complete))
    if args.extend:
        result.extended.save(args.extend)
    if args.corrected_model:
        result.correction(load_model(args.model), runs).save(args.corrected_model)
    if args.json:
        print(result.to_json(args.extend))
    else:
        print(result.summary(errors_in(args)))
        if args.extend:
            print(f"\nExtended simulation: {args.extend}")
        if args.corrected_model:
            print("\n".join(_corrected(result, args.corrected_model)))
    return 0


def _unwritten(args: argparse.Namespace, complete: bool) -> str:
    """What an interruption left undone."""
    files = [path for path in (args.extend, args.corrected_model) if path]
    told = "the account is complete" if complete else "the account so far is incomplete"
    return told + (f", and {' and '.join(map(str, files))} not written" if files else "")


def _corrected(result: Diagnosis, path: str) -> Iterator[str]:
    """What the extended correction model takes off, and what it cannot."""
    from ..diagnosis.correction import NOT_AT_RUN_TIME

    yield f"\nExtended correction model: {path}"
    for finding in result.findings:
        if finding.cause in NOT_AT_RUN_TIME:
            yield f"  not corrected: {finding.cause} ({NOT_AT_RUN_TIME[finding.cause]})"
