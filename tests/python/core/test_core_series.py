"""Arguments of `_core.Series`: every kind of number and array, `out=`, threads, errors."""

from __future__ import annotations

import math
import multiprocessing
import threading

import numpy as np
import pytest

from trueangle._core import Compensator, Series
from trueangle.errors import ArgumentError, NotInvertibleError

#: Default and exact paths, relative to the sum of amplitudes.
ACCURACY = 3e-15

PERIOD = 360.0
ORDERS = [1, 2, 5, 17]
COSINE = [0.03, -0.02, 0.004, 0.001]
SINE = [-0.01, 0.05, 0.002, -0.003]
CONSTANT = 0.25


@pytest.fixture(scope="module")
def series() -> Series:
    return make()


def make(argument: str = "reference", period: float = PERIOD) -> Series:
    return Series(period, CONSTANT, [1.0], [ORDERS], [COSINE], [SINE], argument)


def reference(theta, period=PERIOD):
    turn = np.asarray(theta, dtype=np.float64) * (2 * np.pi / period)
    value = np.full_like(turn, CONSTANT)
    for k, a, b in zip(ORDERS, COSINE, SINE, strict=True):
        value += a * np.cos(k * turn) + b * np.sin(k * turn)
    return value


def tolerance(series: Series) -> float:
    # numpy rounds k * x (up to 17 turns here): its own error on top of ours.
    return (ACCURACY + 17 * 2 * math.pi * np.finfo(float).eps) * series.amplitude_sum + np.spacing(
        CONSTANT
    )


def test_float_gives_float(series):
    for value in (12.5, 12, np.float64(12.5), -3):
        result = series.error(value)
        assert type(result) is float
        assert result == pytest.approx(float(reference(value)), abs=tolerance(series))


def test_arrays_without_dimensions_give_scalars_as_in_numpy(series):
    result = series.error(np.array(12.5))
    assert isinstance(result, np.float64)
    assert result == series.error(12.5)
    assert isinstance(series.error(np.float32(12.5)), np.float32)
    out = np.empty(())
    assert series.error(np.array(12.5), out=out) is out
    assert out == series.error(12.5)


LAYOUTS = {
    "contiguous": lambda x: x,
    "list": lambda x: x.tolist(),
    "nested": lambda x: x.reshape(6, 10),
    "fortran": lambda x: np.asfortranarray(x.reshape(6, 10)),
    "strided": lambda x: np.repeat(x, 3)[::3],
    "reversed": lambda x: x[::-1],
    "transposed": lambda x: x.reshape(3, 4, 5).transpose(1, 2, 0),
    "broadcast": lambda x: np.broadcast_to(x, (2, x.size)),
    "big_endian": lambda x: x.astype(">f8"),
    "misaligned": lambda x: misaligned(x),
    "subclass": lambda x: x.view(np.recarray),
}


def misaligned(x):
    memory = np.zeros(x.nbytes + 1, dtype=np.uint8)
    view = memory[1:].view(np.float64)
    view[...] = x
    assert not view.flags.aligned
    return view


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("writeable", [True, False])
def test_every_layout_gives_the_same_values(series, layout, writeable):
    theta = np.linspace(-400.0, 800.0, 60)
    given = LAYOUTS[layout](theta)
    if isinstance(given, np.ndarray) and given.flags.owndata:
        given.flags.writeable = writeable
    result = series.error(given)
    assert isinstance(result, np.ndarray)
    assert result.dtype == np.dtype("float64")
    assert result.shape == np.shape(given)
    values = np.asarray(given, dtype=np.float64)
    one_by_one = np.array([series.error(float(v)) for v in values.ravel()]).reshape(values.shape)
    np.testing.assert_array_equal(result, one_by_one)
    np.testing.assert_allclose(result, reference(values), rtol=0, atol=tolerance(series))


@pytest.mark.parametrize("layout", ["contiguous", "strided", "fortran", "misaligned", "transposed"])
@pytest.mark.parametrize("out_layout", ["C", "F", "strided", "misaligned"])
def test_out_of_every_layout(series, layout, out_layout):
    given = LAYOUTS[layout](np.linspace(-400.0, 800.0, 60))
    if out_layout == "strided":
        out = np.full((*given.shape, 2), np.nan)[..., 0]
    elif out_layout == "misaligned":
        out = misaligned(np.full(60, np.nan)).reshape(given.shape)
    else:
        out = np.full(given.shape, np.nan, order=out_layout)
    assert series.error(given, out=out) is out
    np.testing.assert_array_equal(out, series.error(given))


