"""What searches share: known orders, lines from pairs, golden maxima, signs, joint covariances."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..estimation.extension import Extension
from ..estimation.linear import pseudo_inverse
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .ambiguity import Ambiguity

Array: TypeAlias = NDArray[np.float64]

#: A chosen term with its coefficients and their covariance.
Fitted: TypeAlias = tuple[Extension, Array, Array]

#: Periods over the travel below which there is no line.
HALF = 0.5

#: Correlations of the noise that are one.
SAME_CORRELATION = 0.02

#: Share of the largest derivative below which one is rounding, and the variance then reported.
ROUNDED, UNKNOWN = 1e-12, 1e24

_GOLDEN = (5.0**0.5 - 1.0) / 2.0


def line_parameters(coefficients: Array, covariance: Array) -> tuple[float, float, float, float]:
    """Amplitude, phase (deg) and their standard deviations of ``A cos + B sin``."""
    a, b = float(coefficients[0]), float(coefficients[1])
    amplitude = float(np.hypot(a, b))
    phase = float(np.degrees(np.arctan2(a, b)) % 360.0)
    if amplitude == 0.0:
        return 0.0, phase, float(np.sqrt(covariance[0, 0])), 180.0
    along = np.array([a, b]) / amplitude
    across = np.array([b, -a]) / amplitude
    std = float(np.sqrt(along @ covariance @ along))
    turn = float(np.degrees(np.sqrt(across @ covariance @ across) / amplitude))
    return amplitude, phase, std, min(turn, 180.0)


def line_quantities(rows: Iterable[Sequence[float]], amplitudes: str = "amplitudes") -> Parameters:
    """Lines (order and `line_parameters`) as parameters of a finding."""
    orders, sizes, phases, stds, phase_stds = zip(*rows, strict=True)
    return {
        "orders": quantity(orders),
        amplitudes: quantity(sizes, stds),
        "phases_deg": quantity(phases, phase_stds),
    }


def golden_maximum(
    function: Callable[[float], float], low: float, high: float, steps: int = 14
) -> tuple[float, float]:
    """Place and value of the maximum of a function with one peak in [low, high]."""
    a, b = low, high
    c, d = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
    fc, fd = function(c), function(d)
    for _ in range(steps):
        if fc > fd:
            b, d, fd = d, c, fc
            c = b - _GOLDEN * (b - a)
            fc = function(c)
        else:
            a, c, fc = c, d, fd
            d = a + _GOLDEN * (b - a)
            fd = function(d)
    return (c, fc) if fc > fd else (d, fd)


def is_of_one_sign(regression: Regression, extension: Extension) -> bool:
    """With this term all elements of its cause have one sign, as springs have.

    Elements of different signs would only be a difference of two equal ones.
    """
    after = regression.coefficients_with(extension)
    elements = [float(extension.coefficients[0])]
    at = regression.base.shape[1]
    for term in regression.terms:
        if term.cause == extension.cause:
            elements.append(float(after[at]))
        at += term.columns.shape[1]
    return min(elements) * max(elements) > 0.0


def known_orders(around: JointPattern) -> list[float]:
    """Orders of the pattern and those that gears and encoders are known to have."""
    joint = around.joint
    orders = {float(m) for m in around.pattern.orders}
    orders |= {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    return sorted(orders)


def shows_line(signals: Signals, orders: Array) -> NDArray[np.bool_]:
    """Orders for which a run travels far enough to show a line.

    Less than half a period is like any slow curve.
    """
    return np.asarray(orders * signals.run_turns().max() >= HALF)


def is_gear_order(around: JointPattern, order: float) -> bool:
    """An order of the motor or the wave generator."""
    named = around.joint.name_order(order)
    return named is not None and named[0] != "output"


def grid_ambiguity(regression: Regression, spots: Sequence[Ambiguity]) -> Ambiguity | None:
    """On a grid of positions: lines behind aliases, which change from run to run as noise does."""
    if regression.signals.grid is None:
        return None
    return next((spot for spot in spots if spot.factor == "grid"), None)


def seen_beside(regression: Regression, extension: Extension) -> Regression | None:
    """The regression with the noise and the outliers found when an extension is fitted.

    Without a large one its form is confused with correlated noise and its ends with outliers, so
    that its shape is estimated wrongly. None where the noise is the same.
    """
    full = regression.with_terms([*regression.terms, extension])
    if abs(full.whiten.rho - regression.whiten.rho) < SAME_CORRELATION:
        return None
    return regression.with_terms(regression.terms, full.whiten.rho).of_target(full.target)


def tangent_covariance(regression: Regression, terms: Sequence[Fitted], tangents: Array) -> Array:
    """Covariance of coefficients and shape parameters that are estimated jointly.

    ``tangents`` are the derivatives of the signal by the coefficients of the terms first, then
    by the parameters of their shapes, at the estimate; everything else of the regression is
    projected out. What widens the given covariance of the coefficients (runs that differ, form
    errors) widens that of the shapes in the same measure.
    """
    chosen = [extension for extension, _, _ in terms]
    others = [term for term in regression.terms if all(term is not one for one in chosen)]
    # Under the noise found with these terms: without them what they explain looks correlated.
    x, _ = regression.with_terms(others, regression.whiten.rho).projected(tangents)
    # Each of length 1: what the readings hardly determine has a large variance, and not none.
    sizes = np.sqrt(np.einsum("ij,ij->j", x, x))
    seen = sizes > ROUNDED * sizes.max(initial=0.0)
    x = np.where(seen, x / np.where(seen, sizes, 1.0), 0.0)
    sizes = np.where(seen, sizes, np.inf)
    information = x.T @ x
    count = sum(len(coefficients) for _, coefficients, _ in terms)
    given = sum(float(np.trace(covariance)) for _, _, covariance in terms)
    own = pseudo_inverse(information[:count, :count]) / np.outer(sizes[:count], sizes[:count])
    joint = pseudo_inverse(information) / np.outer(sizes, sizes)
    found = np.asarray(given / float(np.trace(own)) * joint, dtype=np.float64)
    found[~seen, ~seen] = UNKNOWN
    return found
