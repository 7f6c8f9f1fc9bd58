"""Threads of numpy's linear algebra while a diagnosis runs."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

import trueangle as ta
from trueangle.support.blas import blas_threads, one_blas_thread


@pytest.fixture
def count(monkeypatch):
    """Asks for the threads, of which there are two outside."""
    found = blas_threads()
    if found is None:
        pytest.skip("numpy brought no OpenBLAS")
    asks, sets = found
    before = asks()
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    sets(2)
    yield asks
    sets(before)


def test_there_is_one_thread_inside_and_as_many_as_before_outside(count):
    with one_blas_thread():
        assert count() == 1
        with one_blas_thread():
            assert count() == 1
        assert count() == 1
    assert count() == 2


def test_an_error_gives_them_back(count):
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        raise ZeroDivisionError
    assert count() == 2


def test_those_who_overlap_give_them_back_at_the_end_of_the_last(count):
    inside, leave = threading.Event(), threading.Event()

    def work():
        with one_blas_thread():
            inside.set()
            leave.wait(10.0)

    other = threading.Thread(target=work)
    other.start()
    assert inside.wait(10.0)
    with one_blas_thread():
        pass
    assert count() == 1
    leave.set()
    other.join()
    assert count() == 2


def test_products_are_those_of_two_threads(count):
    x = np.random.default_rng(2).standard_normal((400, 300))
    two = x.T @ x
    with one_blas_thread():
        one = x.T @ x
    np.testing.assert_allclose(one, two, rtol=1e-13, atol=1e-11)


@pytest.mark.parametrize(
    ("what", "within"),
    [
        (ta.select_orders, "trueangle.fitting.orders.choice.choose_argument"),
        (ta.report, "trueangle.reports.composition.check_output"),
        (ta.selfcal, "trueangle.selfcalibration.calibrate.as_recordings"),
    ],
)
def test_what_has_many_small_products_has_one(what, within, count, monkeypatch, tmp_path):
    seen = []

    def stop(*_, **__):
        seen.append(count())
        raise KeyboardInterrupt

    monkeypatch.setattr(within, stop)
    theta = np.linspace(0.0, 300.0, 50)
    runs = ta.CalibrationRun(theta, theta + 0.01 * np.sin(np.radians(theta)), period=360.0)
    with pytest.raises(KeyboardInterrupt):
        what(runs, **({} if what is ta.select_orders else {"path": tmp_path / "report.html"}))
    assert seen == [1]
    assert count() == 2


@pytest.mark.parametrize(
    ("command", "given", "threads"),
    [("fit", {}, "1"), ("fit", {"OPENBLAS_NUM_THREADS": "2"}, "2"), ("bench", {}, "None")],
)
def test_a_command_asks_for_one_before_numpy_is_there(command, given, threads):
    code = (
        "import os, sys\nfrom trueangle import cli\n"
        "cli.main = lambda: print(os.environ.get('OPENBLAS_NUM_THREADS'), 'numpy' in sys.modules)\n"
        "cli.process()"
    )
    kept = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code, command],
        env=kept | given,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [threads, "False"]
