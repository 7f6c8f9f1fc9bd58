"""``trueangle demo``: what the package does, on simulated joints, without any file.

Equations 8 and 9 of the paper give the error of two joints at 36 positions. The same
values there follow from orders of the gear (100 for 8, 202 for 14, ...), for which the
paper's correction makes the joint worse wherever it was not calibrated.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from ..errors import ArgumentError
from ..support.files import REPORT
from .parser import Output, declare

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..fitting.orders.result import OrderSelection
    from ..planning.result import CalibrationPlan
    from ..runs.run import CalibrationRun
    from ..support.arrays import Array

HELP = "fit, correct and diagnose simulated joints; needs no files"
EXAMPLE = "trueangle demo --report demo.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    declare(parser, "--seed", int, "seed of the simulated noise (default: 0)", default=0)
    declare(parser, "--report FILE", Output.of(REPORT), "also write a report of the diagnosis")
    told = "calibrate a sine and a cosine channel instead, without a reference"
    declare(parser, "--channels", bool, told)


def run(args: argparse.Namespace) -> int:
    """Show the three parts, each a few lines, or the channels."""
    if args.channels:
        if args.report:
            raise ArgumentError("--report is of the demo without --channels: leave one out")
        print(_channels(args.seed))
        return 0
    for number, part in enumerate((_corrected, _between, _diagnosed), 1):
        print(f"{number}. {part(args.seed)}\n")
    if args.report:
        from ..reports.demo import demo_report

        demo_report(args.report, seed=args.seed)
        print(f"report written to {args.report}")
    else:
        print("The same with pictures: trueangle demo --report demo.html")
    return 0


def _corrected(seed: int) -> str:
    """The paper's joint a: fitted on five groups, the sixth corrected."""
    import numpy as np

    from ..fitting.fit import fit
    from ..support.letterchart import letter_chart

    *groups, unseen = simulated_groups(JOINT_A, seed=seed)
    model = fit(groups).model
    left = model.correct(unseen.indicated) - unseen.reference
    place = unseen.reference % 360.0
    read, corrected = (3600.0 * e for e in (unseen.centred_error, left - left.mean()))
    before, after = float(np.ptp(read)), float(np.ptp(corrected))
    published = PUBLISHED[JOINT_A.name]
    return "\n".join(
        [
            "The error of a joint's encoder repeats in every turn. Measured once",
            "   against a reference, the pattern is subtracted from then on:",
            "",
            *letter_chart(place, {"o": read, "*": corrected}, "arcsec"),
            "   o error as read, * error corrected, over one turn of the output in degrees",
            "",
            f"   peak-to-peak  {before:6.2f} -> {after:5.2f} arcsec, "
            f"{100.0 * (1.0 - after / before):.1f} % less, in readings not fitted",
            f"   the paper     {published[0]:6.2f} -> {published[1]:5.2f} arcsec, "
            f"{published[2]:.1f} % less (simulated here)",
            f"   orders kept   {', '.join(f'{order:g}' for order in model.orders)}",
        ]
    )


def _between(seed: int) -> str:
    """What the 36 positions cannot show."""
    return (
        "What 36 positions cannot show: orders 36 apart give the same readings. A\n"
        "   correction may then be right at the positions and wrong between them.\n\n"
        f"{short_report(paper_study(seed))}"
    )


def short_report(study: Study) -> str:
    """The whole study in ten lines: what 36 positions show, and what lies between."""
    plan = study.plan
    offset = f"{plan.mount_offsets_deg[-1]:g}"
    lines = [
        "The paper's study repeated (6 groups at 36 positions, peak-to-peak in arcsec)",
        "  joint, true orders       at 36 positions     everywhere",
    ]

    def add(joints: Mapping[str, Reduction], what: str) -> None:
        for name, found in joints.items():
            (before, after), (whole, left) = found.positions, found.dense
            there = f"{before:4.0f} -> {after:3.0f} ({found.at_positions:+.0f} %)"
            between = f"{whole:4.0f} -> {left:3.0f} ({found.in_between:+.0f} %)"
            lines.append(f"  joint {name}, {what:14}  {there:18}  {between}")

    add(study.published, "paper's orders")
    add(study.gear, "gear orders")
    lines.append("  Both orders give the same 36 readings: only other positions separate them.")
    add(study.planned, "gear, 2 mounts")
    lines.append(
        f"  `ta.plan_mounts(gear_ratio=100)`: mounts at 0 and {offset} deg,\n"
        f"  standard errors {plan.worst_noise_factor:.2f} times the ideal"
    )
    return "\n".join(lines)


def _diagnosed(seed: int) -> str:
    """One hidden effect, found."""
    from dataclasses import replace

    from ..diagnosis import diagnose
    from ..reports.demo import demo_simulation
    from ..simulation import Backlash, simulate

    believed = demo_simulation()
    true = replace(believed, effects=(Backlash(half_width_arcsec=8.0),))
    result = diagnose(simulate(true, seed=seed), believed)
    return (
        "Where does the error come from? This joint has a backlash of +-8 arcsec that\n"
        f"   its simulation does not have. The diagnosis of its runs:\n\n{result.summary()}"
    )


