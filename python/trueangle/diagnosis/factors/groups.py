"""The groups of columns that readings of these runs can determine."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...effects.orderspectrum import OrderSpectrum
from ...joint.pattern import line_columns
from ...joint.signals import Signals
from ...runs.aliasing import count_positions
from ...support.arrays import Array
from .events import late_readings, step_events
from .group import GRID, LOW, STANDS_OUT, Group
from .jumps import jumps, less_lines

#: Bands of orders above the low ones, a group each.
BANDS: Final = ((13, 24), (25, 48), (49, 96))

#: Harmonics of a shaft's turn by which any function of its place is represented: a bump, a worn
#: sector, a row of them.
HARMONICS: Final = 48

#: Orders whose products with a factor are always tried.
ALWAYS: Final = (1.0, 2.0)

#: Lines of a spectrum that are tried in addition.
PEAKS: Final = 5

#: Highest order of a spectrum, and readings for each order.
ORDERS: Final = 400
SAMPLED: Final = 2.5

#: Shares of the range by which a factor must change to be one.
SPEED_CHANGES, LOAD_CHANGES, TEMPERATURE_CHANGES = 0.1, 0.05, 0.1

#: Deviation of sizes, over the greatest, below which they are one.
ONE_SIZE: Final = 0.02

#: Share of a turn below which the place is a smooth function, too.
ARC: Final = 0.98

#: Lengths of transitions after a reversal, in shares of the median segment of one direction.
LENGTHS: Final = (0.003, 0.01, 0.03, 0.1, 0.3)

#: Shares of the range within which values are one level, and knots one; and hats at most.
LEVEL: Final = 0.1
NEXT: Final = 0.01
KNOTS: Final = 8

#: Runs up to which each may have a pattern.
MOST_RUNS: Final = 24

Basis = Callable[[Array], Array]


class Axis:
    """A factor: its values at the readings, and functions of them."""

    def __init__(self, factor: str, x: Array, basis: Basis, at: Array, unit: str) -> None:
        self.factor, self.x, self.basis, self.at, self.unit = factor, x, basis, at, unit

    def alone(self) -> Iterator[Group]:
        """Its function."""
        group = Group.of_function(self.factor, self.x, self.basis, self.at, self.unit)
        if group is not None:
            yield group

    def times(
        self, theta: Array, orders: Iterable[float], basis: Basis | None = None
    ) -> Iterator[Group]:
        """Its products with lines."""
        for order in orders:
            yield Group.of_product(
                f"{self.factor}_place",
                self.x,
                basis or self.basis,
                self.at,
                self.unit,
                theta,
                (order,),
            )


def factor_groups(
    signals: Signals,
    error: Array,
    lines: Sequence[float] = (),
    drawn: Sequence[float] = (),
    frequencies: Sequence[float] = (),
    events: Sequence[tuple[int, int]] = (),
    shafts: Iterable[float] = (),
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
    shafts : iterable of float
        Cycles of the other shafts in an output turn.
    """
    theta = signals.theta
    left = _without_low(theta, error, signals.run)
    known = [m for m in dict.fromkeys(lines) if m > 0.0]
    spectrum = _PeakSpectrum(theta, signals.places)
    peaks = [*known, *spectrum.peaks(left, LOW)]
    groups = [*_place(signals, error, peaks)]
    # Hundreds of columns, which would cost most of the search where single lines take all.
    others = less_lines(theta, left, peaks)
    wide = [orders for orders in _bands(signals) if orders and spectrum.shows(others, orders)]
    patterns = (_pattern(signals, cycles) for cycles in dict.fromkeys(map(abs, shafts)))
    wide += [orders for orders in patterns if orders and spectrum.shows(left, orders)]
    for orders in wide:
        waves, at = _waves(orders), groups[0].at
        group = Group.of_function("place", signals.degrees, waves, at, "deg", orders)
        groups += [group] if group is not None else []
    for axis, product in _axes(signals):
        groups += axis.alone()
        if product is not None:
            own = product(axis.x)
            asked = [*ALWAYS, *known[:LOW]]
            for column in own.T:
                asked += spectrum.peaks(left * (column - column.mean()))
            groups += axis.times(theta, dict.fromkeys(asked), product)
    groups += _of_one_way(signals)
    groups += _of_runs(signals, [*ALWAYS, *known[:2], *drawn])
    groups += _of_frequencies(signals, frequencies)
    groups += step_events(signals, events)
    groups += late_readings(signals, error)
    given = {*ALWAYS, *known, *drawn}
    low = {float(k) for k in range(1, LOW + 1)}
    for k, group in enumerate(groups):
        sought = {*group.orders} - given - (low if group.factor == "place" else set())
        if len(group.orders) == 1 and sought:
            groups[k] = replace(group, alternatives=float(spectrum.count))
    return groups


