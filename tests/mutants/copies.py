"""A copy of the project to plant faults in, and the tests that run there."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from faults import Fault

#: What the copy needs; measured data are looked for beside the project itself.
PARTS = ("src", "benches", "tests", "python", "docs", "examples", ".ci", ".github")
FILES = ("Cargo.toml", "Cargo.lock", "pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE")
FILES += ("CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "Makefile")

#: Exit status of pytest where tests failed; others mean that none could run.
FAILED = 1

#: Of the core for tests of the package: built in half a minute, without the long link.
QUICK = {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16"}


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
        self.kept = folder / "core"
        shutil.copy(core.origin, self.kept)
        shutil.copy(core.origin, self.core)

    def tried(self, fault: Fault) -> Verdict:
        """What the tests of a fault say with it planted."""
        before = fault.plant(self.folder)
        path = self.folder / fault.file
        try:
            if fault.of_core and not fault.tests[0].startswith("cargo"):
                told = self._build()
                if told:
                    return Verdict("broken", told=told)
            return self.run(fault.tests)
        finally:
            path.write_text(before, encoding="utf-8")
            if fault.of_core:
                shutil.copy(self.kept, self.core)

    def run(self, tests: tuple[str, ...]) -> Verdict:
        """Run some tests in the copy."""
        if tests[0].startswith("cargo"):
            return self._cargo(tests)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        status, told = self._done(command, self._environment())
        if status is None:
            return Verdict("killed", "(time is up)")
        if status == FAILED:
            lines = [line for line in told.splitlines() if line.startswith(("FAILED", "ERROR"))]
            return Verdict("killed", lines[0].split(" - ")[0] if lines else "", told[-1500:])
        if status == 0 and " passed" in told:
            return Verdict("survived", told=told[-300:])
        return Verdict("broken", told=told[-1500:])

    def _cargo(self, tests: tuple[str, ...]) -> Verdict:
        command = ["cargo", "test", "--locked", "-q", *tests[0].split()[1:]]
        status, told = self._done([*command, "--no-run"], self._environment())
        if status != 0:
            return Verdict("broken", told=told[-1500:])
        status, told = self._done(command, self._environment())
        if status is None:
            return Verdict("killed", "(time is up)")
        lines = [line for line in told.splitlines() if line.startswith("    ")]
        said = lines[-1].strip() if status and lines else ""
        return Verdict("killed" if status else "survived", said, told[-1500:])

    def _build(self) -> str:
        """Build the core of the copy for Python; what went wrong."""
        command = ["cargo", "build", "--release", "--locked", "-q", "--features", "python", "--lib"]
        status, told = self._done(command, self._environment() | QUICK)
        if status != 0:
            return told[-1500:] or "the core was not built in time"
        ending = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
        prefix = "" if sys.platform == "win32" else "lib"
        built = self.folder / "target" / "release" / f"{prefix}trueangle.{ending}"
        self.core.unlink()
        shutil.copy(built, self.core)
        return ""

    def _environment(self) -> dict[str, str]:
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

    def _done(self, command: list[str], environment: dict[str, str]) -> tuple[int | None, str]:
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
            told, _ = process.communicate(timeout=self.seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return None, ""
        return process.returncode, told
