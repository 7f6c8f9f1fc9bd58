"""Functions of the place: lines, patterns of a shaft, a sector, and ramps that fall back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ...effects.orderspectrum import OrderSpectrum
from ...joint.pattern import line_columns, lines_columns
from ...joint.signals import Signals
from ...runs.aliasing import count_positions
from ...support.arrays import Array
from .group import GRID, LOW, STANDS_OUT, Basis, Group

#: Bands of orders above the low ones, a group each.
BANDS: Final = ((13, 24), (25, 48), (49, 96))

#: Harmonics of a shaft's turn by which any function of its place is represented: a bump, a worn
#: sector, a row of them.
HARMONICS: Final = 48

#: Lines of a spectrum that are tried in addition.
PEAKS: Final = 5

#: Highest order of a spectrum, and readings for each order.
ORDERS: Final = 400
SAMPLED: Final = 2.5

#: Share of a turn below which the place is a smooth function, too.
ARC: Final = 0.98


#: Places that are tried at once, and jumps: a facet has two.
TRIED: Final = 360
ENDS: Final = 2


class PeakSpectrum:
    """The strongest lines of values at angles in radians, and whether some have power."""

    def __init__(self, theta: Array, places: int) -> None:
        self.count = int(min(ORDERS, theta.size / SAMPLED, 0.5 * places))
        self.turns = float(np.ptp(theta)) / (2.0 * np.pi)
        self.sums = OrderSpectrum(theta, [0], 1.0, 1.0, self.count) if self.count > LOW else None

    def powers(self, values: Array) -> Array:
        """Power of every order, over that of the values; of none where there is nothing to see."""
        power = float(values @ values)
        if self.sums is None or not power > 0.0:
            return np.zeros(0)
        return np.asarray(np.abs(self.sums.sums(values).sum(axis=1)) ** 2 / power)

    def peaks(self, powers: Array, above: int = 0) -> list[float]:
        """The strongest orders above some; none over an arc, where they run together."""
        orders = range(above, powers.size if self.turns >= ARC else 0)
        best = sorted(orders, key=lambda k: -powers[k])[:PEAKS]
        return [float(k + 1) for k in best if powers[k] > STANDS_OUT]


def shows(powers: Array, orders: Iterable[float]) -> bool:
    """Lines have more power together than noise leaves them; so where none can be looked at."""
    at = [round(order) - 1 for order in orders if LOW < round(order) <= powers.size]
    level = float(np.median(powers)) / np.log(2.0) if at else 0.0
    # Three standard deviations of their mean power above that of noise.
    return not at or bool(powers[at].mean() > level * (1.0 + 3.0 / np.sqrt(len(at))))


def without_low(signals: Signals, error: Array) -> Array:
    """The error less what its mean by run and the low orders take of it."""
    left, run = less_lines(signals.theta, error, range(1, LOW + 1)), signals.run
    counts = np.maximum(np.bincount(run), 1)
    return np.asarray(left - (np.bincount(run, left) / counts)[run])


def place_groups(
    signals: Signals,
    error: Array,
    left: Array,
    known: Sequence[float],
    shafts: Iterable[float],
    spectrum: PeakSpectrum,
) -> Iterator[Group]:
    """Lines, jumps, a sector, any function of a shaft's place, and over an arc a smooth one."""
    theta, degrees = signals.theta, signals.degrees
    start, span = float(theta.min()), float(np.ptp(theta))
    whole = span / (2.0 * np.pi) >= ARC
    at = np.linspace(0.0, 360.0, 73) if whole else np.degrees(np.linspace(start, start + span, 49))
    less_low = less_lines(theta, error, range(1, LOW + 1))
    parts: list[Sawtooth | Sector] = []
    if whole:
        parts += [*jumps(degrees, less_low), *sectors(degrees, left)]
    at = np.union1d(at, [x for part in parts for x in part.grid])
    powers = spectrum.powers(left)
    low = [float(k) for k in range(1, LOW + 1) if 2 * k <= signals.places]
    peaks = [*known, *spectrum.peaks(powers, LOW)]
    # Hundreds of columns, which would cost most of the search where single lines take all.
    others = spectrum.powers(less_lines(theta, left, peaks))
    wide = [orders for orders in _bands(signals) if orders and shows(others, orders)]
    patterns = (_pattern(signals, cycles) for cycles in dict.fromkeys(map(abs, shafts)))
    wide += [orders for orders in patterns if orders and shows(powers, orders)]
    for orders in [*((m,) for m in dict.fromkeys([*low, *peaks])), *wide]:
        yield Group.of_function("place", degrees, _waves(orders), at, "deg", orders)
    for part in parts:
        group = Group.of_function("place", degrees, part.values, at, "deg")
        yield replace(group, alternatives=part.count, jump=part.where)
    middle = np.degrees(start + 0.5 * span)

    def smooth(x: Array) -> Array:
        u = (x - middle) / max(0.5 * np.degrees(span), 1e-12)
        return np.column_stack([u, u**2, u**3] if not whole else [u])

    # Over several turns this is a ramp of the travel, which no pattern is.
    travel = at if not whole else np.degrees(np.linspace(start, start + span, GRID))
    yield Group.of_function("place", degrees, smooth, travel, "deg")


