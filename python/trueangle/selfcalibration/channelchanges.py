"""How constants of channels change: from run to run, with temperature, over periods of a turn."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError
from ..estimation.channels import estimate_channels
from ..runs.rawchannels import CONSTANTS, Channels
from ..support.arrays import Array

#: Standard errors from which a size is reported, and the least one, relative to the amplitude.
SURE: Final = 4.0
LEAST: Final = 1e-3


class ChannelChange(NamedTuple):
    """What moved between the first run and another one."""

    run: str
    cause: str
    sensor: float
    magnet: float
    amplitude: float
    says: str


def standard_errors(channels: Channels) -> Array:
    """Standard errors of the constants; offsets and the amplitude relative to it."""
    std = np.sqrt(np.diag(np.asarray(channels.covariance)))
    std[:3] /= abs(channels.fundamental)
    return np.asarray(std)


def changes_between(runs: Sequence[tuple[str, Channels]], known: bool) -> Iterable[ChannelChange]:
    """What moved between the first run and each other one."""
    for label, after in runs[1:]:
        base, before = runs[0]
        sensor = abs(after.image - before.image)
        size, was = abs(after.fundamental), abs(before.fundamental)
        # In the unit of the columns: the gap does not change an offset of the electronics.
        magnet = 0.5 * abs(after.offset - before.offset * was / size)
        if known:
            magnet = abs(_second(after) - _second(before))
        amplitude = math.log(size / was)
        sizes = {
            "sensor_eccentricity": (sensor, "the sensor moved off the axis, or the gains changed"),
            "magnet_eccentricity": (
                magnet,
                "the magnet moved off the axis" + ("" if known else ", or the offsets changed"),
            ),
            "gap": (
                # Change of ln(amplitude) that counts as much as one of 1 of a coefficient of the
                # curve: also temperature, supply and a shift of the sensor change the amplitude.
                abs(amplitude) / 30.0,
                f"the gap changed (amplitude {100.0 * math.expm1(amplitude):+.2g} %)",
            ),
        }
        cause = max(sizes, key=lambda name: sizes[name][0])
        std = float(np.hypot(standard_errors(before), standard_errors(after))[:4].max())
        if sizes[cause][0] > max(SURE * std, LEAST):
            says = f"run {label} compared with run {base}: {sizes[cause][1]}"
            yield ChannelChange(label, cause, sensor, magnet, amplitude, says)


def _second(channels: Channels) -> complex:
    return sum(complex(h.re, h.im) for h in channels.harmonics if h.order == 2)


def _constants_by(
    group: NDArray[np.intp], sine: Array, cosine: Array, named: str
) -> tuple[list[int], Array, Array]:
    """Groups whose readings settle the constants, those, and their standard errors."""
    kept, values, stds = [], [], []
    for i in np.unique(group):
        with contextlib.suppress(NoModelError):
            channels = estimate_channels(sine[group == i], cosine[group == i], named).channels
            kept.append(int(i))
            values.append([getattr(channels, name) for name in CONSTANTS])
            stds.append(np.sqrt(np.diag(np.asarray(channels.covariance))))
    return kept, np.array(values), np.array(stds)


def per_kelvin(sine: Array, cosine: Array, temperature: Array, named: str) -> dict[str, Any]:
    """Slopes of the constants with temperature that are significant."""
    known = np.isfinite(temperature)
    sine, cosine, temperature = sine[known], cosine[known], temperature[known]
    # Kelvin from which drift is estimated.
    if temperature.size == 0 or float(np.ptp(temperature)) < 2.0:
        return {}
    edges = np.quantile(temperature, np.linspace(0.0, 1.0, 6)[1:-1])
    part = np.searchsorted(edges, temperature, side="right")
    kept, values, std = _constants_by(part, sine, cosine, named)
    at = np.array([temperature[part == i].mean() for i in kept])[:, None]
    if len(kept) < 2 or not np.ptp(at) > 0.0:
        return {}
    weights = std**-2.0
    off = at - (weights * at).sum(axis=0) / weights.sum(axis=0)
    power = (weights * off**2).sum(axis=0)
    return _significant((weights * off * values).sum(axis=0) / power, power**-0.5)


def between_periods(
    pairs: Sequence[Sequence[Array]], channels: Channels, named: str
) -> dict[str, Any]:
    """Standard deviation of each constant over the periods of a turn, beyond its own errors."""
    phases = [channels.unwrapped(*pair) / channels.constants[-1] for pair in pairs]
    turn = np.floor(np.concatenate(phases) / (2.0 * math.pi)).astype(np.intp)
    sine, cosine = np.hstack([np.array(pair) for pair in pairs])
    kept, values, std = _constants_by(turn % channels.periods_per_turn, sine, cosine, named)
    if len(kept) < 2:
        return {}
    own = (std**2).mean(axis=0)
    spread = np.sqrt(np.maximum(values.var(axis=0, ddof=1) - own, 0.0))
    # The standard error of the standard deviation of n samples of the errors alone.
    return _significant(spread, np.sqrt(own) / (2.0 * (len(kept) - 1)) ** 0.25)


def _significant(values: Array, std: Array) -> dict[str, Any]:
    rows = zip(CONSTANTS, values.tolist(), std.tolist(), strict=True)
    return {n: {"value": v, "std": s} for n, v, s in rows if abs(v) > SURE * s}
