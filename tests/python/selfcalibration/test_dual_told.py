"""What two encoders leave blind, what is noted of their motion, and which parts predict others."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.runs.travel import Span
from trueangle.selfcalibration import dual
from trueangle.selfcalibration.dualfit import RatioEstimate
from trueangle.selfcalibration.gearlines import GearedChannels, SharedLine

SEED = 68_400
OUTPUT, MOTOR, BOTH = SharedLine(2.0, 2, 0), SharedLine(60.0, 0, 2), SharedLine(30.0, 30, 1)


def swept(size: int, back: bool, ratio: float = 30.37, zero: float = 1.1, seed: int = SEED):
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
    second, _ = swept(600, back=True, zero=2.9, seed=SEED + 1)
    model = selfcal([first, second]).model
    left = model.correct(np.degrees(first["indicated_rad"])) - np.degrees(theta)
    assert np.std(left) * 3600.0 < 1.0
