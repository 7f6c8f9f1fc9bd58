"""Faults of the two angles, of rows and of extent: each from both sides of its bound."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.runs.checks.angles import (
    angle_ratio,
    mixed_units,
    ratio_suggestion,
    swapped_channels,
    told_ratio,
    wrapped_reference,
    wrong_ratio,
)
from trueangle.runs.checks.check import duplicate_rows, duplicate_runs, unsorted_time
from trueangle.runs.checks.fault import DataFault
from trueangle.runs.checks.record import Record
from trueangle.runs.checks.result import Extent, extent_of, extent_verdicts

SWEEP = np.linspace(3.0, 303.0, 160)


def record(reference: np.ndarray, indicated: np.ndarray | None = None, label: str = "1", **more):
    indicated = reference + 0.5 if indicated is None else indicated
    return Record(label, reference, indicated, **more)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("size", "says"),
    [
        (1.149, "{}"),
        (0.851, "{}"),
        (np.pi / 180.0, "indicated: radians in a column of degrees"),
        (180.0 / np.pi, "reference: radians in a column of degrees"),
        (1.0 / 360.0, "indicated: turns in a column of degrees"),
        (360.0 * 1.009, "reference: turns in a column of degrees"),
        (2.0 * np.pi * 0.991, "reference: turns in a column of radians"),
        (2.0 * np.pi * 1.011, "a gear of ratio 70/11"),
        (100.0, "a gear of ratio 100 between"),
        (50.5, "a gear of ratio 101/2 between"),
        (7.3, "a gear of ratio 73/10 between"),
        (1.16, "the indicated angle moves 1.16 times as far"),
        (2.0 * 1.0019, "a gear of ratio 2 between"),
        (0.0123, "the indicated angle moves 0.0123 times as far"),
        (1.0021 / 2.0, "the indicated angle moves 0.501 times as far"),
        (1.0019 / 2.0, "a gear of ratio 1/2 between"),
    ],
)
def test_what_a_ratio_suggests(size: float, says: str, sign: float) -> None:
    found = ratio_suggestion(sign * size)
    near = says.endswith("{}")
    way = "no gear between" if sign > 0 else "the indicated angle has the opposite sign"
    assert found.startswith("a gear of ratio" if "70/11" in says else says.format(way))
    assert near or ("other way" in found) == (sign < 0)
    assert ratio_suggestion(None) == "the joint hardly moved"
    # An angle that stands still has no ratio of teeth.
    assert ratio_suggestion(0.0) == "the indicated angle moves 0 times as far as the reference"


def test_the_ratio_is_the_median_of_the_runs() -> None:
    runs = [record(SWEEP, k * SWEEP) for k in (1.0, 3.0, 2.0)]
    assert angle_ratio(runs) == pytest.approx(2.0)
    for travel, told in ((5.01, True), (4.99, False)):
        assert (angle_ratio([record(np.linspace(0.0, travel, 20))]) is not None) == told
    for step, told in ((89.0, True), (91.0, False)):
        assert (angle_ratio([record(np.arange(12) * step)]) is not None) == told
    assert angle_ratio([record(np.array([0.0, 5.0, 10.0]))]) is None
    assert angle_ratio([record(np.array([0.0, 5.0, 10.0, 15.0]))]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("slope", "kind"),
    [(1.149, None), (0.851, None), (1.151, "wrong_gear_ratio"), (0.849, "wrong_gear_ratio"),
     (-1.149, "wrong_sign"), (-0.851, "wrong_sign"), (-1.151, "wrong_gear_ratio")],
)  # fmt: skip
def test_signs_and_ratios_that_are_wrong(slope: float, kind: str | None) -> None:
    runs = [record(SWEEP, slope * SWEEP, "a"), record(SWEEP, SWEEP, "b")]
    found = list(wrong_ratio(runs))
    assert [(f.fault, f.runs, f.rows) for f in found] == ([(kind, ("a",), ())] if kind else [])
    if kind:
        assert found[0].unusable
        assert "run a" in found[0].says
        assert "all runs" in next(iter(wrong_ratio(runs[:1]))).says
    if kind == "wrong_gear_ratio":
        assert f"{slope:.6g} times" in found[0].says


@pytest.mark.parametrize(("unit", "size"), [("radians", np.pi / 180.0), ("turns", 1.0 / 360.0)])
def test_runs_and_rows_in_another_unit(unit: str, size: float) -> None:
    other = record(size * SWEEP, label="r")
    (found,) = mixed_units([record(SWEEP), other, record(SWEEP, label="3")])
    assert (found.fault, found.runs, found.rows) == ("mixed_units", ("r",), ())
    assert f"looks like {unit} among degrees" in found.says
    for factor, told in ((1.3, True), (1.4, False), (0.7, True), (0.6, False)):
        scaled = record(size * SWEEP * factor, label="r")
        assert bool(list(mixed_units([record(SWEEP), scaled]))) == told
    short = SWEEP[:30] * 0.1
    assert not list(mixed_units([record(short), record(size * short, label="r")]))
    rng = np.random.default_rng(71_300)
    noise = [rng.normal(0.0, 0.01, SWEEP.size) for _ in range(2)]
    # What moves little, with the noise of the others, is no other unit.
    little = record(size * SWEEP, size * SWEEP + noise[0], "little")
    assert not list(mixed_units([record(SWEEP, SWEEP + noise[1]), little]))
    for rows in (np.arange(80, 120), np.arange(40, 160), rng.choice(np.arange(4, 160), 12, False)):
        for column in ("reference", "indicated"):
            part = {"reference": SWEEP, "indicated": SWEEP + noise[0]}
            part[column] = part[column].copy()
            part[column][rows] *= size
            (found,) = mixed_units([record(**part)])
            assert found.rows == tuple(1 + np.sort(rows))
            assert f"the {column} angle of run 1 looks like {unit} among degrees in" in found.says
            with pytest.raises(ArgumentError, match=f"{column} angle of run 1 looks like {unit}"):
                ta.fit(ta.CalibrationRun(**part, period=360.0))
    assert not list(mixed_units([record(**{k: v[100:131] for k, v in part.items()})]))
    assert not list(mixed_units([record(np.zeros(64))]))


def test_a_reference_that_wraps_at_no_turn() -> None:
    angle = np.linspace(0.0, 700.0, 400)
    for period, told in ((180.0, True), (300.0, True), (360.0, False)):
        (found,) = list(wrapped_reference([record(np.mod(angle, period), angle)])) or (None,)
        assert (found is not None) == told
        if found:
            jumps = np.flatnonzero(np.diff(np.floor(angle / period))) + 1
            assert found.rows == tuple(1 + jumps)
            assert f"wraps after {period:.4g} deg" in found.says or "wraps after" in found.says
    wraps = np.mod(angle, 180.0)
    assert not list(wrapped_reference([record(wraps[:7], angle[:7])]))
    # A slip in the middle of the range, and one that closes up again, are no wraps.
    slip = angle + np.where(angle > 200.0, -90.0, 0.0)
    assert not list(wrapped_reference([record(slip, angle)]))
    assert not list(wrapped_reference([record(np.mod(angle, 180.0), np.mod(angle, 180.0))]))
    # One reading that is wrong is none either, wherever it is.
    for at in (0, 1, 200, 398, 399):
        for wrong in (-1e3, 1e9):
            one = np.where(np.arange(400) == at, wrong, angle)
            assert not list(wrapped_reference([record(one, angle)]))


def test_a_reference_much_noisier_than_the_joint() -> None:
    rng = np.random.default_rng(1)
    steps = SWEEP + rng.uniform(-0.5, 0.5, SWEEP.size)
    fine = 0.002 * rng.normal(size=SWEEP.size)
    time = np.interp(steps, SWEEP, np.arange(SWEEP.size) * 0.1)
    for factor, told in ((14.0, True), (7.0, False)):
        rough = steps + factor * 0.002 * rng.normal(size=SWEEP.size)
        found = list(swapped_channels([record(rough, steps + fine, time=time)]))
        assert bool(found) == told
    assert found == []
    many = steps + 0.1 * rng.normal(size=SWEEP.size)
    (found,) = swapped_channels([record(many, steps + fine, time=time)])
    assert found.fault == "swapped_channels"
    assert not list(swapped_channels([record(many[:29], (steps + fine)[:29], time=time[:29])]))
    assert list(swapped_channels([record(many[:30], (steps + fine)[:30], time=time[:30])]))
    # At even counts of the joint nothing is told of its noise.
    assert not list(swapped_channels([record(SWEEP + 0.1 * rng.normal(size=160), SWEEP)]))


@pytest.mark.parametrize("pace", [210.1, 52.05, 17.9])
def test_counts_that_are_coarser_than_the_noise_of_the_reference_are_no_fault(pace) -> None:
    """Of 19 bit at an even pace most readings are on the line between their neighbours."""
    rng = np.random.default_rng(19)
    time = 0.005 * np.arange(2000)
    true = pace * np.arange(2000) * 360.0 / 2.0**19
    counts = np.floor((true + 0.3 * np.sin(np.radians(true))) / 360.0 * 2.0**19)
    noisy = true + rng.normal(0.0, 1e-4, time.size)
    run = ta.CalibrationRun(noisy, counts * 360.0 / 2.0**19, 360.0, time=time)
    assert ta.check(run).data_faults == ()


def test_rows_and_runs_that_are_there_twice() -> None:
    time = np.arange(160.0)
    (found,) = duplicate_runs([record(SWEEP, label=k) for k in "abc"])
    assert found.runs == ("a", "b", "c")
    assert "runs a, b and c hold" in found.says
    assert not list(duplicate_runs([record(SWEEP), record(SWEEP[::-1], label="b")]))
    assert not list(duplicate_runs([record(SWEEP)]))
    assert not list(duplicate_runs([record(SWEEP[:2], label=k) for k in "ab"]))
    assert list(duplicate_runs([record(SWEEP[:3], label=k) for k in "ab"]))
    assert not list(duplicate_runs([record(SWEEP, np.zeros(160), label=k) for k in "ab"]))
    twice = np.insert(np.arange(160), [20, 50], [19, 3])
    (found,) = duplicate_rows([record(SWEEP[twice], time=time[twice])])
    assert found.rows == (21, 52)
    assert found.says.startswith("run 1 has 2 readings twice")
    one = np.insert(np.arange(160), 20, 19)
    assert next(iter(duplicate_rows([record(SWEEP[one], time=time[one])]))).says.startswith(
        "run 1 has 1 reading "
    )
    assert not list(duplicate_rows([record(SWEEP[twice])]))
    copied = np.random.default_rng(3).permutation(np.repeat(np.arange(160), 3))
    (found,) = duplicate_rows([record(SWEEP[copied])])
    assert len(found.rows) == 2 * 160
    assert found.says.startswith(
        f"320 of 480 readings of run 1 repeat others to the last digit (first: {found.rows[0]})"
    )
    part = np.append(np.arange(160), np.arange(40, 70))
    (found,) = duplicate_rows([record(SWEEP[part])])
    assert found.rows == tuple(range(161, 191))
    anew = np.append(SWEEP + 0.5, SWEEP[40:70] + 0.5 + 0.01 * (np.arange(30) % 2))
    assert not list(duplicate_rows([record(SWEEP[part], anew)]))
    assert not list(duplicate_rows([record(SWEEP[[5, 9, 5, 9]])]))
    assert not list(duplicate_rows([record(SWEEP, time=time)]))
    assert not list(duplicate_rows([record(SWEEP[one], time=np.arange(161.0))]))
    back = time.copy()
    back[[30, 90]] = 5.5
    (found,) = unsorted_time([record(SWEEP, time=back)])
    assert found.rows == (31, 91)
    assert "2 times (first at reading 31: 5.5 s after 29 s)" in found.says
    assert not list(unsorted_time([record(SWEEP, time=np.minimum(time, 90.0)), record(SWEEP)]))


def test_a_fault_lists_a_hundred_rows_and_counts_all() -> None:
    for size in (100, 101):
        found = DataFault.of("stale_samples", ["a", "a", "b"], range(size), "x", "y")
        told = found.to_dict()
        assert (len(told["rows"]), told["rows_total"], told["runs"]) == (100, size, ["a", "b"])
        assert not told["unusable"]
        assert str(found) == "stale_samples: x; y"


@pytest.mark.parametrize("shift", [0.0, 200.0, -170.0])
def test_the_span_is_the_turn_less_its_widest_gap(shift: float) -> None:
    for span in (90.0, 350.0):
        places = np.mod(np.linspace(0.0, span, 200) + shift, 360.0)
        assert extent_of([record(places)]).span_deg == pytest.approx(span)
    grid = np.arange(36) * 10.0 + shift
    assert extent_of([record(grid)]).span_deg == 360.0
    for left_out, span in ((1, 360.0), (2, 330.0)):
        assert extent_of([record(grid[left_out:])]).span_deg == pytest.approx(span)


def test_levels_directions_and_speeds_of_the_runs() -> None:
    time = np.arange(160) * 0.1
    runs = [
        record(SWEEP, time=time, torque=np.full(160, 3.0), temperature=np.full(160, 20.0)),
        record(SWEEP[::-1], time=time, torque=np.full(160, 3.04), temperature=np.full(160, 21.1)),
        record(SWEEP, time=0.5 * time, torque=np.full(160, -2.0), mount=np.full(160, 30.0)),
    ]
    found = extent_of(runs)
    assert (found.readings, found.runs, found.timed) == (480, 3, True)
    assert found.turns == pytest.approx(300.0 / 360.0)
    assert found.directions == (-1, 1)
    speed = 300.0 / 15.9
    assert found.speeds == (float(f"{speed:.4g}"), float(f"{2 * speed:.4g}"))
    for jump in (99.0, -99.0):  # of a pause and of a clock that is set back, no speed
        assert (
            extent_of([record(SWEEP, time=time + jump * (time > 5.0))]).speeds == found.speeds[:1]
        )
    assert found.loads == (-2.0, 3.02)
    assert found.temperatures == (20.0, 21.1)
    assert found.mounts == (30.0,)
    assert extent_of(runs[:1]).directions == (1,)
    assert extent_of(runs[1:2]).directions == (-1,)
    assert not extent_of([runs[0], record(SWEEP)]).timed
    given = extent_of([record(SWEEP, time=time, velocity=np.full(160, -7.0))])
    assert given.speeds == (7.0,)
    for gap, levels in ((1.01, 2), (0.99, 1)):
        some = [record(SWEEP, temperature=np.full(160, t)) for t in (20.0, 20.0 + gap)]
        assert len(extent_of(some).temperatures) == levels


def test_what_can_and_cannot_be_known() -> None:
    def told(**changes) -> tuple[list[str], list[str]]:
        whole = {"readings": 900, "runs": 3, "span_deg": 350.0, "turns": 2.0,
                 "directions": (-1, 1), "speeds": (1.0, 2.0), "loads": (1.0, 2.0),
                 "temperatures": (1.0, 2.0), "mounts": (1.0, 2.0), "timed": True}  # fmt: skip
        can, cannot = extent_verdicts(Extent(**(whole | changes)))
        return can, [f"{c['what']}: {c['because']}" for c in cannot]

    can, cannot = told()
    assert (len(can), cannot) == (8, [])
    for changes, lost in (
        ({"span_deg": 349.9}, "over a whole turn: 350 deg of travel"),
        ({"directions": (1,)}, "reversal error: one direction"),
        ({"timed": False}, "delay, drift and lines in time: no time stamps"),
        ({"speeds": (1.0,)}, "a delay, separately from play and from a zero offset: one speed"),
        ({"loads": (1.0,)}, "compliance: one torque"),
        ({"temperatures": ()}, "thermal drift: no temperature"),
        ({"mounts": (1.0,)}, "the reference's own error apart from the joint's: one mount"),
        ({"runs": 2}, "differences between runs: 2 runs"),
    ):
        fewer, cannot = told(**changes)
        assert len(fewer) == 7
        assert len(cannot) == 1
        assert lost in cannot[0]


@pytest.mark.parametrize("teeth", range(2, 14))
def test_ratios_of_up_to_thirteen_teeth_are_offered(teeth: int) -> None:
    """No smaller pair of wheels comes near one more tooth on the one than on the other."""
    assert f"a gear of ratio {2 * teeth + 1}/{teeth} between" in ratio_suggestion(2.0 + 1.0 / teeth)


@pytest.mark.parametrize(
    ("ratio", "teeth"), [(51 / 50, "51/50"), (50 / 51, "50/51"), (1.01, "101/100"), (1.1, "11/10")]
)
def test_wheels_that_differ_by_a_tooth_are_told_from_an_error_by_the_travel(ratio, teeth) -> None:
    """An error of 25 deg bends the slope over n turns by n^-2 of that over one."""
    rng = np.random.default_rng(31_600)

    def over(turns: float, slope: float, error: float, lost: float = 0.0) -> Record:
        x = np.linspace(0.0, 360.0 * turns, 4000)
        read = slope * x + error * np.sin(np.radians(x)) - lost * np.round(x / x[-1])
        return record(x, read + rng.normal(0.0, 1e-3, x.size))

    (fault,) = wrong_ratio([over(6.0, ratio, 0.05)])
    assert fault.fault == "wrong_gear_ratio"
    assert f"a gear of ratio {teeth} between the two that is not reduced" in fault.says
    assert told_ratio([over(6.0, ratio, 0.05)])[1] in fault.says
    for turns in (1.0, 1.3, 2.0, 2.7, 6.0):
        assert not list(wrong_ratio([over(turns, 1.0, 25.0)])), turns
    lost = over(6.0, 1.0, 0.1, 36.0)  # counts lost halfway are no ratio
    assert not list(wrong_ratio([lost]))
    assert told_ratio([lost])[1] == "no gear between the two columns"


def test_a_fit_of_a_steep_ratio_names_it_and_no_number_of_orders() -> None:
    x = np.linspace(0.0, 1080.0, 2000)
    for ratio, teeth in ((1.1, "11/10"), (1.02, "51/50")):
        told = rf"{ratio:g} times .* ratio {teeth} .*; divide the indicated"
        with pytest.raises(ArgumentError, match=told):
            ta.fit({"reference_deg": x, "indicated_deg": ratio * x}, range(1, 18))


@pytest.mark.parametrize("turns", [3, 120])
def test_a_ratio_that_coarse_readings_hide_is_no_lack_of_travel(turns) -> None:
    coarse = record(np.linspace(0.0, 360.0 * turns, 3 * turns + 1))
    told = (None, "readings more than 90 deg apart do not show it; read more densely")
    assert told_ratio([coarse]) == told
    assert told_ratio([record(np.linspace(0.0, 4.9, 20))]) == (
        None,
        "the joint hardly moved",
    )
