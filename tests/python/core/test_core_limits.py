"""What decides about work and memory has limits, and nothing hangs, aborts or is lost."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.errors import ArgumentError, NotInvertibleError

#: Seconds within which an impossible request is refused, on a machine busy with others.
SOON = 5.0

#: Seconds after which a child counts as hanging.
HANGS = 120.0


def in_child(code: str, **options) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process of its own, whose death is seen and whose hang ends."""
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=HANGS,
        check=False,
        **options,
    )


# -- budgets --------------------------------------------------------------------------


def steep(order: int, cycles: float = 1.0, amplitude: float = 1.0) -> ta.HarmonicModel:
    orders = [1, 2, order]
    shaft = ta.Shaft("output", cycles, orders, [amplitude] * 3, [0.0] * 3)
    return ta.HarmonicModel([shaft], period=360.0)


@pytest.mark.parametrize(
    ("order", "cycles", "error", "message"),
    [
        (10**9, 1.0, NotInvertibleError, "may reach"),
        (1000, 1e6, NotInvertibleError, "may reach"),
        (4, 1e10, ArgumentError, "1e-9 to 1e9"),
        (10**9, 2.0, ArgumentError, "at most 1000000000"),
        (10**10, 1.0, ArgumentError, "whole numbers from 1"),
        (10**30, 1.0, ArgumentError, "whole numbers from 1"),
    ],
)
def test_orders_beyond_measure_are_refused_at_once(order, cycles, error, message):
    start = time.perf_counter()
    with pytest.raises(error, match=message):
        steep(order, cycles)
    assert time.perf_counter() - start < SOON


def test_the_slope_is_bounded_however_high_the_order():
    # The sum of the slopes is a bound that costs nothing, the grid one that is tighter.
    for high in (40, 5000, 10**6, 10**9):
        orders, a = [2, 3, high], [1.0, 0.7, 1.0 / high]
        series = _core.Series(360.0, 0.0, [1.0], [orders], [a], [[0.0] * 3])
        x = np.concatenate([np.linspace(0.0, 360.0, 40_001), np.linspace(100.0, 100.001, 4001)])
        rate = 2.0 * math.pi / 360.0
        steepest = rate * sum(k * c for k, c in zip(orders, a, strict=True))
        assert np.abs(series.slope(x)).max() <= series.slope_bound <= steepest * (1 + 1e-12)


def test_lines_that_cannot_add_up_do_not_count_as_if_they_did():
    # cos(x) and cos(3 x) / 3 are steepest at different angles: 1.54, not 2.
    a = 0.62 * 360.0 / (2.0 * math.pi)
    series = _core.Series(360.0, 0.0, [1.0], [[1, 3]], [[a, a / 3.0]], [[0.0, 0.0]])
    x = np.linspace(0.0, 360.0, 100_001)
    true = np.abs(series.slope(x)).max()
    assert true <= series.slope_bound <= 1.006 * true < 0.97
    # ... also as orders of a fast shaft and as orders with a common factor
    for cycles, orders in (([1000.5], [1, 3]), ([1.0], [10_000, 30_000])):
        k = cycles[0] * orders[0]
        fast = _core.Series(360.0, 0.0, cycles, [orders], [[a / k, a / 3.0 / k]], [[0.0, 0.0]])
        assert fast.slope_bound == pytest.approx(series.slope_bound, rel=1e-9)


def test_a_fit_of_a_high_order_is_answered_at_once():
    theta = np.linspace(0.0, 360.0, 500, endpoint=False)
    run = ta.CalibrationRun(theta, theta + 0.1 * np.cos(np.radians(theta)), period=360.0)
    start = time.perf_counter()
    with contextlib.suppress(ta.TrueAngleError):  # refused or answered
        ta.fit([run], orders=[10**6]).model.correct(theta)
    with pytest.raises(ArgumentError, match="number of orders fitted together"):
        _core.fit([(theta, theta, None)], 360.0, [1.0], [list(range(1, 5000))])
    with pytest.raises(ArgumentError, match="highest order of moments"):
        ta.Moments([10**6])
    assert time.perf_counter() - start < SOON


@pytest.mark.parametrize("threads", [0, -3, 1025, 10**30, "two", 2.0, True])
@pytest.mark.parametrize("terms", [(), (ta.Backlash(0.1),)])
def test_threads_have_limits_with_and_without_terms(threads, terms):
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], 0.0, 360.0, terms=terms)
    for compute in (model.error, model.correct):
        for angles in (1.0, np.ones(3)):
            with pytest.raises(ArgumentError, match="threads must be 1 or more"):
                compute(angles, threads=threads)
            with pytest.raises(ArgumentError, match="path must be"):
                compute(angles, path="nonsense")


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="counts threads in /proc")
def test_asking_for_other_numbers_of_threads_leaves_one_pool():
    found = in_child(
        """
        import os
        import numpy as np
        import trueangle as ta
        model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0)
        x = np.linspace(0.0, 360.0, 200_000)
        before = len(os.listdir("/proc/self/task"))
        results = {model.error(x, threads=n).tobytes() for n in range(2, 301)}
        print(len(os.listdir("/proc/self/task")) - before, len(results), os.cpu_count())
        """
    )
    assert found.returncode == 0, found.stderr
    more, different, cores = (int(word) for word in found.stdout.split())
    assert different == 1
    assert more <= cores


