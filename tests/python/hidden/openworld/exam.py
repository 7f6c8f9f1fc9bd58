"""Ask questions by the hundred and print how many were answered right.

Run it from the repository root, for instance

    python -m tests.python.hidden.openworld.exam outside nothing --seeds 10 --jobs 2
    python -m tests.python.hidden.openworld.exam high --kinds backlash latency --seeds 3 --show
"""

from __future__ import annotations

import argparse
import sys
import traceback
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from ..answer import STANDARD_ERRORS
from .questions import JUDGES, Case, Verdict, ask, cases


def attempt(case: Case) -> Verdict:
    """The verdict; an exception is a wrong answer and no reason to stop the exam."""
    try:
        return ask(case)
    except Exception as failure:
        where = traceback.extract_tb(failure.__traceback__)[-1]
        name = f"{type(failure).__name__} in {Path(where.filename).name}:{where.lineno}: {failure}"
        return Verdict(case, False, (name,), (), False, "", float("nan"))


def table(verdicts: list[Verdict]) -> str:
    """Right answers per group and kind."""
    kinds: dict[tuple[str, str], list[Verdict]] = defaultdict(list)
    for v in verdicts:
        kinds[v.case.group, v.case.kind].append(v)
        kinds[v.case.group, "all"].append(v)
    lines = []
    for (group, kind), found in sorted(
        kinds.items(), key=lambda item: (item[0][0], item[0][1] == "all")
    ):
        right = sum(v.right for v in found)
        lines.append(
            f"{group:9s} {kind:45s} {right:4d}/{len(found):<4d} {100 * right / len(found):5.1f} %"
        )
        scores = [score for v in found for score in v.scores.values()]
        if scores:
            near = sum(abs(score) <= STANDARD_ERRORS for score in scores)
            lines[-1] += f"   parameters within {STANDARD_ERRORS:g} se {near}/{len(scores)}"
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("groups", nargs="+", choices=[*JUDGES])
    parser.add_argument("--kinds", nargs="+")
    parser.add_argument("--scales", nargs="+", type=float, default=[1.0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print every answer")
    args = parser.parse_args()
    seeds = range(args.first_seed, args.first_seed + args.seeds)
    asked = [c for g in args.groups for s in args.scales for c in cases(g, seeds, s)]
    if args.kinds:
        asked = [case for case in asked if case.kind in args.kinds]
    verdicts = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for verdict in pool.map(attempt, asked) if args.jobs > 1 else map(attempt, asked):
            verdicts.append(verdict)
            if args.show:
                print(verdict, flush=True)
    print(table(verdicts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
