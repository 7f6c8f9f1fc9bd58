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
from trueangle.logs.keeping import KeptReadings
from trueangle.logs.turns import TurnCounter, TurnSpan, TurnState

from .conftest import made_angles

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


@pytest.mark.parametrize("cut", [1, 7, 333, 500, 999])
def test_batches_count_as_numpy_unwraps_the_whole(cut):
    angles = made_angles(1000, turns=7.3)
    counter = TurnCounter(360.0)
    parts = [counter.count(angles[i : i + cut]) for i in range(0, 1000, cut)]
    expected = np.rint((np.unwrap(angles, period=360.0) - angles) / 360.0)
    np.testing.assert_array_equal(np.concatenate(parts), expected)


def test_a_border_right_at_the_wrap_counts_one_turn():
    counter = TurnCounter(360.0)
    assert counter.count(np.array([358.0, 359.5])).tolist() == [0, 0]
    assert counter.count(np.array([0.5, 1.0])).tolist() == [1, 1]
    assert counter.count(np.array([359.9])).tolist() == [0]
    assert counter.count(np.array([0.0])).tolist() == [1]


def test_missing_readings_are_stepped_over_also_at_borders():
    counter = TurnCounter(360.0)
    assert counter.count(np.array([np.nan, 350.0, np.nan])).tolist() == [0, 0, 0]
    assert counter.count(np.array([np.nan, np.nan])).tolist() == [0, 0]
    assert counter.count(np.array([np.nan, 10.0, np.nan, 340.0])).tolist() == [0, 1, 1, 0]
    assert counter.state == TurnState(340.0, 0)


def test_angles_of_many_turns_are_left_alone():
    assert not TurnCounter(360.0).count(np.linspace(-5000.0, 5000.0, 200)).any()


def test_parts_counted_by_themselves_join_to_the_whole():
    angles = made_angles(1000, turns=-5.2)
    whole = TurnCounter(360.0)
    whole.count(angles)
    state = TurnState()
    for part in np.array_split(angles, 6):
        alone = TurnCounter(360.0)
        alone.count(part)
        state = TurnSpan(360.0, float(part[0]), *alone.state).after(state)
    assert state == whole.state
    assert TurnSpan(360.0, None, None, 0).after(state) == state  # nothing but NaN


def test_a_batch_of_nothing_but_gaps_stays_in_its_turn():
    counter = TurnCounter(360.0)
    counter.count(np.array([350.0, 10.0, 120.0, 240.0, 350.0, 10.0]))
    turns = counter.state.turns
    assert turns == 2
    assert counter.count(np.array([np.nan, np.nan])).tolist() == [2, 2]
    assert counter.state.turns == turns


@pytest.mark.parametrize("cut", range(1, 8))
def test_parts_join_across_a_wrap_at_their_border(cut):
    """A wrap at every step: wherever the parts are cut, one lies between them."""
    angles = np.array([100.0, 340.0, 220.0, 100.0, 340.0, 220.0, 100.0, 340.0])
    whole = TurnCounter(360.0)
    whole.count(angles)
    assert whole.state.turns == -3
    state = TurnState()
    for part in (angles[:cut], angles[cut:]):
        alone = TurnCounter(360.0)
        alone.count(part)
        state = TurnSpan(360.0, float(part[0]), *alone.state).after(state)
    assert state == whole.state


KEEPING_SEED = 71_300
BLOCK = 256
ROWS = 400 * BLOCK + 77
X = np.arange(ROWS, dtype=np.float64)


def kept_of(cuts, most=1 << 30, part=1.0, salt=3):
    """What is kept of a log that comes in batches, each beginning where a block does."""
    kept = KeptReadings(most, part)
    for begin, end in zip([0, *cuts], [*cuts, ROWS], strict=True):
        kept.take("run", salt, begin, X[begin:end], -X[begin:end])
    return kept


