"""Constants of two channels by a reference: linear in the curve's coefficients."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from .. import _core
from ..errors import NoModelError
from ..runs.checks.channelreadings import ChannelReadings
from ..runs.rawchannels import Channels
from ..support.arrays import Array
from .channels import CELLS, cell_counts, channels_of, inflation
from .linear import least_squares

#: Harmonics of the curve, where the channels went through their whole period.
_HARMONICS: Final = (-3, -2, 2, 3)

#: Share of the cells of a period that is a whole one.
_WHOLE: Final = 0.9


def referenced_channels(
    signals: Sequence[tuple[Array, Array, Array]], channels: Channels, named: str
) -> Channels:
    """Constants of channels whose phase a reference determines, of runs with a zero each.

    ``signals`` are sine, cosine and reference of every run; ``channels`` state the sense, periods
    and unit.

    ::

        z = sum_k z_k exp(i k (φ + ψ_r)),    φ = ± 2 pi p θ / period

    Raises
    ------
    NoModelError
        A channel is dead, or both are one.
    """
    sine, cosine = (np.concatenate([run[i] for run in signals]) for i in (0, 1))
    kept = ChannelReadings.of(sine, cosine).checked(named).kept
    unit = channels.direction * channels.periods_per_turn * 2.0 * math.pi / channels.period
    phases = [unit * run[2] for run in signals]
    zeros = [
        float(np.angle(_curve(y, x, phase, (-1, 0, 1))[2]))
        for (y, x, _), phase in zip(signals, phases, strict=True)
    ]
    phase = np.concatenate([p + zero for p, zero in zip(phases, zeros, strict=True)])[kept]
    sine, cosine = sine[kept], cosine[kept]
    whole = float((cell_counts(phase) > 0).sum()) >= _WHOLE * CELLS
    harmonics = _HARMONICS if whole else ()
    z = _curve(sine, cosine, phase, (-1, 0, 1, *harmonics))
    # From where the cosine is at its top.
    phase = phase + float(np.angle(z[2] + np.conj(z[0])))
    design = _real_design(phase, harmonics)
    target = np.concatenate([cosine, sine])
    found = _core.LinearModel.of_rows(design, target.reshape(-1, 1), None)
    parameters = np.asarray(found.coefficients).ravel()
    residuals = target - design @ parameters
    freedom = target.size - parameters.size
    if freedom < 1:
        raise NoModelError(f"{named}: {sine.size} readings are too few for the channels")
    variance = float(residuals @ residuals) / freedom
    correlated = max(inflation(residuals[: sine.size]), inflation(residuals[sine.size :]))
    covariance = np.asarray(found.inverse) * variance * correlated
    return channels_of(
        parameters,
        covariance,
        harmonics,
        direction=channels.direction,
        periods_per_turn=channels.periods_per_turn,
        period=channels.period,
    )


def _curve(sine: Array, cosine: Array, phase: Array, orders: Sequence[int]) -> Array:
    """Complex coefficients of the orders of ``cosine + i sine``."""
    columns = [np.cos(k * phase) for k in orders] + [-np.sin(k * phase) for k in orders]
    first = np.column_stack(columns)
    columns = [np.sin(k * phase) for k in orders] + [np.cos(k * phase) for k in orders]
    design = np.concatenate([first, np.column_stack(columns)])
    found = least_squares(design, np.concatenate([cosine, sine]))
    return np.asarray(found[: len(orders)] + 1j * found[len(orders) :])


def _real_design(phase: Array, harmonics: Sequence[int]) -> Array:
    """Rows of the cosine, then of the sine, by the parameters of `channels_of`."""
    zero, one = np.zeros_like(phase), np.ones_like(phase)
    cosine = [one, zero, np.cos(phase), zero, zero]
    sine = [zero, one, zero, np.sin(phase), np.cos(phase)]
    for k in harmonics:
        c, s = np.cos(k * phase), np.sin(k * phase)
        cosine += [c, -s]
        sine += [s, c]
    return np.concatenate([np.column_stack(cosine), np.column_stack(sine)])
