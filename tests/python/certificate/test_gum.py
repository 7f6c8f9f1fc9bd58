"""The examples of JCGM 100:2008 (GUM), annex H, to the digits printed there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike

from trueangle.certificate import Budget, Contribution, Estimates
from trueangle.certificate.budget import coverage_factor
from trueangle.errors import ArgumentError

VOLT = [5.007, 4.994, 5.005, 4.990, 4.999]
MILLIAMPERE = [19.663, 19.639, 19.640, 19.685, 19.678]
PHASE = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433]


def test_h1_end_gauge() -> None:
    budget = Budget(
        (
            Contribution("standard", 25.0, degrees_of_freedom=18),
            Contribution("difference", 9.7, "A", "t", 25.6),
            Contribution("difference of expansion", 2.9, degrees_of_freedom=50),
            Contribution("difference of temperature", 16.6, degrees_of_freedom=2),
        )
    )
    assert round(budget.standard) == 32
    assert math.floor(budget.degrees_of_freedom) == 16
    assert round(coverage_factor(budget.degrees_of_freedom, 0.99), 2) == 2.92
    assert abs(coverage_factor(budget.degrees_of_freedom, 0.99) * 32 - 93) < 0.5


def means_of(observations: ArrayLike) -> Estimates:
    """Means of simultaneous observations, a row each (Type A, JCGM 100, 4.2 and 5.2.3)."""
    sets = np.asarray(observations)
    covariance = np.cov(sets, rowvar=False) / len(sets)
    return Estimates(sets.mean(axis=0), covariance, len(sets) - 1.0)


def test_h2_resistance_and_reactance() -> None:
    means = means_of(np.column_stack([VOLT, MILLIAMPERE, PHASE]))
    assert [round(float(v), d) for v, d in zip(means.values, (4, 4, 5), strict=True)] == [
        4.9990,
        19.6610,
        1.04446,
    ]
    assert [round(float(u), d) for u, d in zip(means.standard, (4, 4, 5), strict=True)] == [
        0.0032,
        0.0095,
        0.00075,
    ]
    r = means.correlation
    assert [round(float(x), 2) for x in (r[0, 1], r[0, 2], r[1, 2])] == [-0.36, 0.86, -0.65]

    _is_printed(means.through(_impedance))


def test_h2_from_the_single_observations() -> None:
    # H.2.4, table H.4: resistance, reactance and impedance of every set, then their means.
    sets = [_impedance(np.array(x)) for x in zip(VOLT, MILLIAMPERE, PHASE, strict=True)]
    found = means_of(sets)
    _is_printed(found)
    assert [round(float(u), 3) for u in found.standard] == [0.071, 0.295, 0.236]


def _impedance(x: np.ndarray) -> list[float]:
    size = x[0] / (1e-3 * x[1])
    return [size * math.cos(x[2]), size * math.sin(x[2]), size]


def _is_printed(found: Estimates) -> None:
    """Tables H.3 and H.4. Unrounded, the first way gives 0.29558 where 0.295 is printed."""
    assert [round(float(v), 3) for v in found.values] == [127.732, 219.847, 254.260]
    assert np.abs(found.standard - [0.071, 0.295, 0.236]).max() < 0.0006
    r = found.correlation
    assert [round(float(x), 3) for x in (r[0, 1], r[0, 2], r[1, 2])] == [-0.588, -0.485, 0.993]


def test_h3_thermometer() -> None:
    t = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
    b = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160]
    design = np.column_stack([np.ones(11), np.array(t) - 20.0])
    line, rest, *_ = np.linalg.lstsq(design, np.array(b), rcond=None)
    covariance = float(rest[0]) / 9.0 * np.linalg.inv(design.T @ design)
    fitted = Estimates(line, covariance, 9.0)
    assert round(float(line[0]), 4) == -0.1712
    assert round(float(line[1]), 5) == 0.00218
    assert round(float(fitted.standard[0]), 4) == 0.0029
    assert round(float(fitted.standard[1]), 5) == 0.00067
    assert round(float(fitted.correlation[0, 1]), 3) == -0.930
    at = fitted.through(lambda x: [x[0] + 10.0 * x[1]])
    assert round(float(at.values[0]), 4) == -0.1494
    assert round(float(at.standard[0]), 4) == 0.0041
    assert at.degrees_of_freedom == 9.0


def test_no_contribution_is_no_uncertainty() -> None:
    empty = Budget(())
    assert (empty.standard, empty.expanded, empty.degrees_of_freedom) == (0.0, 0.0, math.inf)


@pytest.mark.parametrize(
    ("name", "allowed", "refused"),
    [
        ("standard", [0.0, 1e-9, 3.0], [-1e-9, math.nan, math.inf]),
        ("degrees_of_freedom", [0.5, 9.0, math.inf], [0.0, -1.0, math.nan]),
        ("sensitivity", [-2.0, 0.0, 1.0], [math.nan, math.inf, -math.inf]),
    ],
)
def test_numbers_of_a_contribution(name: str, allowed: list[float], refused: list[float]) -> None:
    """A budget of any that is allowed is one of numbers; a sensitivity of nan was let through."""
    for value in allowed:
        line = Contribution("a", **{"standard": 2.0, name: value})
        budget = Budget((line, Contribution("b", 1.0)))
        assert budget.standard == pytest.approx(math.hypot(line.sensitivity * line.standard, 1.0))
        assert math.isfinite(budget.expanded)
        assert sum(budget.shares()) == pytest.approx(100.0)
    for value in refused:
        with pytest.raises(ArgumentError, match=r"^contribution 'a': "):
            Contribution("a", **{"standard": 2.0, name: value})