@pytest.mark.skipif(os.cpu_count() == 1, reason="one processor")
def test_a_large_batch_is_shared_by_threads_and_a_small_one_is_not():
    found = in_child(
        """
        import os
        import numpy as np
        import trueangle as ta
        shaft = ta.Shaft("output", 1, [1, 20], [0.1, 0.0], [0.0, 0.1])
        model = ta.HarmonicModel([shaft], period=360.0)
        counts = []
        for size in (1, 100, 4_000_000):
            model.correct(np.linspace(0.0, 360.0, size), threads=2)
            counts.append(len(os.listdir("/proc/self/task")))
        print(*counts)
        """
    )
    assert found.returncode == 0, found.stderr
    one, small, large = (int(word) for word in found.stdout.split())
    assert small == one
    assert large > one


# -- numbers that no model may have ----------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"period": 5e-324}, "period"),
        ({"period": 1e300}, "period"),
        ({"condition_number": -1.0}, "condition_number"),
        ({"condition_number": math.inf}, "condition_number"),
        ({"constant": 1e300}, "size of constant"),
        ({"shafts": [ta.Shaft("output", 1, [1], [1e200], [0])]}, "size of cosine"),
        ({"span": (5e300, -5e300)}, "span"),
        ({"span": (10.0, 5.0)}, "not stop before"),
        ({"span": (math.nan, 5.0)}, "span"),
    ],
)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_numbers_that_no_model_may_have(change, message, argument):
    from trueangle.model.records import FitRecord

    fields = {"shafts": [ta.Shaft("output", 1, [1], [0.0], [0.5])], "period": 360.0} | change
    span = fields.pop("span", (0.0, 360.0))
    record = FitRecord(samples=10, runs=1, span=span, residual=0.1)
    with pytest.raises(ta.TrueAngleError, match=message):
        ta.HarmonicModel(**fields, argument=argument, fit=record)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_an_accepted_model_has_a_value_at_every_angle(argument):
    rng = np.random.default_rng(seed := 20_261_121)
    print(f"seed {seed}")
    angles = np.array([0.0, 1.0, -1e6, 1e15, 1e300, -1.7e308, 5e-324])
    accepted = 0
    for _ in range(400):
        cycles = 10.0 ** rng.uniform(-10, 10)
        cycles = round(cycles) or 1.0 if rng.random() < 0.5 else cycles
        orders = sorted({int(10.0 ** rng.uniform(0, 9)) for _ in range(3)})
        period = 10.0 ** rng.uniform(-31, 31)
        a, b = (10.0 ** rng.uniform(-30, 10, len(orders)) * period for _ in range(2))
        constant = 10.0 ** rng.uniform(-3, 10) * period
        try:
            shaft = ta.Shaft("output", cycles, orders, a, b)
            model = ta.HarmonicModel([shaft], constant, period, argument)
        except ta.TrueAngleError:
            continue
        accepted += 1
        step = model.compensator()
        for compute in (model.error, model.correct):
            assert not np.isnan(compute(angles)).any(), model
        assert not np.isnan([step(angle) for angle in angles.tolist()]).any(), model
    assert accepted > 20


