"""The groups of columns that readings of these runs can determine."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...estimation.factor import orthonormal_basis
from ...joint.pattern import line_columns
from ...joint.signals import Signals
from ...support.arrays import Array
from .account import SAME_COLUMNS
from .events import step_events
from .group import FEW, GRID, LOW, PAIRS, Basis, Group
from .places import PeakSpectrum, place_groups, without_low

#: Orders whose products with a factor are always tried.
ALWAYS: Final = (1.0, 2.0)

#: Shares of the range by which a factor must change to be one.
SPEED_CHANGES, LOAD_CHANGES, TEMPERATURE_CHANGES = 0.1, 0.05, 0.1

#: Deviation of sizes, over the greatest, below which they are one.
ONE_SIZE: Final = 0.02

#: Lengths of transitions after a reversal, in shares of the median segment of one direction.
LENGTHS: Final = (0.003, 0.01, 0.03, 0.1, 0.3)

#: Shares of the range within which values are one level, and knots one; and hats at most.
LEVEL: Final = 0.1
NEXT: Final = 0.01
KNOTS: Final = 8

#: Runs up to which each may have a pattern.
MOST_RUNS: Final = 24


@dataclass(frozen=True, eq=False)
class Axis:
    """A factor: its values at the readings, functions of them, and those of products with lines.

    The functions may be those of other ``factors``, too.
    """

    factor: str
    x: Array
    basis: Basis
    at: Array
    unit: str
    products: Sequence[Basis] = ()
    factors: int = 1

    def alone(self) -> Group:
        """Its function."""
        group = Group.of_function(self.factor, self.x, self.basis, self.at, self.unit)
        return replace(group, factors=self.factors)

    def times(self, theta: Array, order: float, basis: Basis) -> Group:
        """Products with a line less their means: a line of the place is a group of its own."""
        means = basis(self.x).mean(axis=0)
        factor = f"{self.factor}_place"
        return Group.of_product(
            factor, self.x, lambda x: basis(x) - means, self.at, self.unit, theta, (order,)
        )


def factor_groups(
    signals: Signals,
    error: Array,
    lines: Sequence[float] = (),
    drawn: Sequence[float] = (),
    frequencies: Sequence[float] = (),
    events: Sequence[tuple[int, int]] = (),
    shafts: Sequence[float] = (),
) -> list[Group]:
    """Groups of columns at these readings.

    Parameters
    ----------
    signals : Signals
    error : ndarray, shape (n,)
        Measured minus simulated, whose spectra propose further lines.
    lines : sequence of float
        Orders, in cycles of an output turn, that are looked at for any spectra.
    drawn : sequence of float
        Orders that are new in every run.
    frequencies : sequence of float
        Lines in Hz that are new in every run.
    events : sequence of (int, int)
        Run and row at which something happened once.
    shafts : sequence of float
        Cycles of the other shafts in an output turn.
    """
    theta = signals.theta
    left = without_low(signals, error)
    known = [m for m in dict.fromkeys(lines) if m > 0.0]
    spectrum = PeakSpectrum(theta, signals.places)
    groups = [*place_groups(signals, error, left, known, shafts, spectrum)]
    axes = [*_axes(signals)]
    groups += _of_pairs([*axes, _travel(signals)])
    for axis in axes:
        groups.append(axis.alone())
        for product in axis.products:
            asked = [*ALWAYS, *known[:LOW], *drawn]
            for column in product(axis.x).T:
                asked += spectrum.peaks(spectrum.powers(left * (column - column.mean())))
            groups += [axis.times(theta, order, product) for order in dict.fromkeys(asked)]
    groups += _of_one_way(signals)
    groups += _of_runs(signals, [*ALWAYS, *known[:2], *drawn], left, spectrum)
    groups += _of_frequencies(signals, frequencies)
    groups += step_events(signals, events)
    given = {*ALWAYS, *known, *drawn}
    low = {float(k) for k in range(1, LOW + 1)}
    for k, group in enumerate(groups):
        sought = {*group.orders} - given - (low if group.factor == "place" else set())
        if len(group.orders) == 1 and (sought or group.factor == "place"):
            number = float(spectrum.count) if sought else _number(group.orders[0], shafts)
            groups[k] = replace(group, alternatives=number)
    return groups


def _number(order: float, shafts: Sequence[float]) -> float:
    """The lowest number that a line has on any shaft: k is as likely as 1/k of the first."""
    on = [order / abs(c) for c in (1.0, *shafts)]
    return min((n for n in on if n > 0.5 and abs(n - round(n)) < 1e-6), default=max(order, 1.0))


def _axes(signals: Signals) -> Iterator[Axis]:
    """Factors that change."""
    d = signals.direction
    if bool((d > 0.0).any() and (d < 0.0).any()):
        yield Axis("direction", d, _column, np.array([-1.0, 1.0]), "sign", [_column])
        yield from _reversals(signals)
    yield from _signed("speed", signals.velocity, 2.0 * SPEED_CHANGES, "deg/s")
    tau = signals.torque
    yield from _signed("load", tau, LOAD_CHANGES, "Nm")
    if tau is not None and np.unique(np.sign(tau)).size > 1:
        # At a level of nought noise has the sign.
        signs = np.sign(tau) * (np.abs(tau) > NEXT * np.ptp(tau))
        yield Axis("load_sign", signs, _column, np.array([-1.0, 1.0]), "sign")
    kelvin = signals.temperature
    if kelvin is not None and np.ptp(kelvin) > TEMPERATURE_CHANGES:
        mean, half = float(kelvin.mean()), 0.5 * float(np.ptp(kelvin))
        knots = knots_of(kelvin)
        grid = grid_of(knots)

        def warm(x: Array) -> Array:
            s = (x - mean) / half
            return np.column_stack([s, s * s])

        any_one = _hats(knots)
        product = any_one if any_one(knots).shape[1] <= FEW else warm
        yield Axis("temperature", kelvin, warm, grid, "C", [product])
        yield Axis("temperature", kelvin, any_one, grid, "C")
    yield from _signed("current", signals.current, LOAD_CHANGES, "A")
    yield from _clock(signals)


def _signed(factor: str, x: Array | None, changes: float, unit: str) -> Iterator[Axis]:
    """Functions of what has two signs: odd and even ones, and any, unless it has one size."""
    top = 0.0 if x is None else float(np.abs(x).max(initial=0.0))
    if x is None or not np.ptp(x) > changes * top > 0.0:
        return
    grid = grid_of(knots_of(x))
    if float(np.std(np.abs(x))) < ONE_SIZE * top:
        yield Axis(factor, x, lambda x: x[:, None] / top, grid, unit, [_column])
        return
    sizes = _hats(knots_of(np.abs(x)))

    def bent(x: Array, power: float = 2.0) -> Array:
        signs = np.column_stack([np.sign(x), np.ones_like(x)])
        return np.hstack([signs * (np.abs(x)[:, None] / top) ** p for p in (1.0, power)])

    def from_rest(x: Array) -> Array:
        return np.hstack([np.sign(x)[:, None], bent(x, 0.5)[:, ::2]])

    def even(x: Array) -> Array:
        return sizes(np.abs(x))

    def odd(x: Array) -> Array:
        # One sign may differ from the other at any size, at the smallest too.
        return np.sign(x)[:, None] * np.hstack([np.ones((x.size, 1)), even(x)])

    parts = [even, odd] if float(x.min()) < 0.0 < float(x.max()) else [even]
    # Of few levels these have no more columns.
    products = parts if even(x[:1]).shape[1] <= FEW else [bent]
    yield Axis(factor, x, lambda x: bent(x, 0.5), grid, unit)
    yield Axis(factor, x, bent, grid, unit, products)
    # With a step at rest they are functions of the sign, too.
    of_both = [lambda x: np.hstack([part(x) for part in parts]), from_rest]
    for basis in of_both[: len(parts)]:
        yield Axis(factor, x, basis, grid, unit, (), len(parts))


def knots_of(x: Array) -> Array:
    """Levels of what is set, and quantiles of what moves; none next to another."""
    order = np.sort(x)
    step = 0.5 * LEVEL * float(order[-1] - order[0])
    cuts = np.flatnonzero(np.diff(order) > step)
    edges = np.concatenate([[0], cuts + 1, [order.size]])
    knots = np.array([order[a:b].mean() for a, b in itertools.pairwise(edges)])
    if not 2 <= knots.size <= KNOTS:
        knots = np.quantile(order, np.linspace(0.0, 1.0, KNOTS))
    knots = np.unique(knots)
    return np.asarray(knots[np.diff(knots, prepend=-np.inf) > NEXT * np.ptp(order)])


def grid_of(knots: Array) -> Array:
    """The knots, and evenly spaced values that are not next to one."""
    even = np.linspace(knots[0], knots[-1], GRID)
    apart = np.abs(even[:, None] - knots).min(axis=1) > 0.25 * (even[1] - even[0])
    return np.union1d(even[apart], knots)


def _hats(knots: Array) -> Basis:
    """Hats at knots: any function."""

    def basis(values: Array) -> Array:
        return np.column_stack(
            [np.interp(values, knots, row) for row in np.eye(knots.size)[: max(knots.size - 1, 1)]]
        )

    return basis


def _column(x: Array) -> Array:
    return np.asarray(x[:, None])


def _reversals(signals: Signals) -> Iterator[Axis]:
    """Transitions after a reversal, by travel and by time, and what grows while the joint stands.

    They change sides with the direction, or not. Those from the start of a run, which may be at
    rest or in the midst of a motion, are their own.
    """
    sign = np.where(signals.direction < 0.0, -1.0, 1.0)
    first = signals.segment_first[signals.segment]
    ways = ((signals.travel, "deg", 0.0), (_since(signals), "s", 0.0), (_rest(signals), "s", 1.0))
    for x, unit, end in ways:
        if x is None:
            continue
        longest = np.zeros(signals.segment_direction.size)
        np.maximum.at(longest, signals.segment, x)
        if not longest.any():
            continue
        whole = float(np.median(longest[longest > 0.0]))
        lengths = np.array(LENGTHS) * whole

        def settles(x: Array, lengths: Array = lengths, end: float = end) -> Array:
            decays = np.exp(-np.minimum(np.abs(x)[:, None] / lengths, 700.0))
            return np.abs(decays - end) * np.sign(x)[:, None]

        at = np.linspace(1e-6, 0.5, GRID) * whole
        x = np.maximum(x, 1e-9 * whole)
        for own in (sign * ~first, 1.0 * ~first, sign * first):
            yield Axis("reversal_time", x * own, settles, at, unit)


def _rest(signals: Signals) -> Array | None:
    """Seconds since the joint stopped; 0 while it moves."""
    v = signals.velocity
    if v is None or signals.time is None:
        return None
    moves = np.abs(v) >= NEXT * float(np.abs(v).max(initial=0.0))
    moves[[start for start, _ in signals.run_bounds()]] = True
    since = np.maximum.accumulate(np.arange(v.size) * moves)
    return np.asarray(signals.clock - signals.clock[since])


def _since(signals: Signals) -> Array | None:
    """Seconds since the last reversal."""
    if signals.time is None:
        return None
    first = np.zeros(signals.segment_direction.size)
    order = np.arange(len(signals))[::-1]
    first[signals.segment[order]] = signals.clock[order]
    return np.asarray(signals.clock - first[signals.segment])


def _clock(signals: Signals) -> Iterator[Axis]:
    """Time in the run: what all runs show; what only one has is noise."""
    spans = [float(np.ptp(signals.clock[a:b])) for a, b in signals.run_bounds()]
    whole = max(spans, default=0.0)
    if not whole > 0.0:
        return

    def path(x: Array) -> Array:
        u = x / whole
        return np.column_stack([u, u * u, np.exp(-u / 0.1), np.exp(-u / 0.03)])

    unit = "s" if signals.time is not None else "reading"
    yield Axis("run_time", signals.clock, path, np.linspace(0.0, whole, GRID), unit)


def _travel(signals: Signals) -> Axis:
    """The way that the joint has gone in a run, about its mean: each run has its own zero."""
    way = np.zeros(len(signals))
    for start, stop in signals.run_bounds():
        own = np.abs(np.diff(signals.degrees[start:stop], prepend=signals.degrees[start]))
        way[start:stop] = np.cumsum(own) - np.cumsum(own).mean()
    return Axis("travel", way, _column, np.zeros(1), "deg")


def _of_pairs(axes: Sequence[Axis]) -> Iterator[Group]:
    """Products of two factors that are no sums of functions of each: the runs cross them.

    Of each what is proportional, and of its size or its square.
    """
    first = {axis.factor: axis for axis in reversed(axes)}
    for one, other in ((first[a], first[b]) for a, b in PAIRS if {a, b} <= first.keys()):
        sides = [axis.basis(axis.x)[:, :2] for axis in (one, other)]
        columns = _products(*sides)
        basis = orthonormal_basis(np.hstack([np.ones((len(columns), 1)), *sides]))
        left, total = columns - basis @ (basis.T @ columns), np.sum(np.var(columns, axis=0))
        if np.sum(np.var(left, axis=0)) > SAME_COLUMNS * total:
            most, scale = sides[0][[np.argmax(one.x)]], float(np.sqrt(total))

            def at_most(x: Array, basis=other.basis, most=most, scale=scale) -> Array:  # type: ignore[no-untyped-def]
                return np.asarray(_products(most, basis(x)[:, :2]) / scale)

            factor = f"{one.factor}_{other.factor}"
            yield Group(factor, columns / scale, (), other.at, at_most, other.unit)


def _products(one: Array, other: Array) -> Array:
    return np.hstack([one * column[:, None] for column in other.T])


def _of_one_way(signals: Signals) -> Iterator[Group]:
    """A function of the place that is met in one direction only."""
    d = signals.direction
    if (d > 0.0).all() or not (d > 0.0).any():
        return
    orders = tuple(float(k) for k in range(LOW + 1) if 2 * k <= signals.places)
    for way in (-1.0, 1.0):
        yield Group.of_product(
            "direction_place",
            d,
            lambda x, way=way: np.asarray(x[:, None] * way > 0.0, dtype=np.float64),  # type: ignore[misc]
            np.array([-1.0, 1.0]),
            "sign",
            signals.theta,
            orders,
        )


def _of_runs(
    signals: Signals, lines: Sequence[float], left: Array, spectrum: PeakSpectrum
) -> Iterator[Group]:
    """Zeros of the runs, their trend, and a pattern of each run, also of lines that one run has."""
    if signals.runs < 2:
        return
    run = signals.run.astype(np.float64)
    at = np.arange(signals.runs, dtype=np.float64)

    def each(x: Array) -> Array:
        return np.asarray(x[:, None] == at, dtype=np.float64)

    zeros = Axis("run", run, each, at, "run")
    yield zeros.alone()
    if signals.runs > 2:
        yield Axis("run", run, _in_order, at, "run").alone()
    if signals.runs <= MOST_RUNS:
        powers = [spectrum.powers(left * (own - own.mean())) for own in each(run).T]
        # The strongest alone: a group has two columns for every run.
        asked = dict.fromkeys([*lines, *spectrum.peaks(np.max(powers, axis=0))[:1]])
        yield from (zeros.times(signals.theta, m, each) for m in asked)
    mount = signals.mount
    if mount is not None and np.ptp(mount) > 0.0:
        degrees = np.degrees(signals.theta - mount)
        for k in (1.0, 2.0, 3.0, 4.0):
            yield Group.of_function(
                "mount_place",
                degrees,
                lambda x, k=k: line_columns(np.radians(x), k),  # type: ignore[misc]
                np.linspace(0.0, 360.0, 73),
                "deg",
                (k,),
            )


def _in_order(x: Array) -> Array:
    """What changes from run to run in their order: a trend, and what settles."""
    return np.column_stack([x, x**2 / 8.0, 4.0 * np.exp(-x / 2.0)])


def _of_frequencies(signals: Signals, frequencies: Sequence[float]) -> Iterator[Group]:
    """Lines in time, with a new phase in every run."""
    if signals.time is None:
        return
    for hertz in frequencies:
        wave = line_columns(2.0 * np.pi * signals.clock, hertz)
        columns = np.hstack([wave * (signals.run == r)[:, None] for r in range(signals.runs)])
        scale = float(np.sqrt(np.mean(np.sum(columns**2, axis=1))))
        at = np.array([hertz])
        yield Group("frequency", columns / scale, (), at, None, "Hz", 0.5 * len(signals))
