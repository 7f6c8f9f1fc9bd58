"""Fixtures shared by all tests."""

from __future__ import annotations

import os
import re
import signal
import sys
from pathlib import Path

# As the command has it, and for what tests start: where the cores are taken by other tests,
# threads of numpy that wait for each other cost ten times the work. Before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

from trueangle.support import deadline

# Machines are shared: time says nothing about correctness.
settings.register_profile(
    "trueangle", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("trueangle")

# What a shell runs in the background is deaf to Ctrl-C, and so is all that it starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Likewise what nohup starts to a hang-up; tests that send one to a child need the default there.
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

ROOT = Path(__file__).resolve().parents[2]

# Work where no time is given is counted and ends alike everywhere; tests that need a whole account,
# whatever it takes, ask for `patient`.
PATIENT = 20.0
DEFAULT_WORK = deadline.LEAST


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work without a time given comes to its own end."""
    monkeypatch.setattr(deadline, "LEAST", PATIENT * DEFAULT_WORK)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of measured data that is not part of the project."""
    folder = Path(os.environ.get("TRUEANGLE_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no measured data at {folder}")
    return folder


def expected_skips(*names: str) -> re.Pattern[str]:
    """Reasons of `skips.txt` that hold everywhere, and those of the systems or jobs named."""
    found = []
    for line in (Path(__file__).parent / "skips.txt").read_text(encoding="utf-8").splitlines():
        system, colon, reason = line.partition(": ")
        if not line or line.startswith("#"):
            continue
        if not colon or system not in ("darwin", "win32", "linux", "partial"):
            found.append(line)
        elif system in names:
            found.append(reason)
    return re.compile("|".join(f"(?:{reason})" for reason in found))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `slow.txt` lists."""
    here = Path(__file__).parent
    lines = (here / "slow.txt").read_text(encoding="utf-8").splitlines()
    slow = tuple(line for line in lines if line and not line.startswith("#"))
    for item in items:
        if os.path.relpath(item.path, here).replace(os.sep, "/").startswith(slow):
            item.add_marker("slow")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Report skips on no list where TRUEANGLE_CI is set, and fail."""
    job = os.environ.get("TRUEANGLE_CI", "")
    if not job:
        return
    expected = expected_skips(sys.platform, job)
    unexpected = [
        report.longrepr
        for report in terminalreporter.getreports("skipped")
        if isinstance(report.longrepr, tuple) and not expected.search(report.longrepr[2])
    ]
    if unexpected:
        terminalreporter.section("skips that are on no list (tests/python/skips.txt)")
        for file, line, reason in unexpected:
            terminalreporter.line(f"{file}:{line}: {reason}", red=True)
        terminalreporter._session.exitstatus = pytest.ExitCode.TESTS_FAILED
