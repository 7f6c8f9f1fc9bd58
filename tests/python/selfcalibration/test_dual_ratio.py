"""Which gear ratio two encoders are read with: as given, whole, or measured; and what is told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.runs.travel import Span
from trueangle.selfcalibration import dual
from trueangle.selfcalibration.dualfit import RatioEstimate, estimate_dual_ratio
from trueangle.selfcalibration.gearlines import GearedChannels, SharedLine

SEED = 59_200

GIVEN, ASKED = (True, False), (True, True)
FREE = (False, False)

WHOLE = "give the count of teeth as `gear_ratio=`"


def used(
    monkeypatch: pytest.MonkeyPatch,
    start: float,
    measured: float,
    std: float,
    given: bool,
    asked: bool,
) -> dual._UsedRatio:
    estimate = RatioEstimate(measured, std)
    monkeypatch.setattr(dual, "estimate_dual_ratio", lambda *args: estimate)
    found = dual._ratio(None, start, "auto", 3.0, given, asked)  # type: ignore[arg-type]
    assert found.measured is estimate
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("start", "measured", "std", "how", "ratio", "told"),
    [
        # As given: told where the readings exclude it, by six errors and a part in 10 000.
        (100.0, 100.05, 0.01, GIVEN, 100.0, ""),
        (100.0, 100.07, 0.01, GIVEN, 100.0, "a gear ratio of {}, not {:g}, which is kept"),
        (100.0, 99.93, 0.01, GIVEN, 100.0, "a gear ratio of {}, not {:g}, which is kept"),
        (100.0, 100.009, 0.001, GIVEN, 100.0, ""),
        (100.0, 100.011, 0.001, GIVEN, 100.0, "not {1:g}, which is kept"),
        # Asked for: kept within four errors, else as measured, a whole one within four of it.
        (100.0, 100.039, 0.01, ASKED, 100.0, "a gear ratio of {}; {:g} stays"),
        (100.0, 100.041, 0.01, ASKED, 100.041, "is estimated: {}, not {:g}, taken as 100.041"),
        (100.0, 101.039, 0.01, ASKED, 101.0, "is estimated: {}, not {:g}, taken as 101"),
        (100.0, 100.961, 0.01, ASKED, 101.0, "is estimated: {}, not {:g}, taken as 101"),
        # Nothing given: whole within four errors.
        (100.2, 100.03, 0.01, FREE, 100.0, "is estimated: {}, taken as 100"),
        (100.2, 100.05, 0.01, FREE, 100.05, "is estimated: {}, taken as 100.05"),
        (0.3, 0.4, 0.2, FREE, 1.0, "as well: give the count of teeth as `gear_ratio=`, taken as 1"),
    ],
)  # fmt: skip
def test_a_ratio_is_used_as_the_readings_leave_it(
    start: float, measured: float, std: float, how: tuple[bool, bool], ratio: float, told: str,
    sign: float, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    found = used(monkeypatch, sign * start, sign * measured, std, *how)
    assert found.used == pytest.approx(sign * ratio, rel=1e-12)
    numbers = f"{sign * measured:.7g} (std {std:.2g})"
    wanted = told.format(numbers, sign * start).replace("taken as ", f"taken as {'-' * (sign < 0)}")
    assert wanted in found.note
    assert bool(found.note) == bool(told)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("std", "range_told"), [(0.124, False), (0.126, True), (0.3, True)])
def test_a_range_of_ratios_is_told_where_teeth_are_not(
    std: float, range_told: bool, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four errors to either side that hold more than one whole number; counts are positive."""
    found = used(monkeypatch, sign * 50.2, sign * 50.1, std, *FREE)
    assert found.used == sign * 50.0
    low, high = 50.1 - 4.0 * std, 50.1 + 4.0 * std
    told = f"any from {low:.4g} to {high:.4g} explains the readings as well: {WHOLE}"
    assert (told in found.note) == range_told


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("how", "ratio", "told"),
    [
        (GIVEN, 50.2, ""),
        (ASKED, 50.2, "do not separate the gear ratio from orders of the output: {} is kept"),
        (FREE, 50.0, "separate the gear ratio from orders of the output; give it as `gear_ratio=`"),
    ],
)  # fmt: skip
def test_readings_that_do_not_tell_the_ratio_leave_the_one_that_is_known(
    how: tuple[bool, bool], ratio: float, told: str, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = used(monkeypatch, sign * 50.2, sign * 50.2, math.inf, *how)
    assert found.used == sign * ratio
    assert found.note.endswith(told.format(f"{sign * 50.2:g}"))
    assert bool(found.note) == bool(told)


def over_an_arc(rng: np.random.Generator, turns: float, orders: Sequence[int]) -> GearedChannels:
    """One way over some turns, lines of 10 to 200 arcsec in noise of 5; the ratio is 50.3."""
    theta = np.linspace(0.0, 2.0 * np.pi * turns, 800) + rng.uniform(0.0, 2.0 * np.pi)
    error = rng.normal(0.0, 5.0, theta.size)
    for k in orders:
        error += rng.uniform(10.0, 200.0) * np.sin(k * theta + rng.uniform(0.0, 2.0 * np.pi))
    return GearedChannels([50.3 * theta], [theta + np.radians(error / 3600.0)], [None])


@pytest.mark.parametrize("orders", [(1, 2), (1, 2, 3, 5), (2, 4)], ids=str)
@pytest.mark.parametrize("turns", [0.4, 0.6, 0.9, 1.5])
def test_a_ratio_is_as_certain_as_orders_that_nobody_sees_leave_it(
    turns: float, orders: Sequence[int]
) -> None:
    """Over an arc, errors had been of the orders chosen: a third of them were ten times too small.

    Where it is not told, or hardly, nothing is claimed.
    """
    print("seed", SEED)
    rng = np.random.default_rng([SEED, int(10 * turns), *orders])
    pulls = []
    for _ in range(24):
        found = estimate_dual_ratio(over_an_arc(rng, turns, orders), 50.25, "auto", turns)
        if np.isfinite(found.std):
            pulls.append((found.value - 50.3) / found.std)
    print(turns, orders, len(pulls), np.std(pulls) if pulls else None)
    if turns > 0.5:
        assert len(pulls) > 20
        # Of 24 pulls the root of the mean square is so once in 10 000 times.
        assert 0.55 < np.sqrt(np.mean(np.square(pulls))) < 1.6
    assert not pulls or np.abs(pulls).max() < 4.5


TOLD_SEED = 68_400
OUTPUT, MOTOR, BOTH = SharedLine(2.0, 2, 0), SharedLine(60.0, 0, 2), SharedLine(30.0, 30, 1)


def swept(size: int, back: bool, ratio: float = 30.37, zero: float = 1.1, seed: int = TOLD_SEED):
    """A turn and a half at a speed that changes, or out and back."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, size)
    theta = 9.0 * (np.sin(math.pi * t) if back else 0.1 * t + 1.4 * t**2)
    error = 40.0 * np.cos(theta + zero + 0.7) + 20.0 * np.cos(ratio * theta + 0.5)
    error += 0.5 * rng.normal(size=size)
    return {
        "time_s": 4.0 * t,
        "motor_rad": ratio * theta,
        "indicated_rad": theta + zero + ARCSEC * error,
    }, theta


def selfcal(logs, ratio: float = 30.37) -> ta.SelfCalibration:
    return ta.selfcal(logs, method="dual", orders=[1], gear_ratio=ratio)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_only_sums_show_is_named_with_its_reason(sign: float) -> None:
    zero, sums = dual._blind([OUTPUT, MOTOR], [], sign * 30.37, 1.5)
    assert zero.orders == (0.0,)
    assert sums.orders == (2.0, 60.0)
    *_, shared = dual._blind([OUTPUT, BOTH, MOTOR], [], sign * 30.0, 1.5)
    assert shared.orders == (30.0,)
    assert shared.because == "the ratio of 30 is whole: output 30 with motor 1 are one number each"
    assert "spin-down of the motor" in shared.measure
    *_, near, lost = dual._blind([OUTPUT, BOTH], [MOTOR, OUTPUT], sign * 30.1, 0.75)
    assert near.because == "over 0.75 turns output 30 with motor 1 are one number each"
    assert near.measure == "more turns of the output"
    assert lost.orders == (60.0, 2.0)
    assert lost.because.startswith("0.75 turns of the output hold too little of them")


def test_orders_of_the_output_are_those_of_a_travel_below_a_turn() -> None:
    part, whole = Span(10.0, 250.0, False), Span(0.0, 360.0, True)
    note = dual._arc_note(part, [SharedLine(1.0, 1, 0), BOTH, MOTOR, OUTPUT], 360.0)
    assert "orders 1, 2 of the output describe the error within this travel" in note
    assert dual._arc_note(whole, [OUTPUT], 360.0) == ""
    assert dual._arc_note(part, [MOTOR, BOTH], 360.0) == ""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("second", "same"),
    [((1.0, 0.0), True), ((1.0, 0.21), False), ((1.0, 0.19), True), ((0.05, 1.3), False)],
)
def test_halves_are_the_same_places_where_they_share_four_fifths(
    second: tuple[float, float], same: bool, sign: float
) -> None:
    motor = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(*second, 50)])
    assert dual._same_places(sign * motor) == same


@pytest.mark.parametrize(("size", "told"), [(199, False), (200, True)])
def test_two_hundred_readings_predict_each_other(size: int, told: bool) -> None:
    one = selfcal(swept(size, back=True)[0])
    assert bool(one.held_out) == told
    blocks = selfcal(swept(400, back=False)[0]).held_out
    assert set(blocks) == {"blocks"}
    assert set(selfcal(swept(400, back=True)[0]).held_out) == {"halves"}


@pytest.mark.parametrize("back", [False, True])
def test_one_direction_shows_no_reversal(back: bool) -> None:
    one = selfcal(swept(300, back)[0])
    told = "one direction of travel only: reversal error is not identifiable" in one.notes
    assert told != back
    assert ("reversal_error_arcsec" in one.beside) == back
    # The speed changes either way, and shows a delay.
    assert "delay_s" in one.beside


@pytest.mark.parametrize(
    ("back", "timed", "std"), [(True, True, 0.2), (False, True, math.inf), (True, False, 0.2)]
)
def test_numbers_beside_are_told_where_motion_shows_them(
    back: bool, timed: bool, std: float
) -> None:
    log, _ = swept(300, back)
    time = log["time_s"] if timed else None
    channels = GearedChannels([log["motor_rad"]], [log["indicated_rad"]], [time])
    dense = SimpleNamespace(nuisances=[3.0, 5.0][not back :], nuisance_std=[0.3, 0.5][not back :])
    ratio = dual._UsedRatio(30.0, RatioEstimate(30.4, std), "")
    found = dual._beside(SimpleNamespace(dense=dense), ratio, channels)  # type: ignore[arg-type]
    wanted = {"gear_ratio": 30.0, "gear_ratio_measured": 30.4}
    wanted["gear_ratio_std"] = std if math.isfinite(std) else None  # type: ignore[assignment]
    if back:
        wanted["reversal_error_arcsec"] = pytest.approx(6.0 / ARCSEC)
        wanted["reversal_error_std_arcsec"] = pytest.approx(0.6 / ARCSEC)
    if timed:
        wanted["delay_s"], wanted["delay_std_s"] = -5.0, 0.5
    assert found == wanted


def test_the_motors_lines_are_those_of_the_first_run() -> None:
    """A ratio that is not whole: with another zero they stand elsewhere in the output's angle."""
    first, theta = swept(600, back=True)
    second, _ = swept(600, back=True, zero=2.9, seed=TOLD_SEED + 1)
    model = selfcal([first, second]).model
    left = model.correct(np.degrees(first["indicated_rad"])) - np.degrees(theta)
    assert np.std(left) * 3600.0 < 1.0
