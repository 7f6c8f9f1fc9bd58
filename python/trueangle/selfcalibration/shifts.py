"""``shifts``: two encoders, or an encoder and a polygon, clamped at several angles.

``d_j = z_j + error_a(s_a) - error_b(s_b)``: each reads its own pattern at its own place, and
turning one against the other moves the patterns apart. Coupling errors that change with every
clamping are random terms of orders 1 and 2.

What it can never see: the zero; orders at which all shifts are whole turns, ``k (phi_i -
phi_j)``; what changes with the clamping in the same way for both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from ..errors import NoModelError
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.distributions import f_tail
from ..support.layout import order_ranges
from .dense import DenseFit, dense_fixed_point, fit_dense
from .densetriangle import DenseRows
from .model import ENCODER, pattern_model, reference_free_calibration
from .orderchoice import significant_orders
from .projected import NOT_SEEN, Unknown, harmonic_rows, harmonic_unknowns
from .recording import Clampings, Recording, clampings_of
from .result import ARCSEC, Blind, HeldOutPattern, SelfCalibration, order_estimates

OTHER: Final = "the other encoder"
FACETS: Final = "the polygon's facets"


#: An order that retains less, jointly with the other pattern, is refused.
_LEAST: Final = 1e-3


def shift_patterns(
    recordings: Sequence[Recording],
    orders: str | Sequence[float] = "auto",
    *,
    period: float = 360.0,
) -> SelfCalibration:
    """Both patterns from readings at several shifts; see `trueangle.selfcal`."""
    design = clampings_of(recordings)
    if isinstance(orders, str):
        highest = design.facets // 2 if design.facets else 32
        wanted = tuple(float(k) for k in range(1, highest + 1))
    else:
        wanted = tuple(orders)
    if design.facets and any(k > design.facets / 2 for k in wanted):
        raise NoModelError(
            f"{recordings[0].named}: {design.facets} facets show orders up to "
            f"{design.facets // 2}, order {max(wanted):g} looks like order "
            f"{abs(max(wanted) - design.facets):g} there; leave it out"
        )
    fit = _fit(design, wanted)
    lost = _lost(fit, wanted)
    kept = tuple(k for k in wanted if k not in lost)
    if isinstance(orders, str) and not design.facets:
        kept = significant_orders(fit.projected, fit.patterns, fit.covariance, kept, None)
        kept = tuple(sorted({*kept, *lost}))
        fit = _fit(design, kept)
        kept = tuple(k for k in kept if k not in lost)
    if not kept:
        raise NoModelError(
            f"{recordings[0].named}: no order can be determined: "
            + (
                f"all shifts are equivalent at orders {order_ranges(lost)}"
                if lost
                else "none is significant"
            )
        )
    count = sum(a.size for a in design.joint)
    if count <= len(design.joint) + fit.projected.rank:
        raise NoModelError(
            f"{recordings[0].named}: {count} readings are not more than the unknowns (zeros, "
            "orders, facets), so no error can be stated: clamp at one more angle, or give fewer "
            "orders"
        )
    noise = math.sqrt(fit.projected.variance)
    limit = noise * math.sqrt(2.0 / count)
    at = [i for k in kept for i in fit.projected.index(ENCODER, k)]
    retained = fit.projected.retained()
    # Of the order at half the number of facets only the cosine is identifiable.
    for first in at[::2]:
        if fit.projected.alone[first + 1] == 0.0:
            retained[first + 1] = retained[first]
    covariance = fit.covariance[np.ix_(at, at)]
    table = order_estimates(kept, fit.patterns[at], covariance, retained[at], limit)
    blind = [Blind.zero("the zero: only differences of two readings are measured")]
    if lost:
        where = ", ".join(f"{math.degrees(s) % 360.0:.4g}" for s in design.shift)
        what = FACETS if design.facets else OTHER
        blind.append(
            Blind(
                lost,
                f"at shifts of {where} deg order k of {ENCODER} and order k of {what} are "
                "confounded: k times every shift is the same part of a turn",
                "clamp at one more angle, off the equal spacing "
                '(`trueangle.planning.plan_self("shifts")`)',
            )
        )
    notes = [*design.notes, *_notes(design, fit)]
    return reference_free_calibration(
        table,
        "shifts",
        blind,
        notes,
        recordings,
        readings=count,
        noise=noise,
        period=period,
        turns=sum(float(np.ptp(np.unwrap(a))) for a in design.joint) / (2.0 * math.pi),
        held_out=_held_out(design, tuple(sorted({*kept, *lost})), fit),
        beside=_beside(design, fit, lost, limit),
    )


def _columns(design: Clampings, orders: Sequence[float]) -> list[Unknown]:
    columns = harmonic_unknowns(ENCODER, orders)
    if design.facets:
        return columns + [Unknown(f"facet {i}", 0.0, "") for i in range(design.facets)]
    return columns + harmonic_unknowns(OTHER, orders)


def _fit(design: Clampings, orders: Sequence[float], runs: Sequence[int] | None = None) -> DenseFit:
    """Fixed point over the places on both scales."""
    runs = range(len(design.joint)) if runs is None else runs
    columns = _columns(design, orders)
    coupling = len(runs) >= 3

    def at(coefficients: Array, settled: bool) -> DenseFit:
        parts = [
            _rows(design, j, i, len(runs), orders, coefficients, coupling and settled)
            for i, j in enumerate(runs)
        ]
        random = list(range(len(runs), parts[0].nuisances.shape[1]))
        # A lattice shows a combination or does not; free places show some of them hardly.
        return fit_dense(parts, columns, random, floor=_LEAST if design.facets else NOT_SEEN)

    return dense_fixed_point(at, len(columns))


def _rows(
    design: Clampings,
    j: int,
    i: int,
    runs: int,
    orders: Sequence[float],
    coefficients: Array,
    coupling: bool,
) -> DenseRows:
    """Patterns of one clamping; nuisances: its zero and its coupling."""
    a, b = design.joint[j], design.other[j]
    m = 2 * len(orders)
    place = pattern_model(orders, coefficients[:m]).correct(a)
    mine = harmonic_rows(place, orders)
    if design.facets and orders and max(orders) * 2 == design.facets:
        # At half the number of facets the sine is the same at every position.
        flat = np.abs(mine[m - 1]).max() < 0.05
        if flat:
            mine[m - 1] = 0.0
    if design.facets:
        origin = float(np.mod(design.other[0][0], 2.0 * math.pi))
        index = np.round(np.mod(b - origin, 2.0 * math.pi) * design.facets / (2.0 * math.pi))
        theirs = np.zeros((design.facets, a.size))
        theirs[index.astype(np.int64) % design.facets, np.arange(a.size)] = -1.0
    else:
        other = pattern_model(orders, coefficients[m:]).correct(b)
        theirs = -harmonic_rows(other, orders)
    zero = float(np.angle(np.exp(1j * (a - b)).mean()))
    width = runs * (5 if coupling else 1)
    nuisances = np.zeros((a.size, width))
    nuisances[:, i] = 1.0
    if coupling:
        # Orders of a coupling that changes with the clamping.
        nuisances[:, runs + 4 * i : runs + 4 * i + 4] = harmonic_rows(place, (1.0, 2.0)).T
    target = zero + wrap(a - b - zero)
    return DenseRows(np.concatenate([mine, theirs]).T, nuisances, np.asarray(target))


def _lost(fit: DenseFit, orders: Sequence[float]) -> tuple[float, ...]:
    projected, told, lost = fit.projected, fit.projected.told, []
    for k in orders:
        both = [n for n in projected.index(ENCODER, k) if projected.alone[n] > 0.0]
        if not both or not told[both].all():
            lost.append(k)
    return tuple(lost)


def _beside(
    design: Clampings, fit: DenseFit, lost: Sequence[float], limit: float
) -> dict[str, Any]:
    found: dict[str, Any] = {"shifts_deg": [math.degrees(s) % 360.0 for s in design.shift]}
    noise = math.sqrt(fit.projected.variance)
    found["coupling_arcsec"] = math.sqrt(fit.random_variance) * noise * ARCSEC
    m = len(fit.patterns) - (design.facets or 0)
    if design.facets:
        values = fit.patterns[m:]
        covariance = fit.covariance[m:, m:]
        centre = np.eye(values.size) - 1.0 / values.size
        spread = np.diagonal(centre @ covariance @ centre)
        # Positions of the joint by the same fit; what is blind is split evenly between both.
        places = np.mod(design.joint[0], 2.0 * math.pi)
        orders = [c.order for c in fit.projected.columns if c.part == "cos"]
        error = fit.patterns[:m] @ harmonic_rows(places, orders)
        found["positions_deg"] = np.degrees(places).tolist()
        found["positions_arcsec"] = ((error - error.mean()) * ARCSEC).tolist()
        found["facets_arcsec"] = ((values - values.mean()) * ARCSEC).tolist()
        found["facets_std_arcsec"] = (np.sqrt(np.maximum(spread, 0.0)) * ARCSEC).tolist()
        return found
    orders = [c.order for c in fit.projected.columns if c.source == OTHER and c.part == "cos"]
    kept = [k for k in orders if k not in lost]
    at = [i for k in kept for i in fit.projected.index(OTHER, k)]
    table = order_estimates(
        kept,
        fit.patterns[at],
        fit.covariance[np.ix_(at, at)],
        fit.projected.retained(at),
        limit,
        OTHER,
    )
    found["other"] = [o.to_dict() for o in table]
    return found


def _notes(design: Clampings, fit: DenseFit) -> list[str]:
    notes = []
    if design.facets:
        notes.append(f"the other is a polygon of {design.facets} facets, each with its own error")
    if len(design.joint) < 3:
        notes.append(
            "two clampings: a coupling that changes with the clamping passes for orders 1 and 2; "
            "three or more would show it"
        )
    size = math.sqrt(fit.random_variance * fit.projected.variance) * ARCSEC
    if fit.random_variance > 0.0:
        notes.append(
            f"the coupling changes by {size:.3g} arcsec (rms, orders 1 and 2) from clamping to "
            "clamping"
        )
    return [*notes, *fit.notes]


def _held_out(
    design: Clampings, orders: Sequence[float], whole: DenseFit
) -> dict[str, HeldOutPattern]:
    """Each clamping predicted by the others."""
    runs = len(design.joint)
    if runs < 3:
        return {}
    before = after = 0.0
    count = 0
    for j in range(runs):
        fit = _fit(design, orders, [i for i in range(runs) if i != j])
        rows = _rows(design, j, 0, 1, orders, whole.patterns, False)
        # What the others cannot determine, and so not predict, is fitted here.
        seen = fit.projected.told
        here = np.concatenate([rows.patterns[:, ~seen], rows.nuisances], axis=1)
        basis_rows = _basis(here, 1e-6)
        told = rows.patterns[:, seen]

        def clear(values: Array, basis_rows: Array = basis_rows) -> Array:
            return np.asarray(values - basis_rows @ (basis_rows.T @ values))

        plain, left = clear(rows.target), clear(rows.target - told @ fit.patterns[seen])
        before += float(plain @ plain)
        after += float(left @ left)
        count += plain.size - basis_rows.shape[1]
    p = _chance_of_one_pattern(design, orders, whole)
    if count < runs or p is None:
        return {}
    return {
        "clampings": HeldOutPattern(
            "all clampings but one",
            "the one held out",
            math.sqrt(before / count) * ARCSEC,
            math.sqrt(after / count) * ARCSEC,
            p,
        )
    }


def _chance_of_one_pattern(
    design: Clampings, orders: Sequence[float], whole: DenseFit
) -> float | None:
    """Fisher's test of one pattern for all clampings against one for each.

    Both models contain the other's pattern and the couplings with their estimated variance; the
    rows are whitened. None where a pattern for each leaves no degrees of freedom.
    """
    runs, m = len(design.joint), 2 * len(orders)
    # The noise of whitened rows is what earlier readings do not predict.
    scale = math.sqrt(whole.random_variance * whole.correlation.level)
    common, apart = [], []
    for j in range(runs):
        rows = _rows(design, j, j, runs, orders, whole.patterns, True)
        block = np.concatenate(
            [rows.nuisances, rows.patterns[:, m:], rows.patterns[:, :m], rows.target[:, None]],
            axis=1,
        )
        block[:, runs : 5 * runs] *= scale
        block = whole.correlation.whitened(block)
        own = np.zeros((len(block), (runs - 1) * m))
        if j:
            own[:, (j - 1) * m : j * m] = block[:, -m - 1 : -1]
        common.append(block)
        apart.append(own)
    design_rows, more = np.concatenate(common), np.concatenate(apart)
    prior = np.zeros((4 * runs, design_rows.shape[1]))
    prior[:, runs : 5 * runs] = np.eye(4 * runs)
    one = np.concatenate([design_rows, prior])
    basis = _basis(one[:, :-1], 1e-8)
    left = one[:, -1] - basis @ (basis.T @ one[:, -1])
    extra = np.vstack([more, np.zeros((4 * runs, more.shape[1]))])
    size = np.sqrt((extra**2).sum(axis=0))
    extra = extra / np.where(size > 0.0, size, 1.0)
    # A small remainder next to the other's pattern and couplings is scatter of the angles: dropped.
    own = _basis(extra - basis @ (basis.T @ extra), math.sqrt(_LEAST), 1.0)
    between = float(((own.T @ left) ** 2).sum())
    few, freedom = float(own.shape[1]), float(len(one) - basis.shape[1] - own.shape[1])
    rest = float(left @ left) - between
    if few < 1.0 or freedom < 1.0 or not rest > 0.0:
        return None
    return f_tail(between / few / (rest / freedom), few, freedom)


def _basis(columns: Array, least: float, size: float | None = None) -> Array:
    """Orthonormal directions of columns, those below a share of the greatest (or a size) none."""
    if size is None:
        lengths = np.sqrt((columns**2).sum(axis=0))
        columns = columns / np.where(lengths > 0.0, lengths, 1.0)
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, values > least * (values.max(initial=0.0) if size is None else size)])
