"""``trueangle demo``: what the package does, on simulated joints, without any file."""

from __future__ import annotations

import argparse

from ..support.files import REPORT
from .paths import Output

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
    print(_corrected(args.seed))
    print()
    print(_between(args.seed))
    print()
    print(_diagnosed(args.seed))
    if args.report:
        from ..reports.demo import demo_report

        demo_report(args.report, seed=args.seed)
        print(f"\nreport written to {args.report}")
    return 0


def _corrected(seed: int) -> str:
    """The paper's joint a: fitted on five groups, the sixth corrected."""
    import numpy as np

    from ..fitting.fit import fit
    from .paperstudy.study import JOINT_A, PUBLISHED, simulated_groups

    *groups, unseen = simulated_groups(JOINT_A, seed=seed)
    model = fit(groups).model
    before = 3600.0 * float(np.ptp(unseen.centred_error))
    after = 3600.0 * float(np.ptp(model.correct(unseen.indicated) - unseen.reference))
    published = PUBLISHED[JOINT_A.name]
    return "\n".join(
        [
            "Joint a of the paper (Eq. 8), read at 36 positions in six groups with noise;",
            "fitted on five groups, the sixth corrected:",
            f"  orders kept   {', '.join(f'{order:g}' for order in model.orders)}",
            f"  peak-to-peak  {before:6.2f} -> {after:5.2f} arcsec, "
            f"{100.0 * (1.0 - after / before):.1f} % less",
            f"  the paper     {published[0]:6.2f} -> {published[1]:5.2f} arcsec, "
            f"{published[2]:.1f} % less",
        ]
    )


def _between(seed: int) -> str:
    """What the 36 positions cannot tell."""
    from .paperstudy.report import short_report
    from .paperstudy.study import paper_study

    return short_report(paper_study(seed))


def _diagnosed(seed: int) -> str:
    """One hidden effect, found."""
    from dataclasses import replace

    from ..diagnosis import diagnose
    from ..effects import Backlash
    from ..reports.demo import demo_simulation
    from ..simulation import simulate

    believed = demo_simulation()
    true = replace(believed, effects=(Backlash(half_width_arcsec=8.0),))
    result = diagnose(simulate(true, seed=seed), believed)
    return (
        "Another simulated joint has a backlash of +-8 arcsec that its simulation lacks.\n"
        f"What the diagnosis makes of its runs:\n\n{result.summary()}"
    )
