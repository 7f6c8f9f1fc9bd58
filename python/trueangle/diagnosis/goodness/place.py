"""Errors that return at the same place, constant or modulated by direction, speed or load.

Each unit u (a run, or a piece of one of few runs) gives one complex sum per order m,

::

    z_um = Σ_{t in u} g_t e_t exp(-i m θ_t),    w_um = z_um / s_um,

with a modulator g (1, direction, speed and others) and s the level of the unit's own spectrum about
m, so that neither correlation nor unequal noise matters. What is bound to place adds up over
units, noise does not:

::

    T_m = |Σ_u w_um|² / U ~ Exp(1),
    |Σ_u w_um|² / (U Σ_u |w_um|²) ~ Beta(1, U - 1).

The second holds for any spectrum, the first where a few units agree by
accident; the larger p of the two counts. Orders are tried one by one, and the lowest 4, 8, 16
and so on together, which the p value includes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ...support.arrays import Array
from ...support.display_units import brief_number
from ...support.distributions import incomplete_gamma_tail, student_tail
from .evidence import Evidence, drawn_signs, largest_of, made_even
from .leftover import Leftover

Complex = NDArray[np.complex128]

#: Orders tested unless more are requested.
LEAST_ORDERS = 64

#: Orders to each side that make the level of a unit's spectrum; least number over all units.
HALF_WINDOW, POOLED = 4, 40

#: Widths of bands of the lowest orders.
BANDS = (4, 8, 16, 32, 64, 128)

#: Share of the sum of sizes below which a sum of products is the rounding of nothing.
ROUNDED = 1e-9

#: Share of a modulator's power from which on it changes within runs.
MOVES = 1e-3

#: Factors that are not tested by direction too.
ALONE = ("time in the run", "sign of the torque")

#: Spread of a factor, in shares of its size, from which on it counts as changing.
CHANGES = 0.05


@dataclass(frozen=True)
class _Modulator:
    name: str
    values: Array
    what: str
    looks_like: str


def place_tests(left: Leftover, top: float = LEAST_ORDERS) -> list[Evidence]:
    """One test for each way in which place may matter.

    Parameters
    ----------
    left : Leftover
    top : float
        Highest output order.

    Returns
    -------
    list of Evidence
        ``place``, ``place x direction`` where both were measured, and place by speed,
        torque, temperature where these change, each also by direction. About 1 ns per
        reading, order and modulator.
    """
    units = left.units()
    if len(units) < 2 or not np.any(left.residual):
        return []
    step = _step(left)
    most = 0.5 * left.places  # of more orders no place shows any
    count = int(max(min(max(min(top, 1024.0) / step, 8.0), most / step), 1.0))
    modulators = _modulators(left)
    values = left.centred(units)
    starts = np.array([start for start, _ in units])
    sizes = np.array([stop - start for start, stop in units], dtype=np.float64)
    modulated = np.column_stack([values * m.values for m in modulators])
    sums = _sums(modulated, left.theta, step, count, starts)
    found = []
    for k, modulator in enumerate(modulators):
        found.append(_judged(modulator, sums[:, :, k], sizes, step, left, units))
    return found


def _step(left: Leftover) -> float:
    """Orders resolved by the travel: whole ones, or wider apart over a part of a turn."""
    return 1.0 if left.turns > 0.9 else 1.0 / max(left.turns, 1e-3)


def _modulators(left: Leftover) -> list[_Modulator]:
    ones = np.ones(len(left))
    text = "repeats at the same places"
    found = [_Modulator("place", ones, text, "depends on place")]
    moving = left.direction[left.direction != 0.0]
    both = moving.size > 0 and np.ptp(moving) > 0.0
    if both:
        text = "differs between the directions of travel at the same place"
        looks_like = "depends on place and direction"
        found.append(_Modulator("place x direction", left.direction, text, looks_like))
    for name, values in left.factors.items():
        spread = float(np.std(values))
        if spread <= CHANGES * float(np.abs(values).max(initial=0.0)) or spread == 0.0:
            continue
        g = (values - values.mean()) / spread
        text = f"at the same places changes with the {name}"
        found.append(_Modulator(f"place x {name}", g, text, f"follows the {name}"))
        if both and name not in ALONE:
            text = f"differs between the directions by an amount that changes with the {name}"
            looks_like = f"follows the {name} by direction"
            by_both = g * left.direction
            found.append(_Modulator(f"place x direction x {name}", by_both, text, looks_like))
    return found


def _sums(
    values: Array, theta: Array, step: float, count: int, starts: NDArray[np.int64]
) -> Complex:
    """Sums over units of ``values exp(-i m theta)``, m = step ... count step."""
    columns = np.ascontiguousarray(values.T)
    sums = _core.unit_sums(theta, columns, starts.tolist(), step, step, count)
    return sums.view(np.complex128)


def _level(power: Array, half: int) -> Array:
    """Running mean over the orders, narrower at the ends so as to stay about the order."""
    count = power.shape[0]
    total = np.vstack([np.zeros((1, power.shape[1])), np.cumsum(power, axis=0)])
    k = np.arange(count)
    reach = np.minimum(half, count - 1)
    low = np.clip(k - reach, 0, max(count - 2 * reach - 1, 0))
    high = np.minimum(low + 2 * reach + 1, count)
    return np.asarray((total[high] - total[low]) / (high - low)[:, None])


def _judged(
    modulator: _Modulator,
    z: Complex,
    sizes: Array,
    step: float,
    left: Leftover,
    units: list[tuple[int, int]],
) -> Evidence:
    count, n_units = z.shape
    half = max(HALF_WINDOW, -(-POOLED // (2 * n_units)))
    level = np.sqrt(np.maximum(_level(np.abs(z) ** 2, half), 1e-300))
    level = np.maximum(level, ROUNDED * level.max())  # a unit of rounding alone has no information
    w = np.sqrt(sizes / sizes.mean()) * z / level
    alone = None if modulator.name == "place" else unit_sums(modulator.values, left, units)
    p, statistic, band, k, logs = _smallest(w, alone, np.ones(n_units))
    # Trials depend on each other: the same search with random signs shows how much.
    p = made_even(p, [_smallest(w, alone, signs)[0] for signs in drawn_signs(n_units)])
    size = 0.0 if alone is None else alone.size
    # Power of a line beyond the expected sum of its units with random phases.
    whole = max(float((modulator.values**2).sum()), 1e-300)
    excess = np.abs(z.sum(axis=1)) ** 2 - (np.abs(z) ** 2).sum(axis=1)
    power = 2.0 * np.maximum(excess, 0.0) / whole**2
    is_clear = np.exp(-logs) * count < 0.01
    if band > 0.0:
        detail = f"strongest in the orders up to {band * step:.4g}"
        rms = float(np.sqrt(power[: int(band)].sum()))
    elif band < 0.0:
        detail = f"by about {brief_number(abs(size))} arcsec at every place"
        rms = abs(size) * float(np.sqrt(whole / len(left)))
    else:
        amplitude = float(np.sqrt(2.0 * power[k]))
        detail = f"strongest at order {(k + 1) * step:.4g}, about {brief_number(amplitude)} arcsec"
        rms = float(np.sqrt(power[is_clear].sum()))
    says = f"the residual {modulator.what}: {detail}"
    lines = tuple((step * (1.0 + np.flatnonzero(is_clear))).tolist()) if alone is None else ()
    looks_like = modulator.looks_like
    return Evidence(modulator.name, statistic, p, says, rms=rms, looks_like=looks_like, lines=lines)


def _smallest(
    w: Complex, alone: ModulatedSums | None, signs: Array
) -> tuple[float, float, float, int, Array]:
    """Smallest p value of orders, bands of them and the modulator alone, and what has it.

    The p value, its statistic, the band (0 for one order, -1 for none), the order that is
    most significant, and the evidence of every order.
    """
    count, n_units = w.shape
    coherent = np.abs(w @ signs) ** 2
    own = np.sum(np.abs(w) ** 2, axis=1)
    share = np.minimum(coherent / np.maximum(n_units * own, 1e-300), 1.0 - 1e-16)
    logs = np.minimum(coherent / n_units, -(n_units - 1) * np.log1p(-share))
    k = int(np.argmax(logs))
    one = largest_of(float(np.exp(-logs[k])), count)
    trials: list[tuple[float, float, float]] = [(one, float(logs[k]), 0.0)]
    sums = np.cumsum(logs)
    for width in BANDS:
        if width < count:
            total = float(sums[width - 1])
            p = incomplete_gamma_tail(float(width), total)
            trials.append((p, total / width, float(width)))
    if alone is not None:
        trials.append((alone.chance(signs), 0.0, -1.0))
    p, statistic, band = min(trials)
    # Bands hold each other: as many as half of them are independent, about.
    return largest_of(p, 1.0 + 0.5 * (len(trials) - 1)), statistic, band, k, logs


@dataclass(frozen=True)
class ModulatedSums:
    """Sums over units of a modulator times the residual, and the amplitude they correspond to."""

    sums: Array
    size: float

    def chance(self, signs: Array | float = 1.0) -> float:
        """Probability of as large a sum by the scatter of units; some may change their sign."""
        n, power = self.sums.size, float(self.sums @ self.sums)
        if self.size == 0.0:
            return 1.0
        square = min(float((self.sums * signs).sum()) ** 2 / power, n * (1.0 - 1e-12))
        return 2.0 * student_tail(float(np.sqrt(square * (n - 1) / (n - square))), n - 1)


def unit_sums(g: Array, left: Leftover, units: list[tuple[int, int]]) -> ModulatedSums:
    """Of the modulator itself, at no place in particular."""
    # Within runs, or between them where it does not change within any.
    inside = left.centred(left.bounds)
    # What scatters about a level that a run keeps is the noise of its sensor: no change.
    within = sum(float(np.sum((g[a:b] - g[a:b].mean()) ** 2)) for a, b in left.bounds)
    moves = within > MOVES * float(np.sum((g - g.mean()) ** 2))
    e = inside if moves else left.residual - left.residual.mean()
    sums = np.array([float(g[a:b] @ e[a:b]) for a, b in units])
    centre = g.mean()
    own = sum(
        float(np.sum((g[a:b] - (g[a:b].mean() if moves else centre)) ** 2))
        for a, b in (left.bounds if moves else units)
    )
    product = float(g @ e)
    told = (
        len(units) >= 3
        and own > 0.0
        and float(sums @ sums) > 0.0
        and abs(product) > ROUNDED * float(np.abs(g) @ np.abs(e))
    )
    return ModulatedSums(sums, product / own if told else 0.0)