@pytest.mark.parametrize("shape", [(0,), (0, 3), (3, 0, 2)])
def test_no_samples(series, shape):
    assert series.error(np.empty(shape)).shape == shape
    assert series.error(np.empty(shape, dtype=np.uint16)).shape == shape
    assert series.error(np.empty(shape), out=np.empty(shape)).shape == shape


def test_float32_stays_float32_within_its_bound(series):
    theta = np.linspace(-400.0, 800.0, 1001, dtype=np.float32)
    result = series.error(theta)
    assert result.dtype == np.float32
    exact = series.error(theta.astype(float))
    np.testing.assert_allclose(result, exact, rtol=0, atol=series.float32_bound)
    # A unit in the last place of the greatest value, and little more.
    assert series.float32_bound <= 2.5 * np.finfo(np.float32).eps * (
        series.amplitude_sum + abs(CONSTANT)
    )
    in_place = theta.copy()
    assert series.correct(in_place, out=in_place) is in_place
    # The inverse is as accurate as the series here, and the difference is rounded once.
    atol = 2 * series.float32_bound + 0.5 * np.spacing(np.float32(800.0))
    np.testing.assert_allclose(in_place, series.correct(theta.astype(float)), rtol=0, atol=atol)


def test_float32_by_the_table_of_doubles_is_rounded_once(series):
    theta = np.linspace(-400.0, 800.0, 1001, dtype=np.float32)
    for method in (series.error, series.correct):
        expected = method(theta.astype(float)).astype(np.float32)
        np.testing.assert_array_equal(method(theta, path="table"), expected)


def test_float32_path_is_told_and_forced(series):
    assert series.float32_path.startswith("cubics-")
    theta = np.linspace(0.0, 360.0, 101, dtype=np.float32)
    forced = series.error(theta, path=series.float32_path)
    np.testing.assert_array_equal(forced, series.error(theta))
    with pytest.raises(ArgumentError, match="float32"):
        series.error(theta.astype(float), path="cubics")
    # Shafts without a common turn have no table.
    free = Series(PERIOD, 0.0, [1.5], [[1]], [[1.0]], [[0.0]])
    assert free.float32_path.startswith("exact-")
    exact = free.error(theta.astype(float))
    np.testing.assert_allclose(free.error(theta), exact, rtol=0, atol=free.float32_bound)


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", ">i2", "f2"])
def test_other_numbers(dtype):
    counts = make(period=64.0)
    theta = np.arange(120).astype(dtype)
    result = counts.error(theta)
    assert result.dtype == (np.float32 if dtype == "f2" else np.float64)
    np.testing.assert_allclose(
        result, reference(theta, 64.0), rtol=1e-6 if dtype == "f2" else 0, atol=tolerance(counts)
    )


@pytest.mark.parametrize(
    "wrong",
    [
        True,
        "text",
        None,
        1j,
        pytest.param(object(), id="object"),
        [[1.0], [1.0, 2.0]],
        np.array([True]),
        np.array(["1"]),
        np.array([1j]),
        np.array(["2020"], "datetime64[s]"),
        np.ma.array([1.0, 2.0], mask=[0, 1]),
    ],
    ids=repr,
)
def test_angles_that_are_no_numbers(series, wrong):
    with pytest.raises(ArgumentError):
        series.error(wrong)


@pytest.mark.parametrize("method", ["error", "correct"])
@pytest.mark.parametrize("n", [1, 37, 1000, 250_000])
def test_in_place_equals_out_equals_new(series, method, n):
    theta = np.linspace(-1e3, 1e3, n)
    compute = getattr(series, method)
    fresh = compute(theta)
    out = np.empty_like(theta)
    compute(theta, out=out)
    in_place = theta.copy()
    assert compute(in_place, out=in_place) is in_place
    np.testing.assert_array_equal(out, fresh)
    np.testing.assert_array_equal(in_place, fresh)


def test_out_must_fit(series):
    theta = np.zeros(4)
    read_only = np.zeros(4)
    read_only.flags.writeable = False
    for out, word in [
        (np.zeros(3), "shape"),
        (np.zeros((4, 1)), "shape"),
        (np.zeros(4, np.float32), "float32"),
        (np.zeros(4, int), "int64"),
        (np.zeros(4, complex), "complex128"),
        ([0.0] * 4, "list"),
        (read_only, "read-only"),
    ]:
        with pytest.raises(ArgumentError, match=word):
            series.error(theta, out=out)
    with pytest.raises(ArgumentError, match="float64 for angles of dtype uint16"):
        series.error(np.zeros(4, np.uint16), out=np.zeros(4, np.float32))


