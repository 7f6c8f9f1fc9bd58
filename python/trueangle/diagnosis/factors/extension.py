"""A factor without a name in the simulation: its function as curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...effects.curve import POINTS, PRODUCTS, VALUES, Curve
from ...support.arrays import Array
from .group import Group, lines_of

#: Points of a turn, at least.
LEAST = 72

#: Part of the larger of two functions below which the smaller one is rounding.
_ROUNDING = 1e-3


def curves_of(
    factor: str,
    shaft: str | None,
    groups: Sequence[Group],
    means: Sequence[Array],
    shafts: Mapping[str, float],
) -> list[Curve]:
    """The function of a factor's groups as effects; none of what no other run shows.

    ::

        f(x) (A cos mθ + B sin mθ)    or, where A and B change apart, two of these

    Parameters
    ----------
    factor : str
    shaft : str or None
        Whose orders products have.
    groups : sequence of Group
        Of that factor.
    means : sequence of ndarray
        Coefficients of the columns of each.
    shafts : mapping of str to float
        Turns of each in one turn of the output.
    """
    own = [(group, mean) for group, mean in zip(groups, means, strict=True) if group.event is None]
    if factor in PRODUCTS:
        cycles = shafts.get(shaft or "output", 1.0)
        return [*_products(factor, shaft or "output", cycles, own)] if own else []
    # A ramp over several turns is no pattern of one, nor are its places.
    most = max((group.at.size for group, _ in own), default=0)
    own = [(group, mean) for group, mean in own if group.at.size == most]
    return [_alone(factor, own)] if factor in VALUES and own else []


def _alone(factor: str, own: Sequence[tuple[Group, Array]]) -> Curve:
    at = own[0][0].at
    highest = max((m for group, _ in own for m in group.orders), default=0.0)
    if highest:
        turns = (at[-1] - at[0]) / 360.0
        count = max(LEAST, int(np.ceil(POINTS * highest * turns)))
        at = np.concatenate([np.linspace(at[0], at[-1], 1 + count), at])
    at = np.unique(plain_numbers(at))
    values = sum((group.values_about_mean(at) @ mean for group, mean in own), np.zeros(at.size))
    return Curve(factor, tuple(at.tolist()), plain_numbers(values))


def _products(
    factor: str, shaft: str, cycles: float, own: Sequence[tuple[Group, Array]]
) -> Iterator[Curve]:
    at, mean = plain_numbers(own[0][0].at), np.concatenate([mean for _, mean in own])
    for order, (values, columns) in lines_of([group for group, _ in own]).items():
        waves = values @ mean[columns].reshape(-1, 2)
        if not order:
            yield Curve(factor.removesuffix("_place"), at, plain_numbers(waves[:, 0]))
            continue
        parts, sizes, pairs = np.linalg.svd(waves, full_matrices=False)
        for part, size, (cosine, sine) in zip(parts.T, sizes, pairs, strict=False):
            if not size > _ROUNDING * sizes[0]:
                continue
            sign = 1.0 if part[np.argmax(np.abs(part))] > 0.0 else -1.0
            phase = float(np.degrees(np.arctan2(sign * cosine, sign * sine)) % 360.0)
            shown = plain_numbers(sign * size * part)
            yield Curve(factor, at, shown, shaft, (order / cycles,), (round(phase, 4),))


def plain_numbers(values: Array) -> tuple[float, ...]:
    """Numbers of a file: to a millionth of their range."""
    digits = 6 - int(np.ceil(np.log10(max(float(np.ptp(values)), 1e-9))))
    return tuple(np.round(values, digits).tolist())
