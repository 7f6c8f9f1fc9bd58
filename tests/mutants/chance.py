"""Faults that nobody chose: ``python tests/mutants/chance.py --room planning --count 20``.

The operators are cosmic-ray's: another sign, another comparison, a number one more or less, a
condition turned round, ``and`` for ``or``, a loop that never runs. Faults are drawn with a seed
that is printed from all that could be planted in the rooms asked for. Only tests that reach the
changed line are run (coverage.py records which do, once); a line that none reaches is a survivor.
What cannot be noticed stands with its reason in ``equivalent.toml``. To go through one module,
``--file python/trueangle/joint/gear.py --count 200`` in place of rooms.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import random
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

from copies import LATE, Copy, Verdict
from faults import Fault
from linetests import LineTests, reaching, rooms_of_tests

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "trueangle"

#: Rooms that compute or that read, print and draw numbers.
ROOMS = (
    "certificate", "cli", "diagnosis", "effects", "estimation", "export", "fitting", "fleets",
    "formats", "joint", "logs", "model", "planning", "plots", "rehearsal", "reports",
    "runs", "selfcalibration", "simulation", "simulators", "support",
)  # fmt: skip

OPERATORS = (
    *(
        f"ReplaceBinaryOperator_{a}"
        for a in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul")
    ),
    *(
        f"ReplaceComparisonOperator_{a}"
        for a in (
            "Lt_LtE",
            "Lt_GtE",
            "LtE_Lt",
            "Gt_GtE",
            "Gt_LtE",
            "GtE_Gt",
            "Eq_NotEq",
            "NotEq_Eq",
        )
    ),
    "ReplaceUnaryOperator_Delete_USub",
    "ReplaceUnaryOperator_Delete_Not",
    "ReplaceAndWithOr",
    "ReplaceOrWithAnd",
    "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue",
    "NumberReplacer",
    "AddNot",
    "ZeroIterationForLoop",
)

#: What stops at lengths that never differ; no test can notice that it is gone.
GUARD = "strict=True"

#: Tests of one fault at most, the ones that reach least first: they are the narrowest.
MOST_TESTS = 60

#: The broadest, in whose approved texts stands whatever is told; asked last.
TEXTS = "tests/python/transcripts/"


class Drawn(NamedTuple):
    """A fault by its place: what the operator makes of which line."""

    file: str
    operator: str
    occurrence: int
    line: int
    before: str
    after: str
    text: str


def drawn(count: int, seed: int, files: list[Path]) -> list[Drawn]:
    """So many faults of all that the operators could plant in ``files``."""
    chance = random.Random(seed)
    weights = [len(p.read_text("utf-8").splitlines()) for p in files]
    found: dict[tuple[str, str, int], Drawn] = {}
    beyond: dict[tuple[Path, str], int] = {}
    for _ in range(200 * count):
        if len(found) == count:
            break
        path = chance.choices(files, weights)[0]
        operator = chance.choice(OPERATORS)
        occurrence = chance.randrange(40)
        if occurrence >= beyond.get((path, operator), 40):
            continue
        code = path.read_text("utf-8")
        changed = mutate_code(code, get_operator(f"core/{operator}")(), occurrence)
        if changed is None or changed == code:
            beyond[path, operator] = occurrence
            continue
        made = mutation(path, operator, occurrence, code, changed)
        if made is not None:
            found[made.file, made.operator, made.occurrence] = made
    return list(found.values())


def mutation(path: Path, operator: str, occurrence: int, code: str, changed: str) -> Drawn | None:
    """The fault at one occurrence; None where it is none, or none that runs."""
    old, new = code.splitlines(), changed.splitlines()
    line = next((k for k, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), None)
    # Lengths that never differ: without the guard nothing changes.
    if line is not None and new[line] == old[line].replace(GUARD, GUARD.replace("True", "False")):
        return None
    if line is None or old[line].lstrip().startswith(("from ", "import ", "@", "__all__", "*,")):
        return None
    try:
        if ast.dump(ast.parse(code)) == ast.dump(ast.parse(changed)):
            return None
    except SyntaxError:
        return None
    file = path.relative_to(ROOT).as_posix()
    return Drawn(
        file, operator, occurrence, line + 1, old[line].strip(), new[line].strip(), changed
    )


def excused(fault: Drawn) -> str:
    """Why nobody can notice it, where `equivalent.toml` says so."""
    path = Path(__file__).with_name("equivalent.toml")
    for entry in tomllib.loads(path.read_text("utf-8"))["equivalent"]:
        if (entry["file"], entry["before"], entry["after"]) == (
            fault.file, fault.before, fault.after,
        ):  # fmt: skip
            return str(entry["because"])
    return ""


def judged(copy: Copy, fault: Drawn, tests: list[str], unfit: set[str]) -> Iterator[str]:
    """What became of a fault, ``killed`` or one of four other words, and what is said of it."""
    why = excused(fault)
    if why:
        yield from ("excused", why)
        return
    if not tests:
        yield from ("unreached", "")
        return
    whole = (ROOT / fault.file).read_text("utf-8")
    planted = Fault("chance", fault.file, whole, fault.text, tuple(tests[:MOST_TESTS]))
    verdict = copy.tried(planted, -1)
    if verdict.outcome == "survived":
        verdict = asked_again(copy, planted, tests, unfit)
    # Tests that cannot even be collected have noticed, if they can without the fault.
    if verdict.outcome == "broken" and copy.run(planted.tests).outcome == "broken":
        yield from ("broken", verdict.told)
        return
    yield "survived" if verdict.outcome == "survived" else "killed"
    yield verdict.by


def asked_again(copy: Copy, planted: Fault, tests: list[str], unfit: set[str]) -> Verdict:
    """What the whole files of the tests say, and the approved texts where they reach the line.

    What a fixture of a module or a cache computes, the first test that asks for it reaches alone.
    """
    files = [*dict.fromkeys(test.split("::")[0] for test in planted.tests)]
    texts = {test.split("::")[0] for test in tests if test.startswith(TEXTS)} - set(files)
    left = [f"--deselect={test}" for test in unfit]
    for asked in filter(None, (files, sorted(texts))):
        again = dataclasses.replace(planted, tests=(*asked, "-m", "not slow", *left))
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
    parser.add_argument("--tests", action="append", help="folders of tests; by default all")
    parser.add_argument(
        "--quick", action="store_true", help="without the slow tests: what is noticed at least"
    )
    parser.add_argument("--least", type=float, default=0.0, help="share killed, else status 1")
    parser.add_argument("--seconds", type=float, default=300.0, help="for the tests of a fault")
    parser.add_argument(
        "--coverage", type=Path, metavar="FOLDER", help="where it is kept for another time"
    )
    args = parser.parse_args()
    seed = int(time.time()) // 86400 if args.seed is None else args.seed
    rooms = args.room or list(ROOMS)
    files = sorted(p for room in rooms for p in (PACKAGE / room).rglob("*.py"))
    if args.file:
        files = [path.resolve() for path in args.file]
    where = [str(path) for path in args.file] if args.file else rooms
    print(f"seed {seed}, {args.count} faults in {', '.join(where)}", flush=True)
    faults = drawn(args.count, seed, files)
    scores: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Copy(ROOT, Path(folder), args.seconds)
        data = args.coverage or Path(folder) / "coverage"
        lines = LineTests(data.resolve())
        lines.record(copy, args.tests or rooms_of_tests(), quick=args.quick)
        reached, unfit = lines.reached(), lines.failing()
        for fault in faults:
            start = time.monotonic()
            tests = reaching(reached.get(fault.file, {}), fault.line)
            outcome, said = judged(copy, fault, tests, unfit)
            scores.setdefault(fault.file.split("/")[2], Counter())[outcome] += 1
            print(
                f"{outcome:9} {fault.file}:{fault.line} {fault.operator} {fault.before!r} -> "
                f"{fault.after!r} ({len(tests)} tests, {time.monotonic() - start:.0f} s) {said}",
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