def test_partial_overlap_is_refused(series):
    memory = np.linspace(0.0, 1.0, 20)
    before = memory.copy()
    for x, out in [
        (memory[:10], memory[1:11]),
        (memory[1:11], memory[:10]),
        (memory[:10], memory[:10][::-1]),
        (memory[::2], memory[:10]),
        (memory[:8].view(np.uint64), memory[1:9]),
    ]:
        with pytest.raises(ArgumentError, match="overlaps"):
            series.error(x, out=out)
    np.testing.assert_array_equal(memory, before)
    # Interleaved memory is not shared memory.
    expected = series.error(before[::2])
    np.testing.assert_array_equal(series.error(memory[::2], out=memory[1::2]), expected)
    np.testing.assert_array_equal(memory[1::2], expected)
    np.testing.assert_array_equal(memory[::2], before[::2])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("method", ["error", "slope", "correct"])
def test_what_is_not_finite_gives_nan(series, method, dtype):
    theta = np.zeros(100, dtype)
    bad = [0, 17, 63, 99]
    theta[bad] = [np.nan, np.inf, -np.inf, np.nan]
    result = getattr(series, method)(theta)
    assert np.flatnonzero(np.isnan(result)).tolist() == bad
    assert math.isnan(getattr(series, method)(math.inf))


def test_correct_undoes_the_error():
    for argument in ("reference", "indicated"):
        series = make(argument)
        theta = np.linspace(-720.0, 720.0, 3001)
        if argument == "reference":
            np.testing.assert_allclose(
                series.correct(theta + series.error(theta)), theta, rtol=0, atol=3e-13
            )
        else:
            np.testing.assert_array_equal(series.correct(theta), theta - series.error(theta))


def test_slope_is_the_derivative(series):
    theta = np.linspace(0.0, 360.0, 101)
    step = 1e-4
    difference = (series.error(theta + step) - series.error(theta - step)) / (2 * step)
    np.testing.assert_allclose(series.slope(theta), difference, rtol=0, atol=1e-9)
    assert abs(series.slope(theta)).max() <= series.slope_bound


def test_what_cannot_be_inverted():
    steep = Series(2 * math.pi, 0.0, [1.0], [[1]], [[0.0]], [[1.5]])
    assert steep.error(0.5) == pytest.approx(1.5 * math.sin(0.5), abs=1.5 * ACCURACY)
    for correct in (lambda: steep.correct(0.5), lambda: steep.correct(np.zeros(3))):
        with pytest.raises(NotInvertibleError) as caught:
            correct()
        assert caught.value.slope == steep.slope_bound >= 1
    with pytest.raises(NotInvertibleError):
        Compensator(steep)
    Compensator(Series(2 * math.pi, 0.0, [1.0], [[1]], [[0.0]], [[1.5]], "indicated"))


def test_compensator_equals_correct(series):
    step = Compensator(series).step
    for value in np.linspace(-1e4, 1e4, 501):
        assert step(value) == series.correct(value)
    assert type(step(1)) is float
    assert math.isnan(step(math.nan))
    with pytest.raises(TypeError):
        step("1")


@pytest.mark.parametrize("threads", [1, 2, 3, 64])
@pytest.mark.parametrize("n", [99_999, 100_000, 1_234_567])
def test_threads_do_not_change_results(series, threads, n):
    theta = np.linspace(-1e5, 1e5, n)
    np.testing.assert_array_equal(
        series.error(theta, threads=threads), series.error(theta, threads=1)
    )


def test_paths(series):
    theta = np.linspace(-720.0, 720.0, 1001)
    direct = series.error(theta, path="direct")
    assert series.path.startswith("table-")
    for path in ("table", "exact", "table-portable", "exact-portable", series.path):
        error = abs(series.error(theta, path=path) - direct).max()
        assert error <= ACCURACY * series.amplitude_sum + np.spacing(CONSTANT)
    for path in ("fast", "table-mmx", "table-", ""):
        with pytest.raises(ArgumentError, match="'table', 'cubics', 'exact', 'direct' or"):
            series.error(np.zeros(3), path=path)
    with pytest.raises(ArgumentError, match="slopes are not tabulated"):
        series.slope(theta, path="table")


@pytest.mark.parametrize("dtype", ["i2", "u2", "i4", "i8", "u8"])
@pytest.mark.parametrize("method", ["error", "correct"])
def test_counts(dtype, method):
    series = make(period=4096.0)
    assert series.counts_path == "counts"
    limits = np.iinfo(dtype)
    theta = np.random.default_rng(7).integers(
        max(limits.min, -(10**6)), min(limits.max, 10**6), 20_000, dtype=dtype
    )
    compute = getattr(series, method)
    np.testing.assert_array_equal(compute(theta), compute(theta.astype(float)))
    np.testing.assert_array_equal(compute(theta, path="counts"), compute(theta, path="table"))
    for period in (4096.5, 2.0**21):
        with pytest.raises(ArgumentError, match="whole number of counts"):
            make(period=period).error(theta, path="counts")
    with pytest.raises(ArgumentError, match="must be integers"):
        series.error(theta.astype(float), path="counts")


