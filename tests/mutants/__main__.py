"""Planted faults: ``python tests/mutants [--sample] [--only PART] [--seconds 180]``.

Each fault of ``faults/*.toml`` replaces one text in one source file of a copy of the project,
and the tests it names must fail then; they pass without it, which is tried first (``--trust``
where they have just been run: then only that the copy works). A fault that
no test notices has survived: exit status 1. What is known to survive says why (``survives``).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # started as a module, too

from copies import Copy
from faults import Fault, chosen, read_faults

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Plant each fault and run its tests."""
    parser = argparse.ArgumentParser(prog="python tests/mutants", description=__doc__)
    parser.add_argument("--sample", action="store_true", help="the faults marked so: some minutes")
    parser.add_argument("--only", action="append", metavar="PART", help="of a name or a file")
    parser.add_argument("--core", choices=("all", "no", "only"), default="all", help="of the core")
    parser.add_argument("--seconds", type=float, default=300.0, help="for the tests of a fault")
    parser.add_argument(
        "--trust", action="store_true", help="the tests pass: try only the first one's unplanted"
    )
    parser.add_argument("--check", action="store_true", help="only look for the texts to replace")
    parser.add_argument("--copy", metavar="FOLDER", help="where the copy is kept for another time")
    args = parser.parse_args()
    faults = chosen(read_faults(ROOT), args.sample, args.only, args.core)
    wrong = [f"{fault.name}: {said}" for fault in faults for said in fault.problems(ROOT)]
    for line in wrong:
        print(line)
    if args.check or wrong or not faults:
        print(f"{len(faults)} faults, {len(wrong)} that cannot be planted")
        return 1 if wrong or not faults else 0
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Copy(ROOT, Path(args.copy or folder), args.seconds)
        of_core = [fault for fault in faults if fault.of_core]
        told = copy.build(of_core) if of_core else ""
        if told:
            print(f"the core with its faults was not built:\n{told}")
            return 1
        if not unplanted(copy, faults[:1] if args.trust else faults):
            return 1
        return planted(copy, faults)


def unplanted(copy: Copy, faults: list[Fault]) -> bool:
    """Whether the tests pass without any fault."""
    good = True
    for tests in dict.fromkeys(tuple(fault.tests) for fault in faults if fault.tests):
        start = time.monotonic()
        verdict = copy.run(tests)
        if verdict.outcome != "survived":
            print(f"without a fault {verdict.outcome}: {' '.join(tests)}\n{verdict.told}")
            good = False
        else:
            print(f"passes in {time.monotonic() - start:.0f} s: {' '.join(tests)}", flush=True)
    return good


def planted(copy: Copy, faults: list[Fault]) -> int:
    """Plant one fault after the other; the exit status."""
    counts: Counter[str] = Counter()
    numbers = {fault.name: k for k, fault in enumerate(f for f in faults if f.of_core)}
    for fault in faults:
        start = time.monotonic()
        verdict = copy.tried(fault, numbers.get(fault.name, -1))
        outcome = verdict.outcome
        if fault.survives:
            outcome = "excused" if outcome == "survived" else "killed though excused"
        counts[outcome] += 1
        seconds = time.monotonic() - start
        print(f"{outcome:9} {fault.name} ({seconds:.0f} s) {verdict.by}", flush=True)
        if outcome == "excused":
            print(f"          {fault.survives}")
        elif outcome not in ("killed",):
            print(verdict.told, flush=True)
    said = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
    print(f"{len(faults)} faults: {said}")
    return 0 if counts["killed"] + counts["excused"] == len(faults) else 1


if __name__ == "__main__":
    sys.exit(main())