def _waves(orders: Sequence[float]) -> Basis:
    """Lines of an angle in degrees, expected to be the smaller the higher their order is."""
    weights = orders[0] / np.repeat(orders, 2)
    return lambda x: lines_columns(np.radians(x), np.array(orders)) * weights


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


@dataclass(frozen=True)
class Sector:
    """A part of a turn with a function of its own.

    Attributes
    ----------
    start, width : float
        Degrees.
    functions : int
        By which it is represented.
    count : int
        Sectors that were looked at.
    """

    start: float
    width: float
    functions: int
    count: int
    where: None = None

    def values(self, degrees: Array) -> Array:
        """The functions, as columns: cosines of half periods inside, and nothing outside."""
        u = np.mod(degrees - self.start, 360.0)[:, None] / self.width
        return np.asarray(np.cos(np.pi * u * np.arange(self.functions)) * (u < 1.0))

    @property
    def grid(self) -> Array:
        """Places by which its function is drawn, degrees."""
        steps = np.linspace(0.0, 1.0 - 1e-9, 8 * self.functions)
        return np.asarray(np.mod(self.start + self.width * steps, 360.0))


def sectors(degrees: Array, left: Array) -> Iterator[Sector]:
    """The part of a turn in which values are larger than elsewhere, if noise does not make it.

    By the likelihood of a variance of its own.
    """
    parts = 72  # of a turn: several next to one another are a sector
    part = (np.mod(degrees, 360.0) * parts / 360.0).astype(np.int64) % parts
    sums = np.array([np.bincount(part, x, parts) for x in (np.ones_like(left), left**2)])
    shares = sums / np.maximum(sums.sum(axis=1, keepdims=True), 1e-300)
    twice = np.cumsum(np.hstack([np.zeros((2, 1)), shares, shares]), axis=1)
    starts, widths = np.arange(parts)[:, None], np.arange(1, parts // 2)
    share, square = twice[:, starts + widths] - twice[:, starts]
    in_out = np.array([[share, 1.0 - share], [square, 1.0 - square]]) + 1e-12
    gain = 0.5 * left.size * np.sum(in_out[0] * np.log(in_out[0] / in_out[1]), axis=0)
    gain[square <= share] = 0.0
    gain[share * left.size < LOW * SAMPLED] = 0.0
    at, width = np.unravel_index(np.argmax(gain), gain.shape)
    if gain[at, width] > np.log(gain.size) + STANDS_OUT:
        functions = int(min(HARMONICS, share[at, width] * left.size / SAMPLED))
        yield Sector(at * 360.0 / parts, widths[width] * 360.0 / parts, functions, gain.size)


@dataclass(frozen=True)
class Sawtooth:
    """A ramp over a turn that falls back at one place.

    Attributes
    ----------
    before, after : float
        Neighbouring places, degrees, between which it falls back.
    count : int
        Of how many such gaps.
    """

    before: float
    after: float
    count: int

    @property
    def where(self) -> float:
        """The middle, degrees from 0 to 360."""
        return (0.5 * (self.before + self.after)) % 360.0

    @property
    def grid(self) -> tuple[float, float]:
        """Places by which it is drawn, degrees."""
        return self.before % 360.0, self.after % 360.0

    def values(self, degrees: Array) -> Array:
        """The ramp, degrees, as a column."""
        return np.mod(degrees - self.where, 360.0)[:, None]


def less_lines(theta: Array, values: Array, orders: Iterable[float]) -> Array:
    """Columns of values less what lines and a constant take of them."""
    lines = [line_columns(theta, float(m)) for m in orders]
    columns = np.column_stack([np.ones(theta.size), *lines])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=1e-9)[0])


def jumps(degrees: Array, left: Array) -> list[Sawtooth]:
    """Ramps that explain most of values less low orders.

    Of all gaps between places that whose ramp, less its own low orders, explains most, and then the
    next: a sensor that does not use all of its counts jumps where they begin, a facet at both ends.
    """
    places = np.unique(np.round(degrees, 9) % 360.0)
    if places.size <= 2 * LOW + 2:
        return []
    gaps = [
        Sawtooth(float(a), float(b), places.size)
        for a, b in zip(places, np.append(places[1:], places[0] + 360.0), strict=True)
    ]
    coarse = np.unique(np.linspace(0, places.size - 1, min(places.size, TRIED)).astype(int))
    known = _unit_ramps(degrees, [gaps[k] for k in coarse])
    found: list[Sawtooth] = []
    while len(found) < ENDS:
        tried, ramps = coarse, known
        while True:
            best = int(np.argmax((left @ ramps) ** 2))
            if tried.size < 3 or tried[-1] - tried[0] == tried.size - 1:
                break
            tried = np.arange(tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)] + 1)
            ramps = _unit_ramps(degrees, [gaps[k] for k in tried])
        size = float(ramps[:, best] @ left)
        if not size**2 > 2.0 * STANDS_OUT * float(left @ left) / left.size:
            break  # noise makes as much of one of many gaps
        found.append(gaps[tried[best]])
        left = left - size * ramps[:, best]
    return found


def _unit_ramps(degrees: Array, gaps: list[Sawtooth]) -> Array:
    """Ramps less their own low orders, of length 1."""
    ramps = np.hstack([gap.values(degrees) for gap in gaps])
    ramps = less_lines(np.radians(degrees), ramps, range(1, LOW + 1))
    return np.asarray(ramps / np.maximum(np.linalg.norm(ramps, axis=0), 1e-6))
