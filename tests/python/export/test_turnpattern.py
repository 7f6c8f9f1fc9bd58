"""The pattern of a turn that targets hold: parts add up, ways come back, its own error."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.pattern import TurnPattern
from trueangle.model.terms import Backlash, LocalDefect

SEED = 55_401
UNITS = (360.0, 1.0, 2.0 * np.pi, 4096.0)
THETA = np.linspace(0.0, 1.0, 997)


def model(period, argument="reference", terms=()):
    """An output and a motor of 7 turns, in any unit; amplitudes of some arcmin."""
    unit = period / 360.0
    shafts = [
        ta.Shaft("output", 1, [1, 3], [0.02 * unit, 0.01 * unit], [0.03 * unit, -0.02 * unit]),
        ta.Shaft("motor", 7, [1, 2], [0.004 * unit, -0.002 * unit], [0.001 * unit, 0.003 * unit]),
    ]
    return ta.HarmonicModel(
        shafts, constant=0.5 * unit, period=period, argument=argument, terms=terms
    )


def defects(period):
    unit = period / 360.0
    return (
        LocalDefect(100.0 * unit, 12.0 * unit, 0.02 * unit),
        LocalDefect(200.0 * unit, 90.0 * unit, 0.01 * unit, 7.0),
    )


@pytest.mark.parametrize("period", UNITS)
def test_patterns_of_shafts_add_up_to_the_whole(period):
    """Each in turns of its own shaft, of which the output sees one in so many."""
    whole = TurnPattern(model(period, terms=defects(period)))
    parts = whole.shafts()
    assert [(name, cycles) for name, cycles, _ in parts] == [("output", 1.0), ("motor", 7.0)]
    total = sum(part.error(cycles * THETA) / cycles for _, cycles, part in parts)
    np.testing.assert_allclose(total, whole.error(THETA), atol=1e-12)
    assert np.ptp(total) > 1e-4
    assert whole.zero == pytest.approx(0.5 / 360.0)


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_reading_is_corrected_to_where_it_was_read(period, argument):
    pattern = TurnPattern(model(period, argument))
    read = pattern.reading(THETA)
    np.testing.assert_allclose(read - pattern.taken_off(read), THETA, atol=1e-11)
    np.testing.assert_allclose(
        pattern.correction(read), pattern.taken_off(read) - 0.5 / 360.0, atol=1e-12
    )
    at = THETA if argument == "reference" else read
    np.testing.assert_allclose(read - THETA, pattern.error(at) + pattern.zero, atol=1e-11)


@pytest.mark.parametrize("period", UNITS)
def test_each_way_has_its_own_side_of_the_play(period):
    """Play adds its half width one way and takes it off the other, at the same angles."""
    half = 0.01 / 360.0
    with_play = model(period, terms=(*defects(period), Backlash(half * period)))
    pattern = TurnPattern(with_play)
    assert pattern.has_direction
    assert not TurnPattern(model(period)).has_direction
    for direction in (1, -1):
        error = pattern.directed(THETA, direction)
        np.testing.assert_allclose(error, pattern.error(THETA) + direction * half, atol=1e-12)


@pytest.mark.parametrize("period", UNITS)
def test_what_is_known_of_it_is_the_scatter_of_its_draws_over_a_turn(period):
    """Coefficients drawn by their covariance: mean square over the turn, without the zero."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    root = rng.normal(size=(9, 9)) * 1e-3 * period / 360.0
    pattern = TurnPattern(model(period).replace(covariance=root @ root.T))
    x = 2.0 * np.pi * np.arange(256) / 256
    waves = [f(k * x) for k in (1, 3, 7, 14) for f in (np.cos, np.sin)]
    spread = root[1:] @ root[1:].T
    variance = np.mean(np.einsum("ki,kl,li->i", np.array(waves), spread, np.array(waves)))
    wanted = np.sqrt(variance) / period * 1_296_000.0
    assert pattern.uncertainty_arcsec == pytest.approx(wanted, rel=1e-9)
    assert TurnPattern(model(period)).uncertainty_arcsec is None


@pytest.mark.parametrize(("entries", "holds"), [(30, True), (29, True), (28, False)])
def test_a_table_holds_orders_below_half_its_entries(entries, holds):
    """Order 14 needs 29: at 28 its sine is zero at every entry."""
    pattern = TurnPattern(model(360.0))
    if holds:
        pattern.check_orders(entries, "table", 29, 64)
    else:
        with pytest.raises(ta.TrueAngleError, match=r"up to 13.* order 14: use `entries=29`"):
            pattern.check_orders(entries, "table", 29, 64)


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("turned", [0.0, 70.0, 180.0])
def test_one_order_of_two_shafts_has_the_amplitude_of_their_sum(period, turned):
    """By the spectrum of the error: in phase they add up, against each other they do not."""
    size, angle = 0.01 * period / 360.0, np.radians(turned)
    shafts = [
        ta.Shaft("output", 1, [2, 7], [0.0, size], [2.0 * size, 0.0]),
        ta.Shaft("motor", 7, [1], [1.5 * size * np.cos(angle)], [1.5 * size * np.sin(angle)]),
    ]
    pattern = TurnPattern(ta.HarmonicModel(shafts, period=period))
    grid = np.arange(64) / 64.0
    spectrum = np.abs(np.fft.rfft(pattern.error(grid))) / 32.0
    assert list(pattern.lines) == [2.0, 7.0]
    for order, amplitude in pattern.lines.items():
        assert amplitude == pytest.approx(spectrum[int(order)], rel=1e-9, abs=1e-15)
