"""Faults of the core that nobody chose: ``python tests/mutants/chancecore.py --count 200``.

Drawn as in `chance`, by the operators of `rustchanges`, with a seed that is printed, and all built
into one core, each behind a question that the environment answers; those that the compiler refuses
are left out. The core's own tests run first, each alone, only those that reach the fault and the
quickest first. What they let pass, and the bindings in ``src/python``, the tests in Python are
asked about. What cannot be noticed stands with its reason in ``equivalent.toml``.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from copies import CHOSEN, Copy
from faults import changed_line, excused
from rustchanges import Change, changes, switched

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "src"

#: Not compiled here, instructions of the other processor; and tests of the core beside it.
LEFT_OUT = ("neon.rs" if platform.machine() in ("x86_64", "AMD64") else "x86.rs", "tests.rs")

#: Tests in Python that reach most of the core.
ASKED = tuple(f"tests/python/{room}" for room in ("core", "model", "estimation"))

#: Tests of one fault at most.
MOST_TESTS = 40
#: Seconds for a test that takes none; a loop that has lost its end is noticed.
LEAST_SECONDS = 30.0

#: File told of what is reached, see `planted.rs`.
REACHED = "TRUEANGLE_REACHED"

LIBRARIES = ("libtrueangle.so", "libtrueangle.dylib", "trueangle.dll")

#: As tests are built (Cargo.toml), without what only a debugger reads.
PROFILE = {f"CARGO_PROFILE_{name}_DEBUG": "0" for name in ("DEV", "TEST")}
PROFILE |= {"CARGO_PROFILE_DEV_OPT_LEVEL": "2"}


class Drawn(NamedTuple):
    """A fault: in which file what becomes what, and the line as it is and as it becomes."""

    file: str
    change: Change
    before: str
    after: str

    @property
    def folder(self) -> str:
        """The first folder or file below ``src``."""
        return self.file.split("/")[1].removesuffix(".rs")


class Test(NamedTuple):
    """A command that tries one test, and how long it takes where it passes."""

    command: tuple[str, ...]
    seconds: float


def drawn(count: int, seed: int, files: Sequence[Path], root: Path = ROOT) -> list[Drawn]:
    """So many faults, none inside of another; files by their lines, then operators alike."""
    chance = random.Random(seed)
    possible: dict[Path, dict[str, list[Change]]] = {}
    for path in files:
        for change in changes(path.read_text("utf-8")):
            possible.setdefault(path, {}).setdefault(change.operator, []).append(change)
    paths = list(possible)
    weights = [len(path.read_text("utf-8").splitlines()) for path in paths]
    found: list[tuple[Path, Change]] = []
    for _ in range(50 * count if paths else 0):
        if len(found) == count:
            break
        path = chance.choices(paths, weights)[0]
        change = chance.choice(possible[path][chance.choice(sorted(possible[path]))])
        if not any(
            path == other and change.start <= taken.end and taken.start <= change.end
            for other, taken in found
        ):
            found.append((path, change))
    return [_of(path, change, root) for path, change in found]


def _of(path: Path, change: Change, root: Path) -> Drawn:
    source = path.read_bytes()
    changed = source[: change.start] + change.new.encode() + source[change.end :]
    _, before, after = changed_line(source.decode(), changed.decode())
    return Drawn(path.relative_to(root).as_posix(), change, before.strip(), after.strip())


def built(copy: Copy, faults: dict[int, Drawn], cargo: Sequence[str]) -> list[str]:
    """Build the copy with these faults, without those that do not compile; what was built."""
    files = {fault.file for fault in faults.values()}
    while True:
        places: dict[str, list[tuple[int, range]]] = {}
        for file in files:
            numbered = [(k, f.change) for k, f in faults.items() if f.file == file]
            text, ranges = switched((ROOT / file).read_text("utf-8"), numbered)
            (copy.folder / file).write_text(text, "utf-8")
            ordered = sorted(numbered, key=lambda pair: pair[1].start)
            places[file] = [(k, r) for (k, _), r in zip(ordered, ranges, strict=True)]
        command = ["cargo", *cargo, "--locked", "--message-format=json"]
        done = subprocess.run(
            command, cwd=copy.folder, env=copy.environment() | PROFILE,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        said = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        if done.returncode == 0:
            made = [m for m in said if m["reason"] == "compiler-artifact"]
            tests = [m["executable"] for m in made if m["profile"]["test"] and m["executable"]]
            return tests or [path for m in made for path in m["filenames"]]
        refused: set[int] = set()
        told = [m["message"] for m in said if m["reason"] == "compiler-message"]
        errors = [e for e in told if e["level"] == "error"]
        for span in (s for e in errors for s in e["spans"]):
            for number, place in places.get(span["file_name"], ()):
                if span["byte_start"] < place.stop and place.start < span["byte_end"]:
                    refused.add(number)
        if not refused:
            raise SystemExit("\n".join(e["rendered"] for e in errors) or done.stderr[-3000:])
        for number in refused:
            fault = faults.pop(number)
            print(f"refused   {fault.file}:{fault.change.line} {fault.after!r}", flush=True)


def ran(copy: Copy, test: Test, more: dict[str, str]) -> bool:
    """Whether it passes, and in time."""
    environment = copy.environment() | {"RUST_BACKTRACE": "0"} | more
    limit = max(LEAST_SECONDS, 10.0 * test.seconds)
    try:
        done = subprocess.run(
            test.command, cwd=copy.folder, env=environment, timeout=limit, check=False,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def of_rust(copy: Copy, executables: Sequence[str]) -> dict[int, list[Test]]:
    """Tests of the core that reach each fault, the quickest first."""
    reached: dict[int, list[Test]] = {}
    record = copy.folder / "reached"
    for executable in executables:
        listed = subprocess.run(
            [executable, "--list", "--format", "terse"], capture_output=True, text=True, check=True
        )
        names = [n.removesuffix(": test") for n in listed.stdout.splitlines() if ": test" in n]
        for name in names:
            record.write_text("")
            test = Test((executable, "--exact", name), 60.0)
            start = time.monotonic()
            if not ran(copy, test, {REACHED: str(record)}):
                print(f"fails without a fault: {name}", flush=True)
                continue
            for number in record.read_text().split():
                taken = test._replace(seconds=time.monotonic() - start)
                reached.setdefault(int(number), []).append(taken)
    return {number: sorted(tests, key=lambda t: t.seconds) for number, tests in reached.items()}


def of_python(copy: Copy, folders: Sequence[str]) -> dict[int, list[Test]]:
    """Tests in Python that reach each fault, the quickest first."""
    record = copy.folder / "reached"
    record.write_text("")
    environment = copy.environment() | {REACHED: str(record)}
    environment["PYTHONPATH"] += os.pathsep + str(Path(__file__).parent)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "reached"]
    subprocess.run(
        [*command, "-m", "not slow", *folders], cwd=copy.folder, env=environment, check=False
    )
    reached: dict[int, list[Test]] = {}
    numbers: list[int] = []
    for line in record.read_text("utf-8").splitlines():
        if not line.startswith(("= ", "! ")):
            numbers.append(int(line))
            continue
        seconds, name = line[2:].split(" ", 1)
        # What fails by itself would notice every fault.
        for number in numbers if line.startswith("=") else ():
            reached.setdefault(number, []).append(Test((name,), float(seconds)))
        numbers = []
    return {number: sorted(tests, key=lambda t: t.seconds) for number, tests in reached.items()}


def noticed_in_rust(copy: Copy, number: int, tests: Sequence[Test]) -> str:
    """The first test that fails with the fault."""
    more = {CHOSEN: str(number)}
    return next((test.command[-1] for test in tests if not ran(copy, test, more)), "")


def noticed_in_python(copy: Copy, number: int, tests: Sequence[Test]) -> str:
    """The same of tests in Python, all in one process."""
    names = tuple(test.command[-1] for test in tests)
    verdict = copy.run(names, {CHOSEN: str(number)})
    # Tests that cannot even be collected have noticed, if they can without the fault.
    if verdict.outcome == "broken" and copy.run(names).outcome == "broken":
        return ""
    return "" if verdict.outcome == "survived" else verdict.by or verdict.outcome


def judge(
    faults: dict[int, Drawn], tests: dict[int, list[Test]], notice: Callable[..., str], copy: Copy
) -> dict[int, str]:
    """``killed``, ``survived`` or ``unreached``: what becomes of each."""
    found: dict[int, str] = {}
    for number, fault in faults.items():
        start, mine = time.monotonic(), tests.get(number, [])[:MOST_TESTS]
        by = notice(copy, number, mine) if mine else ""
        found[number] = "killed" if by else "survived" if mine else "unreached"
        print(
            f"{found[number]:9} {fault.file}:{fault.change.line} {fault.change.operator}"
            f" {fault.before!r} -> {fault.after!r} ({len(mine)} tests,"
            f" {time.monotonic() - start:.0f} s) {by}",
            flush=True,
        )
    return found


def main() -> int:
    """Draw, build, run, and tell the score of every folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=None, help="by default another every day")
    parser.add_argument("--file", action="append", type=Path, help="of these files alone")
    parser.add_argument("--tests", action="append", help="in Python, in place of the usual ones")
    parser.add_argument("--least", type=float, default=0.0, help="share noticed, else status 1")
    parser.add_argument("--seconds", type=float, default=300.0, help="in Python, for a fault")
    parser.add_argument("--copy", type=Path, help="where the copy is kept for another time")
    args = parser.parse_args()
    seed = int(time.time()) // 86400 if args.seed is None else args.seed
    files = [path.resolve() for path in args.file or sorted(SOURCES.rglob("*.rs"))]
    print(f"seed {seed}, {args.count} faults in the core", flush=True)
    faults = drawn(args.count, seed, [path for path in files if path.name not in LEFT_OUT])
    left = dict(enumerate(faults))
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Copy(ROOT, args.copy or Path(folder), args.seconds)
        copy.switchable()
        made = built(copy, left, ["test", "--no-run", "--lib", "--tests"])
        tests = of_rust(copy, made)
        asked = {k: f for k, f in left.items() if not excused(f.file, f.before, f.after)}
        outcomes = dict.fromkeys(left, "excused") | judge(asked, tests, noticed_in_rust, copy)
        made = built(copy, left, ["build", "--lib", "--features", "python"])
        asked = {k: f for k, f in asked.items() if k in left and outcomes[k] != "killed"}
        copy.core.unlink()
        library = next(p for p in made if p.endswith(LIBRARIES))
        shutil.copy(library, copy.core)
        tests = of_python(copy, args.tests or ASKED)
        again = judge(asked, tests, noticed_in_python, copy)
        for number, outcome in again.items():
            if outcome != "unreached":
                outcomes[number] = "by Python" if outcome == "killed" else outcome
    return told(left, outcomes, args.least)


def told(faults: dict[int, Drawn], outcomes: dict[int, str], least: float) -> int:
    """Print the score of every folder; the exit status."""
    scores: dict[str, Counter[str]] = {}
    for number, fault in faults.items():
        for name in (fault.folder, "~all"):
            scores.setdefault(name, Counter())[outcomes[number]] += 1
    for name, counts in sorted(scores.items()):
        noticed = counts["killed"] + counts["by Python"] + counts["excused"]
        print(f"{name.lstrip('~')}: {noticed} of {counts.total()} noticed ({dict(counts)})")
        if name == "~all" and noticed < least * counts.total():
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