def _channels(seed: int) -> str:
    """Two channels of a 12-bit converter, calibrated by their curve alone."""
    import numpy as np

    from ..runs.rawchannels import Channels
    from ..selfcalibration.calibrate import selfcal
    from ..support.letterchart import letter_chart

    true = Channels(2095.0, 2023.0, 900.0, gain_ratio=1.04, phase_deg=-1.5)
    phase = 2.0 * np.pi * np.arange(2000) / 2000
    noise = np.random.default_rng(seed).normal(size=(2, phase.size))
    sine, cosine = np.rint(np.array(true.curve(phase)) + 0.9 * noise)
    found = selfcal({"sine": sine, "cosine": cosine}, method="channels")
    assert found.channels is not None
    middle = Channels(offset_sine=2048.0, offset_cosine=2048.0, period=360.0)
    read, corrected = (
        np.degrees(np.angle(off / off.mean()))
        for off in (
            np.exp(1j * (np.radians(angle) - phase))
            for angle in (middle.angle(sine, cosine), found.channels.correct(sine, cosine))
        )
    )
    before, after = float(np.ptp(read)), float(np.ptp(corrected))
    return "\n".join(
        [
            "A 12-bit converter reads a sine and a cosine channel over one turn. Their curve",
            "should be a circle; offsets, gain and phase follow from it, without a reference:",
            "",
            *letter_chart(np.degrees(phase), {"o": read, "*": corrected}, "deg"),
            "   o error of arctan2(sine, cosine), * error corrected, over one turn in degrees",
            "",
            f"   peak-to-peak  {before:5.2f} -> {after:5.2f} deg, "
            f"{100.0 * (1.0 - after / before):.1f} % less",
            "",
            *found.summary().splitlines(),
            "",
            "The same with your file: trueangle selfcal adc.csv --method channels -o joint.json",
        ]
    )


#: Positions of the paper's prism and the groups it took; the last one verifies.
POSITIONS: Final = 36
GROUPS: Final = 6

#: Scatter of one reading, arcsec: what the peak-to-peak of the compensated error leaves
#: room for: 26.62 and 18.40 over 4.24 (mean range of 36 normal values) and over
#: sqrt(1 + 15/180) (15 unknowns from 180 readings).
NOISE: Final = {"a": 6.03, "b": 4.17}

#: Gear orders of ratio 100 that alias to the paper's orders on 36 positions.
GEAR_ORDERS: Final = {8: 100, 7: 101, 16: 200, 15: 201, 14: 202, 12: 300, 4: 400}

#: The paper's figures: peak-to-peak before and after in arcsec, reduction in percent.
PUBLISHED: Final = {"a": (149.53, 26.62, 82.20), "b": (101.35, 18.40, 81.85)}


class PaperJoint(NamedTuple):
    """Error of a joint as a sum of sines: ``{order: (amplitude in arcsec, phase in deg)}``."""

    name: str
    constant: float
    lines: Mapping[int, tuple[float, float]]

    def error(self, degrees: ArrayLike) -> Array:
        """Error in arcsec at reference angles in degrees."""
        import numpy as np

        x = np.radians(np.asarray(degrees, dtype=np.float64))
        total = np.full(x.shape, self.constant)
        for order, (amplitude, phase) in self.lines.items():
            total += amplitude * np.sin(order * x + np.radians(phase))
        return total


#: Equation 8.
JOINT_A: Final = PaperJoint(
    "a",
    0.0,
    {
        1: (14.10, 243.75),
        4: (6.91, 26.73),
        8: (18.05, 46.50),
        12: (6.66, 264.24),
        14: (33.36, 20.82),
        15: (8.94, 57.88),
        16: (19.60, 247.91),
    },
)

#: Equation 9.
JOINT_B: Final = PaperJoint(
    "b",
    -11.47,
    {
        1: (24.31, 15.81),
        4: (10.18, 187.75),
        7: (4.86, 147.06),
        8: (13.85, 258.45),
        12: (4.68, 213.24),
        14: (17.71, 115.24),
        16: (8.64, 128.30),
    },
)


def lifted(joint: PaperJoint, orders: Mapping[int, int] | None = None) -> PaperJoint:
    """The joint with some orders replaced by others that are the same at 36 positions.

    Examples
    --------
    >>> float(abs(lifted(JOINT_A).error(10.0) - JOINT_A.error(10.0)).round(9))
    0.0
    """
    from ..runs.aliasing import fold

    lines = {}
    for order, (amplitude, phase) in joint.lines.items():
        high = (GEAR_ORDERS if orders is None else orders).get(order, order)
        sign = fold(high, POSITIONS)[1] if high != order else 1
        lines[high] = (amplitude, phase if sign > 0 else 180.0 - phase)
    return PaperJoint(joint.name, joint.constant, lines)


