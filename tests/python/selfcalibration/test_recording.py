"""Logs as recordings: units, runs, gaps and line numbers; clampings of two encoders."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.errors import ArgumentError, FileError, NoModelError
from trueangle.selfcalibration.calibrate import _method, _orders, _ripple
from trueangle.selfcalibration.recording import Recording, as_recordings, clampings_of

TURN = 2.0 * math.pi
UNITS = {"deg": 360.0, "rad": TURN, "turn": 1.0}
ANGLE = np.array([0.1, 0.2, 0.35, 0.5])


def table(unit: str, turn: float, **more) -> dict[str, np.ndarray]:
    names = ("indicated", "reference", "motor", "head2", "head1", "shift", "mount")
    found = {f"{name}_{unit}": ANGLE * turn * (k + 1) for k, name in enumerate(names)}
    return found | {"time_s": np.arange(4.0), "current_A": np.full(4, 2.0)} | more


@pytest.mark.parametrize(("unit", "turn"), UNITS.items())
def test_every_unit_gives_the_same_recording(unit: str, turn: float) -> None:
    (found,) = as_recordings(table(unit, turn), {})
    for k, name in enumerate(("indicated", "reference", "motor")):
        np.testing.assert_allclose(getattr(found, name), ANGLE * TURN * (k + 1))
    np.testing.assert_allclose(found.heads[2], ANGLE * TURN * 4)
    np.testing.assert_allclose(found.heads[1], ANGLE * TURN * 5)
    assert list(found.heads) == [1, 2]
    np.testing.assert_allclose(found.shift, ANGLE * TURN * 6)
    np.testing.assert_allclose(found.mount, ANGLE * TURN * 7)
    assert found.time.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert found.current.tolist() == [2.0] * 4
    assert (len(found), found.label, found.named, found.file) == (4, None, "the log", "")


def test_counts_need_their_number() -> None:
    counts = {"indicated_count": np.array([0, 1024, 2048]), "reference_count": np.array([0, 1, 2])}
    (found,) = as_recordings(counts, {"counts_per_turn": 4096, "counts_per_turn_reference": 8})
    np.testing.assert_allclose(found.indicated, TURN * np.array([0.0, 0.25, 0.5]))
    np.testing.assert_allclose(found.reference, TURN * np.array([0.0, 0.125, 0.25]))
    with pytest.raises(Exception, match="give `counts_per_turn=`"):
        as_recordings(counts, {"counts_per_turn_reference": 8})
    with pytest.raises(Exception, match="give `counts_per_turn_reference=`"):
        as_recordings(counts, {"counts_per_turn": 4096})


@pytest.mark.parametrize("period", [360.0, TURN, 1.0, 4096.0])
def test_runs_in_memory_are_recordings(period: float) -> None:
    turns = ANGLE * period
    run = CalibrationRun(
        turns, 2 * turns, period, np.arange(4.0), mount=turns * 3, label="x",
        signals={"motor": turns * 4, "head2": turns * 5, "shift": turns * 6, "current": 1.5},
    )  # fmt: skip
    (found,) = as_recordings(run, {})
    for k, name in enumerate(("reference", "indicated", "mount", "motor")):
        np.testing.assert_allclose(getattr(found, name), ANGLE * TURN * (k + 1))
    np.testing.assert_allclose(found.heads[2], ANGLE * TURN * 5)
    np.testing.assert_allclose(found.shift, ANGLE * TURN * 6)
    assert found.current.tolist() == [1.5] * 4
    assert (found.label, found.named) == ("x", "run x")


def test_a_file_is_parted_by_unit_and_run_without_empty_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "unit,run,time_s,indicated_deg\nA,1,0,10\nB,1,0,20\nA,1,1,\nA,2,1,30\nA,1,2,40\n"
    )
    found = as_recordings(path, {})
    assert [r.label for r in found] == ["A 1", "B 1", "A 2"]
    np.testing.assert_allclose(np.degrees(found[0].indicated), [10.0, 40.0])
    assert found[0].time.tolist() == [0.0, 2.0]
    assert found[0].named == f"{path}, run A 1"
    assert found[0].source is not None
    path.write_text("time_s,indicated_deg\n0,10\n1,\n2,30\n")
    (whole,) = as_recordings(path, {})
    assert whole.time.tolist() == [0.0, 2.0]
    assert whole.named == str(path)
    path.write_text("time_s,reference_deg\n0,10\n1,3\n")
    says = r"log.csv, line 1: no column indicated_deg .* columns are reference_deg, time_s"
    with pytest.raises(FileError, match=says):
        as_recordings(path, {})


def test_a_recording_is_as_long_as_its_first_channel() -> None:
    assert len(Recording(None)) == 0
    assert len(Recording(None, motor=np.zeros(3), reference=np.zeros(3))) == 3
    assert len(Recording(None, reference=np.zeros(2))) == 2
    assert len(Recording(None, heads={1: np.zeros(5)})) == 5


def clamped(shifts: list[float], told: list[float | None] | None = None, set_to_zero: bool = False,
            places: np.ndarray | None = None) -> list[Recording]:  # fmt: skip
    theta = np.linspace(0.0, TURN, 60, endpoint=False) if places is None else places
    told = list(shifts) if told is None else told
    return [
        Recording(
            str(k),
            indicated=theta,
            reference=theta + (0.0 if set_to_zero else math.radians(s)),
            shift=None if t is None else np.full(theta.size, math.radians(t)),
        )
        for k, (s, t) in enumerate(zip(shifts, told, strict=True))
    ]


def test_shifts_are_those_of_the_readings() -> None:
    found = clampings_of(clamped([0.0, 40.0, 350.0]))
    np.testing.assert_allclose(np.degrees(found.shift), [0.0, 40.0, -10.0], atol=1e-9)
    assert (found.facets, found.notes) == (0, ())
    # Of either sign, and told from any first one.
    found = clampings_of(clamped([10.0, 50.0], [-10.0, -50.0]))
    np.testing.assert_allclose(np.degrees(found.shift), [0.0, 40.0], atol=1e-9)
    assert found.notes == ()
    for told, noted in ((41.9, False), (42.1, True)):
        found = clampings_of(clamped([0.0, 40.0], [0.0, told]))
        assert bool(found.notes) == noted
        np.testing.assert_allclose(np.degrees(found.shift), [0.0, 40.0], atol=1e-9)
    assert "up to 2.1 deg" in found.notes[0]
    found = clampings_of(clamped([0.0, 40.0], [0.0, None]))
    assert "estimated from the mean differences" in found.notes[0]
    np.testing.assert_allclose(np.degrees(found.shift), [0.0, 40.0], atol=1e-9)


def test_readings_set_to_one_zero_have_the_shift_that_was_told() -> None:
    recordings = clamped([5.0, 45.0], set_to_zero=True)
    found = clampings_of(recordings)
    np.testing.assert_allclose(np.degrees(found.shift), [0.0, 40.0], atol=1e-9)
    for k, shift in enumerate((5.0, 45.0)):
        np.testing.assert_allclose(
            found.other[k] - recordings[k].reference, math.radians(shift), atol=1e-12
        )
        np.testing.assert_array_equal(found.joint[k], recordings[k].indicated)
    mounts = [Recording(r.label, indicated=r.indicated, reference=r.reference, mount=r.shift)
              for r in recordings]  # fmt: skip
    np.testing.assert_allclose(clampings_of(mounts).shift, found.shift)


def test_clampings_that_show_the_sum_only_are_refused() -> None:
    for shifts, told, fails in (
        ([0.0, 0.51], None, ""),
        ([0.0, 0.49], None, "all clampings have one shift"),
        ([0.0, 0.51], [None, None], ""),
        ([0.0, 0.49], [None, None], "all clampings are at one angle"),
        ([0.0], None, "one clamping shows only"),
    ):
        recordings = clamped(shifts, told)
        if fails:
            with pytest.raises(NoModelError, match=f"run 0: {fails}"):
                clampings_of(recordings)
        else:
            assert len(clampings_of(recordings).joint) == len(shifts)
    for lacking in (Recording("a", indicated=np.zeros(3)), Recording("a", reference=np.zeros(3))):
        with pytest.raises(NoModelError, match="run a: two readings are needed"):
            clampings_of([lacking, lacking])


@pytest.mark.parametrize("n", [6, 12, 24, 36])
def test_facets_of_a_polygon_are_counted(n: int) -> None:
    places = np.tile(np.arange(n) * TURN / n, 4) + 0.3
    shifts = [0.0, 360.0 * 2 / n]
    assert clampings_of(clamped(shifts, places=places)).facets == n
    assert clampings_of(clamped(shifts, places=places + 0.01 * TURN / n)).facets == n
    rng = np.random.default_rng(n)
    assert clampings_of(clamped(shifts, places=rng.uniform(0.0, TURN, 4 * n))).facets == 0


X = np.zeros(4)


@pytest.mark.parametrize(
    ("channels", "method"),
    [
        ({"motor": X, "indicated": X, "time": X, "heads": {1: X, 2: X}}, "dual"),
        ({"motor": X, "reference": X}, "dual"),
        ({"motor": X, "heads": {1: X, 2: X}, "time": X}, "heads"),
        ({"heads": {1: X, 2: X}, "indicated": X, "time": X}, "heads"),
        ({"heads": {1: X}, "indicated": X, "time": X}, "spin-down"),
        ({"shift": X, "reference": X, "indicated": X, "time": X}, "shifts"),
        ({"shift": X, "indicated": X, "time": X}, "spin-down"),
        ({"reference": X, "indicated": X, "time": X}, "spin-down"),
        ({"indicated": X}, None),
        ({"time": X}, None),
        ({"shift": X, "reference": X, "time": X}, None),
        ({"shift": X, "indicated": X}, None),
        ({"motor": X, "time": X}, None),
    ],
)
def test_the_method_is_that_of_the_columns(channels: dict, method: str | None) -> None:
    recording = Recording("7", **channels)
    if method is None:
        with pytest.raises(NoModelError, match="run 7: these columns do not allow"):
            _method([recording])
    else:
        assert _method([recording]) == method


def test_orders_are_whole_numbers_from_one_to_the_limit() -> None:
    assert _orders("auto") == "auto"
    assert _orders([3, 1.0, np.int64(3)]) == (1.0, 3.0)
    assert _orders([4096]) == (4096.0,)
    for wrong in ("all", [], [0], [0.5], [1, 2.5], [4097], [np.nan], [np.inf], 3, ["one"], [None]):
        with pytest.raises(ArgumentError, match="orders must be 'auto' or whole numbers from 1"):
            _orders(wrong)
    with pytest.raises(ArgumentError, match="too many"):
        _orders(range(1, 5000))


def test_ripple_is_auto_none_or_orders() -> None:
    assert _ripple("auto") == "auto"
    assert _ripple("none") == "none"
    assert _ripple([2, 1]) == (1.0, 2.0)
    with pytest.raises(ArgumentError, match="ripple must be 'auto', 'none' or orders, got 'all'"):
        _ripple("all")
