"""``trueangle demo``: what the package does, on simulated joints, without any file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ..support.files import REPORT
from .paths import Output

if TYPE_CHECKING:
    from .paperstudy.study import Reduction, Study


HELP = "fit, correct and diagnose simulated joints; needs no files"
EXAMPLE = "trueangle demo --report demo.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--seed", type=int, default=0, help="of the simulated noise (default: 0)")
    parser.add_argument(
        "--report",
        type=Output.of(REPORT),
        metavar="FILE",
        help="also write a report of the diagnosis",
    )


def run(args: argparse.Namespace) -> int:
    """Show the three parts, each a few lines."""
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
    from .paperstudy.study import JOINT_A, PUBLISHED, simulated_groups

    *groups, unseen = simulated_groups(JOINT_A, seed=seed)
    model = fit(groups).model
    left = model.correct(unseen.indicated) - unseen.reference
    place = unseen.reference % 360.0
    read, corrected = (3600.0 * e for e in (unseen.centred_error, left - left.mean()))
    before, after = float(np.ptp(read)), float(np.ptp(corrected))
    published = PUBLISHED[JOINT_A.name]
    return "\n".join(
        [
            "A joint's encoder is wrong by the same pattern in every turn. Measured once",
            "   against a reference, the pattern can be taken off from then on:",
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
    """What the 36 positions cannot tell."""
    from .paperstudy.study import paper_study

    return (
        "What 36 positions cannot tell: orders 36 apart look the same there. A\n"
        "   correction may then be right at the positions and wrong between them.\n\n"
        f"{short_report(paper_study(seed))}"
    )


def _change(found: Reduction, where: str) -> str:
    before, after = found.positions if where == "positions" else found.dense
    change = found.at_positions if where == "positions" else found.in_between
    return f"{before:4.0f} -> {after:3.0f} ({change:+.0f} %)"


def short_report(study: Study) -> str:
    """The whole study in ten lines: what 36 positions say, and what lies between."""
    plan = study.plan
    lines = [
        "The paper's study repeated (6 groups at 36 positions, peak-to-peak in arcsec)",
        "  joint, true orders       at 36 positions     everywhere",
    ]
    for name, found in study.published.items():
        lines.append(
            f"  {name} as published           {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    for name, found in study.gear.items():
        lines.append(
            f"  {name} gear orders instead    {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    lines.append("  The 36 readings of both are the same: only others can tell.")
    offset = plan.mount_offsets_deg[-1]
    for name, found in study.planned.items():
        lines.append(
            f"  {name} read {offset:g} deg apart too  {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    lines.append(
        f"  `ta.plan_mounts(gear_ratio=100)`: mounts at 0 and {offset:g} deg, "
        f"noise factor {plan.worst_noise_factor:.2f}"
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
        "Why is a joint wrong? This one has a backlash of +-8 arcsec that its\n"
        f"   simulation does not know. What the diagnosis says of its runs:\n\n{result.summary()}"
    )
