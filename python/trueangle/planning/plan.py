"""Calibration plans: positions that keep the wanted orders apart, and how many readings.

The positions are judged by their noise factors (`trueangle.planning.noisefactors`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from ..errors import ArgumentError, NoModelError
from ..joint.gear import HIGHEST_LOW_ORDER as HIGHEST_LOW_ORDER
from ..joint.gear import wanted_orders as wanted_orders
from ..joint.shafts import limited_orders
from ..runs.aliasing import fold
from ..support.argumentkinds import told_kinds
from ..support.distributions import random_numbers
from .noisefactors import (
    mount_noise_factors,
    noise_factors,
    offset_tolerance,
    search_offsets,
    search_shifts,
)
from .result import CalibrationPlan as CalibrationPlan

#: Readings that nobody takes.
_MOST = 1e12


def check_sizes(**sizes: float | None) -> None:
    """Refuse a size, by its name, that is given and not positive and finite."""
    for name, value in sizes.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} must be positive and finite, got {value!r}")


def check_readings(readings: float | None, most: int) -> None:
    """Refuse a number of readings that is given and not whole, or not from 1 to ``most``."""
    if readings is not None and (readings != int(readings) or not 1 <= readings <= most):
        raise ArgumentError(f"readings must be a whole number from 1 to {most}, got {readings!r}")


@told_kinds
def readings_needed(noise: float, standard_error: float, factor: float = 1.0) -> int:
    """Readings that bring an order's standard error down to ``standard_error``.

    ::

        N = 2 (f σ/u)²

    Raises
    ------
    ArgumentError
        A size that is not positive and finite, or more than a million million readings.

    Examples
    --------
    >>> readings_needed(5.0, 0.5, factor=1.02)
    209
    """
    check_sizes(noise=noise, standard_error=standard_error, factor=factor)
    ratio = factor * noise / standard_error
    count = 2.0 * ratio * ratio
    if count > _MOST:
        raise ArgumentError(
            f"`standard_error={standard_error:g}` takes more than {_MOST:g} readings with "
            f"`noise={noise:g}`; allow a larger one"
        )
    return math.ceil(count)


@told_kinds
def plan_mounts(
    gear_ratio: float | None = 100.0,
    positions: int = 36,
    mounts: int = 2,
    *,
    fixed_member: str = "circular_spline",
    orders: Iterable[float] | None = None,
    noise: float | None = None,
    standard_error: float | None = None,
) -> CalibrationPlan:
    """Mounts of an artefact with ``positions`` facets that keep the wanted orders apart.

    Parameters
    ----------
    gear_ratio : float or None
        Motor turns per output turn.
    positions, mounts : int
    fixed_member : {"circular_spline", "flexspline", "none"}
    orders : iterable of int, optional
        Orders wanted; default `wanted_orders`, the low ones as far as one mount sees them.
        Without a gear also their aliases on one mount, as far as all mounts together see them.
    noise, standard_error : float, optional
        Scatter of one reading and the standard error wanted, in one unit: together they
        give the number of readings.

    Raises
    ------
    NoModelError
        No offsets of so few mounts separate the orders; the message states how many do.

    Notes
    -----
    Two mounts are searched exhaustively in steps of a thousandth of the pitch, more from
    fixed random starts; the result is the same every time. Every mount has its own zero.

    Examples
    --------
    >>> plan = plan_mounts(100, positions=36, mounts=2)
    >>> plan.mount_offsets_deg, round(plan.worst_noise_factor, 2)
    ((0.0, 2.14), 1.28)
    """
    _check_count("mounts", mounts, 1)
    wanted, notes = _of_one_mount(gear_ratio, fixed_member, orders, positions)
    if orders is None and gear_ratio is None:
        wanted = _with_aliases(wanted, positions, mounts)
    if any(m != int(m) for m in wanted):
        raise ArgumentError(
            "a gear ratio whose orders are not whole needs several turns of a free reference "
            "encoder; plan one by `trueangle.planning.plan_encoder(...)`"
        )
    seen = [m for m in wanted if fold(int(m), positions)[0] != 0]
    if not seen:
        raise NoModelError(f"all wanted orders are multiples of {positions}: use other positions")
    need = _mounts_needed(positions, seen)
    if mounts < need:
        crowded = _crowded_class(positions, seen)
        raise NoModelError(
            f"{mounts} mount{'s' if mounts > 1 else ''} of {positions} positions cannot separate "
            f"orders {', '.join(f'{m:g}' for m in crowded)}: they look the same there; "
            f"use at least {need} mounts (`mounts={need}`), or a reference that stops at any angle"
        )
    offsets = search_offsets(positions, mounts, seen)
    factors = dict(zip(seen, mount_noise_factors(positions, offsets, seen).tolist(), strict=True))
    shifts, facet = search_shifts(positions, mounts)
    hidden = [m for m in wanted if m not in factors]
    if hidden:
        notes.append(
            f"orders {', '.join(f'{m:g}' for m in hidden)} are the same at every position and "
            "vanish in each mount's zero: only another number of positions shows them"
        )
    if mounts == 2:
        notes.append("2 mounts determine the reference's own errors poorly; use 3 (`mounts=3`)")
    worst = max(factors.values())
    return CalibrationPlan(
        kind="mounts",
        positions=positions,
        mount_offsets_deg=tuple(offsets),
        facet_shifts=shifts,
        facet_noise_factor=facet,
        noise_factors={m: factors.get(m, math.inf) for m in wanted},
        tolerance_deg=offset_tolerance(positions, offsets, seen, worst),
        readings=_rounds(noise, standard_error, worst, positions * mounts),
        notes=tuple(notes),
    )


@told_kinds
def plan_tilts(
    gear_ratio: float | None = 100.0,
    positions: int = 36,
    tilts: int = 2,
    *,
    tilt_arcsec: float = 1200.0,
    fixed_member: str = "circular_spline",
    orders: Iterable[float] | None = None,
    noise: float | None = None,
    standard_error: float | None = None,
) -> CalibrationPlan:
    """Off-null readings of an autocollimator at equally spaced tilts, without a remount.

    The joint is up to ``tilt`` away from every facet's null, on either side, and the
    autocollimator reads the tilt. Its scale must be calibrated: 0.1 % of 1200 arcsec is 1.2 arcsec.

    Examples
    --------
    >>> round(plan_tilts(100, tilt_arcsec=1200.0).worst_noise_factor, 2)
    1.7
    """
    _check_count("tilts", tilts, 2)
    if not (math.isfinite(tilt_arcsec) and tilt_arcsec > 0.0):
        raise ArgumentError(f"tilt_arcsec must be positive, got {tilt_arcsec!r}")
    wanted, notes = _of_one_mount(gear_ratio, fixed_member, orders, positions)
    offsets = [float(o) for o in np.linspace(-tilt_arcsec, tilt_arcsec, tilts) / 3600.0]
    found = mount_noise_factors(positions, offsets, wanted).tolist()
    factors = dict(zip(wanted, found, strict=True))
    blind = [m for m in wanted if not math.isfinite(factors[m]) and fold(int(m), positions)[0]]
    if blind:
        raise NoModelError(
            f"{tilts} tilts cannot separate orders {', '.join(f'{m:g}' for m in blind)}: "
            f"use at least {_mounts_needed(positions, blind)} tilts"
        )
    worst = max(f for f in found if math.isfinite(f))
    seen = [m for m in wanted if math.isfinite(factors[m])]
    return CalibrationPlan(
        kind="tilts",
        positions=positions,
        mount_offsets_deg=tuple(offsets),
        facet_shifts=(0,) * tilts,
        facet_noise_factor=math.inf,
        noise_factors=factors,
        tolerance_deg=offset_tolerance(positions, offsets, seen, worst),
        readings=_rounds(noise, standard_error, worst, positions * tilts),
        notes=(
            *notes,
            "fit the autocollimator's scale as one more column: an error of 0.1 % is "
            f"{0.001 * tilt_arcsec:.2g} arcsec here",
            "the reference is not turned, so its own errors stay in the result",
        ),
    )


@told_kinds
def plan_encoder(
    gear_ratio: float | None = 100.0,
    positions: int | None = None,
    *,
    fixed_member: str = "circular_spline",
    orders: Iterable[float] | None = None,
    noise: float | None = None,
    standard_error: float | None = None,
    seed: int = 0,
) -> CalibrationPlan:
    """Jittered equispaced positions against a free reference encoder.

    Each position is random within its own cell, so no order is an exact alias of another.
    Without ``positions`` there are ``2 * highest order + 20`` of them (820 for ratio 100).

    Examples
    --------
    >>> plan_encoder(100).positions
    820
    """
    wanted = (
        wanted_orders(gear_ratio, fixed_member) if orders is None else tuple(limited_orders(orders))
    )
    _check_orders(wanted)
    count = 2 * math.ceil(max(wanted)) + 20 if positions is None else positions
    _check_count("positions", count, 3)
    jitter = random_numbers(seed).uniform(size=count)
    found = noise_factors((np.arange(count) + jitter) / count, wanted)
    if not np.isfinite(found).all():
        raise NoModelError(
            f"{count} positions are too few for {len(wanted)} orders: use at least "
            f"{2 * len(wanted) + 1}, better {2 * math.ceil(max(wanted)) + 20}"
        )
    worst = float(found.max())
    return CalibrationPlan(
        kind="encoder",
        positions=count,
        mount_offsets_deg=(0.0, 130.0, 250.0),
        facet_shifts=(),
        facet_noise_factor=math.inf,
        noise_factors=dict(zip(wanted, found.tolist(), strict=True)),
        tolerance_deg=180.0 / count,
        readings=_rounds(noise, standard_error, worst, count),
        notes=(
            f"one reading in each of {count} equal cells of the turn, anywhere in the cell",
            "clamp the reference again at 130 and 250 deg, to separate its own eccentricity "
            "and coupling from the joint",
            "move both ways, at two speeds, loads and temperatures, over several turns",
        ),
    )


def _of_one_mount(
    gear_ratio: float | None, fixed_member: str, orders: Iterable[float] | None, positions: int
) -> tuple[tuple[float, ...], list[str]]:
    """The orders, by default the gear's and the low ones that one mount shows, with a note."""
    _check_count("positions", positions, 3)
    if orders is not None:
        wanted = tuple(sorted(set(limited_orders(orders))))
        _check_orders(wanted)
        return wanted, []
    low, most = (positions - 1) // 2, HIGHEST_LOW_ORDER
    why = f"of orders 1-{most} those above {low} are omitted: one mount has too few positions"
    return wanted_orders(gear_ratio, fixed_member, min(low, most)), [why] * (low < most)


