"""The core at its edges: last readings, half turns, what is not a number, what has not moved."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.errors import ArgumentError, NotInvertibleError
from trueangle.support.blas import blas_threads, one_blas_thread

#: Of angles of a few turns.
ROUNDING = 1e-9


def series(amplitude=0.1):
    return _core.Series(360.0, 0.0, [1.0], [[1]], [[amplitude]], [[0.0]])


# -- residuals that are looked at and not kept -----------------------------------------


@pytest.mark.parametrize("size", [1, 7, 8, 9, 2047, 2048, 2049, 5000])
def test_the_largest_residual_is_found_wherever_it_is(size):
    x = np.linspace(0.0, 300.0, size)
    y = x + series().error(x) + 1e-3 * np.sin(np.arange(size))
    for at in {0, size // 2, *range(max(0, size - 9), size)}:
        wild = y.copy()
        wild[at] -= 5.0
        _, largest = _core.scan_residuals(series(), (x, wild, None), "reference", 0.0, 1, 1)
        assert largest == pytest.approx(abs(wild[at] - x[at] - series().error(x[at])), abs=ROUNDING)
        weights = np.ones(size)
        weights[at] = 0.0
        sample, largest = _core.scan_residuals(series(), (x, wild, weights), "reference", 0.0, 1, 1)
        assert largest < 0.01
        assert len(sample) == size - 1


@pytest.mark.parametrize("stride", [1, 3, 7, 1000, 3000])
def test_the_sample_is_every_so_many_residuals(stride):
    x = np.linspace(0.0, 3000.0, 10_001)
    rest = 0.01 * np.random.default_rng(1).normal(size=x.size)
    y = x + series().error(x) + rest
    sample, _ = _core.scan_residuals(series(), (x, y, None), "reference", 0.0, stride, 1)
    np.testing.assert_allclose(sample, rest[::stride], atol=ROUNDING)


def test_residuals_lie_within_half_a_turn():
    x = np.linspace(0.0, 300.0, 50)
    y = x + series().error(x) + 0.5 + 360.0 * np.arange(-25, 25)
    sample, largest = _core.scan_residuals(series(), (x, y, None), "reference", 0.0, 1, 1)
    np.testing.assert_allclose(sample, 0.5, atol=1e-8)
    assert largest == pytest.approx(0.5, abs=1e-8)


# -- sums that merge -------------------------------------------------------------------


def test_sums_merge_across_half_a_turn():
    """Errors near 180 deg, of which each part has its own centre on another side."""
    rng = np.random.default_rng(2)
    theta = rng.uniform(0.0, 360.0, 4000)
    error = 179.9 + 0.4 * np.sin(np.radians(theta)) + 0.01 * rng.normal(size=theta.size)
    wrapped = (error + 180.0) % 360.0 - 180.0
    low, high = wrapped < 0.0, wrapped >= 0.0
    parts = []
    for rows in (high, low):
        parts.append(ta.Moments([1, 2], period=360.0).update(theta[rows], wrapped[rows]))
    whole = ta.Moments([1, 2], period=360.0).update(theta, error).solve()
    for merged in (parts[0] + parts[1], parts[1] + parts[0]):
        found = merged.solve()
        assert found.cosine == pytest.approx(whole.cosine, abs=ROUNDING)
        assert found.sine == pytest.approx(whole.sine, abs=ROUNDING)
        assert found.residual_variance == pytest.approx(whole.residual_variance, rel=1e-6)
        assert (found.constant - 179.9 + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    "other",
    [
        {"period": 2.0 * np.pi},
        {"gear_ratio": 50.0, "orders": {"output": [1, 2], "motor": [1]}},
        {"orders": {"table": [1, 2]}, "shafts": {"table": 1.0}},
        {"orders": {"output": [1, 2]}, "shafts": {"output": 2.0}},
    ],
)
def test_sums_of_another_turn_or_shaft_do_not_merge(other):
    made = ta.Moments([1, 2], period=360.0).update([1.0, 2.0], [0.0, 0.1])
    more = {"orders": [1, 2], "period": 360.0} | other
    different = ta.Moments(more.pop("orders"), **more).update([1.0, 2.0], [0.0, 0.1])
    for merge in (made.merge, made.__iadd__, made.__add__):
        with pytest.raises(ArgumentError, match="merge only if"):
            merge(different)
    assert made.count == 2


# -- what is not a number -----------------------------------------------------------------


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["reference", "indicated"])
@pytest.mark.parametrize("method", [None, "counts", "moments", "plain"])
def test_a_reading_that_is_no_number_is_named_on_every_path(method, where, wrong):
    rng = np.random.default_rng(3)
    reference = rng.integers(0, 512, 20_000).astype(float)
    indicated = reference + rng.normal(0.0, 0.3, reference.size)
    values = {"reference": reference, "indicated": indicated}
    values[where][12_345] = wrong
    with pytest.raises(ArgumentError, match=rf"{where}\[12345\]"):
        _core.fit([(reference, indicated, None)], 512.0, [1.0], [[1, 2]], method=method)


def play(**more):
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.05])
    return ta.HarmonicModel([shaft], period=360.0, terms=[ta.Backlash(0.5)], **more)


def test_a_direction_that_is_no_number_gives_none():
    theta = np.array([10.0, 20.0, 30.0])
    for compute in (play().error, play().correct):
        found = compute(theta, direction=np.array([1.0, np.nan, 1.0]))
        assert np.isfinite(found[[0, 2]]).all()
        assert np.isnan(found[1])


# -- what has not moved ----------------------------------------------------------------


def test_standing_still_keeps_the_direction():
    theta = np.array([10.0, 20.0, 20.0, 20.0])
    found = play().error(theta, direction=np.array([0.0, -1.0, 0.0, 0.0]))
    pattern = 0.05 * np.sin(np.radians(theta))
    np.testing.assert_allclose(found - pattern, [0.0, -0.5, -0.5, -0.5], atol=ROUNDING)
    moved = play().error(np.array([20.0, 10.0, 10.0, 10.0]))
    np.testing.assert_allclose(moved[1:] - 0.05 * np.sin(np.radians(10.0)), -0.5, atol=ROUNDING)


def spring():
    return ta.HarmonicModel([], period=360.0, terms=[ta.PreslidingHysteresis(0.4, 10.0)])


def wound(way, direction, start):
    """Closed form of one element: relaxes towards the direction over its length."""
    return direction - (direction - start) * np.exp(-way / 10.0)


def test_a_spring_unwinds_by_the_way_back_alone():
    """Out by 30, back by 5, on by 12: by the exponential of each way."""
    x = np.array([0.0, 30.0, 25.0, 37.0])
    direction = np.array([1.0, 1.0, -1.0, 1.0])
    found = spring().error(x, direction=direction)
    out = wound(30.0, 1.0, found[0] / 0.4)
    back = wound(5.0, -1.0, out)
    on = wound(12.0, 1.0, back)
    np.testing.assert_allclose(found[1:], 0.4 * np.array([out, back, on]), atol=ROUNDING)


def test_noise_against_the_direction_is_no_travel():
    """A step back without a reversal is noise of the reading: the spring stays wound."""
    x = np.array([0.0, 30.0, 29.0, 30.0, 31.0])
    found = spring().error(x, direction=1.0)
    plain = spring().error(x[[0, 1, 4]], direction=1.0)
    np.testing.assert_allclose(found[2:4], found[1], atol=ROUNDING)
    np.testing.assert_allclose(found[4], plain[2], atol=ROUNDING)


def test_a_reversal_between_two_readings_belongs_to_the_old_direction():
    """The direction turns while the angle still goes on: the way on winds the spring further."""
    x = np.array([0.0, 30.0, 33.0])
    found = spring().error(x, direction=np.array([1.0, 1.0, -1.0]))
    on = wound(33.0, 1.0, found[0] / 0.4)
    np.testing.assert_allclose(found[2], 0.4 * on, atol=ROUNDING)


# -- what cannot be inverted -----------------------------------------------------------


def test_harmonics_and_terms_are_steep_together():
    """Neither alone folds back: 0.6 of the pattern and 0.5 of the friction do."""
    amplitude = 0.6 * 360.0 / (2.0 * np.pi)
    shaft = ta.Shaft("output", 1, [1], [amplitude], [0.0])
    friction = ta.PreslidingHysteresis(0.5, 2.0)
    ta.HarmonicModel([shaft], period=360.0)
    ta.HarmonicModel([], period=360.0, terms=[friction])
    with pytest.raises(NotInvertibleError) as caught:
        ta.HarmonicModel([shaft], period=360.0, terms=[friction]).correct(1.0)
    assert caught.value.slope == pytest.approx(1.1, rel=0.01)
    ta.HarmonicModel([shaft], period=360.0, argument="indicated", terms=[friction]).correct(1.0)


# -- uncertainty -----------------------------------------------------------------------


def test_the_error_of_a_zero_is_that_of_the_whole_design():
    """Over an arc the zero and the harmonics share what is known: by numpy's inverse."""
    rng = np.random.default_rng(4)
    x = np.sort(rng.uniform(0.0, 120.0, 400))
    y = x + 0.2 * np.sin(np.radians(x)) + 0.01 * rng.normal(size=x.size)
    found = _core.fit([(x, y, None)], 360.0, [1.0], [[1, 2]])
    angle = np.radians(np.outer(x, [1, 2]))
    design = np.hstack([np.ones((400, 1)), np.cos(angle), np.sin(angle)])
    left = np.linalg.lstsq(design, y - x, rcond=None)[1][0]
    variance = left / (400 - 5)
    spread = np.sqrt(variance * np.linalg.inv(design.T @ design)[0, 0])
    assert found.degrees_of_freedom == 395
    assert found.residual_variance == pytest.approx(variance, rel=1e-6)
    assert found.offset_std[0] == pytest.approx(spread, rel=1e-6)
    assert spread > 3.0 * np.sqrt(variance / 400)


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
