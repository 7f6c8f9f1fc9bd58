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
from .channels import WHOLE, cell_counts, channels_of, inflation
from .linear import least_squares

#: Harmonics of the curve, where the channels went through their whole period.
_HARMONICS: Final = (-3, -2, 2, 3)

#: Steps to the zeros of several runs, each about squares the distance left.
_STEPS: Final = 6


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
    sine, cosine, reference = (np.concatenate([run[i] for run in signals]) for i in range(3))
    kept = ChannelReadings.of(sine, cosine).checked(named).kept
    run = np.repeat(np.arange(len(signals)), [run[0].size for run in signals])[kept]
    sine, cosine = sine[kept], cosine[kept]
    unit = channels.direction * channels.periods_per_turn * 2.0 * math.pi / channels.period
    phase = unit * reference[kept]
    # Every run from where its cosine is at the top; what several runs then differ is estimated.
    for i in range(len(signals)):
        own = run == i
        design = np.column_stack([np.ones(own.sum()), np.cos(phase[own]), -np.sin(phase[own])])
        _, re, im = least_squares(design, cosine[own])
        phase[own] += math.atan2(im, re)
    harmonics = _HARMONICS if (cell_counts(phase) > 0).mean() >= WHOLE else ()
    target = np.concatenate([cosine, sine])
    others = (run == np.arange(1, len(signals))[:, None]).T
    design = _design(phase, harmonics)
    found = least_squares(design, target)
    width = found.size
    for _ in range(_STEPS if len(signals) > 1 else 1):
        slope = (_design(phase, harmonics, derivative=True) @ found[:width]).reshape(2, -1, 1)
        zeros = (slope * others).reshape(target.size, -1)
        design = np.column_stack([_design(phase, harmonics), zeros])
        model = _core.LinearModel.of_rows(design, target.reshape(-1, 1), None)
        found = np.asarray(model.coefficients).ravel()
        phase = phase + others @ found[width:]
    freedom = target.size - found.size
    if freedom < 1:
        raise NoModelError(f"{named}: {sine.size} readings are too few for the channels")
    residuals = target - design @ found
    variance = float(residuals @ residuals) / freedom
    correlated = max(inflation(residuals[: sine.size]), inflation(residuals[sine.size :]))
    return channels_of(
        found[:width],
        np.asarray(model.inverse)[:width, :width] * variance * correlated,
        harmonics,
        direction=channels.direction,
        periods_per_turn=channels.periods_per_turn,
        period=channels.period,
    )


def _design(phase: Array, harmonics: Sequence[int], *, derivative: bool = False) -> Array:
    """Rows of the cosine, then of the sine, by the parameters of `channels_of`; or their slopes."""
    none = np.zeros_like(phase)
    one = none if derivative else np.ones_like(phase)
    columns = [(one, none), (none, one)]
    for k in (1, *harmonics):
        wave = (1j * k if derivative else 1.0) * np.exp(1j * k * phase)
        x, y = wave.real, wave.imag
        columns += [(x, none), (-y, none), (none, y), (none, x)] if k == 1 else [(x, y), (-y, x)]
    return np.column_stack([np.concatenate(pair) for pair in columns])