def simulated_groups(
    joint: PaperJoint,
    offsets_deg: Sequence[float] = (0.0,) * GROUPS,
    noise: float | None = None,
    seed: int = 0,
) -> list[CalibrationRun]:
    """Groups of 36 readings, each beginning ``offset`` after the first position."""
    import numpy as np

    from ..runs.run import CalibrationRun

    random = np.random.default_rng(seed)
    scatter = NOISE[joint.name] if noise is None else noise
    runs = []
    for number, offset in enumerate(offsets_deg):
        reference = np.asarray(
            np.arange(POSITIONS) * (360.0 / POSITIONS) + offset, dtype=np.float64
        )
        error = joint.error(reference) + random.normal(0.0, scatter, POSITIONS)
        runs.append(
            CalibrationRun(
                reference,
                reference + error / 3600.0,
                period=360.0,
                mount=np.full(POSITIONS, offset),
                label=f"{joint.name}{number + 1}",
            )
        )
    return runs


class Reduction(NamedTuple):
    """Error before and after a correction, arcsec: at the positions and everywhere.

    ``positions`` and ``dense`` are peak-to-peak (before, after), ``dense_rms`` is rms.
    """

    positions: tuple[float, float]
    dense: tuple[float, float]
    dense_rms: tuple[float, float]
    orders: tuple[float, ...]

    @property
    def at_positions(self) -> float:
        """Change of the peak-to-peak error at the positions, percent."""
        return 100.0 * (self.positions[1] / self.positions[0] - 1.0)

    @property
    def in_between(self) -> float:
        """Change of the peak-to-peak error on a dense grid, percent."""
        return 100.0 * (self.dense[1] / self.dense[0] - 1.0)


def reduction(
    joint: PaperJoint,
    runs: Sequence[CalibrationRun],
    orders: Sequence[float],
    held: CalibrationRun | None = None,
) -> Reduction:
    """Fit ``orders`` to the runs and correct a held-out run and a dense grid with them.

    ``held`` defaults to the last run, which then takes no part in the fit.
    """
    import numpy as np

    from ..fitting.fit import fit

    training, last = (runs, held) if held else (runs[:-1], runs[-1])
    model = fit(training, orders=orders).model
    measured = 3600.0 * last.centred_error
    after = measured - 3600.0 * model.error(last.reference)
    grid = np.arange(0.0, 360.0, 0.05)
    truth = joint.error(grid)
    left = truth - 3600.0 * model.error(grid)
    return Reduction(
        (float(np.ptp(measured)), float(np.ptp(after))),
        (float(np.ptp(truth)), float(np.ptp(left))),
        (float(truth.std()), float(left.std())),
        tuple(orders),
    )


class Study(NamedTuple):
    """The paper's study repeated, and the same with gear orders behind the aliases.

    Attributes
    ----------
    selections : dict of str to OrderSelection
        By the paper's method, per joint.
    published : dict of str to Reduction
        Joints as the paper published them.
    gear : dict of str to Reduction
        The same joints with all aliases lifted to gear orders, corrected as in the paper.
    plan : CalibrationPlan
        Two mounts that show the difference.
    planned : dict of str to Reduction
        Gear joints read on both mounts, orders selected by evidence.
    """

    selections: dict[str, OrderSelection]
    published: dict[str, Reduction]
    gear: dict[str, Reduction]
    plan: CalibrationPlan
    planned: dict[str, Reduction]


def paper_study(seed: int = 0) -> Study:
    """Repeat the paper's study with simulated groups of both joints.

    Examples
    --------
    >>> study = paper_study()
    >>> study.gear["a"].at_positions < -75.0 and study.gear["a"].in_between > 50.0
    True
    """
    from ..fitting.orders.select import select_orders
    from ..planning.plan import plan_mounts, wanted_orders

    plan = plan_mounts(100.0, POSITIONS, 2)
    offsets = [o for o in plan.mount_offsets_deg for _ in range(GROUPS // 2)]
    selections, published, gear, planned = {}, {}, {}, {}
    for joint in (JOINT_A, JOINT_B):
        runs = simulated_groups(joint, seed=seed)
        selection = select_orders(runs, range(1, 18), gear_ratio=100, method="paper")
        selections[joint.name] = selection
        published[joint.name] = reduction(joint, runs, selection.orders)
        other = lifted(joint)
        gear[joint.name] = reduction(other, simulated_groups(other, seed=seed), selection.orders)
        read = simulated_groups(other, offsets, seed=seed)
        found = select_orders(read, wanted_orders(100.0), gear_ratio=100).orders
        held = simulated_groups(other, offsets[-1:], seed=seed + 1)[0]
        planned[joint.name] = reduction(other, read, found, held)
    return Study(selections, published, gear, plan, planned)