def places(kept):
    return [int(x[0]) // BLOCK for _, x, _ in kept.blocks["run"]]


@pytest.mark.parametrize("part", [0.5, 0.1])
@pytest.mark.parametrize("salt", [0, 3, 1_000_000])
def test_it_does_not_depend_on_batches(part, salt):
    """At once, block by block, and in batches of unlike numbers of blocks."""
    print("seed", KEEPING_SEED)
    rng = np.random.default_rng(KEEPING_SEED)
    whole = places(kept_of([], part=part, salt=salt))
    every = [BLOCK * k for k in range(1, 401)]
    some = sorted(rng.choice(every, 40, replace=False).tolist())
    for cuts in (every, some, every[::7]):
        kept = kept_of(cuts, part=part, salt=salt)
        assert places(kept) == whole
        x, y = kept.columns("run")
        assert kept.readings == x.size
        np.testing.assert_array_equal(x, -y)
    # A share of all, from every part of the log and from no neighbours more than chance makes.
    assert whole[0] == 0
    for quarter in range(4):
        count = sum(100 * quarter <= k < 100 * quarter + 100 for k in whole)
        assert abs(count - 100 * part) < 4.5 * np.sqrt(100 * part * (1.0 - part)) + 1.0
    pairs = np.count_nonzero(np.diff(whole) == 1)
    assert abs(pairs - 400 * part**2) < 5.0 * np.sqrt(400 * part**2) + 2.0


def test_segments_of_a_log_are_unlike():
    first, second = (set(places(kept_of([], part=0.2, salt=salt))) for salt in (0, 1))
    alike = len(first & second) - 1  # the first block of each is kept anyway
    assert alike < 0.04 * 400 + 5.0 * np.sqrt(0.04 * 400)


@pytest.mark.parametrize("most", [60 * BLOCK, 7 * BLOCK, BLOCK // 2])
def test_half_of_the_blocks_go_until_they_are_few_enough(most):
    """Against the rule written out over all blocks, however the log comes."""
    every = {int(x[0]) // BLOCK: (chance, x.size) for chance, x, _ in kept_of([]).blocks["run"]}
    part = 1.0
    while True:
        left = [k for k, (chance, _) in every.items() if k == 0 or chance < part]
        if sum(every[k][1] for k in left) <= most or len(left) == 1:
            break
        part /= 2.0
    for cuts in ([], [BLOCK * k for k in range(1, 401)], [BLOCK * 199]):
        kept = kept_of(cuts, most=most)
        assert (places(kept), kept.part) == (left, part)
        assert kept.readings == sum(every[k][1] for k in left)


def test_segments_that_were_thinned_unlike_are_one_sample():
    """The share of the one of which less was kept holds for all that follows."""
    one, other = kept_of([], most=50 * BLOCK, salt=0), kept_of([], most=200 * BLOCK, salt=1)
    least = min(one.part, other.part)
    assert one.part != other.part
    for first, second in ((0, 1), (1, 0)):
        parts = [kept_of([], most=50 * BLOCK, salt=0), kept_of([], most=200 * BLOCK, salt=1)]
        parts[first].add(parts[second])
        assert parts[first].part == least
        assert parts[first].readings == one.readings + other.readings
        found = parts[first].thinned(20 * BLOCK)
        assert found.readings <= 20 * BLOCK
        chances = [chance for chance, _, _ in found.blocks["run"][1:]]
        assert max(chances) < found.part < least


def test_readings_that_are_missing_take_no_place():
    kept, x = KeptReadings(1 << 30), X.copy()
    x[10:300] = np.nan
    y = -X
    y[5000:6000] = np.nan
    kept.take("run", 0, 0, x, y)
    known = np.isfinite(x) & np.isfinite(y)
    np.testing.assert_array_equal(
        np.column_stack(kept.columns("run")), np.column_stack([x, y])[known]
    )
    assert kept.readings == np.count_nonzero(known)
