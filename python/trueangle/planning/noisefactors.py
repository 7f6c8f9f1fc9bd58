"""Noise factors: how well positions keep orders apart, and the mounts that do so best.

The factor of an order is the standard deviation of its coefficients over what as many
readings would give if that order were alone; 1 is ideal, infinity is an alias.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..runs.aliasing import fold
from ..support.arrays import Array, first_largest

#: Eigenvalues below this share of the number of readings are zero: an alias.
_SINGULAR: Final = 1e-9

#: A mount may be off by the tolerance as long as no factor exceeds this times ideal.
TOLERATED_FACTOR: Final = 2.0

#: Steps in which offsets are searched, per pitch (0.01 deg for 36 facets).
_STEPS: Final = 1000


_STARTS: Final = 4000  # random starts of the search for three mounts and more


def noise_factors(
    turns: ArrayLike, orders: Sequence[float], zeros: ArrayLike | None = None
) -> Array:
    """Noise factor of each order, all of them and the zeros fitted together.

    ::

        f_k = √((n / 2) λ_max[(Xᵀ X)⁻¹]_k)

    Parameters
    ----------
    turns : array_like, shape (n,)
        Positions in turns.
    orders : sequence of float
        Orders per turn.
    zeros : array_like of int, shape (n,), optional
        Number of the zero (run or mount) of each reading; one zero by default.

    Returns
    -------
    ndarray, shape (len(orders),)
        Infinite for every order that takes part in a collision.
    """
    x = 2.0 * math.pi * np.asarray(turns, dtype=np.float64)
    group = np.zeros(x.size, dtype=np.int64) if zeros is None else np.asarray(zeros)
    columns = [np.asarray(group == g, dtype=np.float64) for g in np.unique(group)]
    first = len(columns)
    for k in orders:
        columns += [np.cos(k * x), np.sin(k * x)]
    design = np.stack(columns, axis=1)
    inverse, lost = _inverse(design)
    at = first + np.arange(2 * len(orders)).reshape(-1, 2)
    greatest = _greatest_of_pairs(inverse[at[:, :, None], at[:, None, :]])
    return np.where((lost[at] > _SINGULAR).any(axis=1), math.inf, np.sqrt(0.5 * x.size * greatest))


def mount_noise_factors(divisions: int, offsets_deg: ArrayLike, orders: Sequence[float]) -> Array:
    """Noise factor of each order for mounts of one uniform grid, each with its own zero.

    Orders that fold differently do not disturb each other on a whole grid, so each class
    is a small complex problem: ``z_j = sum_m d_m exp(+-i m offset_j)``.

    Parameters
    ----------
    divisions : int
        Positions per mount.
    offsets_deg : array_like, shape (..., mounts)
        Offsets in degrees; leading axes are tried at once.
    orders : sequence of int

    Returns
    -------
    ndarray, shape (..., len(orders))
    """
    offsets = np.deg2rad(np.atleast_1d(np.asarray(offsets_deg, dtype=np.float64)))
    lead, mounts = offsets.shape[:-1], offsets.shape[-1]
    factors = np.full((*lead, len(orders)), math.inf)
    classes: dict[int, list[int]] = {}
    for i, m in enumerate(orders):
        if m != int(m):
            raise ArgumentError(f"order {m:g} is not whole: mounts of a grid need whole orders")
        classes.setdefault(fold(int(m), divisions)[0], []).append(i)
    for folded, members in classes.items():
        if folded == 0 or len(members) > mounts:
            continue
        phase = np.stack(
            [fold(int(orders[i]), divisions)[1] * orders[i] * offsets for i in members], axis=-1
        )
        if 2 * folded == divisions:
            # Only cos(N/2 x) is identifiable, so an order takes two mounts.
            if 2 * len(members) > mounts:
                continue
            factors[..., members] = _half_factors(phase)
        else:
            inverse, lost = _inverse(np.exp(1j * phase))
            diagonal = np.diagonal(inverse, axis1=-2, axis2=-1).real
            factors[..., members] = np.where(lost > 0.0, math.inf, np.sqrt(mounts * diagonal))
    return factors


def _inverse(design: NDArray[Any]) -> tuple[NDArray[Any], Array]:
    """``(X^H X)^+``, and the share of each column that lies in singular directions."""
    values, vectors = np.linalg.eigh(np.conj(np.swapaxes(design, -1, -2)) @ design)
    singular = (values <= _SINGULAR * design.shape[-2])[..., None, :]
    parts = vectors / np.where(singular, math.inf, values[..., None, :])
    lost = np.where(singular, np.abs(vectors) ** 2, 0.0).sum(axis=-1)
    return parts @ np.conj(np.swapaxes(vectors, -1, -2)), lost


def _greatest_of_pairs(pairs: Array) -> Array:
    """Greatest eigenvalue of each symmetric matrix of two rows."""
    cosine, sine, mixed = pairs[..., 0, 0], pairs[..., 1, 1], pairs[..., 0, 1]
    return np.asarray(0.5 * (cosine + sine) + np.hypot(0.5 * (cosine - sine), mixed))


def _half_factors(phase: Array) -> Array:
    """Factors of orders that fold onto N/2, where a mount gives one real number each."""
    *_, mounts, orders = phase.shape
    design = np.concatenate([np.cos(phase), -np.sin(phase)], axis=-1)
    inverse, lost = _inverse(design)
    at = np.arange(2 * orders).reshape(2, -1).T
    factors = np.sqrt(0.5 * mounts * _greatest_of_pairs(inverse[..., at[:, :, None], at[:, None]]))
    return np.where((lost > 0.0).any(axis=-1, keepdims=True), math.inf, factors)


def facet_noise_factor(divisions: int, shifts: ArrayLike, highest: int | None = None) -> Array:
    """Worst factor of the joint's orders when the artefact's own errors are fitted too.

    ::

        f_h = (J (1 - |w̄_h|²))^(-1/2),    w_hj = e^(2π i h s_j/N)

    relative to one mount with a perfect artefact.

    Parameters
    ----------
    divisions : int
        Facets N.
    shifts : array_like of int, shape (..., mounts)
        Facets that the artefact is turned by at each mount.
    highest : int, optional
        Highest order looked at; default the last below N/2.

    Examples
    --------
    >>> round(float(facet_noise_factor(36, [0, 28, 30])), 2)
    1.04
    """
    s = np.asarray(shifts, dtype=np.float64)
    orders = np.arange(1, (divisions - 1) // 2 + 1 if highest is None else highest + 1)
    mean = np.exp(2j * math.pi / divisions * s[..., None, :] * orders[:, None]).mean(axis=-1)
    apart = s.shape[-1] * (1.0 - np.abs(mean) ** 2)
    with np.errstate(divide="ignore"):
        factor = 1.0 / np.sqrt(np.where(apart > _SINGULAR, apart, 0.0))
    return np.asarray(factor.max(axis=-1))


def _worst(positions: int, offsets: Array, orders: Sequence[float]) -> Array:
    return np.asarray(mount_noise_factors(positions, offsets, orders).max(axis=-1))


def search_offsets(positions: int, mounts: int, orders: Sequence[float]) -> list[float]:
    """Offsets in degrees with the least worst factor, the first one 0.

    Even parts of the pitch where none are better: of all offsets that serve the wanted orders
    equally they separate the others up to the highest, that of one grid of all positions.
    """
    if mounts == 1:
        return [0.0]
    pitch = 360.0 / positions
    even = np.arange(mounts, dtype=np.float64) * (pitch / mounts)
    # Rounding of a factor that is ideal, 1.
    if float(_worst(positions, even[None], orders)[0]) <= 1.0 + 1e-9:
        return [round(float(o), 9) for o in even]
    steps = np.arange(1, _STEPS, dtype=np.float64) * (pitch / _STEPS)
    # Mirror images are equally good: the smaller offset of two is taken.
    starts: Array = np.zeros((_STARTS if mounts > 2 else 1, mounts))
    if mounts > 2:
        starts[:, 1:] = np.random.default_rng(0).choice(steps, size=(_STARTS, mounts - 1))
    chosen = search_spread(lambda trial: _worst(positions, trial, orders), starts, steps)
    return sorted(round(float(o), 9) for o in chosen)


def search_spread(worst: Callable[[Array], Array], starts: Array, steps: Array) -> Array:
    """The row with the least ``worst``, the first of its numbers fixed.

    The best of ``starts`` are refined: one number at a time moves to its best step, until none
    moves.
    """
    found = []
    for start in starts[np.argsort(worst(starts), kind="stable")[:8]]:
        here: Array = start.copy()
        for _ in range(6):
            before = here.copy()
            for j in range(1, here.size):
                trial = np.repeat(here[None], steps.size, axis=0)
                trial[:, j] = steps
                here = trial[first_largest(-worst(trial))]
            if (here == before).all():
                break
        found.append(here)
    return found[first_largest(-worst(np.array(found)))]


def search_shifts(positions: int, mounts: int) -> tuple[tuple[int, ...], float]:
    """Facet shifts with the least worst factor: all of a few mounts, then one by one."""
    if mounts == 1:
        return (0,), math.inf
    # Sets of facet shifts that are all tried: four mounts of 48 facets.
    head = max(h for h in (2, 3, 4) if h == 2 or math.comb(positions - 1, h - 1) <= 17_000)
    head = min(head, mounts, positions)
    combinations = itertools.combinations(range(1, positions), head - 1)
    trial = np.array([(0, *rest) for rest in combinations], dtype=np.int64)
    best = trial[first_largest(-facet_noise_factor(positions, trial))]
    while best.size < mounts:
        more = np.array([[*best, s] for s in range(1, positions)])
        best = more[first_largest(-facet_noise_factor(positions, more))]
    return tuple(int(s) for s in best), float(facet_noise_factor(positions, best))


def offset_tolerance(
    positions: int, offsets: Sequence[float], orders: Sequence[float], worst: float
) -> float:
    """Largest error of every offset at once with all factors below the tolerated one."""
    if len(offsets) == 1 or worst >= TOLERATED_FACTOR:
        return 0.0
    if len(offsets) <= 5:
        signs = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=len(offsets) - 1)))
    else:
        unit = np.eye(len(offsets) - 1)
        signs = np.concatenate([unit, -unit])
    step = 360.0 / positions / _STEPS
    error = 0.0
    while error < 0.25 * 360.0 / positions:
        trial = np.tile(np.asarray(offsets), (len(signs), 1))
        trial[:, 1:] += (error + step) * signs
        if _worst(positions, trial, orders).max() > TOLERATED_FACTOR:
            break
        error += step
    return round(error, 9)
