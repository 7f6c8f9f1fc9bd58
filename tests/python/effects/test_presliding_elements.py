"""Wind-ups of several lengths: kept apart, of one sign, told with the errors of least squares."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import Backlash, PreslidingHysteresis
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Simulation

Array = np.ndarray
SEED = 85_000
NOISE = 0.6


@pytest.fixture(scope="module")
def signals() -> Signals:
    """Four runs that turn round often, at places that differ."""
    rng = np.random.default_rng(SEED)
    runs = []
    for k in range(4):
        corners = np.cumsum(rng.uniform(30.0, 120.0, 7) * np.resize([1.0, -1.0], 7))
        theta = 90.0 * k + np.interp(np.linspace(0.0, 6.0, 700), np.arange(7.0), corners)
        runs.append(ta.CalibrationRun(theta, theta, 360.0, label=f"run {k}"))
    return join_runs(runs)


def element(regression: Regression, length: float) -> Extension:
    shape = {"length_deg": length} | ({"start_state": 0.0} if length else {})
    columns = PreslidingHysteresis.columns(regression.signals, regression.around, shape)
    return regression.propose(PreslidingHysteresis.kind, shape, columns, 2)


def fitted(signals: Signals, parts: dict[float, float], lengths: list[float]) -> Regression:
    """Elements of these lengths and amplitudes in noise, and terms of the lengths known."""
    print(f"seed {SEED}")
    error = NOISE * np.random.default_rng(SEED + 1).standard_normal(len(signals))
    for length, size in parts.items():
        error += size * (signals.presliding(length, 0.0) if length else signals.direction)
    start = Regression.of(signals, error, Simulation().surroundings, rho=0.0)
    return start.with_terms([element(start, length) for length in lengths])


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        ({3.0: 4.0}, 3.0),
        ({3.0: -4.0}, None),  # the reference has play: friction leads nowhere
        ({3.0: 4.0, 20.0: 3.0}, 20.0),
        ({3.0: 4.0, 0.8: 3.0}, 0.8),
        ({3.0: 4.0, 4.5: 3.0}, None),
        ({3.0: 4.0, 0.0: 2.0}, 0.0),
        ({3.0: 4.0, 20.0: -3.0}, None),
    ],
)
def test_a_further_element_is_apart_from_those_there_are_and_of_their_sign(
    parts: dict[float, float], found: float | None, signals: Signals
) -> None:
    """By 2.5 times, or play, which has no length; and three at most."""
    known = [length for length in (3.0,) if len(parts) > 1]
    proposal = PreslidingHysteresis.propose(fitted(signals, parts, known))
    if found is None:
        # Of two that are not apart at best play stands for what the length misses.
        assert proposal is None or proposal.shape["length_deg"] == 0.0
        return
    assert proposal is not None
    assert proposal.shape["length_deg"] == pytest.approx(found, rel=0.15)
    full = fitted(signals, parts, [3.0, 0.2, 50.0] if len(parts) > 1 else [0.1, 0.2, 50.0])
    assert PreslidingHysteresis.propose(full) is None


@pytest.mark.parametrize("parts", [{3.0: 4.0}, {3.0: 4.0, 25.0: 2.0}, {20.0: -2.0, 1.0: -5.0},
                                   {0.0: 2.0, 12.0: 3.0}, {0.0: 4.0, 12.0: 3.0}])  # fmt: skip
def test_what_is_told_of_elements_is_what_least_squares_says(
    parts: dict[float, float], signals: Signals
) -> None:
    """Amplitude of all; length by their amplitudes, known as that of the strongest one is."""
    regression = fitted(signals, parts, [*parts])
    fits = enumerate(regression.fitted())
    terms = [(term, c, regression.covariance(k)) for k, (term, c) in fits]
    told, effects = PreslidingHysteresis.report(regression, terms)
    sizes = np.array([float(c[0]) for _, c, _ in terms])
    lengths = np.array([*parts])
    columns, tangents = [], {}
    for length, size in zip(parts, sizes.tolist(), strict=True):
        columns.append(signals.presliding(length, 0.0) if length else signals.direction)
        if length:
            moved = signals.presliding(length * 1.001, 0.0)
            tangents[length] = size * (moved - columns[-1]) / (0.001 * length)
    design = np.column_stack([regression.base, *columns, *tangents.values()])
    covariance = NOISE**2 * np.linalg.inv(design.T @ design)
    first, n = regression.base.shape[1], len(parts)
    of_all = np.zeros(design.shape[1])
    of_all[first : first + n] = 1.0
    amplitude, length = told["amplitude_arcsec"], told["length_deg"]
    assert amplitude.value == pytest.approx(sizes.sum())
    assert amplitude.std == pytest.approx(float(np.sqrt(of_all @ covariance @ of_all)), rel=0.1)
    weights = np.abs(sizes) / np.abs(sizes).sum()
    assert length.value == pytest.approx(weights @ lengths)
    strongest = lengths[int(np.argmax(np.abs(sizes)))]
    if strongest:
        at = first + n + [*tangents].index(strongest)
        assert length.std == pytest.approx(float(np.sqrt(covariance[at, at])), rel=0.1)
    else:
        assert length.std is None
    assert effects == [
        PreslidingHysteresis(size, at, 0.0) if at else Backlash(size)
        for size, at in zip(sizes.tolist(), parts, strict=True)
    ]
    assert ("element_lengths_deg" in told) == ("element_amplitudes_arcsec" in told) == (n > 1)
    if n > 1:
        assert told["element_lengths_deg"].value == pytest.approx([*parts])
        assert told["element_amplitudes_arcsec"].value == pytest.approx(sizes.tolist())


def test_a_length_is_known_by_no_more_than_was_searched(signals: Signals) -> None:
    """Of a wind-up in noise as large as itself, too: 60 degrees at most."""
    regression = fitted(signals, {40.0: 0.01}, [40.0])
    ((term, c),) = regression.fitted()
    told, _ = PreslidingHysteresis.report(regression, [(term, c * 1e-6, regression.covariance(0))])
    assert told["length_deg"].std == 60.0
