"""The list of planted faults: one TOML file a room, one table a fault."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent / "faults"

#: What a table of the list may hold.
KEYS = {"name", "file", "old", "new", "tests", "sample", "survives"}


@dataclass(frozen=True)
class Fault:
    """One text replaced by another, and the tests that must notice.

    ``tests`` are arguments of pytest. Texts of the core are expressions, see `copies`.
    ``survives`` is the reason why no test can or need notice.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    sample: bool = False
    survives: str = ""

    @property
    def of_core(self) -> bool:
        """Whether the core must be built anew."""
        return self.file.startswith("src/")

    def problems(self, root: Path) -> list[str]:
        """Why it cannot be planted: nothing where it can."""
        path = root / self.file
        if not path.is_file():
            return [f"there is no {self.file}"]
        count = path.read_text(encoding="utf-8").count(self.old)
        found = [] if count == 1 else [f"{self.file} holds its text {count} times: {self.old!r}"]
        if self.old == self.new:
            found.append("it changes nothing")
        if self.of_core and not (_may_be_expression(self.old) and _may_be_expression(self.new)):
            found.append("its texts are no expressions")
        for test in self.tests:
            file = test.split("::")[0]
            if file.startswith("tests/") and not (root / file).exists():
                found.append(f"there is no {file}")
        return found if self.tests else [*found, "it names no test"]

    def plant(self, root: Path) -> str:
        """Put the fault into the copy at ``root``; what stood there before."""
        path = root / self.file
        before = path.read_text(encoding="utf-8")
        path.write_text(before.replace(self.old, self.new), encoding="utf-8")
        return before


def changed_line(code: str, changed: str) -> tuple[int, str, str]:
    """Number of the first line that differs, from 1, and that line before and after.

    A text that only ends earlier or later differs in a last line of its own.
    """
    pairs = itertools.zip_longest(code.splitlines(), changed.splitlines(), fillvalue="")
    return next((k, a, b) for k, (a, b) in enumerate(pairs, 1) if a != b)


def excused(file: str, before: str, after: str) -> str:
    """Why nobody can notice that a line became another one, where `equivalent.toml` says so."""
    text = FOLDER.with_name("equivalent.toml").read_text("utf-8")
    for entry in tomllib.loads(text)["equivalent"]:
        if (entry["file"], entry["before"], entry["after"]) == (file, before, after):
            return str(entry["because"])
    return ""


def _may_be_expression(text: str) -> bool:
    """Brackets are closed, and no statement stands outside of them."""
    opened: list[str] = []
    for sign in text:
        if sign in "([{":
            opened.append(sign)
        elif sign in ")]}":
            if not opened or opened.pop() + sign not in ("()", "[]", "{}"):
                return False
        elif sign == ";" and not opened:
            return False
    return not opened


def read_faults(root: Path) -> list[Fault]:
    """Every fault of the list, by file and name."""
    found: list[Fault] = []
    for file in sorted(FOLDER.glob("*.toml")):
        for table in tomllib.loads(file.read_text(encoding="utf-8"))["fault"]:
            unknown = table.keys() - KEYS
            assert not unknown, f"{file.name}: {table.get('name')}: no such keys: {unknown}"
            tests = table.pop("tests")
            found.append(Fault(tests=tuple([tests] if isinstance(tests, str) else tests), **table))
    names = [fault.name for fault in found]
    assert len(names) == len(set(names)), sorted(n for n in set(names) if names.count(n) > 1)
    return found


def chosen(
    faults: Sequence[Fault], sample: bool, parts: Sequence[str] | None, core: str
) -> list[Fault]:
    """The faults asked for."""
    return [
        fault
        for fault in faults
        if (fault.sample or not sample)
        and (core == "all" or fault.of_core == (core == "only"))
        and (not parts or any(part in fault.name or part in fault.file for part in parts))
    ]
