"""Rows that are counted over blocks and stretches of a log, and outliers about each run's zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import EmptyCellsWarning, FileError
from trueangle.logs import accumulation
from trueangle.logs.accumulation import (
    LogFitSettings,
    OutlierLimits,
    RunTally,
    log_moments,
    merged_moments,
)

SEED = 72_000
PERIOD = 360.0
ZEROS = {"a": 0.5, "b": -40.0}
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.2], [0.1])], constant=7.0, period=PERIOD)
SETTINGS = LogFitSettings({"output": (1,)}, {"output": 1.0})


@pytest.fixture
def log(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """Two runs in turn, rows without a reading, outliers; and blocks of 100 rows."""
    monkeypatch.setattr(accumulation, "_BLOCK", 100)
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    theta = rng.uniform(0.0, PERIOD, 900)
    run = np.where(np.arange(900) // 150 % 2, "b", "a")
    error = np.asarray(MODEL.error(theta)) - MODEL.constant + 0.01 * rng.normal(size=900)
    error += np.array([ZEROS[name] for name in run])
    far = rng.choice(900, 12, replace=False)
    error[far] += rng.choice([-1.0, 1.0], 12)
    missing = rng.choice(np.setdiff1d(np.arange(900), far), 30, replace=False)
    cells = [f"{x!r}" for x in (theta + error).tolist()]
    for row in missing:
        cells[row] = ""
    path = tmp_path / "log.csv"
    rows = [f"{x!r},{y},{name}" for x, y, name in zip(theta.tolist(), cells, run, strict=True)]
    path.write_text("\n".join(["reference_deg,indicated_deg,run", *rows]))
    known = np.setdiff1d(np.arange(900), missing)
    expected = {
        name: np.flatnonzero(np.isin(known[run[known] == name], far)).tolist() for name in "ab"
    }
    return path, expected, known.size


def test_outliers_have_their_row_among_the_known_ones_of_their_run(log) -> None:
    path, expected, known = log
    zeros = {(str(path), None, name): zero for name, zero in ZEROS.items()}
    limits = OutlierLimits(MODEL, zeros, 0.5)
    found = log_moments(path, replace(SETTINGS, outliers=limits))
    told = {run[2]: tally.outliers for run, tally in found.tallies.items()}
    assert told == expected
    assert (found.rows, found.missing) == (900, 30)
    assert found.moments.count == known - 12
    assert sum(tally.rows for tally in found.tallies.values()) == known


def test_stretches_of_a_run_follow_each_other() -> None:
    """Rows of a later one are counted on; the ends are those of both."""
    first = RunTally(100, -3.0, 40.0, [7, 90])
    first.add(RunTally(50, -5.0, 12.0, [0, 49]))
    assert first == RunTally(150, -5.0, 40.0, [7, 90, 100, 149])


def test_ends_are_those_of_all_blocks_where_a_turn_is_not_all(tmp_path, monkeypatch) -> None:
    """There and back: neither end stands in the last block of 100."""
    monkeypatch.setattr(accumulation, "_BLOCK", 100)
    theta = 100.0 + 500.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 1001))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["reference_deg,indicated_deg", *(f"{x},{x}" for x in theta)]))
    (tally,) = log_moments(
        path, LogFitSettings({"output": (1,), "motor": (1,)}, {"output": 1.0, "motor": 7.3})
    ).tallies.values()
    assert (tally.rows, tally.low, tally.high) == (1001, theta.min(), theta.max())


@pytest.mark.parametrize(
    ("signs", "unit"), [([1.0], "deg"), ([-1.0], "deg"), ([-1.0, 1.0], "rad"), ([-1.0], "turn")]
)
def test_outliers_of_one_pass_are_named_as_in_memory(signs, unit, tmp_path, monkeypatch) -> None:
    """Of two files without a column of runs: number of the run and row among those known.

    Above the pattern, below it and on both sides, in every unit.
    """
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    turn = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0}[unit]
    for name in ("a", "b"):
        theta = np.sort(rng.uniform(0.0, PERIOD, 3000))
        error = np.asarray(MODEL.error(theta)) + 0.01 * rng.normal(size=3000)
        error[rng.choice(3000, 5, replace=False)] += 0.7 * rng.choice(signs, 5)
        both = np.column_stack([theta, theta + error]) * (turn / PERIOD)
        rows = [f"{x!r},{y!r}" for x, y in both.tolist()]
        rows[40] = rows[40].partition(",")[0] + ","
        head = f"reference_{unit},indicated_{unit}"
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *rows]))
    with pytest.warns(EmptyCellsWarning, match="1 of 3000 rows"):
        expected = ta.fit(ta.read_runs(tmp_path), [1])
    assert len(expected.wild) == 10
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 2000)
    found = ta.fit_logs(tmp_path, [1])
    assert found.moments is not None
    assert found.wild == expected.wild
    assert found.readings == expected.readings


@pytest.mark.parametrize("odd", [1, 2])
def test_a_log_in_another_unit_is_named_beside_the_first(odd, tmp_path) -> None:
    """The one that differs, wherever it stands; the first is what it differs from."""
    parts = []
    for number in range(3):
        unit, turn = ("rad", 2.0 * np.pi) if number == odd else ("deg", 360.0)
        rows = [f"{x!r},{x!r}" for x in np.linspace(0.0, 0.9 * turn, 50).tolist()]
        path = tmp_path / f"log{number}.csv"
        path.write_text("\n".join([f"reference_{unit},indicated_{unit}", *rows]))
        parts.append(log_moments(path, SETTINGS))
    with pytest.raises(FileError, match=rf"log{odd}\.csv: .*than that of \S*log0\.csv"):
        merged_moments(parts)
    merged = merged_moments([part for k, part in enumerate(parts) if k != odd])
    assert merged.rows == 100
    # Parts may be merged again: none is changed.
    assert [part.rows for part in parts] == [50] * 3
    assert [part.moments.count for part in parts] == [50] * 3
