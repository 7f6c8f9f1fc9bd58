"""The exam: cases by the hundred, and the confusion matrix as an artefact.

Run it from the repository root, for instance

    python -m tests.python.hidden.exam --scales 1 0.3 --seeds 20 --jobs 2
    python -m tests.python.hidden.exam --causes backlash latency --seeds 5 --show
    python -m tests.python.hidden.exam --set pairs blind none --seeds 5 --first-seed 100

The matrix (CSV) and every answer (JSON) go to ``build/exam`` or to ``$TRUEANGLE_EXAM``.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import traceback
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from statistics import median

from . import blind, pairs
from .answer import STANDARD_ERRORS, Answer, ask
from .case import Case
from .causes import CAUSES

#: Kinds of noise under which nothing may be named when nothing is hidden.
NOISES = ("normal", "correlated", "heavy")


def singles(causes: Iterable[str], scales: Iterable[float], seeds: list[int]) -> list[Case]:
    """One hidden cause at a time in the rich design."""
    return [Case((c,), scale, seed) for c in causes for scale in scales for seed in seeds]


def nothing(seeds: list[int]) -> list[Case]:
    """Data with no hidden effect at all."""
    return [Case((), 1.0, seed, "rich", noise) for noise in NOISES for seed in seeds]


def answers(cases: list[Case], jobs: int = 1, show: bool = False) -> list[Answer]:
    """Ask every case, in as many processes as allowed."""
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            return list(_told(pool.map(attempt, cases), show))
    return list(_told(map(attempt, cases), show))


def attempt(case: Case) -> Answer:
    """The answer to a case; an exception is a wrong answer and no reason to stop the exam."""
    try:
        return ask(case)
    except Exception as failure:
        where = traceback.extract_tb(failure.__traceback__)[-1]
        name = f"{type(failure).__name__} in {Path(where.filename).name}:{where.lineno}"
        return Answer(case, (name,), (), (), {}, {}, str(failure), math.nan, math.nan)


def _told(found: Iterable[Answer], show: bool) -> Iterator[Answer]:
    for answer in found:
        if show:
            print(describe(answer), flush=True)
        yield answer


def describe(answer: Answer) -> str:
    """One line on one answer."""
    scores = ", ".join(f"{name} {score:+.1f} se" for name, score in answer.scores.items())
    shares = ", ".join(f"{share:.2f}" for share in answer.shares.values())
    ok = answer.honest if answer.case.design in blind.BLIND else answer.exact
    return (
        f"{'ok  ' if ok else 'FAIL'} {answer.case}: {list(answer.found)} "
        f"visible {answer.visible:.0f} share [{shares}] {scores} {answer.seconds:.2f} s"
        + (f" blind {sorted(set(answer.blind))}" if not ok else "")
    )


def table(found: list[Answer]) -> str:
    """Per cause, design, noise and scale: how often named first, exactly, with extras."""
    groups: dict[tuple[str, ...], list[Answer]] = defaultdict(list)
    for a in found:
        c = a.case
        groups["+".join(c.causes) or "none", c.design, c.noise, f"{c.scale:g}"].append(a)
    lines = [
        f"{'hidden':45s} {'design':18s} {'scale':>5s} {'n':>3s} {'first':>5s} {'exact':>5s} "
        f"{'extra':>5s} {'honest':>6s} {'in 3se':>7s} {'share':>5s} {'chi2':>7s} {'s':>5s}  wrong"
    ]
    for (hidden, design, noise, scale), group in groups.items():
        scores = [s for a in group for s in a.scores.values()]
        near = sum(abs(s) <= STANDARD_ERRORS for s in scores)
        shares = [a.shares[c] for a in group for c in a.case.causes if c in a.shares]
        shares = [s for s in shares if s == s]
        wrong = Counter(", ".join(a.found) or "none" for a in group if not a.exact)
        lines.append(
            f"{hidden + ('' if noise == 'normal' else ' ' + noise):45s} {design:18s} {scale:>5s} "
            f"{len(group):3d} {sum(a.right_first for a in group):5d} "
            f"{sum(a.exact for a in group):5d} {sum(bool(a.extra) for a in group):5d} "
            f"{sum(a.honest for a in group):6d} {f'{near}/{len(scores)}':>7s} "
            f"{median(shares) if shares else float('nan'):5.2f} "
            f"{median(a.visible for a in group):7.0f} "
            f"{median(a.seconds for a in group):5.2f}  "
            + "; ".join(f"{n}x {w}" for w, n in wrong.most_common(4))
        )
    return "\n".join([*lines, "", *totals(found)])


def totals(found: list[Answer]) -> list[str]:
    """The figures of merit over everything asked."""
    lines = []
    single = [a for a in found if len(a.case.causes) == 1 and a.case.design == "rich"]
    for scale in sorted({a.case.scale for a in single}, reverse=True):
        group = [a for a in single if a.case.scale == scale]
        scores = [s for a in group for s in a.scores.values()]
        lines.append(
            f"scale {scale:g}: named first {_percent(a.right_first for a in group)}, "
            f"exactly {_percent(a.exact for a in group)}, "
            f"with an extra cause {_percent(bool(a.extra) for a in group)}, with a false confirmed "
            f"one {_percent(bool(a.false) for a in group)}, parameters within "
            f"{STANDARD_ERRORS:g} se {_percent(abs(s) <= STANDARD_ERRORS for s in scores)}"
        )
    rest = {
        "two effects, both and no more": [a.exact for a in found if len(a.case.causes) == 2],
        "nothing hidden, false alarms": [bool(a.found) for a in found if not a.case.causes],
        "blind designs answered honestly": [
            a.honest for a in found if a.case.design in blind.BLIND
        ],
    }  # fmt: skip
    lines += [f"{name}: {_percent(flags)}" for name, flags in rest.items() if flags]
    return lines


def _percent(flags: Iterable[bool]) -> str:
    values = list(flags)
    return f"{sum(values)}/{len(values)} ({100 * sum(values) / max(len(values), 1):.1f} %)"


def save(found: list[Answer], folder: Path) -> Path:
    """Write ``confusion.csv`` (truth by first name) and ``answers.json``; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [*CAUSES, "none", "crash"]
    rows: dict[tuple[str, float], Counter[str]] = defaultdict(Counter)
    for a in found:
        if a.case.design == "rich" and len(a.case.causes) < 2:
            first = a.first if a.first in names else "crash"
            rows["".join(a.case.causes) or "none", a.case.scale][first] += 1
    with (folder / "confusion.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["hidden", "scale", *names])
        for (hidden, scale), counts in rows.items():
            writer.writerow([hidden, scale, *(counts[name] for name in names)])
    (folder / "answers.json").write_text(
        json.dumps([a.record() for a in found], indent=1), encoding="utf-8"
    )
    return folder


def artefacts() -> Path:
    """Where the matrix goes."""
    return Path(os.environ.get("TRUEANGLE_EXAM", "build/exam"))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--set", nargs="+", default=["single"],
                        choices=["single", "pairs", "blind", "none"])  # fmt: skip
    parser.add_argument("--causes", nargs="+", default=list(CAUSES), choices=list(CAUSES))
    parser.add_argument("--scales", nargs="+", type=float, default=[1.0])
    parser.add_argument("--seeds", type=int, default=5, help="how many")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print every answer")
    parser.add_argument("-o", "--output", type=Path, default=None)
    args = parser.parse_args(arguments)
    seeds = list(range(args.first_seed, args.first_seed + args.seeds))
    cases = {
        "single": singles(args.causes, args.scales, seeds),
        "pairs": [case for scale in args.scales for case in pairs.cases(scale, seeds)],
        "blind": blind.cases(seeds),
        "none": nothing(seeds),
    }
    found = answers([c for name in args.set for c in cases[name]], args.jobs, args.show)
    print(table(found))
    print(f"written to {save(found, args.output or artefacts())}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