def _check_orders(wanted: tuple[float, ...]) -> None:
    if not wanted:
        raise ArgumentError("orders is empty: name one at least, or leave it out for the usual")


def _check_count(name: str, value: int, least: int) -> None:
    if value != int(value) or value < least:
        raise ArgumentError(f"{name} must be a whole number of at least {least}, got {value!r}")


def _with_aliases(orders: Sequence[float], positions: int, mounts: int) -> tuple[float, ...]:
    """The orders and what looks like them on one mount, below the limit of all positions."""
    beyond = range(positions, (positions * mounts - 1) // 2 + positions, positions)
    aliases = {abs(turn + sign * k) for turn in beyond for k in orders for sign in (-1, 1)}
    return (*orders, *sorted(m for m in aliases if 2 * m < positions * mounts))


def _crowded_class(positions: int, orders: Sequence[float]) -> list[float]:
    """Orders of the fullest fold class (the one at N/2 counts double)."""
    classes: dict[int, list[float]] = {}
    for m in orders:
        classes.setdefault(fold(int(m), positions)[0], []).append(m)
    return max(classes.items(), key=lambda item: len(item[1]) * _cost(item[0], positions))[1]


def _cost(folded: int, positions: int) -> int:
    return 2 if 2 * folded == positions else 1


def _mounts_needed(positions: int, orders: Sequence[float]) -> int:
    crowded = _crowded_class(positions, orders)
    return len(crowded) * _cost(fold(int(crowded[0]), positions)[0], positions)


def _rounds(
    noise: float | None, standard_error: float | None, factor: float, per_round: int
) -> int | None:
    """Readings for the wanted standard error, in whole rounds of all positions."""
    if noise is None and standard_error is None:
        return None
    if noise is None or standard_error is None:
        raise ArgumentError("the number of readings needs both `noise=` and `standard_error=`")
    return math.ceil(readings_needed(noise, standard_error, factor) / per_round) * per_round
