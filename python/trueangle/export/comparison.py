"""Difference of two models, before and after a repair, and whether it is more than noise."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from os import PathLike
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..estimation.linear import wald_statistic
from ..model.file import load_model
from ..model.model import HarmonicModel
from ..support.angles import ARCSEC_PER_TURN, wrap, zero_text
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.distributions import f_tail
from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult
from .pattern import TurnPattern

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
    values, weights, whole = [], [], np.zeros((2 * len(common), 2 * len(common)))
    for model, places in zip((first, second), sides, strict=True):
        at = [i for order in common for i in places[order][0]]
        values.append(np.array([v for order in common for v in places[order][1]]) / model.period)
        spread = np.asarray(model.covariance)[np.ix_(at, at)] / model.period**2
        whole += spread
        weights.append((float(np.trace(spread)), _freedom(model)))
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
    # Beyond this F is chi-squared to rounding.
    freedom = min(every / doubt, 1e9) if doubt > 0.0 else 1e9
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
                chance = _pair_tail(alone, freedom) if scattered else f_tail(alone / 2, 2, freedom)
                # Factor on the p-value of a single order: the orders that a selection tests in two
                # models.
                p = min(p, 220 * chance)
    return Equality("changed" if p <= FALSE_ALARMS else "same", p, statistic, len(common))


def _by_orders(apart: Array, scaled: Array, freedom: float) -> float:
    """P-value of the order that differs most, with a covariance of unknown size and shape."""
    pairs = [slice(i, i + 2) for i in range(0, apart.size, 2)]
    least = min(_pair_tail(wald_statistic(apart[p], scaled[p, p]), freedom) for p in pairs)
    return -math.expm1(len(pairs) * math.log1p(-least)) if least < 1.0 else 1.0


def _pair_tail(squares: float, freedom: float) -> float:
    """P-value of Hotelling's T² of two numbers; ``freedom`` is that of their covariance."""
    # Fewest degrees of freedom of a scatter: fewer contain no information.
    left = max(freedom - 1.0, 0.1)
    return f_tail(squares * left / (2.0 * freedom), 2.0, left)


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


#: Orders that a summary lists.
_LISTED = 12


