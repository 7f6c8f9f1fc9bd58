"""``trueangle diagnose``: name what a simulation lacks."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError, FileError, NoModelError, TrueAngleError
from ..support.deadline import ending_early
from ..support.files import MODEL, SENSOR, SIMULATION
from .options import add_joint, add_shared, errors_in, refuse_given
from .parser import Input, Output, declare
from .robots import add_robot, each_joint, joints_asked, save_models, show_joints
from .signal_options import of_joint, reading_options, signals_by_joint
from .values import declared_shafts, seconds

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..model.model import HarmonicModel
    from ..runs.joining.simulated import MeasuredMinusSimulated
    from ..runs.run import CalibrationRun
    from ..simulation import Simulation
    from .robots import JointAsked

#: `trueangle.runs.joining.simulated.BY`, not imported for a help text.
BY = ("time", "angle")
HELP = "name the physical causes that a simulation of the joint lacks"
EXAMPLE = "trueangle diagnose runs.csv --simulation joint.toml --extend better.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = partial(declare, parser)
    add("runs RUNS...", Input, "calibration runs (CSV or Parquet)")
    add("--simulation FILE", Input, "simulation file (TOML)")
    add(
        "--simulated LOG",
        Input,
        "log of another simulator (MuJoCo, Isaac, Gazebo, Simulink ...) under the same "
        "motion: its true angle as reference, its encoder as indicated. The simulation and "
        "its extension are added to it. --signal simulated.ROLE=NAME[:UNIT] names its columns",
    )
    add(
        "--simulated-by",
        BY,
        "what joins the log to the readings (default: time where the motions are the same)",
    )
    add(
        "--extend FILE",
        Output.of(SIMULATION),
        "write the simulation extended by the findings; where it states none, with the noise "
        "found and designs of the runs, so that simulate repeats them",
    )
    add(
        "--extend-into FILE",
        Output.of(SENSOR),
        "write what the simulator lacks as the sensor of a joint: a fragment of MuJoCo's XML "
        "(.xml) or a functional mock-up unit (.fmu)",
    )
    add("--into-joint NAME", str, "name of the joint in MuJoCo (default: joint)")
    add(
        "--plan FILE",
        Output.of(SIMULATION),
        "write the runs to measure next, which distinguish what these cannot, as a "
        "simulation file (trueangle plan --after has limits and rehearses them)",
    )
    add(
        "--corrected-model FILE",
        Output.of(MODEL),
        "write the correction model of what is confirmed; exit status 1 where nothing is",
    )
    add(
        "--model FILE",
        Input,
        "a correction model to extend by what is confirmed, in place of a new one",
    )
    add_shared(parser, "argument", "run")
    add_joint(parser)
    add_robot(parser)
    add(
        "--within TIME",
        seconds,
        "time limit, as 10s, 2min or seconds; the result lists what was not "
        "done (default: a limit on the work, equal on any machine)",
    )
    add_shared(parser, "progress", "errors-in")
    add("--json", bool, "print the diagnosis as JSON")
    add(
        "--verbose",
        bool,
        "list why these runs cannot show each further cause, and what to measure",
    )


def run(args: argparse.Namespace) -> int:
    """Print the diagnosis."""
    from ..diagnosis import diagnose
    from .run_lists import read_selected_runs

    if args.model is not None and args.corrected_model is None:
        raise ArgumentError(
            "--model FILE (the model to extend) and --corrected-model FILE (the one to write) "
            "belong together"
        )
    if args.simulated is not None and args.corrected_model is not None:
        raise ArgumentError(
            "--corrected-model with --simulated: no correction model can hold what is known as a "
            "log only; leave it out, or write what is found with --extend FILE"
        )
    _refuse_idle(args)
    asked = joints_asked(args)
    if asked is not None:
        return _robot(*asked, args)
    if _of_channels(args):
        return 0
    simulation = _believed(args)
    model = None
    if args.model is not None:
        from ..model.file import load_model

        model = load_model(args.model)
    own = [entry for entry in args.signal or () if entry[0] == "simulated"]
    args.signal = [entry for entry in args.signal or () if entry[0] != "simulated"]
    runs = read_selected_runs(args)
    simulated = None
    if args.simulated is not None:
        simulated = _minus_simulated(runs, args, own)
    with ending_early() as interruption:
        result = diagnose(
            runs, simulation, simulated=simulated, within=args.within, progress=args.progress
        )
    extend = None if interruption.happened else args.extend
    # Whatever fails from here on, the diagnosis is reported.
    told = "" if args.json else result.summary(errors_in(args), verbose=args.verbose)
    print(result.to_json(extend) if args.json else told, flush=True)
    if interruption.happened:
        raise KeyboardInterrupt(_unwritten(args, result.complete))
    _written(result, args, model)
    return 0


def _of_channels(args: argparse.Namespace) -> bool:
    """Print what is wrong with channels, where nothing is assumed about the joint."""
    stated = (args.simulation, args.simulated, args.gear_ratio, args.shaft or None)
    if any(given is not None for given in stated):
        return False
    from ..selfcalibration.channelcauses import channel_diagnosis
    from ..selfcalibration.recording import as_recordings

    recordings = as_recordings(args.runs, {**reading_options(args), "period": None})
    if any(r.sine is None or r.cosine is None for r in recordings):
        return False
    result = channel_diagnosis(recordings)
    print(result.to_json() if args.json else result.summary(), flush=True)
    return True


def _minus_simulated(
    runs: list[CalibrationRun], args: argparse.Namespace, own: list[Any]
) -> MeasuredMinusSimulated:
    """The runs minus the error in the log of the simulator, whose columns ``own`` names.

    Raises
    ------
    FileError
        The log lacks a column; the message gives the option that names it.
    """
    from ..runs.joining import minus_simulated

    columns = (signals_by_joint(own, single=False) or {}).get("simulated")
    given = {**reading_options(args), "signals": columns}
    try:
        return minus_simulated(runs, args.simulated, by=args.simulated_by, **given)
    except FileError as error:
        told = of_joint(error.problem, "simulated")
        missing = [entry for entry in args.signal if entry[1] not in (columns or {})]
        if told != error.problem and missing:
            from shlex import quote

            again = " ".join(f"--signal {quote(f'simulated.{entry.text}')}" for entry in missing)
            told += f"; --signal ROLE=NAME is of the runs only, for the same names add {again}"
        raise FileError(error.path, told, line=error.line, column=error.column) from None


def _refuse_idle(args: argparse.Namespace) -> None:
    """Refuse options that need another one."""
    if args.simulated is None:
        refuse_given(args, ("simulated_by",), "joins the log of a simulator: add --simulated LOG")
    if args.extend_into is None or _is_fmu(args.extend_into):
        refuse_given(args, ("into_joint",), "is of MuJoCo: add --extend-into FILE.xml")
    if args.corrected_model is None and args.argument != "auto":
        raise ArgumentError("--argument is of a correction model: add --corrected-model FILE")


def _is_fmu(path: str) -> bool:
    return str(path).lower().endswith(".fmu")


def _robot(name: str, joints: list[JointAsked], args: argparse.Namespace) -> int:
    """Diagnose every joint against its simulation, or an empty one of its gear."""
    from ..diagnosis import diagnose
    from ..reports.robot import diagnosed_rank
    from .run_lists import read_selected_runs

    single = (args.simulated, args.extend, args.extend_into, args.model, args.plan)
    if any(given is not None for given in single):
        raise ArgumentError(
            "--simulated, --extend, --extend-into, --plan and --model are of one joint: omit "
            "--robot and name its columns with --signal ROLE=NAME"
        )

    def work(joint: JointAsked) -> Diagnosis:
        simulation = _believed(joint.args, empty=True)
        runs = read_selected_runs(joint.args)
        return diagnose(runs, simulation, within=args.within, progress=args.progress)

    found, _ = each_joint(joints, work)
    ranks = (diagnosed_rank(joint, result) for joint, result in found.items())
    title = f"Diagnosis of {name or 'the robot'}"
    show_joints(
        args,
        found,
        ranks,
        title,
        told=lambda joint: found[joint].summary(errors_in(args), verbose=args.verbose),
    )
    if args.corrected_model is not None:
        models = {
            joint: result.correction(argument=args.argument)
            for joint, result in found.items()
            if any(finding.confirmed for finding in result.findings)
        }
        if not models:
            raise ArgumentError("no cause of any joint is confirmed: there is nothing to correct")
        save_models(args.corrected_model, name, joints, models)
        if not args.json:
            print(f"\nCorrection models of {', '.join(models)}: {args.corrected_model}")
    return 0


def _believed(args: argparse.Namespace, empty: bool = False) -> Simulation | None:
    """The simulation: that of the file, or of a joint about which nothing else is assumed.

    ``empty`` where nothing need be stated of the joint.

    Raises
    ------
    ArgumentError
        Neither, and no log; or both.
    """
    from ..joint.joint import DeclaredShaft, Joint
    from ..simulation import Simulation, load_simulation

    stated = args.gear_ratio is not None or args.shaft
    if args.simulation is not None:
        if stated or args.fixed_member != "circular_spline":
            raise ArgumentError(
                "--gear-ratio, --fixed-member and --shaft with --simulation: the simulation "
                "states the joint; leave them out"
            )
        return load_simulation(args.simulation)
    if not stated and not empty:
        if args.simulated is not None:
            return None
        raise ArgumentError(
            "no simulation: give --simulation FILE, --simulated LOG or --gear-ratio R; without a "
            f"gear, run: trueangle diagnose {args.runs[0]} --gear-ratio 1 --fixed-member none"
        )
    shafts = declared_shafts(args.shaft).items()
    ratio = args.gear_ratio
    return Simulation(
        Joint(
            1.0 if ratio is None else ratio,
            "none" if ratio is None else args.fixed_member,
            declared=tuple(DeclaredShaft(name, cycles) for name, cycles in shafts),
        )
    )


def _written(result: Diagnosis, args: argparse.Namespace, model: HarmonicModel | None) -> None:
    """Write the files that were requested, each whether or not another can be."""

    def extend() -> str:
        result.simulation().save(args.extend)
        return f"\nExtended simulation: {args.extend}"

    def correct() -> str:
        result.correction(model, argument=args.argument).save(args.corrected_model)
        return "\n".join(_corrected(result, args.corrected_model, model is not None))

    ripple = None if result.torque is None else result.torque.ripple or None

    def sense() -> str:
        from ..export import export_model

        fmu = _is_fmu(args.extend_into)
        try:
            sensor = result.sensor(without_any=not fmu and bool(ripple))
        except NoModelError as error:
            if not ripple:
                raise
            raise NoModelError(
                f"{error}; a torque ripple is for MuJoCo: --extend-into sensor.xml"
            ) from None
        made = export_model(
            sensor,
            "fmu" if fmu else "mujoco",
            args.extend_into,
            noise_std=result.sensor_noise(),
            **(
                {"variant": "sensor"}
                if fmu
                else {"joint": args.into_joint or "joint", "ripple": ripple}
            ),
        )
        left = "; the torque ripple is not in it: a file of MuJoCo (.xml) has a place for it"
        return f"\nSensor of what is confirmed: {made.output}{left if fmu and ripple else ''}"

    def plan() -> str:
        if result.next_runs is None or not result.next_runs.runs:
            raise ArgumentError(
                f"no further run would distinguish anything: {args.plan} not written"
            )
        result.next_runs.save(args.plan)
        return f"\nRuns to measure next: {args.plan}"

    failed: list[TrueAngleError | OSError] = []
    outputs = (
        (args.extend, extend),
        (args.plan, plan),
        (args.extend_into, sense),
        (args.corrected_model, correct),
    )
    for path, write in outputs:
        try:
            told = write() if path else ""
        except (TrueAngleError, OSError) as error:
            failed.append(error)
        else:
            if told and not args.json:
                print(told)
    for other in failed[:-1]:
        print(f"trueangle: error: {other}", file=sys.stderr)
    if failed:
        raise failed[-1]


def _unwritten(args: argparse.Namespace, complete: bool) -> str:
    """What an interruption left undone."""
    files = [f for f in (args.extend, args.plan, args.extend_into, args.corrected_model) if f]
    told = "the account is complete" if complete else "the account so far is incomplete"
    return told + (f", and {' and '.join(map(str, files))} not written" if files else "")


def _corrected(result: Diagnosis, path: str, extended: bool) -> Iterator[str]:
    """What the correction model subtracts, and what it cannot."""
    from ..diagnosis.correction import NOT_AT_RUN_TIME

    yield f"\n{'Extended correction' if extended else 'Correction'} model: {path}"
    for finding in result.findings:
        why = NOT_AT_RUN_TIME.get(finding.cause, "" if finding.confirmed else "not confirmed")
        if why:
            yield f"  not corrected: {finding.cause} ({why})"
