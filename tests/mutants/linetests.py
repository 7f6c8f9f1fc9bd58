"""Which tests reach a line, as coverage.py records it: each room of tests in a run of its own.

In one run of everything with two workers a part of the contexts is lost; a room takes a minute.
"""

from __future__ import annotations

import ast
import itertools
import sqlite3
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from coverage.numbits import numbits_to_nums

from copies import Copy

#: How pytest begins the line of a test that fails.
ENDED = ("FAILED ", "ERROR ")

#: Rooms that are recorded at a time.
JOBS = 2

#: Endings of what is kept of a room: which lines are reached, which tests fail by themselves, and
#: which fail only where lines are recorded, as they follow calls themselves.
LINES, FAILING, UNSEEN = ".coverage", ".failing", ".unseen"

#: Tests that are recorded apart, in the order in which they are asked.
QUICK, SLOW = "not slow", "slow"


def rooms_of_tests() -> list[str]:
    """Folders below ``tests/python`` that hold tests."""
    root = Path(__file__).resolve().parents[2]
    folders = sorted((root / "tests" / "python").iterdir())
    return [f.relative_to(root).as_posix() for f in folders if [*f.rglob("test_*.py")]]


class LineTests(NamedTuple):
    """What was recorded, in a folder that may be kept for another time."""

    folder: Path

    def record(self, copy: Copy, rooms: list[str], which: str) -> None:
        """Record what is not there yet of the quick tests or of the slow ones."""
        self.folder.mkdir(parents=True, exist_ok=True)
        wanted = [room for room in rooms if not self._of(room, which, FAILING).exists()]
        with ThreadPoolExecutor(JOBS) as pool:
            for told in pool.map(lambda room: self._record(copy, room, which), wanted):
                print(told, flush=True)

    def _record(self, copy: Copy, room: str, which: str) -> str:
        lines = str(self._of(room, which, LINES))
        recorded = (
            f"--cov={copy.folder / 'python' / 'trueangle'}", "--cov-context=test", "--cov-report=",
            room, "-m", which,
        )  # fmt: skip
        told, failed = self._failed(copy, recorded, {"COVERAGE_FILE": lines})
        # A test that fails by itself, as in a copy without history, would notice every fault.
        again = self._failed(copy, failed, {})[1] if failed else []
        self._of(room, which, UNSEEN).write_text("\n".join(set(failed) - set(again)), "utf-8")
        self._of(room, which, FAILING).write_text("\n".join(again), "utf-8")
        return "\n".join([f"{room}: {told}", *failed])

    def _failed(
        self, copy: Copy, asked: Sequence[str], more: dict[str, str]
    ) -> tuple[str, list[str]]:
        """The last line of pytest, and the tests that fail."""
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=line"]
        environment = copy.environment() | more
        done = subprocess.run(
            [*command, *asked], cwd=copy.folder, env=environment, check=False, text=True,
            capture_output=True,
        )  # fmt: skip
        lines = done.stdout.splitlines()
        failed = [line.split(" - ")[0].split(" ", 1)[1] for line in lines if line.startswith(ENDED)]
        return lines[-1] if lines else done.stderr[-300:], failed

    def _of(self, room: str, which: str, ending: str) -> Path:
        name = "*" if room == "*" else room.strip("/").replace("/", "-")
        return self.folder / f"{name}.{which.replace(' ', '-')}{ending}"

    def failing(self) -> set[str]:
        """Tests that fail without a fault."""
        return set(self._kept(self.folder.glob("*" + FAILING)))

    def unseen(self, which: str) -> list[str]:
        """Such tests as may reach any line, for theirs could not be recorded."""
        return self._kept(self.folder.glob(self._of("*", which, UNSEEN).name))

    @staticmethod
    def _kept(files: Iterable[Path]) -> list[str]:
        return [name for path in sorted(files) for name in path.read_text("utf-8").splitlines()]

    def reached(self, which: str) -> dict[str, dict[int, list[str]]]:
        """Such tests as reach each line of each file of the package, the narrowest first."""
        unfit = self.failing() | set(self.unseen(which))
        breadth: Counter[str] = Counter()
        lines: dict[str, dict[int, list[str]]] = {}
        for data in sorted(self.folder.glob(self._of("*", which, LINES).name)):
            for path, context, bits in sqlite3.connect(data).execute(
                "select file.path, context.context, numbits from line_bits"
                " join file on file.id = file_id join context on context.id = context_id"
            ):
                test = context.rpartition("|")[0]  # a parameter may hold that sign, too
                if not test or test in unfit:
                    continue
                name = "python/trueangle/" + path.partition("python/trueangle/")[2]
                for number in numbits_to_nums(bits):
                    lines.setdefault(name, {}).setdefault(number, []).append(test)
                    breadth[test] += 1
        for places in lines.values():
            for number, names in places.items():
                places[number] = sorted(set(names), key=lambda t: (breadth[t], t))
        return lines


def of_line(places: dict[int, list[str]], line: int, code: str) -> list[str]:
    """Tests that reach a line; of one that runs at import, those of the module.

    The first test that imports a module runs its constants, and others are wrong by them.
    """
    if line in places and line not in run_at_import(code):
        return places[line]
    # The narrowest of every line first: a constant may matter to any of them.
    turns = itertools.zip_longest(*(places[number] for number in sorted(places)))
    return list(dict.fromkeys(name for turn in turns for name in turn if name is not None))


def run_at_import(code: str) -> set[int]:
    """Lines outside of the bodies of functions: constants, fields, defaults of arguments."""
    found = set(range(1, code.count("\n") + 2))
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.FunctionDef):
            found.difference_update(range(node.body[0].lineno, (node.end_lineno or 0) + 1))
    return found