def test_tolerance_is_selectable_and_stated():
    arguments = (PERIOD, 0.0, [1.0], [ORDERS], [COSINE], [SINE], "indicated")
    theta = np.linspace(-720.0, 720.0, 100_001)
    segments = []
    for tolerance in (2e-15, 3e-15, 1e-12, 1e-6):
        series = Series(*arguments, tolerance)
        assert series.error_bound <= tolerance * series.amplitude_sum
        error = abs(series.error(theta) - series.error(theta, path="direct")).max()
        assert error <= series.error_bound
        segments.append(series.segments)
    assert segments == sorted(segments, reverse=True)
    assert segments[-1] < segments[0]
    for tolerance in (0.0, 1e-15, 0.1, math.nan):
        with pytest.raises(ArgumentError, match="tolerance must be"):
            Series(*arguments, tolerance)


def test_without_a_period_in_common():
    series = Series(
        PERIOD,
        CONSTANT,
        [1.0, 100.5],
        [ORDERS, [1, 2]],
        [COSINE, [1e-4, 2e-4]],
        [SINE, [0.0, -1e-4]],
    )
    assert series.path.startswith("exact-")
    theta = np.linspace(-7200.0, 7200.0, 10_001)
    tolerance = ACCURACY * series.amplitude_sum + np.spacing(CONSTANT)
    direct = series.error(theta, path="direct")
    np.testing.assert_allclose(series.error(theta), direct, rtol=0, atol=tolerance)
    np.testing.assert_allclose(
        series.correct(theta + direct), theta, rtol=0, atol=4 * np.spacing(7200.0)
    )
    with pytest.raises(ArgumentError, match="does not repeat after one turn"):
        series.error(theta, path="table")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, 0.0, [1.0], [[1]], [[1.0]], [[1.0]]), "period"),
        ((1.0, math.nan, [1.0], [[1]], [[1.0]], [[1.0]]), "constant"),
        ((1.0, 0.0, [-1.0], [[1]], [[1.0]], [[1.0]]), "cycles_per_turn"),
        ((1.0, 0.0, [1.0], [[2, 1]], [[1.0, 0.0]], [[1.0, 0.0]]), "orders"),
        ((1.0, 0.0, [1.0], [[1]], [[1.0, 0.0]], [[1.0]]), "cosine"),
        ((1.0, 0.0, [1.0], [[1]], [[1.0]], [[math.inf]]), "sine"),
        ((1.0, 0.0, [1.0], [], [[1.0]], [[1.0]]), "orders has 0 lists"),
        ((1.0, 0.0, [1.0], [[1]], [[0.0]], [[0.0]], "true"), "argument"),
    ],
)
def test_bad_series(arguments, word):
    with pytest.raises(ArgumentError, match=word):
        Series(*arguments)


def test_a_series_without_harmonics():
    series = Series(360.0, 1.5, [], [], [], [])
    np.testing.assert_array_equal(series.error(np.arange(5.0)), np.full(5, 1.5))
    np.testing.assert_array_equal(series.correct(np.arange(5.0)), np.arange(5.0) - 1.5)


def test_the_interpreter_is_released_for_batches(series):
    theta = np.linspace(0.0, 360.0, 2_000_000)
    started, ticks, done = threading.Event(), [], threading.Event()

    def tick():
        started.set()
        while not done.is_set():
            ticks.append(None)

    ticker = threading.Thread(target=tick)
    ticker.start()
    started.wait()
    before = len(ticks)
    series.error(theta, path="direct", threads=1)
    during = len(ticks) - before
    done.set()
    ticker.join()
    # Were the interpreter held, the ticker could not have run between the two reads
    # but for the moments around the call.
    assert during > 10


def _child(series_arguments, connection):
    series = Series(*series_arguments)
    theta = np.linspace(0.0, 360.0, 300_000)
    connection.send(float(series.error(theta, threads=2).sum()))
    connection.close()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_threads_after_fork(series):
    theta = np.linspace(0.0, 360.0, 300_000)
    expected = float(series.error(theta, threads=2).sum())
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    arguments = (PERIOD, CONSTANT, [1.0], [ORDERS], [COSINE], [SINE])
    process = context.Process(target=_child, args=(arguments, sender))
    process.start()
    try:
        assert receiver.poll(60), "the forked child hangs"
        assert receiver.recv() == expected
    finally:
        process.kill()
        process.join()
