"""Many threads at once on one model, with and without the interpreter's lock."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable

import numpy as np
import pytest

import trueangle as ta
from trueangle._core import Compensator, Series
from trueangle.model.terms import Backlash

THREADS = 8
ROUNDS = 40

free_threaded = pytest.mark.skipif(
    not sysconfig.get_config_var("Py_GIL_DISABLED"), reason="this interpreter has a lock"
)


@free_threaded
def test_importing_leaves_the_lock_off():
    # In a fresh interpreter: other packages of the tests may have switched it on here.
    code = "import sys, trueangle._core; print(sys._is_gil_enabled())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
    assert "GIL" not in found.stderr


def at_once(work: Callable[[int], None]) -> None:
    """Run ``work(i)`` in all threads, started together; raise what any of them raised."""
    start = threading.Barrier(THREADS)
    failures: list[BaseException] = []

    def run(i: int) -> None:
        try:
            start.wait()
            work(i)
        except BaseException as failure:
            failures.append(failure)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]


def series() -> Series:
    return Series(360.0, 0.25, [1.0], [[1, 2, 17]], [[0.03, -0.02, 0.001]], [[0.0, 0.05, 0.0]])


def test_one_series_in_many_threads():
    theta = np.linspace(-720.0, 720.0, 4001)
    single = theta.astype(np.float32)
    counts = np.arange(-500, 500)
    alone = series()
    expected = (
        alone.error(theta),
        alone.correct(theta),
        alone.error(single),
        alone.error(counts),
    )
    step = Compensator(alone).step
    steps = [step(x) for x in theta[:200].tolist()]
    for _ in range(ROUNDS):
        # New every time: the threads meet while its tables are being built.
        shared = series()

        def work(i: int, shared: Series = shared) -> None:
            ways = (
                lambda: shared.error(theta),
                lambda: shared.correct(theta),
                lambda: shared.error(single),
                lambda: shared.error(counts),
            )
            for j in range(len(ways)):
                which = (i + j) % len(ways)
                np.testing.assert_array_equal(ways[which](), expected[which])
            step = Compensator(shared).step
            assert [step(x) for x in theta[:200].tolist()] == steps

        at_once(work)


def test_one_step_in_many_threads():
    step = Compensator(series()).step
    angles = np.linspace(-720.0, 720.0, 20_000).tolist()
    expected = [step(x) for x in angles]

    def work(_: int) -> None:
        assert [step(x) for x in angles] == expected

    at_once(work)


def test_each_thread_its_own_corrector():
    shaft = ta.Shaft("output", 1.0, (1, 2), (0.03, 0.0), (0.0, 0.01))
    backlash = Backlash(0.02)
    model = ta.HarmonicModel(period=360.0, shafts=(shaft,), terms=(backlash,))
    angles = (30.0 * np.sin(np.linspace(0.0, 20.0, 3000))).tolist()
    alone = model.corrector()
    expected = [alone.step(x) for x in angles]

    def work(_: int) -> None:
        corrector = model.corrector()
        assert [corrector.step(x) for x in angles] == expected

    at_once(work)


def test_a_shared_corrector_refuses_or_answers():
    shaft = ta.Shaft("output", 1.0, (1, 2), (0.03, 0.0), (0.0, 0.01))
    model = ta.HarmonicModel(period=360.0, shafts=(shaft,), terms=(Backlash(0.02),))
    shared = model.corrector()
    largest = 0.03 + 0.01 + 0.02

    refusals: list[str] = []

    def work(_: int) -> None:
        for x in np.linspace(0.0, 30.0, 3000).tolist():
            try:
                corrected = shared.step(x)
            except RuntimeError as refusal:  # two threads in it at once
                refusals.append(str(refusal))
            else:
                assert abs(corrected - x) <= largest

    at_once(work)
    assert all("borrowed" in refusal for refusal in refusals)
