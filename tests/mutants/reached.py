"""What of the planted faults each test reaches: a plugin of pytest (``-p reached``).

The core tells each number once to the file named by the environment; here a line with the
test's name and its seconds follows (after ``=``, or ``!`` where it failed), and what was reached
is forgotten for the next.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator

import pytest

import trueangle._core

MOST = 4096

#: Names of tests that failed.
FAILED: set[str] = set()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.failed:
        FAILED.add(report.nodeid)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    seen = (ctypes.c_ubyte * MOST).in_dll(ctypes.CDLL(trueangle._core.__file__), "TRUEANGLE_SEEN")
    ctypes.memset(seen, 0, MOST)
    start = os.times().elapsed
    found = yield
    with open(os.environ["TRUEANGLE_REACHED"], "a", encoding="utf-8") as file:
        sign = "!" if item.nodeid in FAILED else "="
        file.write(f"{sign} {os.times().elapsed - start:.2f} {item.nodeid}\n")
    return found
