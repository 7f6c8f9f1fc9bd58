"""Loops in torque of several elements: kept apart, and told with the errors of least squares."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.effects.torque_hysteresis import SPANS, TorqueHysteresis
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals
from trueangle.simulation import Simulation

from .test_torque_hysteresis import between, under

Array = np.ndarray
SEED = 72_000

#: Arcsec of the noise, and largest torque.
NOISE, TOP = 1.3, 10.0


@pytest.fixture(scope="module")
def signals() -> Signals:
    """Four runs whose torque turns round often, up to the largest one."""
    rng = np.random.default_rng(SEED)
    return under(*(between(0.0, TOP, *rng.uniform(-TOP, TOP, 6)) for _ in range(4)))


def fitted(signals: Signals, parts: dict[float, float], spans: list[float]) -> Regression:
    """Loops of these spans and widths in noise, and terms of the spans that are known."""
    print(f"seed {SEED}")
    error = NOISE * np.random.default_rng(SEED + 1).standard_normal(len(signals))
    error += sum(width * TorqueHysteresis.loop(signals, span) for span, width in parts.items())
    start = Regression.of(signals, error, Simulation().surroundings, rho=0.0)
    return start.with_terms([element(start, span) for span in spans])


def element(regression: Regression, span: float) -> Extension:
    columns = TorqueHysteresis.loop(regression.signals, span)[:, None]
    return regression.propose(TorqueHysteresis.kind, {"span_Nm": span}, columns, parameters=2)


@pytest.mark.parametrize("ratio", [1.2, 1.0 / 1.2])
def test_another_element_is_looked_for_apart_from_those_there_are(
    ratio: float, signals: Signals
) -> None:
    """From trial spans that are, 2.5 times and more; each is refined by 1.75 at most."""
    first = float(TOP * SPANS[4])
    regression = fitted(signals, {first: 8.0, ratio * first: 8.0}, [first])
    found = TorqueHysteresis.propose(regression)
    assert found is None or abs(np.log(found.shape["span_Nm"] / first)) > np.log(1.4)


@pytest.mark.parametrize("ratio", [4.0, 0.25])
def test_another_element_that_is_apart_is_found(ratio: float, signals: Signals) -> None:
    regression = fitted(signals, {2.0: 6.0, 2.0 * ratio: 5.0}, [2.0])
    found = TorqueHysteresis.propose(regression)
    assert found is not None
    assert found.shape["span_Nm"] == pytest.approx(2.0 * ratio, rel=0.15)
    assert found.parameters == 2
    assert found.bic_gain > 100.0
    # Beside three there is none.
    full = fitted(signals, {2.0: 6.0, 2.0 * ratio: 5.0}, [2.0, 0.1, 30.0])
    assert TorqueHysteresis.propose(full) is None
    # Friction of the other sign there would be the difference of two springs.
    opposed = fitted(signals, {2.0: 6.0, 2.0 * ratio: -5.0}, [2.0])
    assert TorqueHysteresis.propose(opposed) is None


@pytest.mark.parametrize(
    "parts", [{2.0: 6.0}, {0.5: -5.0, 3.0: -6.0}, {0.4: 3.0, 2.0: 6.0, 8.0: 4.0}]
)
def test_what_is_told_of_elements_is_what_least_squares_says(
    parts: dict[float, float], signals: Signals
) -> None:
    """Width of all; span by their widths; errors of widths and spans jointly with the base."""
    regression = fitted(signals, parts, [*parts])
    fit = enumerate(regression.fitted())
    terms = [(term, c, regression.covariance(k)) for k, (term, c) in fit]
    told, effects = TorqueHysteresis.report(regression, terms)
    widths = np.array([float(c[0]) for _, c, _ in terms])
    spans = np.array([*parts])
    loops = [TorqueHysteresis.loop(signals, span) for span in parts]
    tangents = [
        width * (TorqueHysteresis.loop(signals, span * 1.001) - loop) / (0.001 * span)
        for span, width, loop in zip(parts, widths, loops, strict=True)
    ]
    design = np.column_stack([regression.base, *loops, *tangents])
    covariance = NOISE**2 * np.linalg.inv(design.T @ design)
    n, first = len(parts), regression.base.shape[1]
    of_widths = np.zeros(design.shape[1])
    of_widths[first : first + n] = 1.0
    of_spans = np.zeros(design.shape[1])
    of_spans[first + n :] = np.abs(widths) / np.abs(widths).sum()
    width, span = told["half_width_arcsec"], told["span_Nm"]
    assert width.value == pytest.approx(widths.sum())
    assert span.value == pytest.approx(of_spans[first + n :] @ spans)
    # The noise is that of the readings: known to 1/sqrt(2 n).
    for entry, along in ((width, of_widths), (span, of_spans)):
        assert entry.std == pytest.approx(float(np.sqrt(along @ covariance @ along)), rel=0.08)
    assert effects == [TorqueHysteresis(*pair) for pair in zip(widths, spans, strict=True)]
    assert ("element_spans_Nm" in told) == ("element_half_widths_arcsec" in told) == (n > 1)
    if n > 1:
        assert told["element_spans_Nm"].value == pytest.approx([*parts])
        assert told["element_half_widths_arcsec"].value == pytest.approx(widths.tolist())