# -- memory ----------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS is enforced on Linux")
@pytest.mark.parametrize("terms", ["", "ta.Backlash(0.1)", "ta.TorsionalCompliance(0.01)"])
def test_memory_that_is_not_there_is_an_error_like_any_other(terms):
    found = in_child(
        f"""
        import resource
        import numpy as np
        import trueangle as ta
        model = ta.HarmonicModel(
            [ta.Shaft("output", 1, [1, 2], [0.1, 0.0], [0.0, 0.2])], period=360.0,
            terms=[{terms}],
        )
        x = np.linspace(0.0, 360.0, 20_000_000)
        signals = dict(torque=1.0) if model.signals else {{}}
        size = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + 60_000_000,) * 2)
        caught = 0
        for compute in (model.error, model.correct):
            try:
                compute(x, **signals)
            except MemoryError:
                caught += 1
        try:
            ta.Moments({{"motor": [40_000]}}, gear_ratio=1.0).update(x[:10], x[:10])
        except MemoryError:
            caught += 1
        try:
            ta._core.fit([(x[:99], x[:99], None)], 360.0, [1.0], [list(range(1, 4000))])
        except MemoryError:
            caught += 1
        print(caught, model.correct(x[:5], **signals).size)
        """,
        env=os.environ | {"TRUEANGLE_NUM_THREADS": "1"},
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.split() == ["4", "5"]


# -- processes and signals -------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_while_another_thread_builds_tables_goes_on():
    found = in_child(
        """
        import os, signal, threading, time, warnings
        import numpy as np
        import trueangle as ta
        warnings.simplefilter("ignore")
        orders = list(range(1, 400))
        a = [1e-4] * len(orders)
        theta = np.linspace(0.0, 360.0, 150_000)
        current, stop = [None], []

        def build():
            while not stop:
                shaft = ta.Shaft("output", 1, orders, a, a)
                model = ta.HarmonicModel([shaft], period=360.0)
                current[0] = model
                model.correct(theta, threads=2)

        thread = threading.Thread(target=build)
        thread.start()
        while current[0] is None:
            time.sleep(0.001)
        hanging = 0
        for i in range(15):
            time.sleep(0.003 + 0.002 * i)
            child = os.fork()
            if child == 0:
                # The very model whose table the other thread may be at.
                signal.alarm(40)
                ok = np.isfinite(current[0].correct(theta, threads=2)).all()
                os._exit(0 if ok else 1)
            _, status = os.waitpid(child, 0)
            hanging += status != 0
        stop.append(True)
        thread.join()
        print(hanging)
        """
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.split() == ["0"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    "work",
    [
        "model.error(x, path='direct')",
        "model.error(x, path='direct', threads=1)",
        "fast.correct(x)",
        "backlash.correct(x)",
        "ta._core.fit([(x, x, None)], 360.0, [1.0, 0.1234567], [list(range(1, 60)), [3]])",
        # One large solution, by QR and by the normal equations.
        "ta._core.fit([(few, few, None)], 360.0, [1.0], [list(range(1, 2500))], method='qr')",
        "ta._core.fit([(few, few, None)], 360.0, [1.0], [list(range(1, 2500))], method='moments')",
    ],
)
def test_long_work_ends_with_ctrl_c(work):
    found = in_child(
        f"""
        import os, signal, threading, time
        import numpy as np
        import trueangle as ta
        a = [1e-6] * 2000
        wide = ta.Shaft("output", 1.0, range(1, 2001), a, a)
        model = ta.HarmonicModel([wide], period=360.0)
        fast = ta.HarmonicModel([ta.Shaft("odd", 1.2345, range(1, 2001), a, a)], period=360.0)
        narrow = ta.Shaft("output", 1.0, range(1, 21), a[:20], a[:20])
        terms = [ta.Backlash(0.01), *(ta.LocalDefect(9.0 * i, 2.0, 1e-3) for i in range(40))]
        backlash = ta.HarmonicModel([narrow], period=360.0, terms=terms)
        x = np.linspace(0.0, 360.0, 20_000_000)
        few = np.linspace(0.0, 360.0, 9000, endpoint=False)
        pressed = []

        def press():
            time.sleep(0.5)
            pressed.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=press).start()
        try:
            {work}
        except KeyboardInterrupt:
            print(time.perf_counter() - pressed[0])
        """
    )
    assert found.returncode == 0, found.stderr
    assert 0.0 < float(found.stdout) < SOON


def test_an_update_that_is_called_off_has_added_nothing():
    if sys.platform == "win32" or threading.current_thread() is not threading.main_thread():
        pytest.skip("signals of POSIX, in the main thread")
    moments = ta.Moments(range(1, 17), period=360.0)
    theta = np.linspace(0.0, 360.0, 50_000)
    moments.update(theta, 0.1 * np.cos(np.radians(theta)))
    before = moments.spectrum()
    many = np.tile(theta, 400)

    def called_off(*_):
        raise InterruptedError

    old = signal.signal(signal.SIGALRM, called_off)
    try:
        for delay in (0.01, 0.025, 0.04):
            signal.setitimer(signal.ITIMER_REAL, delay)
            try:
                moments.update(many, many, threads=1)
            except InterruptedError:
                pass
            else:
                pytest.skip("faster than a signal")
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            # All or nothing: a signal may come when all is done.
            after = moments.spectrum()
            if after.samples == before.samples + many.size:
                break
            assert after.samples == before.samples
            np.testing.assert_array_equal(after.weight, before.weight)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, old)


def test_nothing_is_lost_when_threads_share_moments():
    for _ in range(20):
        shared, n = ta.Moments([1, 2], period=360.0), 8
        barrier = threading.Barrier(n)
        theta = np.linspace(0.0, 360.0, 200_000)
        failures: list[BaseException] = []

        def add(run, shared=shared, barrier=barrier, theta=theta, failures=failures):
            barrier.wait()
            try:
                shared.update(theta, np.cos(theta), run=run % 2)
                shared.count, shared.copy(), shared.__getstate__()
                shared.merge(shared.copy()) if run == 0 else shared.solve([1])
            except BaseException as failure:
                failures.append(failure)

        threads = [threading.Thread(target=add, args=(i,)) for i in range(n)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not failures
        # What thread 0 saw and merged came on top: at least its own.
        assert shared.count >= (n + 1) * theta.size
        assert sum(shared.spectrum(run).samples for run in (0, 1)) == shared.count


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_moments_forked_in_the_middle_of_an_update_say_so():
    moments = ta.Moments([1], period=360.0)
    moments._sums._turn._lock.acquire()  # another thread is at it
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        try:
            moments.update([1.0], [0.0])
        except ArgumentError as refusal:
            os._exit(0 if "forked" in str(refusal) else 2)
        os._exit(1)
    _, status = os.waitpid(child, 0)
    moments._sums._turn._lock.release()
    assert status == 0