class _PeakSpectrum:
    """The strongest lines of values at angles in radians, and whether some have power."""

    def __init__(self, theta: Array, places: int) -> None:
        self.count = int(min(ORDERS, theta.size / SAMPLED, 0.5 * places))
        self.turns = float(np.ptp(theta)) / (2.0 * np.pi)
        self.sums = OrderSpectrum(theta, [0], 1.0, 1.0, self.count) if self.count > LOW else None

    def peaks(self, values: Array, above: int = 0) -> list[float]:
        """The strongest orders above some; none over an arc, where they run together."""
        power = float(values @ values)
        if self.sums is None or self.turns < ARC or not power > 0.0:
            return []
        spectrum = np.abs(self.sums.sums(values).sum(axis=1)) ** 2 / power
        spectrum[:above] = 0.0
        best = np.argsort(spectrum)[::-1][:PEAKS]
        return [float(k + 1) for k in best if spectrum[k] > STANDS_OUT]

    def shows(self, values: Array, orders: Iterable[float]) -> bool:
        """Lines have more power together than noise leaves them; so where none can be looked at."""
        if self.sums is None:
            return True
        at = [round(order) - 1 for order in orders if LOW < round(order) <= self.count]
        spectrum = np.abs(self.sums.sums(values).sum(axis=1)) ** 2
        level = float(np.median(spectrum)) / np.log(2.0)
        # Three standard deviations of their mean power above that of noise.
        return not at or float(spectrum[at].mean()) > level * (1.0 + 3.0 / np.sqrt(len(at)))


def _without_low(theta: Array, error: Array, run: NDArray[np.int64]) -> Array:
    """The error less its mean by run and its low orders."""
    left = less_lines(theta, error, range(1, LOW + 1))
    counts = np.maximum(np.bincount(run), 1)
    return np.asarray(left - (np.bincount(run, left) / counts)[run])


def _place(signals: Signals, error: Array, lines: Iterable[float]) -> Iterator[Group]:
    """Lines, jumps, and over an arc a smooth function of the place."""
    theta = signals.theta
    start, span = float(theta.min()), float(np.ptp(theta))
    turns = span / (2.0 * np.pi)
    whole = turns >= ARC
    at = np.linspace(0.0, 360.0, 73) if whole else np.degrees(np.linspace(start, start + span, 49))
    degrees = signals.degrees
    ramps = jumps(degrees, less_lines(theta, error, range(1, LOW + 1))) if whole else []
    at = np.union1d(at, [end % 360.0 for ramp in ramps for end in (ramp.before, ramp.after)])

    low = [float(k) for k in range(1, LOW + 1) if 2 * k <= signals.places]
    for m in dict.fromkeys([*low, *lines]):
        group = Group.of_function("place", degrees, _waves([m]), at, "deg", (m,))
        if group is not None:
            yield group
    for ramp in ramps:
        group = Group.of_function("place", degrees, ramp.values, at, "deg")
        if group is not None:
            yield replace(group, alternatives=ramp.count, jump=ramp.where)
    middle = np.degrees(start + 0.5 * span)

    def smooth(x: Array) -> Array:
        u = (x - middle) / max(0.5 * np.degrees(span), 1e-12)
        return np.column_stack([u, u**2, u**3] if not whole else [u])

    # Over several turns this is a ramp of the travel, which no pattern is.
    travel = at if not whole else np.degrees(np.linspace(start, start + span, GRID))
    group = Group.of_function("place", degrees, smooth, travel, "deg")
    if group is not None:
        yield group


def _waves(orders: Sequence[float]) -> Basis:
    """Lines of an angle in degrees, expected to be the smaller the higher their order is."""
    return lambda x: np.hstack([line_columns(np.radians(x), m) * orders[0] / m for m in orders])


def _bands(signals: Signals) -> Iterator[tuple[float, ...]]:
    """Orders of the output that are next to one another, and those of any function of its place."""
    for first, last in BANDS:
        if last * SAMPLED < len(signals) and 2 * last <= signals.places:
            yield tuple(float(k) for k in range(first, last + 1))
    yield _pattern(signals, 1.0)


