"""Sums of a selection against the plain design matrix, and the core's one pass."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.orders import harmonicsums, noise
from trueangle.fitting.orders.chosen import held_out_gains
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings, zero_groups
from trueangle.runs.aliasing import distinct_positions

# Normal equations of a few hundred readings, relative to their size.
ROUNDING = 1e-10


def some_units(seed=0, count=3):
    random = np.random.default_rng(seed)
    units = []
    for number in range(count):
        size = 80 + 10 * number
        turns = random.uniform(-2.0, 3.0, size)
        error = 7.0 + number + 0.3 * np.sin(2 * np.pi * 3 * turns) + random.normal(0, 0.1, size)
        units.append(ZeroGroupReadings(turns, error, random.uniform(0.5, 2.0, size), str(number)))
    return units


def design(unit, orders):
    x = 2 * np.pi * unit.turns[:, None] * np.asarray(orders, dtype=float)
    columns = np.concatenate([np.cos(x), np.sin(x)], axis=1)
    return columns - np.average(columns, axis=0, weights=unit.weights)


@pytest.mark.parametrize("orders", [(1, 2, 3, 200), (1, 2.5, 3, 7.3)])
def test_normal_equations_are_those_of_the_design_matrix(orders):
    units = some_units()
    sums = harmonic_sums(units, orders)
    index = [2, 0, 3]
    for number, unit in enumerate(units):
        columns = design(unit, [orders[i] for i in index])
        centred = unit.error - np.average(unit.error, weights=unit.weights)
        np.testing.assert_allclose(
            sums.gram(number, index), (columns.T * unit.weights) @ columns, atol=ROUNDING * 100
        )
        np.testing.assert_allclose(
            sums.rhs(number, index), columns.T @ (unit.weights * centred), atol=ROUNDING * 100
        )
        assert sums.squares[number] == pytest.approx(np.dot(unit.weights, centred**2))


def test_the_cores_sums_are_the_same(monkeypatch):
    random = np.random.default_rng(1)
    turns = random.uniform(-3.0, 5.0, 20_000)
    unit = ZeroGroupReadings(turns, random.normal(300.0, 40.0, turns.size), np.ones(turns.size), "")
    large = harmonic_sums([unit], range(1, 451))
    monkeypatch.setattr(harmonicsums, "_LARGE", 10**9)
    small = harmonic_sums([unit], range(1, 451))
    for mine, other in zip(large.total(), small.total(), strict=True):
        scale = np.abs(other).max()
        np.testing.assert_allclose(mine, other, atol=ROUNDING * scale)


def test_450_orders_take_one_pass(monkeypatch):
    passes = []
    inner = harmonicsums._spectra
    monkeypatch.setattr(
        harmonicsums, "_spectra", lambda *a: passes.append(a[0].turns.size) or inner(*a)
    )
    random = np.random.default_rng(2)
    runs = []
    for _ in range(3):
        angles = random.uniform(0.0, 360.0, 60_000)
        error = 0.02 * np.cos(np.radians(3 * angles)) + 0.005 * np.sin(np.radians(402 * angles))
        noisy = angles + error + random.normal(0.0, 0.05, angles.size)
        runs.append(ta.CalibrationRun(angles, noisy, period=360.0))
    chosen = ta.select_orders(runs, candidates=range(1, 451))
    assert chosen.orders == (3, 402)
    assert len(passes) == 3
    assert sum(passes) < 9000  # of more readings some tell the orders


def test_held_out_errors_are_those_of_leaving_units_out():
    units = some_units(4)
    orders = (1, 2, 3, 4)
    sums = harmonic_sums(units, orders)

    def left_out(used):
        total = 0.0
        for out, unit in enumerate(units):
            gram = sum(sums.gram(u, used) for u in range(3) if u != out)
            rhs = sum(sums.rhs(u, used) for u in range(3) if u != out)
            columns = design(unit, [orders[i] for i in used])
            centred = unit.error - np.average(unit.error, weights=unit.weights)
            wrong = centred - columns @ np.linalg.solve(gram, rhs)
            total += float(np.dot(unit.weights, wrong**2))
        return total

    without, with_, model = held_out_gains(sums, [2, 1], [1, 2, 3])
    assert model == pytest.approx(left_out([2, 1]))
    assert without == pytest.approx([left_out([2]), left_out([1]), left_out([2, 1])])
    assert with_ == pytest.approx([left_out([2, 1]), left_out([2, 1]), left_out([2, 1, 3])])


@pytest.mark.parametrize("sizes", [[2, 1, 7, 40], [2000, 3000]])
def test_units_have_the_errors_of_their_runs(sizes):
    """Many short runs are taken together, long ones one by one."""
    rng = np.random.default_rng(len(sizes))
    runs = []
    for k, n in enumerate(sizes):
        reference = rng.uniform(-720.0, 720.0, n)
        indicated = reference + 178.0 + 3.0 * rng.standard_normal(n) + 360.0 * (k % 2)
        runs.append(ta.CalibrationRun(reference, indicated, period=360.0))
    units, places = zero_groups(runs, whole=True)
    assert np.array_equal(places, np.arange(sum(sizes)))
    for unit, run in zip(units, runs, strict=True):
        np.testing.assert_allclose(unit.error, run.centred_error, rtol=1e-12, atol=1e-12)


def test_noise_of_repeats_is_that_of_least_squares(monkeypatch):
    """A mean for each position and unit, however the pairs that occur are found."""
    rng = np.random.default_rng(9)
    turns = [rng.integers(0, 12, 60) / 12.0, rng.integers(0, 12, 40) / 12.0, np.array([0.31, 0.31])]
    units = [ZeroGroupReadings(t, rng.standard_normal(t.size), np.ones(t.size), "") for t in turns]
    runs = [ta.CalibrationRun(360.0 * t, 360.0 * t, period=360.0) for t in turns]
    positions = distinct_positions(runs)
    unit = np.repeat(np.arange(3), [t.size for t in turns])
    y = np.concatenate([u.error for u in units])
    design = np.zeros((y.size, len(positions) + 3))
    design[np.arange(y.size), positions.index] = 1.0
    design[np.arange(y.size), len(positions) + unit] = 1.0
    left = y - design @ np.linalg.lstsq(design, y)[0]
    freedom = y.size - np.linalg.matrix_rank(design)
    for room in (noise._ROOM, 0):
        monkeypatch.setattr(noise, "_ROOM", room)
        found = noise.pure_error(units, positions)
        assert found.degrees_of_freedom == freedom
        assert found.variance == pytest.approx(left @ left / freedom, rel=1e-6)


@pytest.mark.parametrize("orders", [[1, 2, 5, 9], [1.0, 2.5, 7.3]])
def test_parts_of_the_normal_matrix_are_parts_of_it(orders):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    units = [
        ZeroGroupReadings(
            rng.uniform(0.0, 1.0, n), rng.normal(size=n), rng.uniform(0.5, 2.0, n), ""
        )
        for n in (50, 700)
    ]
    sums = harmonic_sums(units, orders)
    for unit in range(sums.units):
        whole = sums.gram(unit, range(len(orders)))
        part = sums.gram(unit, [2, 0], [1])
        assert np.array_equal(part, whole[np.ix_(sums.columns([2, 0]), sums.columns([1]))])


@pytest.mark.parametrize("name", ["turns", "error", "weights"])
def test_kept_spectra_are_those_of_the_same_readings_alone(name):
    """The spectra of a unit are kept; one that differs in one reading has its own."""
    (unit,) = some_units(count=1)
    harmonic_sums([unit], [1, 2])
    values = getattr(unit, name).copy()
    values[17] *= 1.25
    other = unit._replace(**{name: values})
    found = harmonic_sums([other], [1, 2])
    harmonicsums._few.cache_clear()
    fresh = harmonic_sums([other], [1, 2])
    for one, two in zip(found.total(), fresh.total(), strict=True):
        np.testing.assert_array_equal(one, two)
    before = harmonicsums._few.cache_info()
    harmonic_sums([other], [1, 2])
    after = harmonicsums._few.cache_info()
    assert (after.hits, after.misses) == (before.hits + 1, before.misses)
