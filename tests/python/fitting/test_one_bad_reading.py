"""One reading wrong by anything: the model is that of the others, and every door names the row."""

import numpy as np
import pytest

import trueangle as ta

GRID = np.linspace(0.0, 2.0 * np.pi, 500, endpoint=False)
SIZES = (0.5, 2.0, 44.0, 91.0, 178.0, 183.0, -60.0, 1e5, 1e12, 7e299)


def joint(seed, least):
    """Readings of one joint in turns of one to twenty runs, and which of them is to be wrong."""
    rng = np.random.default_rng(seed)
    runs, size = int(rng.choice([1, 2, 3, 5, 8, 20])), int(rng.integers(least, 200))
    orders = rng.choice(np.arange(1, 7), 2, replace=False)
    amplitudes = 0.06 * rng.uniform(0.3, 1.0, 2)
    phases = rng.uniform(0.0, 2.0 * np.pi, 2)
    tables = []
    for _ in range(runs):
        x = np.sort(rng.uniform(0.0, 2.0 * np.pi, size))
        waves = amplitudes * np.cos(np.outer(x, orders) - phases)
        tables.append((x, x + np.radians(waves.sum(axis=1) + 0.002 * rng.standard_normal(size))))
    return tables, int(rng.integers(runs)), int(rng.integers(size))


def runs_of(tables, run, row, off):
    """The runs with one reading off by so many degrees, or without it."""
    found = []
    for k, (x, y) in enumerate(tables):
        if k == run and off is None:
            x, y = np.delete(x, row), np.delete(y, row)
        elif k == run:
            y = y.copy()
            y[row] += np.radians(off)
        found.append(ta.CalibrationRun(x, y, label=f"r{k}"))
    return found


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(8))
def test_the_model_is_that_of_the_other_readings(seed):
    tables, run, row = joint(1000 + seed, 12)
    expected = ta.fit(runs_of(tables, run, row, None)).model.error(GRID)
    for off in SIZES:
        fit = ta.fit(runs_of(tables, run, row, off))
        left = fit.model.error(GRID) - expected
        assert left.std() <= 0.1 * expected.std(), (off, run, row)
        assert (f"r{run}", row) in [(label, index) for label, index in fit.wild], off
        assert len(fit.wild) > 3 or f"reading {row + 1} of run r{run}" in fit.model.fit.note


@pytest.mark.parametrize("seed", range(8))
def test_check_names_the_row_and_nothing_else(seed):
    tables, run, row = joint(2000 + seed, 50)
    for off in SIZES:
        faults = ta.check(runs_of(tables, run, row, off)).data_faults
        found = [(f.fault, f.runs, f.rows) for f in faults]
        assert found == [("outliers", (f"r{run}",), (row + 1,))], off
        assert not faults[0].unusable
    assert ta.check(runs_of(tables, run, row, None)).data_faults == ()


@pytest.mark.parametrize("size", [1, 2, 3, 6, 7, 11])
def test_check_names_no_row_of_a_run_too_short_to_tell(size):
    x = np.linspace(0.5, 5.0, size)
    y = x + np.where(np.arange(size) == size // 2, 0.3, 0.0)
    assert [f for f in ta.check(ta.CalibrationRun(x, y)).data_faults if f.fault == "outliers"] == []


@pytest.mark.parametrize("kind", ["same", "opposite", "frozen"])
@pytest.mark.parametrize("several", [2, 3, 5])
@pytest.mark.parametrize("places", [np.tile(np.arange(36.0), 5), np.arange(0.0, 54.0, 0.1)])
def test_several_side_by_side_are_told_as_one_is(places, several, kind):
    x = 10.0 * places
    y = x + 0.02 * np.sin(np.radians(x)) + 5e-4 * np.random.default_rng(1).standard_normal(x.size)
    expected = ta.fit(ta.CalibrationRun(x, y, 360.0, label="r")).model.shafts[0].orders
    rows = np.arange(70, 70 + several * (1 + 6 * (kind == "frozen")))
    sign = np.where(rows % 2, -1.0, 1.0) if kind == "opposite" else 1.0
    y[rows] = y[69] if kind == "frozen" else y[rows] + 0.3 * sign
    fit = ta.fit(run := ta.CalibrationRun(x, y, 360.0, label="r"))
    assert fit.model.shafts[0].orders == expected
    wild, old = ([], rows.size) if kind == "frozen" else (rows.tolist(), 0)
    assert ([row for _, row in sorted(fit.wild)], fit.readings) == (wild, y.size - old)
    (fault,) = ta.check(run).data_faults
    assert fault.fault == ("stale_samples" if kind == "frozen" else "outliers")
    assert fault.rows == tuple(rows + 1)
