"""``heads``: several reading heads on one disc.

Every head reads the disc's pattern at its own place: ``h_i = s_i + error(s_i)`` with
``s_i = theta + alpha_i``. Differences of heads hold no motion at all.

What it can never see: the zero; orders at which all heads see the same, ``k (alpha_i -
alpha_j)`` whole turns for all of them; errors of a head's own electronics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from ..errors import ArgumentError, NoModelError
from ..support.angles import wrap
from ..support.arrays import Array
from .dense import DenseFit, dense_fixed_point, fit_dense, patterns_apart
from .densetriangle import DenseRows
from .model import ENCODER, pattern_model, reference_free_calibration
from .orderchoice import significant_orders
from .projected import harmonic_rows, harmonic_unknowns
from .recording import Recording
from .result import Blind, HeldOutPattern, OrderEstimate, SelfCalibration, order_estimates
from .verification import chance_of_parts, judged_patterns

#: Heads whose readings differ by less than this share one zero (radians: half a degree).
_SAME: Final = math.radians(0.5)

_CHUNK: Final = 8192


def head_patterns(
    recordings: Sequence[Recording],
    orders: str | Sequence[float] = "auto",
    *,
    angles: Sequence[float] | None = None,
    period: float = 360.0,
) -> SelfCalibration:
    """Patterns from differences of heads; ``angles`` in degrees where readings share a zero."""
    numbers = sorted(recordings[0].heads)
    if len(numbers) < 2 or any(sorted(r.heads) != numbers for r in recordings):
        raise NoModelError(
            f"{recordings[0].named}: two heads or more are needed in every run, as columns "
            f"head1_deg, head2_deg ...; got {', '.join(f'head{i}' for i in numbers) or 'none'}"
        )
    places = _places(recordings, numbers, angles)
    readings = [np.stack([r.heads[i] for i in numbers]) + s[:, None] for r, s in places]
    wanted = tuple(float(k) for k in range(1, 33)) if isinstance(orders, str) else orders
    fit = _fit(readings, wanted)
    blind = _blind(fit, wanted, numbers, readings)
    lost = {k for b in blind for k in b.orders}
    kept = tuple(k for k in wanted if k not in lost)
    if isinstance(orders, str):
        kept = significant_orders(fit.projected, fit.patterns, fit.covariance, kept)
    if not kept:
        raise NoModelError(
            f"{recordings[0].named}: the heads differ at no significant order; record longer"
        )
    fit = _fit(readings, kept)
    count = sum(h.size for h in readings)
    noise = math.sqrt(fit.projected.variance)
    table = order_estimates(
        kept,
        fit.patterns,
        fit.covariance,
        fit.projected.retained(),
        noise * math.sqrt(2.0 / count),
    )
    turns = sum(float(np.ptp(np.unwrap(h[0]))) for h in readings) / (2.0 * math.pi)
    notes = _notes(fit, readings, numbers, turns, table)
    blind.insert(0, Blind.zero("no reading without a reference shows it"))
    return reference_free_calibration(
        table,
        "heads",
        blind,
        notes,
        recordings,
        readings=count,
        noise=noise,
        period=period,
        turns=turns,
        held_out=_held_out(readings, kept, fit),
        beside={"head_angles_deg": [math.degrees(a) % 360.0 for a in _angles(readings)]},
    )


def _places(
    recordings: Sequence[Recording], numbers: Sequence[int], angles: Sequence[float] | None
) -> list[tuple[Recording, Array]]:
    """What to add to each head's reading to have its place on the disc's scale."""
    if angles is not None:
        given = np.radians(np.asarray(angles, dtype=np.float64))
        if given.shape != (len(numbers),) or not np.isfinite(given).all():
            raise ArgumentError(
                f"head_angles needs one angle for each of {len(numbers)} heads, got {angles!r}"
            )
    found = []
    for r in recordings:
        gaps = np.array(
            [
                float(np.angle(np.exp(1j * (r.heads[i] - r.heads[numbers[0]])).mean()))
                for i in numbers
            ]
        )
        shared = bool(np.abs(wrap(gaps)).max() < _SAME)
        if shared and angles is None:
            raise NoModelError(
                f"{r.named}: the heads read the same angle, so their zeros were set equal "
                "and their places are unknown: give them (`head_angles=[0, 119.2, 203.7]`)"
            )
        found.append(
            (r, given - given[0] if shared and angles is not None else np.zeros(len(numbers)))
        )
    return found


def _fit(readings: Sequence[Array], orders: Sequence[float]) -> DenseFit:
    """Fixed point over the places: patterns at corrected readings."""
    columns = harmonic_unknowns(ENCODER, orders)
    lost = _common(readings)

    def at(coefficients: Array, _settled: bool) -> DenseFit:
        parts = list(_rows(readings, orders, coefficients))
        return fit_dense(parts, columns, freedom_lost=lost)

    return dense_fixed_point(at, len(columns))


def _common(readings: Sequence[Array]) -> float:
    """Rows without information of their own: one per angle, for the mean of the heads."""
    return float(sum(h.shape[1] for h in readings))


def _rows(
    readings: Sequence[Array], orders: Sequence[float], coefficients: Array
) -> list[DenseRows]:
    """Differences to the mean of the heads, a zero for every head and run."""
    model = pattern_model(orders, coefficients)
    runs, n = len(readings), len(readings[0])
    parts = []
    for j, h in enumerate(readings):
        places = model.correct(h)
        zero = np.angle(np.exp(1j * (h - h[:1])).mean(axis=1))
        for a in range(0, h.shape[1], _CHUNK):
            part = slice(a, a + _CHUNK)
            rows = np.stack([harmonic_rows(s, orders) for s in places[:, part]])  # (n, 2K, rows)
            alone = (rows**2).sum(axis=(0, 2))
            rows -= rows.mean(axis=0)
            gap = wrap(h[:, part] - h[:1, part] - zero[:, None])
            gap -= gap.mean(axis=0)
            size = gap.shape[1]
            nuisances = np.zeros((n, size, runs * (n - 1)))
            for i in range(1, n):
                column = np.full(n, -1.0 / n)
                column[i] += 1.0
                nuisances[:, :, j * (n - 1) + i - 1] = column[:, None]
            parts.append(
                DenseRows(
                    rows.transpose(0, 2, 1).reshape(n * size, -1),
                    nuisances.reshape(n * size, -1),
                    gap.ravel(),
                    alone,
                    n,
                )
            )
    return parts


def _angles(readings: Sequence[Array]) -> Array:
    mean = np.mean([np.exp(1j * (h - h[:1])).mean(axis=1) for h in readings], axis=0)
    return np.asarray(np.angle(mean))


def _blind(
    fit: DenseFit,
    orders: Sequence[float],
    numbers: Sequence[int],
    readings: Sequence[Array],
) -> list[Blind]:
    retained = fit.projected.retained()
    lost = tuple(
        # Differences of heads show less of an order than this: refused (a factor of 30).
        k
        for i, k in enumerate(orders)
        if float(np.min(retained[2 * i : 2 * i + 2])) < 1e-3
    )
    if not lost:
        return []
    angle = np.degrees(_angles(readings)) % 360.0
    where = ", ".join(f"{a:.4g}" for a in angle)
    return [
        Blind(
            lost,
            f"with heads at {where} deg these orders are equal at all heads (order {lost[0]:g} at "
            f"head {numbers[0]} is the same at every head): differences hold nothing of them",
            "move one head, or add one, off the equal spacing "
            '(`trueangle.planning.plan_self("heads")`)',
        )
    ]


def _notes(
    fit: DenseFit,
    readings: Sequence[Array],
    numbers: Sequence[int],
    turns: float,
    table: Sequence[OrderEstimate],
) -> list[str]:
    angle = _angles(readings)
    left = [
        o for o in table if abs(np.exp(1j * o.order * angle).mean()) * o.amplitude > 3.0 * o.std
    ]
    notes = [f"the model corrects the reading of head {numbers[0]}"]
    if left:
        worst = max(left, key=lambda o: abs(np.exp(1j * o.order * angle).mean()) * o.amplitude)
        size = abs(np.exp(1j * worst.order * angle).mean()) * worst.amplitude
        notes.append(
            f"the mean of the heads keeps {size:.3g} arcsec of order {worst.order:g}, the most "
            "of all"
        )
    else:
        notes.append("the mean of the heads keeps none of the orders given")
    if turns < 0.95:
        notes.append(f"only {turns:.2f} turns were travelled: orders are correlated")
    return [*notes, *fit.notes]


def _held_out(
    readings: Sequence[Array], orders: Sequence[float], whole: DenseFit
) -> dict[str, HeldOutPattern]:
    """Odd turns against even ones."""
    odd = [np.floor(np.unwrap(h[0]) / (2.0 * math.pi)).astype(np.int64) % 2 == 1 for h in readings]
    heads = len(readings[0])
    enough = 8 * len(orders)
    if min(sum(int((turn == which).sum()) for turn in odd) for which in (True, False)) < enough:
        return {}
    rows = _rows(readings, orders, whole.patterns)
    groups = [
        np.tile(turn[a : a + _CHUNK], heads) for turn in odd for a in range(0, turn.size, _CHUNK)
    ]
    fit = patterns_apart(rows, groups, harmonic_unknowns(ENCODER, orders), _common(readings))
    first, second = np.split(fit.patterns, 2)
    noise = math.sqrt(whole.projected.variance)
    names = ("odd turns", "even turns")
    return {"odd_even_turns": judged_patterns(first, second, chance_of_parts(fit), noise, names)}
