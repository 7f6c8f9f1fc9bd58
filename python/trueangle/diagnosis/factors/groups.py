"""The groups of columns that readings of these runs can tell of."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...effects.orderspectrum import OrderSpectrum
from ...joint.lines import line_columns
from ...joint.signals import Signals
from ...support.arrays import Array
from .group import GRID, Group

#: Orders of the output, each a group; and the bands above them, a group each.
LOW: Final = 12
BANDS: Final = ((13, 24), (25, 48))

#: Lines that products with a factor are always asked for.
ALWAYS: Final = (1.0, 2.0)

#: Lines of a spectrum that are asked for beside, and by how much each must stand out of the mean
#: power: of noise alone about one of 500 does.
PEAKS: Final = 5
STANDS_OUT: Final = 8.0

#: Orders that a spectrum is looked at up to, and readings for each.
ORDERS: Final = 400
SAMPLED: Final = 2.5

#: Shares of the range by which a factor must change to be one.
SPEED_CHANGES, LOAD_CHANGES, TEMPERATURE_CHANGES = 0.1, 0.05, 0.1

#: Share of a turn below which the place is a smooth function, too.
ARC: Final = 0.98

#: Lengths of transitions after a reversal, in shares of the median stretch of one direction.
LENGTHS: Final = (0.003, 0.01, 0.03, 0.1, 0.3)

#: Share of the range within which values are one level, and hats at most.
LEVEL: Final = 0.1
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
                order,
            )


def factor_groups(
    signals: Signals,
    error: Array,
    lines: Sequence[float] = (),
    drawn: Sequence[float] = (),
    frequencies: Sequence[float] = (),
) -> list[Group]:
    """Groups of columns at these readings.

    Parameters
    ----------
    signals : Signals
    error : ndarray, shape (n,)
        Measured minus simulated, whose spectra propose further lines.
    lines : sequence of float
        Orders, in cycles of an output turn, that are looked at whatever the spectra are.
    drawn : sequence of float
        Orders that every run has anew.
    frequencies : sequence of float
        Lines in Hz that every run has anew.
    """
    theta = signals.theta
    left = _without_low(theta, error, signals.run)
    known = [m for m in dict.fromkeys(lines) if m > 0.0]
    spectrum = _Spectrum(theta)
    groups = [*_place(signals, [*known, *spectrum.peaks(left)])]
    for axis, product in _axes(signals):
        groups += axis.alone()
        if product is not None:
            own = product(axis.x)
            asked = [*ALWAYS, *known[:LOW]]
            for column in own.T:
                asked += spectrum.peaks(left * (column - column.mean()))
            groups += axis.times(theta, dict.fromkeys(asked), product)
    groups += _of_runs(signals, [*ALWAYS, *known[:2], *drawn])
    groups += _of_frequencies(signals, frequencies)
    given = {*ALWAYS, *known, *drawn, *map(float, range(1, LOW + 1))}
    return [
        replace(group, alternatives=float(spectrum.count))
        if len(group.orders) == 1 and group.orders[0] not in given
        else group
        for group in groups
    ]


class _Spectrum:
    """Lines that stand out, of values at angles in radians."""

    def __init__(self, theta: Array) -> None:
        self.count = int(min(ORDERS, theta.size / SAMPLED))
        self.turns = float(np.ptp(theta)) / (2.0 * np.pi)
        self.sums = OrderSpectrum(theta, [0], 1.0, 1.0, self.count) if self.count > LOW else None

    def peaks(self, values: Array) -> list[float]:
        """The strongest orders above the low ones; none over an arc, where they run together."""
        power = float(values @ values)
        if self.sums is None or self.turns < ARC or not power > 0.0:
            return []
        spectrum = np.abs(self.sums.sums(values).sum(axis=1)) ** 2 / power
        spectrum[:LOW] = 0.0
        best = np.argsort(spectrum)[::-1][:PEAKS]
        return [float(k + 1) for k in best if spectrum[k] > STANDS_OUT]


def _without_low(theta: Array, error: Array, run: NDArray[np.int64]) -> Array:
    """The error less what its mean by run and the low orders take of it."""
    inside = [line_columns(theta, float(k)) for k in range(1, LOW + 1)]
    columns = np.column_stack([np.ones(theta.size), *inside])
    left = error - columns @ np.linalg.lstsq(columns, error, rcond=1e-9)[0]
    counts = np.maximum(np.bincount(run), 1)
    return np.asarray(left - (np.bincount(run, left) / counts)[run])


def _place(signals: Signals, lines: Iterable[float]) -> Iterator[Group]:
    """Lines, bands of lines, and over an arc a smooth function of the place."""
    theta = signals.theta
    start, span = float(theta.min()), float(np.ptp(theta))
    turns = span / (2.0 * np.pi)
    whole = turns >= ARC
    at = np.linspace(0.0, 360.0, 73) if whole else np.degrees(np.linspace(start, start + span, 49))
    degrees = signals.degrees

    def waves(orders: Sequence[float]) -> Basis:
        return lambda x: np.hstack([line_columns(np.radians(x), m) for m in orders])

    low = [float(k) for k in range(1, LOW + 1)]
    for m in dict.fromkeys([*low, *lines]):
        group = Group.of_function("place", degrees, waves([m]), at, "deg", (m,))
        if group is not None:
            yield group
    for first, last in BANDS:
        if last * SAMPLED < theta.size:
            band = tuple(float(k) for k in range(first, last + 1))
            group = Group.of_function("place", degrees, waves(band), at, "deg", band)
            if group is not None:
                yield group
    middle = np.degrees(start + 0.5 * span)

    def smooth(x: Array) -> Array:
        u = (x - middle) / max(0.5 * np.degrees(span), 1e-12)
        return np.column_stack([u, u**2, u**3] if not whole else [u])

    # Over several turns this is a ramp of the travel, which no pattern is.
    travel = at if not whole else np.degrees(np.linspace(start, start + span, GRID))
    group = Group.of_function("place", degrees, smooth, travel, "deg")
    if group is not None:
        yield group


def _axes(signals: Signals) -> Iterator[tuple[Axis, Basis | None]]:
    """Factors, each with its functions in products with lines; None without products."""
    d = signals.direction
    both = bool((d > 0.0).any() and (d < 0.0).any())
    if both:
        at = np.array([-1.0, 1.0])
        yield Axis("direction", d, _column, at, "sign"), _column
        yield from ((axis, None) for axis in _reversals(signals))
    v = signals.velocity
    if v is not None and np.abs(v).max(initial=0.0) > 0.0:
        top = float(np.abs(v).max())
        apart = float(np.std(np.abs(v))) / top
        if np.ptp(v) > 2.0 * SPEED_CHANGES * top:
            grid = np.linspace(v.min(), v.max(), GRID)

            def speed(x: Array) -> Array:
                u = x / top
                all_of = [u, np.abs(u), u * np.abs(u), u * u]
                return np.column_stack(all_of if apart > 0.02 else all_of[:1])

            def moving(x: Array) -> Array:
                u = x / top
                return np.column_stack([u, np.abs(u)] if apart > 0.02 else [u])

            yield Axis("speed", v, speed, grid, "deg/s"), moving
            if apart > 0.02:
                yield Axis("speed", v, _hats(v), grid, "deg/s"), None
    tau = signals.torque
    if tau is not None and np.ptp(tau) > LOAD_CHANGES * np.abs(tau).max(initial=0.0) > 0.0:
        most = float(np.abs(tau).max())
        grid = np.linspace(tau.min(), tau.max(), GRID)

        def load(x: Array) -> Array:
            s = x / most
            return np.column_stack([s, s * np.abs(s), np.abs(s)])

        yield Axis("load", tau, load, grid, "Nm"), lambda x: x[:, None] / most
        yield Axis("load", tau, _hats(tau), grid, "Nm"), None
        if np.unique(np.sign(tau)).size > 1:
            yield Axis("load_sign", np.sign(tau), _column, np.array([-1.0, 1.0]), "sign"), None
    kelvin = signals.temperature
    if kelvin is not None and np.ptp(kelvin) > TEMPERATURE_CHANGES:
        mean, half = float(kelvin.mean()), 0.5 * float(np.ptp(kelvin))
        grid = np.linspace(kelvin.min(), kelvin.max(), GRID)

        def warm(x: Array) -> Array:
            s = (x - mean) / half
            return np.column_stack([s, s * s])

        def with_mean(x: Array) -> Array:
            return np.column_stack([np.ones(x.size), (x - mean) / half])

        yield Axis("temperature", kelvin, warm, grid, "C"), with_mean
        yield Axis("temperature", kelvin, _hats(kelvin), grid, "C"), None
    ampere = signals.current
    if ampere is not None and np.ptp(ampere) > LOAD_CHANGES * np.abs(ampere).max(initial=0.0) > 0.0:
        most_a = float(np.abs(ampere).max())
        grid = np.linspace(ampere.min(), ampere.max(), GRID)

        def field(x: Array) -> Array:
            s = x / most_a
            return np.column_stack([s, np.abs(s)])

        yield Axis("current", ampere, field, grid, "A"), None
    yield from ((axis, None) for axis in _clock(signals))


def _hats(x: Array) -> Basis:
    """Hats at levels of what is set, and at quantiles of what moves: any function of it."""
    order = np.sort(x)
    step = 0.5 * LEVEL * float(order[-1] - order[0])
    cuts = np.flatnonzero(np.diff(order) > step)
    edges = np.concatenate([[0], cuts + 1, [order.size]])
    knots = np.array([order[a:b].mean() for a, b in itertools.pairwise(edges)])
    if not 2 <= knots.size <= KNOTS:
        knots = np.quantile(order, np.linspace(0.0, 1.0, KNOTS))
    knots = np.unique(knots)

    def basis(values: Array) -> Array:
        return np.column_stack(
            [np.interp(values, knots, row) for row in np.eye(knots.size)[: max(knots.size - 1, 1)]]
        )

    return basis


def _column(x: Array) -> Array:
    return np.asarray(x[:, None])


def _reversals(signals: Signals) -> Iterator[Axis]:
    """Transitions after a reversal, by travel and by time."""
    since = _since(signals)
    for x, unit in ((signals.travel, "deg"), (since, "s")):
        if x is None:
            continue
        whole = float(np.median(_longest(signals, x)))
        if not whole > 0.0:
            continue
        lengths = np.array(LENGTHS) * whole

        def decays(x: Array, lengths: Array = lengths) -> Array:
            return np.exp(-np.minimum(np.abs(x)[:, None] / lengths, 700.0)) * np.sign(x)[:, None]

        # Signed by the direction: a reversal error changes sides.
        signed = np.maximum(x, 1e-9 * whole) * np.where(signals.direction < 0.0, -1.0, 1.0)
        yield Axis("reversal_time", signed, decays, np.linspace(1e-6, 0.5, GRID) * whole, unit)


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
    """Time in the run: what all runs show of it; what each has of its own is noise."""
    spans = [float(np.ptp(signals.clock[a:b])) for a, b in signals.run_bounds()]
    whole = max(spans, default=0.0)
    if not whole > 0.0:
        return

    def path(x: Array) -> Array:
        u = x / whole
        return np.column_stack([u, u * u, np.exp(-u / 0.1), np.exp(-u / 0.03)])

    unit = "s" if signals.time is not None else "reading"
    yield Axis("run_time", signals.clock, path, np.linspace(0.0, whole, GRID), unit)


def _of_runs(signals: Signals, lines: Sequence[float]) -> Iterator[Group]:
    """Zeros of the runs, their trend, and patterns of their own."""
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
    """Lines in time, of a phase of its own in every run."""
    if signals.time is None:
        return
    for hertz in frequencies:
        wave = line_columns(2.0 * np.pi * signals.clock, hertz)
        columns = np.hstack([wave * (signals.run == r)[:, None] for r in range(signals.runs)])
        scale = float(np.sqrt(np.mean(np.sum(columns**2, axis=1))))
        at = np.array([hertz])
        yield Group("frequency", columns / scale, (), at, np.zeros((1, columns.shape[1])), "Hz")
