"""Faults that nobody chose: ``python tests/mutants/chance.py --room planning --count 20``.

The operators are cosmic-ray's: another sign, another comparison, a number one more or less, a
condition turned round, ``and`` for ``or``, a loop that never runs. Faults are drawn with a seed
that is printed from all that could be planted in the rooms asked for. Only tests that reach the
changed line are run, the quick ones first (coverage.py records which do, once); a line that none
reaches is a survivor. What cannot be noticed stands with its reason in ``equivalent.toml``. To go
through one module, ``--file python/trueangle/joint/gear.py --count 200`` in place of rooms; to try
what somebody else wrote down, ``--list FILE`` (tables as in ``faults``, without tests).
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from copies import LATE, Copy, Verdict
from drawing import ROOT, Drawn, drawn, listed
from faults import Fault, excused
from linetests import QUICK, SLOW, LineTests, of_line, rooms_of_tests

PACKAGE = ROOT / "python" / "trueangle"

#: Rooms that compute or that read, print and draw numbers.
ROOMS = (
    "certificate", "cli", "diagnosis", "effects", "estimation", "export", "fitting", "fleets",
    "formats", "joint", "logs", "model", "planning", "plots", "rehearsal", "reports",
    "runs", "selfcalibration", "simulation", "simulators", "support",
)  # fmt: skip

#: Tests of one fault at most: those of its module, then the ones that reach least.
MOST_TESTS = 60
#: The same of slow tests, which are asked last.
MOST_SLOW = 30

#: Files that are asked once more as a whole.
MOST_FILES = 12

#: The broadest, in whose approved texts stands whatever is told; asked last.
TEXTS = "tests/python/transcripts/"


def reaching(lines: dict[int, list[str]], fault: Drawn) -> list[str]:
    """Tests that reach a fault, those in files named after its module first."""
    stem = Path(fault.file).stem.strip("_")
    tests = of_line(lines, fault.line, fault.text)
    return sorted(tests, key=lambda test: stem not in test.split("::")[0])


def judged(copy: Copy, fault: Drawn, asked: list[list[str]], unfit: set[str]) -> tuple[str, str]:
    """What became of a fault, ``killed`` or one of four other words, and what is said of it.

    ``asked`` are the quick tests that reach it, and the slow ones where they are asked.
    """
    why = excused(fault.file, fault.before, fault.after)
    if why:
        return "excused", why
    if not any(asked):
        return "unreached", ""
    whole = (ROOT / fault.file).read_text("utf-8")
    verdict = Verdict("survived")
    for tests in asked:
        planted = Fault("chance", fault.file, whole, fault.text, tuple(tests))
        if verdict.outcome == "survived" and tests:
            verdict = copy.tried(planted, -1)
            # Tests that cannot even be collected have noticed, if they can without the fault.
            if verdict.outcome == "broken" and copy.run(planted.tests).outcome == "broken":
                return "broken", verdict.told
        if verdict.outcome == "survived" and tests and tests is asked[0]:
            verdict = asked_again(copy, planted, tests, unfit)
    return "survived" if verdict.outcome == "survived" else "killed", verdict.by


def asked_again(copy: Copy, planted: Fault, tests: list[str], unfit: set[str]) -> Verdict:
    """What the whole files of the tests say, and the approved texts where they reach the line.

    What a fixture of a module or a cache computes, the first test that asks for it reaches alone.
    """
    files = [*dict.fromkeys(test.split("::")[0] for test in planted.tests)][:MOST_FILES]
    texts = {test.split("::")[0] for test in tests if test.startswith(TEXTS)} - set(files)
    left = [f"--deselect={test}" for test in unfit]
    for asked in filter(None, (files, sorted(texts))):
        again = dataclasses.replace(planted, tests=(*asked, "-m", QUICK, *left))
        verdict = copy.tried(again, -1)
        # Many files may take their time; a loop without an end has been noticed before.
        if verdict.outcome == "killed" and verdict.by != LATE:
            return verdict
    return Verdict("survived")


def main() -> int:
    """Draw, plant, and tell the score of every room."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=None, help="by default another every day")
    parser.add_argument(
        "--room", action="append", choices=ROOMS, help="by default all that compute"
    )
    parser.add_argument(
        "--file", action="append", type=Path, help="in place of rooms: faults of these files alone"
    )
    parser.add_argument(
        "--list", type=Path, help="in place of drawing: faults that somebody wrote down"
    )
    parser.add_argument("--tests", action="append", help="folders of tests; by default all")
    parser.add_argument(
        "--quick", action="store_true", help="without the slow tests: what is noticed at least"
    )
    parser.add_argument("--least", type=float, default=0.0, help="share killed, else status 1")
    parser.add_argument("--seconds", type=float, default=300.0, help="for the tests of a fault")
    parser.add_argument(
        "--coverage", type=Path, metavar="FOLDER", help="where it is kept for another time"
    )
    parser.add_argument("--jobs", type=int, default=1, help="faults at a time, each in a copy")
    args = parser.parse_args()
    seed = int(time.time()) // 86400 if args.seed is None else args.seed
    rooms = args.room or list(ROOMS)
    files = sorted(p for room in rooms for p in (PACKAGE / room).rglob("*.py"))
    if args.file:
        files = [path.resolve() for path in args.file]
    where = [str(path) for path in args.file] if args.file else rooms
    what = args.list or f"seed {seed}, {args.count} faults in {', '.join(where)}"
    print(what, flush=True)
    faults = listed(args.list) if args.list else drawn(args.count, seed, files)
    scores: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies = [
            Copy(ROOT, Path(folder) / f"copy{k}", args.seconds) for k in range(max(1, args.jobs))
        ]
        data = args.coverage or Path(folder) / "coverage"
        lines = LineTests(data.resolve())
        kinds = (QUICK,) if args.quick else (QUICK, SLOW)
        for which in kinds:
            lines.record(copies[0], args.tests or rooms_of_tests(), which)
        reached, unfit = [lines.reached(which) for which in kinds], lines.failing()
        unseen = [lines.unseen(which) for which in kinds]
        idle = Queue[Copy]()
        for copy in copies:
            idle.put(copy)

        def tried(fault: Drawn) -> tuple[Drawn, str, str]:
            start = time.monotonic()
            tests = [reaching(of.get(fault.file, {}), fault) for of in reached]
            tests = [
                [*some[:most], *(t for t in some[most:] if t.startswith(TEXTS)), *more]
                for some, most, more in zip(tests, (MOST_TESTS, MOST_SLOW), unseen, strict=False)
            ]
            copy = idle.get()
            try:
                outcome, said = judged(copy, fault, tests, unfit)
            finally:
                idle.put(copy)
            took = f"({sum(map(len, tests))} tests, {time.monotonic() - start:.0f} s)"
            return fault, outcome, f"{took} {said}"

        with ThreadPoolExecutor(len(copies)) as pool:
            for fault, outcome, said in pool.map(tried, faults):
                scores.setdefault(fault.file.split("/")[2], Counter())[outcome] += 1
                print(
                    f"{outcome:9} {fault.file}:{fault.line} {fault.operator} {fault.before!r} -> "
                    f"{fault.after!r} {said}",
                    flush=True,
                )
    whole = Counter[str]()
    for room, counts in [*sorted(scores.items()), ("all", whole)]:
        whole.update(counts if room != "all" else {})
        noticed = counts["killed"] + counts["excused"]
        print(f"{room}: {noticed} of {counts.total()} noticed ({dict(counts)})")
    noticed = whole["killed"] + whole["excused"]
    return 0 if noticed >= args.least * whole.total() else 1


if __name__ == "__main__":
    sys.exit(main())
