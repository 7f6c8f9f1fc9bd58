"""A copy of the project to plant faults in, and the tests that run there.

A fault of the package is one text replaced by another while its tests run. The faults of the
core are all built into one core, each behind a question that the environment answers: a build
for each would take a day.
"""

from __future__ import annotations

import compileall
import os
import py_compile
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from faults import Fault

#: What the copy needs; measured data are looked for beside the project itself.
PARTS = ("src", "benches", "tests", "python", "docs", "examples", ".ci", ".github")
FILES = ("Cargo.toml", "Cargo.lock", "pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE")
FILES += ("CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "Makefile")

#: What is said where the tests did not end in time.
LATE = "(time is up)"

#: Exit status of pytest where tests failed; others mean that none could run.
FAILED = 1

#: What the core with all faults is built with: without the long link.
QUICK = {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16"}
#: Seconds for that on a busy machine.
BUILD = 3600.0

#: Which fault of the core is switched on, by its number.
CHOSEN = "TRUEANGLE_PLANTED"


class Verdict(NamedTuple):
    """``killed``, ``survived`` or ``broken`` (no test could run), by which, and what was said."""

    outcome: str
    by: str = ""
    told: str = ""


class Copy:
    """The project copied to ``folder``; tests are killed after ``seconds``."""

    def __init__(self, root: Path, folder: Path, seconds: float) -> None:
        self.root, self.folder, self.seconds = root, folder, seconds
        ignored = shutil.ignore_patterns("__pycache__", "_build", "target", ".*_cache", "*.tmp")
        for part in PARTS:
            shutil.rmtree(folder / part, ignore_errors=True)
            shutil.copytree(root / part, folder / part, ignore=ignored)
        for file in FILES:
            shutil.copy(root / file, folder / file)
        core = find_spec("trueangle._core")
        assert core is not None, "build the core first: make develop"
        assert core.origin is not None
        self.core = folder / "python" / "trueangle" / Path(core.origin).name
        shutil.copy(core.origin, self.core)
        # A fault's modules are compiled by its tests; the others once. By what they hold, for
        # faults come and go within the second that times of files tell.
        by_content = py_compile.PycInvalidationMode.CHECKED_HASH
        compileall.compile_dir(folder / "python", quiet=2, invalidation_mode=by_content)

    def tried(self, fault: Fault, number: int) -> Verdict:
        """What the tests of a fault say with it planted."""
        if fault.of_core:
            return self.run(fault.tests, {CHOSEN: str(number)})
        before = fault.plant(self.folder)
        try:
            return self.run(fault.tests)
        finally:
            (self.folder / fault.file).write_text(before, encoding="utf-8")

    def build(self, faults: Sequence[Fault]) -> str:
        """A core with all these faults, none of them switched on; what went wrong."""
        for number, fault in enumerate(faults):
            path = self.folder / fault.file
            text = path.read_text(encoding="utf-8")
            either = f"(if crate::planted::is({number}) {{ {fault.new} }} else {{ {fault.old} }})"
            path.write_text(text.replace(fault.old, either), encoding="utf-8")
        self.switchable()
        command = ["cargo", "build", "--release", "--locked", "-q", "--features", "python", "--lib"]
        status, told = self._done(command, self.environment() | QUICK, BUILD)
        if status != 0:
            return told[-3000:] or "the core was not built in time"
        ending = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
        prefix = "" if sys.platform == "win32" else "lib"
        built = self.folder / "target" / "release" / f"{prefix}trueangle.{ending}"
        self.core.unlink()
        shutil.copy(built, self.core)
        return ""

    def switchable(self) -> None:
        """Give the core the question that says which fault is switched on (`planted.rs`)."""
        source = self.folder / "src"
        shutil.copy(Path(__file__).with_name("planted.rs"), source / "table")
        for file, more in (
            ("table/lib.rs", "pub mod planted;\n"),
            ("lib.rs", "pub use trueangle_table::planted;\n"),
        ):
            text = (source / file).read_text(encoding="utf-8")
            text = text.replace("#![forbid(unsafe_code)]", "")
            allowed = "#![allow(unconditional_panic, arithmetic_overflow)]\n"
            (source / file).write_text(allowed + text + more, encoding="utf-8")

    def run(self, tests: tuple[str, ...], more: Mapping[str, str] | None = None) -> Verdict:
        """Run some tests in the copy."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        status, told = self._done(command, self.environment() | dict(more or {}), self.seconds)
        if status is None:
            return Verdict("killed", LATE)
        if status == FAILED:
            lines = [line for line in told.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return Verdict("killed", lines[0].split(" - ")[0] if lines else "", told[-1500:])
        if status < 0:
            return Verdict("killed", f"(signal {-status})")
        if status == 0 and " passed" in told:
            return Verdict("survived", told=told[-300:])
        return Verdict("broken", told=told[-1500:])

    def environment(self) -> dict[str, str]:
        data = os.environ.get("TRUEANGLE_DATA", str(self.root.parent / "shared" / "data"))
        more = {
            "PYTHONPATH": str(self.folder / "python"),
            "TRUEANGLE_DATA": data,
            "CARGO_TARGET_DIR": str(self.folder / "target"),
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYO3_PYTHON": sysconfig.get_config_var("EXENAME") or sys.executable,
        }
        return {k: v for k, v in os.environ.items() if k != "CARGO_TARGET_DIR"} | more

    def _done(
        self, command: list[str], environment: dict[str, str], seconds: float
    ) -> tuple[int | None, str]:
        """Exit status (None: time was up, everything it started is killed) and output."""
        process = subprocess.Popen(
            command,
            cwd=self.folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        try:
            told, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, ""
        return process.returncode, told
