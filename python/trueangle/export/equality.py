"""Whether two models differ by more than their readings' noise: a test at a stated level."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from ..estimation.linear import wald_statistic
from ..model.model import HarmonicModel
from ..support.arrays import Array
from ..support.distributions import f_tail

#: Probability that two calibrations of one pattern are reported to differ.
FALSE_ALARMS: Final = 0.01


class Equality(NamedTuple):
    """``statistic`` is T^2 over the tested orders, ``p`` its p-value under noise alone."""

    verdict: Literal["same", "changed"]
    p: float
    statistic: float
    orders: int


def pattern_equality(first: HarmonicModel, second: HarmonicModel) -> Equality | None:
    """Hotelling's statistic of the orders that both models have.

    ::

        T² = (b₂ - b₁)' (S₁ + S₂)⁻¹ (b₂ - b₁),    T² / 2K ~ F(2K, ν)

    with the degrees of freedom of both residual variances together (Satterthwaite). A covariance
    from the scatter of few runs is known neither in size nor in shape: each order is then tested
    separately,

    ::

        T_k² (ν - 1) / 2ν ~ F(2, ν - 1),    p = 1 - (1 - min_k p_k)^K

    (Hotelling 1931; Sidak 1967). An order that
    one of them lacks was chosen by its size in the other: it is tested by itself, with twice its
    covariance (the other's readings determine it as well) and its p-value multiplied by the number
    of orders that a selection tests. The zero, which mounting moves, is excluded.

    Returns
    -------
    Equality or None
        None where no order is common, or a covariance is missing.

    Examples
    --------
    >>> import trueangle as ta
    >>> shaft = lambda a: ta.Shaft("output", 1, [1], [a], [0.0])
    >>> known = np.diag([0.0, 1e-4, 1e-4])
    >>> one, other = (ta.HarmonicModel([shaft(a)], covariance=known) for a in (0.5, 0.52))
    >>> found = pattern_equality(one, other)
    >>> found.verdict, round(found.p, 3)
    ('same', 0.368)
    """
    if first.covariance is None or second.covariance is None:
        return None
    sides = [_coefficients(model) for model in (first, second)]
    common = [order for order in sides[0] if order in sides[1]]
    if not common:
        return None
    values, spreads, weights = [], [], []
    for model, places in zip((first, second), sides, strict=True):
        at = [i for order in common for i in places[order][0]]
        values.append(np.array([v for order in common for v in places[order][1]]) / model.period)
        spread = np.asarray(model.covariance)[np.ix_(at, at)] / model.period**2
        spreads.append(spread)
        weights.append((float(np.trace(spread)), _freedom(model)))
    whole = spreads[0] + spreads[1]
    scale = np.sqrt(np.diag(whole))
    if not (scale > 0.0).all():
        return None
    scaled = whole / np.outer(scale, scale)
    # Least pivot of the covariance, its rows scaled, with which it is inverted.
    if float(np.linalg.eigvalsh(scaled)[0]) < 1e-10:
        return None
    apart = (values[1] - values[0]) / scale
    statistic = wald_statistic(apart, scaled)
    every = sum(trace for trace, _ in weights) ** 2
    doubt = sum(trace**2 / freedom for trace, freedom in weights)
    freedom = every / doubt if doubt > 0.0 else math.inf
    # Beyond this F is chi-squared to rounding.
    freedom = min(freedom, 1e9)
    scattered = any(m.fit is not None and m.fit.freedom is not None for m in (first, second))
    if scattered:
        p = _by_orders(apart, scaled, freedom)
    else:
        p = f_tail(statistic / apart.size, float(apart.size), freedom)
    for model, places in zip((first, second), sides, strict=True):
        for order in places.keys() - set(common):
            rows, pair = places[order]
            spread = np.asarray(model.covariance)[np.ix_(rows, rows)]
            if float(np.linalg.det(spread)) > 0.0:
                alone = wald_statistic(np.array(pair), 2.0 * spread)
                chance = _pair_tail if scattered else _known_tail
                # Factor on the p-value of a single order: the orders that a selection tests in two
                # models.
                p = min(p, 220 * chance(alone, freedom))
    return Equality("changed" if p <= FALSE_ALARMS else "same", p, statistic, len(common))


def _by_orders(apart: Array, scaled: Array, freedom: float) -> float:
    """P-value of the order that differs most, with a covariance of unknown size and shape."""
    orders = apart.size // 2
    pairs = [slice(2 * i, 2 * i + 2) for i in range(orders)]
    least = min(_pair_tail(wald_statistic(apart[p], scaled[p, p]), freedom) for p in pairs)
    return -math.expm1(orders * math.log1p(-least)) if least < 1.0 else 1.0


def _pair_tail(squares: float, freedom: float) -> float:
    """P-value of Hotelling's T² of two numbers; ``freedom`` is that of their covariance."""
    # Fewest degrees of freedom of a scatter: fewer contain no information.
    left = max(freedom - 1.0, 0.1)
    return f_tail(squares * left / (2.0 * freedom), 2.0, left)


def _known_tail(squares: float, freedom: float) -> float:
    """The same for a covariance that is known except for its size."""
    return f_tail(squares / 2.0, 2.0, freedom)


def _coefficients(model: HarmonicModel) -> dict[float, tuple[tuple[int, int], tuple[float, float]]]:
    """Rows of the covariance, cosine and sine of each output order; those given twice omitted."""
    found: dict[float, tuple[tuple[int, int], tuple[float, float]]] = {}
    twice = set()
    at = 1
    for shaft in model.shafts:
        for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
            order = k * shaft.cycles_per_turn
            if order in found:
                twice.add(order)
            found[order] = (at, at + 1), (a, b)
            at += 2
    return {order: rows for order, rows in found.items() if order not in twice}


def _freedom(model: HarmonicModel) -> float:
    """Of the covariance, or readings less unknowns; infinite where the model states neither."""
    if model.fit is None:
        return math.inf
    if model.fit.freedom is not None:
        return model.fit.freedom
    unknowns = np.asarray(model.covariance).shape[0] - 1
    return max(float(model.fit.samples - model.fit.wild - model.fit.runs - unknowns), 1.0)