def _pattern(signals: Signals, cycles: float) -> tuple[float, ...]:
    """Orders of any function of a shaft's place."""
    places = count_positions(signals.theta * cycles / (2.0 * np.pi))
    return tuple(k * cycles for k in range(1, min(HARMONICS, places // 2) + 1))


def _axes(signals: Signals) -> Iterator[tuple[Axis, Basis | None]]:
    """Factors, each with its functions in products with lines; None without products."""
    d = signals.direction
    if bool((d > 0.0).any() and (d < 0.0).any()):
        yield Axis("direction", d, _column, np.array([-1.0, 1.0]), "sign"), _column
        yield from ((axis, None) for axis in _reversals(signals))
    yield from _signed("speed", signals.velocity, 2.0 * SPEED_CHANGES, "deg/s")
    tau = signals.torque
    yield from _signed("load", tau, LOAD_CHANGES, "Nm")
    if tau is not None and np.unique(np.sign(tau)).size > 1:
        yield Axis("load_sign", np.sign(tau), _column, np.array([-1.0, 1.0]), "sign"), None
    kelvin = signals.temperature
    if kelvin is not None and np.ptp(kelvin) > TEMPERATURE_CHANGES:
        mean, half = float(kelvin.mean()), 0.5 * float(np.ptp(kelvin))
        knots = knots_of(kelvin)
        grid = grid_of(knots)

        def warm(x: Array) -> Array:
            s = (x - mean) / half
            return np.column_stack([s, s * s])

        def with_mean(x: Array) -> Array:
            return np.column_stack([np.ones(x.size), warm(x)])

        yield Axis("temperature", kelvin, warm, grid, "C"), with_mean
        yield Axis("temperature", kelvin, _hats(knots), grid, "C"), None
    for axis, _ in _signed("current", signals.current, LOAD_CHANGES, "A"):
        yield axis, None
    yield from ((axis, None) for axis in _clock(signals))


def _signed(
    factor: str, x: Array | None, changes: float, unit: str
) -> Iterator[tuple[Axis, Basis | None]]:
    """Functions of what has two signs: odd and even ones, and any, unless it has one size."""
    top = 0.0 if x is None else float(np.abs(x).max(initial=0.0))
    if x is None or not np.ptp(x) > changes * top > 0.0:
        return
    knots = knots_of(x)
    grid = grid_of(knots)
    if float(np.std(np.abs(x))) < ONE_SIZE * top:
        yield Axis(factor, x, lambda x: x[:, None] / top, grid, unit), lambda x: x[:, None] / top
        return

    def curves(x: Array) -> Array:
        lines = np.column_stack([x / top, np.abs(x) / top])
        return np.hstack([lines, lines * np.abs(x)[:, None] / top])

    yield Axis(factor, x, curves, grid, unit), curves
    if not float(x.min()) < 0.0 < float(x.max()):
        yield Axis(factor, x, _hats(knots), grid, unit), None
        return
    sizes = _hats(knots_of(np.abs(x)))

    def both(x: Array) -> Array:
        # One sign may differ from the other at any size, at the smallest too.
        even = sizes(np.abs(x))
        return np.hstack([even, np.sign(x)[:, None] * np.hstack([np.ones((x.size, 1)), even])])

    yield Axis(factor, x, both, grid, unit), None


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
    """Transitions after a reversal, by travel and by time.

    They change sides with the direction, or not. Those from the start of a run, which may be at
    rest or in the midst of a motion, are their own.
    """
    since = _since(signals)
    sign = np.where(signals.direction < 0.0, -1.0, 1.0)
    first = signals.segment_first[signals.segment]
    for x, unit in ((signals.travel, "deg"), (since, "s")):
        if x is None:
            continue
        whole = float(np.median(_longest(signals, x)))
        if not whole > 0.0:
            continue
        lengths = np.array(LENGTHS) * whole

        def decays(x: Array, lengths: Array = lengths) -> Array:
            return np.exp(-np.minimum(np.abs(x)[:, None] / lengths, 700.0)) * np.sign(x)[:, None]

        at = np.linspace(1e-6, 0.5, GRID) * whole
        x = np.maximum(x, 1e-9 * whole)
        for own in (sign * ~first, 1.0 * ~first, sign * first):
            yield Axis("reversal_time", x * own, decays, at, unit)


def _since(signals: Signals) -> Array | None:
    """Seconds since the last reversal."""
    if signals.time is None:
        return None
    first = np.zeros(signals.segment_direction.size)
    order = np.arange(len(signals))[::-1]
    first[signals.segment[order]] = signals.clock[order]
    return np.asarray(signals.clock - first[signals.segment])


def _longest(signals: Signals, x: Array) -> Array:
    longest = np.zeros(signals.segment_direction.size)
    np.maximum.at(longest, signals.segment, x)
    return np.asarray(longest[longest > 0.0] if (longest > 0.0).any() else longest)


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


def _of_runs(signals: Signals, lines: Sequence[float]) -> Iterator[Group]:
    """Zeros of the runs, their trend, and a pattern of each run."""
    if signals.runs < 2:
        return
    run = signals.run.astype(np.float64)
    at = np.arange(signals.runs, dtype=np.float64)

    def each(x: Array) -> Array:
        return np.asarray(x[:, None] == at, dtype=np.float64)

    zeros = Axis("run", run, each, at, "run")
    yield from zeros.alone()
    if signals.runs > 2:
        yield from Axis("run", run, _in_order, at, "run").alone()
    if signals.runs <= MOST_RUNS:
        # One of the runs less: what all have in common is of the place.
        yield from zeros.times(signals.theta, dict.fromkeys(lines), lambda x: each(x)[:, 1:])
    mount = signals.mount
    if mount is not None and np.ptp(mount) > 0.0:
        degrees = np.degrees(signals.theta - mount)
        for k in (1.0, 2.0, 3.0, 4.0):
            group = Group.of_function(
                "mount_place",
                degrees,
                lambda x, k=k: line_columns(np.radians(x), k),  # type: ignore[misc]
                np.linspace(0.0, 360.0, 73),
                "deg",
                (k,),
            )
            if group is not None:
                yield group


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