@dataclass(frozen=True)
class Comparison(PlainResult):
    """Second model less first, in what they correct.

    Attributes
    ----------
    orders : list of dict
        ``{"order", "amplitude_arcsec", "phase_deg", "std_arcsec", "model"}`` of the difference
        of the errors, ``C sin(order * angle + phase)``; ``std_arcsec`` is of the amplitude in any
        one phase, None where neither model states a covariance; ``model`` is "A" or "B" where only
        the first or the second has the order, else "both".
    rms_arcsec, max_abs_arcsec : float
        Of the difference over the turn, or what both were fitted on, its zero taken out.
    std_arcsec : float or None
        Standard deviation of the difference over the same, from the covariances of both; None
        where neither states one. Over a turn it is without the zero, which readings of a part
        of it do not separate from the orders.
    each_std_arcsec : list of float or None
        The same of the first and of the second model.
    zero_deg : float
        Difference of the constants.
    argument : str
        Its angle: the reading where one of them was read from a table that
        is looked up there, which knows no other zero.
    table_rms_arcsec, table_max_abs_arcsec : float or None
        What tables that were read add to their models by interpolation between their entries and
        by whole numbers, at most; None where neither model was read from a table.
    differ_in : list of str
        Terms that only one of them has, or with other parameters: not compared.
    verdict : {"same", "changed"} or None
        Whether they differ by more than the noise of their readings, in the orders that both
        have and without the zero; None where that cannot be determined: a model without a
        covariance, or with another argument.
    p : float or None
        Probability of as large a difference between two calibrations of one pattern.
    false_alarms : float
        Below which ``p`` is "changed": the share of unchanged patterns that are reported as
        changed.
    share : float
        Of the turn that both were fitted on: what it is measured over.
    """

    orders: list[dict[str, Any]]
    rms_arcsec: float
    max_abs_arcsec: float
    std_arcsec: float | None
    each_std_arcsec: list[float | None]
    zero_deg: float
    argument: str
    differ_in: list[str]
    table_rms_arcsec: float | None = None
    table_max_abs_arcsec: float | None = None
    verdict: Literal["same", "changed"] | None = None
    p: float | None = None
    false_alarms: float = FALSE_ALARMS
    share: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """All attributes."""
        return dict(vars(self))

    def _brief(self) -> str:
        return (
            f"{self.rms_arcsec:.4g} arcsec rms, {self.max_abs_arcsec:.4g} max abs, "
            f"{counted(self.orders, 'order')}"
        )

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The numbers as lines of text.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """
        unit = error_unit(errors_in, self.max_abs_arcsec)
        lines = [
            *self._verdict(unit),
            f"Largest difference {unit.text(self.max_abs_arcsec)}; zero of B minus zero of A "
            f"{zero_text(self.zero_deg, 360.0)} (not tested).",
            *self._arithmetic(unit),
            f"  order  {f'amplitude/{unit.name}':>16}  phase/deg  {f'+-/{unit.name}':>10}",
        ]
        # The largest first, and as many as a screen holds: of a table read back there are hundreds.
        largest = sorted(self.orders, key=lambda row: -(row["amplitude_arcsec"] or 0.0))
        for row in largest[:_LISTED]:
            amplitude, spread = row["amplitude_arcsec"] or 0.0, row["std_arcsec"]
            size, std = unit.pair(amplitude, spread)
            # Part of an amplitude below which its standard error is that of rounded numbers.
            if spread is not None and 0.0 < spread < 1e-6 * amplitude:
                # What rounding alone leaves open is no reason to print nine digits.
                size, std = unit.number(amplitude), f"{spread * unit.per_arcsec:.1g}"
            lines.append(f"{row['order']:7g}  {size:>16}  {row['phase_deg']:9.1f}  {std:>10}")
        if len(largest) > _LISTED:
            lines.append(f"  ... and {len(largest) - _LISTED} smaller ones")
        lines += [f"not compared: {kind}" for kind in self.differ_in]
        return laid_out(lines)

    def _verdict(self, unit: ErrorUnit) -> list[str]:
        """Whether the models differ, by how much, and which of them to use."""
        part = "the turn" + f", where both were fitted ({self.share:.0%})" * (self.share < 1.0)
        size = f"{unit.text(self.rms_arcsec)} rms over {part}"
        if self.verdict is None or self.p is None:
            return [f"Difference {size}; not tested: that needs the covariance of both models."]
        a, b = (std or 0.0 for std in self.each_std_arcsec)
        first = f"No significant difference: {size}."
        use = "Use either." if a == b else f"Use {'BA'[a < b]}, the more certain one."
        if self.verdict == "changed":
            first = f"Changed: {'; '.join([*self._moved(unit), size])}."
            # Where the difference is less than what either is uncertain by, that one is no judge.
            if max(a, b) < self.rms_arcsec:
                use = "To see which one fits today: trueangle watch READINGS -m A, then B."
        known = f"Standard error of the curves: {unit.text(a)} rms of A, {unit.text(b)} of B."
        p = "< 1e-12" if self.p < 1e-12 else f"= {self.p:.2g}"
        p = f"p {p}: probability of such a difference if only noise differs; a change is reported"
        return [first, f"{use} {known}", f"{p} below {self.false_alarms:g}."]

    def _moved(self, unit: ErrorUnit) -> list[str]:
        """The orders that differ by more than three standard errors, the clearest first."""
        rows = (row for row in self.orders if row["std_arcsec"] and row["amplitude_arcsec"])
        clearest = sorted(rows, key=lambda row: row["std_arcsec"] / row["amplitude_arcsec"])[:3]
        return [
            f"order {row['order']:g} by {unit.text(row['amplitude_arcsec'], row['std_arcsec'])}"
            + f" (in {row['model']} only)" * (row["model"] != "both")
            for row in clearest
            if row["amplitude_arcsec"] > 3.0 * row["std_arcsec"]
        ]

    def _arithmetic(self, unit: ErrorUnit) -> list[str]:
        if self.table_max_abs_arcsec is None or self.table_rms_arcsec is None:
            return []
        sizes = f"{unit.text(self.table_max_abs_arcsec)}, {unit.number(self.table_rms_arcsec)} rms"
        return [f"Interpolation and whole numbers of the table add at most {sizes}."]


@told_kinds
def compare(
    a: HarmonicModel | str | PathLike[str], b: HarmonicModel | str | PathLike[str]
) -> Comparison:
    """Difference of two models per order and over the turn, with its uncertainty.

    ::

        Δ(θ) = ε_b(θ) - ε_a(θ)

    at the true angle, also of a model whose argument is the indicated one. Where one of them was
    read from a table that is looked up at the reading r, whose true angle has an unknown zero,

    ::

        Δ(r) = θ_a(r) - θ_b(r)

    with its mean taken out: two corrections of one device, with any zeros. Where one of
    them is of a reversed sensor and the other is not, as a table for its firmware, both are taken
    as the sensor counts.

    Parameters
    ----------
    a, b : HarmonicModel or path
        Their units may differ.

    Returns
    -------
    Comparison

    Raises
    ------
    ArgumentError
        Shafts of which one turn of the output does not come back to the start; models that
        were fitted on parts of the turn that have nothing in common.

    Examples
    --------
    >>> import trueangle as ta
    >>> a = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> b = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.4])], period=360.0)
    >>> round(ta.compare(a, b).orders[0]["amplitude_arcsec"], 6)
    360.0
    """
    first, second = (m if isinstance(m, HarmonicModel) else load_model(m) for m in (a, b))
    if first.indicated_sign != second.indicated_sign:
        first, second = first.in_sensor_sense(), second.in_sensor_sense()
    models = first, second
    one, two = TurnPattern(first), TurnPattern(second)
    waves = one.waves, two.waves
    orders = sorted({*waves[0], *waves[1]})
    if not (one.is_periodic and two.is_periodic) and first.argument != second.argument:
        raise ArgumentError(
            "one model follows the reference and one the indicated angle, and a shaft is not "
            "periodic in one output turn: fit both with the same `argument=`"
        )
    at_readings = _is_looked_up(first) or _is_looked_up(second)
    same = first.argument == second.argument and not at_readings
    # Turns over which shafts that do not come back are looked at.
    turns = 1 if one.is_periodic and two.is_periodic else 32
    top = max(orders, default=1.0)
    # Points per cycle of the fastest order.
    points = 1 << math.ceil(math.log2(max(4096.0, 32 * top * turns)))
    if points > 1 << 22:
        raise ArgumentError(f"order {top:g} is too high to be compared over a turn")
    x = np.arange(points, dtype=np.float64) * (turns / points)
    # What the models make of a reading, of their argument, of a true angle.
    curve = TurnPattern.correction if at_readings else TurnPattern.error if same else _at_truth
    difference = curve(two, x) - curve(one, x)
    inside = _fitted(first, x) & _fitted(second, x)
    if not inside.any():
        raise ArgumentError("the models were fitted on different parts of the turn: none is common")
    zero = float(np.mean(difference)) if turns == 1 or at_readings else 0.0
    spectrum = np.fft.rfft(difference - zero) * (2.0 / points)
    variances = [_variances(model) for model in models]
    rows: list[dict[str, Any]] = []
    for order in orders:
        if same:
            z = waves[1].get(order, 0j) - waves[0].get(order, 0j)
        elif turns == 1:
            z = 1j * complex(spectrum[round(order)])
        else:
            z = 2j * complex(np.mean((difference - zero) * np.exp(-2j * np.pi * order * x)))
        size = {"order": order, "amplitude_arcsec": abs(z) * ARCSEC_PER_TURN}
        phase = math.degrees(cmath.phase(z)) % 360.0
        of = "both" if order in waves[0] and order in waves[1] else "BA"[order in waves[0]]
        own = [each[order] for each in variances if order in each]
        std = math.sqrt(sum(own)) * ARCSEC_PER_TURN if own else None
        rows.append({**size, "phase_deg": phase, "std_arcsec": std, "model": of})
    tables = [(m.fit.table, ARCSEC_PER_TURN / m.period) for m in models if m.fit and m.fit.table]
    kinds = dict.fromkeys(t.kind for t in (*first.terms, *second.terms))
    terms = [kind for kind in kinds if _terms(first, kind) != _terms(second, kind)]
    each = [pattern.uncertainty_arcsec for pattern in (one, two)]
    if not inside.all():
        difference, zero = difference[inside], float(np.mean(difference[inside]))
        each = [_spread(model, x[inside]) for model in models]
    difference = difference - zero
    known = [std for std in each if std is not None]
    told: Equality | None = pattern_equality(first, second) if same else None
    return Comparison(
        orders=rows,
        rms_arcsec=float(np.sqrt(np.mean(difference**2))) * ARCSEC_PER_TURN,
        max_abs_arcsec=float(np.max(np.abs(difference))) * ARCSEC_PER_TURN,
        std_arcsec=math.hypot(*known) if known else None,
        each_std_arcsec=each,
        zero_deg=float(wrap(two.zero - one.zero + zero, 1.0)) * 360.0,
        argument="indicated" if at_readings else first.argument if same else "reference",
        differ_in=terms,
        table_rms_arcsec=math.hypot(*(t.rms * u for t, u in tables)) if tables else None,
        table_max_abs_arcsec=sum(t.max_abs * u for t, u in tables) if tables else None,
        verdict=None if told is None else told.verdict,
        p=None if told is None else told.p,
        share=float(np.mean(inside)),
    )


def _fitted(model: HarmonicModel, x: Array) -> Any:
    """Which places in turns lie within the part of the turn that was fitted."""
    span = model.partial_span
    if span is None or not model.is_periodic:
        return np.ones(x.size, dtype=bool)
    return (x * model.period - span[0]) % model.period <= span[1] - span[0]


def _spread(model: HarmonicModel, x: Array) -> float | None:
    """Standard deviation of a model over places in turns, arcsec."""
    if model.covariance is None:
        return None
    rms = float(np.sqrt(np.mean(model.band(x * model.period) ** 2)))
    return rms / model.period * ARCSEC_PER_TURN


def _is_looked_up(model: HarmonicModel) -> bool:
    """Whether a model was read from a table that a device looks up at its reading."""
    fit = model.fit
    if fit is None or fit.method != "table":
        return False
    return fit.table is None or fit.table.argument == "indicated"


def _at_truth(pattern: TurnPattern, theta: Array) -> Array:
    return pattern.reading(theta) - theta - pattern.zero


def _variances(model: HarmonicModel) -> dict[float, float]:
    """Of one coefficient of each output order, in turns squared; of none where none is known."""
    if model.covariance is None:
        return {}
    each = np.diagonal(model.covariance) / model.period**2
    return {k: float(each[list(rows)].mean()) for k, (rows, _) in _coefficients(model).items()}


def _terms(model: HarmonicModel, kind: str) -> list[Any]:
    turn = 1.0 / model.period
    return [(turn, term.to_table()) for term in model.terms if term.kind == kind]
