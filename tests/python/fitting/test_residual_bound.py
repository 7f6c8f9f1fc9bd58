"""What no residual exceeds, known when the readings were summed: it must hold, and tell."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.fitting.problem import Problem

#: Readings from which a fit watches for the farthest, and some more.
MANY = (1 << 18) + 12_345

#: Of residuals of a hundredth of a degree of angles of several turns.
ROUNDING = 1e-11

#: A bound this many times the largest residual decides about 8 standard deviations wherever
#: the largest of normal readings is below 6.
TIGHT = 1.25

PERIOD, SIGMA = 360.0, 0.01


def drawn(count=MANY, seed=None, order=False):
    seed = int(np.random.SeedSequence().entropy % 2**32) if seed is None else seed
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    x = rng.uniform(-400.0, 700.0, count)
    if order:
        x.sort()
    error = 3.0 + np.cos(np.radians(x)) - 0.4 * np.sin(np.radians(7.0 * x + 20.0))
    return x, x + error + SIGMA * rng.normal(size=count)


def largest(found, runs, orders, argument):
    """The largest residual by the definition, each run around its own zero."""
    most = 0.0
    for zero, (x, y, weights) in zip(found.offsets, runs, strict=True):
        angle = np.radians(x if argument == "reference" else y)
        fitted = sum(
            a * np.cos(k * angle) + b * np.sin(k * angle)
            for k, a, b in zip(orders, found.cosine[0], found.sine[0], strict=True)
        )
        rest = (y - x - zero - fitted + 180.0) % 360.0 - 180.0
        most = max(most, np.abs(rest[slice(None) if weights is None else weights > 0.0]).max())
    return most


def check(runs, orders, tight=TIGHT, **options):
    argument = options.get("argument", "reference")
    found = _core.fit(runs, PERIOD, [1.0], [orders], watch=True, **options)
    most = largest(found, runs, orders, argument)
    assert most - ROUNDING <= found.residual_bound <= tight * most
    return found


@pytest.mark.parametrize("order", [False, True])
@pytest.mark.parametrize("options", [{}, {"method": "qr"}, {"argument": "indicated"}])
def test_the_bound_holds_and_is_tight(order, options):
    check([(*drawn(order=order), None)], list(range(1, 18)), **options)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_far_reading_is_never_missed(threads):
    """The first, the last, and such as wait for others of their segment until the end."""
    for at in (0, MANY // 2, MANY - 100, MANY - 1):
        x, y = drawn(seed=at)
        y[at] -= 40.0 * SIGMA
        found = check([(x, y, None)], [1, 7], threads=threads)
        assert found.residual_bound > 30.0 * SIGMA


def test_readings_of_no_weight_are_not_watched():
    x, y = drawn()
    weights = np.random.default_rng(1).uniform(0.5, 2.0, x.size)
    weights[::7] = 0.0
    y[::7] += 30.0
    check([(x, y, weights)], [1, 7])
    y[8] += 1.0
    found = check([(x, y, weights)], [1, 7])
    assert found.residual_bound > 0.9


def test_every_run_is_watched_around_its_own_zero():
    first, second = drawn(200_000), drawn(150_000)
    second = (second[0], second[1] + 170.0)
    orders = [1, 7]
    check([(*first, None), (*second, None)], orders)
    second[1][77] += 2.0
    found = check([(*first, None), (*second, None)], orders)
    assert found.residual_bound > 1.9


def test_an_order_that_the_model_lacks_is_in_the_bound():
    check([(*drawn(), None)], [1])


def test_a_bound_by_a_first_fit_of_a_grid():
    """Even strides would meet the same places of a grid of 256 positions."""
    x = np.tile(np.arange(256) * (PERIOD / 256), MANY // 256)
    rest = SIGMA * np.random.default_rng(3).normal(size=x.size)
    check([(x, x + np.cos(np.radians(x)) + rest, None)], [1, 2, 3])


def test_exact_readings_have_a_bound_of_rounding():
    x, _ = drawn()
    run = (x, x + np.cos(np.radians(x)), None)
    found = _core.fit([run], PERIOD, [1.0], [[1, 2]], watch=True)
    assert found.residual_bound < ROUNDING


def test_where_nothing_was_watched_the_bound_is_infinite():
    x, y = drawn()
    turn = 4096.0
    counts = np.rint(x / PERIOD * turn)

    def fit(run, orders, period=PERIOD, watch=True):
        return _core.fit([(*run, None)], period, [1.0], [orders], watch=watch)

    assert fit((x, y), [1]).residual_bound < math.inf
    assert fit((x, y), [1], watch=False).residual_bound == math.inf
    assert fit((x[:10_000], y[:10_000]), [1]).residual_bound == math.inf
    found = fit((counts, counts + 0.3 * (y - x)), [1], turn)
    assert found.method == "counts"
    assert found.residual_bound == math.inf
    assert fit((x, y), [1, 400]).residual_bound == math.inf


def test_a_sample_is_that_of_the_scan():
    x, y = drawn()
    series = _core.Series(PERIOD, 3.0, [1.0], [[1]], [[1.0]], [[0.0]])
    weights = np.where(np.arange(x.size) % 3 == 0, 0.0, 1.5)
    for given in (None, weights):
        for stride in (1, 2, 61):
            run = (x, y, given)
            wanted, _ = _core.scan_residuals(series, run, "reference", 0.1, stride)
            for threads in (1, 2):
                found = _core.sample_residuals(series, run, "reference", 0.1, stride, threads)
                np.testing.assert_allclose(found, wanted, rtol=0.0, atol=ROUNDING)


# -- what the fit makes of it ----------------------------------------------------------


def test_clean_readings_are_not_read_again(monkeypatch):
    def again(self, fitted):
        raise AssertionError("the bound decides")

    monkeypatch.setattr(Problem, "largest", again)
    x, y = drawn()
    result = ta.fit(ta.CalibrationRun(x, y, period=PERIOD), orders=range(1, 18))
    assert result.wild == ()
    assert result.residual_std == pytest.approx(SIGMA, rel=0.01)


@pytest.mark.parametrize("at", [0, MANY - 1])
def test_a_wild_reading_among_many_is_set_aside(at):
    x, y = drawn()
    y[at] += 12.0 * SIGMA
    result = ta.fit(ta.CalibrationRun(x, y, period=PERIOD, label="r"), orders=[1, 7])
    assert result.wild == (("r", at),)


def test_what_the_bound_cannot_decide_is_looked_at(monkeypatch):
    """A reading of 7 standard deviations: of 150 orders the two fits may differ by another."""
    looks = []
    look = Problem.largest
    monkeypatch.setattr(Problem, "largest", lambda *args: looks.append(look(*args)) or looks[-1])
    x, y = drawn(seed=5)
    run, orders = ta.CalibrationRun(x, y, period=PERIOD), range(1, 151)
    rest = ta.fit(run, orders=orders, loss="linear").residuals
    y[3] += 7.0 * SIGMA - rest[3]
    result = ta.fit(ta.CalibrationRun(x, y, period=PERIOD), orders=orders)
    assert result.wild == ()
    assert looks == [pytest.approx(7.0 * SIGMA, rel=0.02)]
