"""Partial travel: spans, penalties, and amplitudes that stay small."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.travel import covered_span


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        (np.arange(0, 360, 10.0), (0.0, 360.0, True)),
        (np.arange(0, 360, 60.0), (0.0, 360.0, True)),
        (np.linspace(10, 200, 191), (10.0, 200.0, False)),
        (np.linspace(-100, 90, 191), (260.0, 450.0, False)),
        (np.linspace(0, 339, 340), (0.0, 339.0, False)),
        (np.linspace(0, 341, 342), (0.0, 360.0, True)),
        (np.linspace(0, 190, 191) + 3600.0, (0.0, 190.0, False)),
    ],
)
def test_span(angles, expected):
    assert covered_span([angles], 360.0) == pytest.approx(expected)


@pytest.mark.parametrize("arc", [90.0, 190.0, 270.0])
@pytest.mark.parametrize("runs", [1, 3])
def test_an_arc_gives_a_usable_model_with_small_amplitudes(arc, runs):
    """True error: not a harmonic series, 0.5 deg; noise 0.1 deg."""

    def truth(x):
        return 0.5 * np.tanh(3 * np.sin(np.radians(x - 20.0))) + 0.2 * np.cos(np.radians(2 * x))

    rng = np.random.default_rng(21)
    data = []
    for _ in range(runs):
        x = rng.uniform(0, arc, 300)
        data.append(ta.CalibrationRun(x, x + truth(x) + 0.1 * rng.normal(size=300) + 5.0, 360.0))
    result = ta.fit(data, orders=range(1, 9))
    inside = np.linspace(0, arc, 400)
    difference = result.model.error(inside) - truth(inside)
    # As good as the noise of one reading, everywhere on the arc.
    assert difference.std() < 0.1
    assert result.model.amplitudes.sum() < 5.0
    assert result.model.partial_span == pytest.approx((0.0, arc), abs=5.0)
    assert any("extrapolated" in note for note in result.notes)


def test_a_full_turn_is_never_penalised():
    theta = np.arange(0.0, 360.0, 5.0)
    run = ta.CalibrationRun(theta, theta + np.sin(np.radians(theta)), 360.0)
    assert ta.fit(run, orders=range(1, 9)).ridge == 0.0


def test_a_given_penalty_is_kept_and_zero_means_none():
    x = np.linspace(0, 200, 300)
    rng = np.random.default_rng(1)
    run = ta.CalibrationRun(x, x + np.sin(np.radians(x)) + 0.1 * rng.normal(size=300), 360.0)
    assert ta.fit(run, orders=range(1, 5), ridge=0.01).ridge == 0.01
    wild = ta.fit(run, orders=range(1, 7), ridge=0.0)
    tame = ta.fit(run, orders=range(1, 7))
    assert wild.condition_number > 1e3
    assert tame.model.amplitudes.sum() < wild.model.amplitudes.sum()
