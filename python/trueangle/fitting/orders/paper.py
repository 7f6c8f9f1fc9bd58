"""The paper's selection of orders: prominent amplitude and a phase that repeats.

"An Angle Error Compensation Method Based on Harmonic Analysis for Integrated Joint
Modules", Sensors 2020: Eq. 1 fitted to each run, amplitude and phase by Eq. 2, orders
kept by eye from both (Figs. 6 and 7), averaged, and verified on a held-out run (Fig. 9).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError
from ...runs.aliasing import Positions
from ...runs.run import CalibrationRun
from ...support.arrays import Array, median
from .candidates import Candidates
from .lookalikes import find_lookalikes
from .noise import ReadingVariance
from .phases import circular_range_deg
from .result import OrderSelection
from .selection import FALSE_ALARM
from .table import OrderRow
from .verdicts import row_with_verdict, selection_notes
from .zerogroups import ZeroGroupReadings, zero_groups

#: Phases of a retained order lie within this arc over the runs. Noise alone stays within
#: 60 degrees over five runs in 0.4 % of cases, within the paper's "about 10" in 3e-6,
#: which in turn loses an order of 10 standard errors every other time.
PHASE_RANGE_DEG: Final = 60.0

#: A retained order has at least this share of the largest amplitude.
PROMINENCE: Final = 0.1


#: Degrees of freedom from which a variance is known.
_NORMAL: Final = 1e9


def log_chance(statistic: float, dof: float) -> float:
    """Logarithm of the probability that noise alone reaches ``statistic`` of two coefficients.

    ::

        P{2 F(2, ν) > T} = (1 + T / ν)^(-ν / 2)
    """
    v = min(dof, _NORMAL)
    return -0.5 * v * math.log1p(max(statistic, 0.0) / v)


def _run_coefficients(
    units: Sequence[ZeroGroupReadings], orders: Sequence[float]
) -> tuple[Array, Array]:
    """A and B of Eq. 1 for each run by itself, its constant fitted too.

    Returns
    -------
    coefficients : ndarray of complex, shape (runs, orders)
        ``B + iA``, whose argument is the phase ``atan2(A, B)`` of Eq. 2.
    residuals : ndarray, shape (runs,)
        Weighted sum of squared residuals of each run.

    Raises
    ------
    ArgumentError
        A run whose positions do not hold all orders.
    """
    angular = 2.0 * math.pi * np.asarray(orders, dtype=np.float64)
    found, left = [], []
    for unit in units:
        x = unit.turns[:, None] * angular
        root = np.sqrt(unit.weights)
        design = np.concatenate([np.ones((x.shape[0], 1)), np.cos(x), np.sin(x)], axis=1)
        solution, _, rank, _ = np.linalg.lstsq(
            design * root[:, None], unit.error * root, rcond=1e-10
        )
        if rank < design.shape[1]:
            raise ArgumentError(
                f"run {unit.label} cannot hold {len(orders)} orders by itself, as the paper's "
                "method needs: give fewer candidates, or use `method='evidence'`"
            )
        cosine, sine = solution[1:].reshape(2, -1)
        found.append(sine + 1j * cosine)
        left.append(float((((unit.error - design @ solution) * root) ** 2).sum()))
    return np.array(found), np.array(left)


def select_by_paper(
    runs: Sequence[CalibrationRun], positions: Positions, candidates: Candidates
) -> OrderSelection:
    """Orders that the paper's rules retain, for comparison with selection by evidence.

    Every run but the last is fitted by itself; an order is kept when its amplitude is
    prominent and its phase repeats; the last run verifies. Put right against the paper:

    - 37 readings from 0 to 360 degrees are 36 positions, so that the highest order is 17
      because 18 has no sine there (the paper counts N = 37);
    - the constant is the least-squares intercept of each run and a nuisance, not the mean
      of 17 readings (below Eq. 5);
    - phases are ``atan2(A, B)`` (Eq. 2 has a one-argument arctan), their range is taken on
      the circle, and runs are averaged as A and B: phases that straddle 0/360 would
      otherwise average to nonsense, and amplitudes of absent orders to 1.25 standard errors;
    - "peak value" is peak-to-peak.

    The rules test that an order repeats, not where it comes from: an alias repeats too.
    """
    if len(runs) < 3:
        raise ArgumentError(
            f"`method='paper'` compares runs and holds one out: give three or more, got {len(runs)}"
        )
    orders = [k for k in candidates.orders if k in candidates.main and k <= candidates.highest]
    if not orders:
        raise ArgumentError("all orders are above the Nyquist limit; read at more positions")
    units, places = zero_groups(runs, candidates.whole)
    placed = positions.of_rows(places)
    training, held = units[:-1], units[-1]
    each, left = _run_coefficients(training, orders)
    mean = each.mean(axis=0)
    amplitude = np.abs(mean)
    scatter = (np.abs(each - mean) ** 2).sum(axis=0) / (2.0 * (len(training) - 1) * len(training))
    spread = circular_range_deg(np.angle(each))
    prominent = amplitude >= PROMINENCE * amplitude.max()
    kept = prominent & (spread <= PHASE_RANGE_DEG)
    gains = _gains(held, orders, mean, kept)
    dof = 2 * (len(training) - 1)
    free = max(1, sum(u.turns.size for u in training) - len(training) * (2 * len(orders) + 1))
    noise = ReadingVariance(float(left.sum()) / free, free, "residual")
    if free < len(training) * 3:
        # A run of 36 positions holds 35 unknowns: only the scatter of runs shows noise.
        per_run = float(np.mean([u.weights.sum() for u in training]))
        variance = 0.5 * per_run * float(median(scatter)) * len(training)
        noise = ReadingVariance(variance, dof * len(orders), "repeats")
    retained = [orders[n] for n in np.flatnonzero(kept)]
    alike = find_lookalikes(units, placed, retained, noise.variance, candidates.highest_alias)
    aliases = dict(zip(retained, alike, strict=True))
    rows, share = [], math.log(len(orders) / FALSE_ALARM)
    for n, k in enumerate(orders):
        t = float(amplitude[n] ** 2 / scatter[n]) if scatter[n] > 0.0 else math.inf
        chance = (log_chance(float(t), dof) + math.log(len(orders))) / math.log(10.0)
        verdict = "retained" if kept[n] else ("small" if not prominent[n] else "phase varies")
        row = OrderRow(
            order=k,
            retained=bool(kept[n]),
            verdict=verdict,
            cosine=float(mean[n].imag),
            sine=float(mean[n].real),
            standard_error=math.sqrt(float(scatter[n])),
            statistic=t,
            log10_false_alarm=min(0.0, chance),
            holdout_gain=float(gains[n]),
            phase_spread_deg=float(spread[n]),
            aliases=tuple(aliases.get(k, ())),
            needed=math.sqrt(float(scatter[n]) * dof * math.expm1(2.0 / dof * share)),
        )
        rows.append(row)
    amplitudes = {row.order: row.amplitude for row in rows if row.retained}
    rows = [row_with_verdict(row, candidates, placed, amplitudes) for row in rows]
    before, after = (_residual(held, orders, mean, which) for which in (np.zeros_like(kept), kept))
    selection = OrderSelection(
        orders=tuple(retained),
        table=tuple(rows),
        reason="" if retained else "no order is both prominent and repeats its phase",
        method="paper",
        period=runs[0].period,
        positions=placed,
        samples=sum(u.turns.size for u in units),
        runs=len(runs),
        noise=noise,
        holdout="the last run",
        holdout_rms=(float(np.sqrt(np.mean(before**2))), float(np.sqrt(np.mean(after**2)))),
        gear_ratio=candidates.gear_ratio,
    )
    notes = (
        *_verification(before, after, runs[0].period),
        *selection_notes(selection, candidates, runs),
    )
    return selection.with_notes(notes)


def _residual(
    held: ZeroGroupReadings,
    orders: Sequence[float],
    mean: NDArray[np.complex128],
    which: NDArray[np.bool_],
) -> Array:
    """The held-out run less the chosen orders, about its own zero."""
    angular = 2.0 * math.pi * np.asarray(orders, dtype=np.float64)[which]
    model = (np.exp(1j * held.turns[:, None] * angular) * mean[which]).imag.sum(axis=1)
    left = held.error - model
    return np.asarray(left - np.average(left, weights=held.weights))


def _gains(
    held: ZeroGroupReadings,
    orders: Sequence[float],
    mean: NDArray[np.complex128],
    kept: NDArray[np.bool_],
) -> Array:
    """Reduction of the held-out mean square by each order added to the kept ones."""
    gains = np.empty(len(orders))
    for n in range(len(orders)):
        with_, without = kept.copy(), kept.copy()
        with_[n], without[n] = True, False
        before = float(np.mean(_residual(held, orders, mean, without) ** 2))
        after = float(np.mean(_residual(held, orders, mean, with_) ** 2))
        gains[n] = (before - after) / before if before > 0.0 else 0.0
    return gains


def _verification(before: Array, after: Array, period: float) -> tuple[str, ...]:
    scale = 1_296_000.0 / period
    first, last = scale * float(np.ptp(before)), scale * float(np.ptp(after))
    share = 100.0 * (1.0 - last / first) if first > 0.0 else 0.0
    return (
        f"the last run verifies: {first:.2f} -> {last:.2f} arcsec peak-to-peak at its positions "
        f"({share:.2f} % less)",
    )
