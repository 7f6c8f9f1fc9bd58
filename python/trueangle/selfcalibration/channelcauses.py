"""What is wrong with a sine and a cosine channel, and what changes, in words: causes of errors."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError
from ..estimation.channels import ChannelEstimate, estimate_channels, referenced_channels
from ..runs.channelangle import following
from ..runs.checks.channelreadings import CENTRED
from ..runs.rawchannels import CONSTANTS, Channels
from ..runs.source import OtherReadingOptions
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.layout import counted, laid_out, wrapped_lines
from ..support.plainresult import PlainResult, plain_fields
from .recording import Recording, as_recordings, track_readings

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


class ChannelCause(NamedTuple):
    """One cause: what it makes, and what draws the same curve."""

    cause: str
    orders: tuple[float, ...]
    size_relative: float
    std_relative: float
    error_deg: float
    """Amplitude of the angle error of these orders."""
    says: str
    not_distinguished_from: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChannelDiagnosis(PlainResult):
    """Causes of the angle error of two channels, strongest first.

    Attributes
    ----------
    causes : tuple of ChannelCause
    changes : tuple of ChannelChange
        Of every run against the first one, where something moved.
    drift : dict
        Per kelvin and over the periods of a turn: each constant with its standard error.
    reference : bool
        Whether a reference resolves what draws one curve.
    coverage_deg : float
        How much of the channels' period the readings cover.
    channels : Channels
    """

    causes: tuple[ChannelCause, ...]
    changes: tuple[ChannelChange, ...]
    drift: dict[str, Any]
    reference: bool
    coverage_deg: float
    channels: Channels

    @property
    def sentence(self) -> str:
        """The strongest cause in one sentence."""
        if not self.causes:
            return "no error of the channels is significant"
        return self.causes[0].says

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        keys = "sentence causes changes drift reference coverage_deg channels"
        return plain_fields(self, keys)

    def _brief(self) -> str:
        return f"{counted(self.causes, 'cause')}, {counted(self.changes, 'change')}"

    def lines(self) -> list[str]:
        """Causes, changes and drift as lines of a summary."""
        lines = [f"diagnosis: {self.sentence}"]
        lines += [f"  {c.cause}: {c.says}" for c in self.causes[1:]]
        lines += [f"  {c.says}" for c in self.changes]
        for by, found in self.drift.items():
            rows = [f"{n} {v['value']:.2g} +- {v['std']:.1g}" for n, v in found.items()]
            lines.append(f"  {by}: {', '.join(rows)}")
        return [part for line in lines for part in wrapped_lines(line, 4)]

    def summary(self) -> str:
        """The result as text."""
        return laid_out([*self.lines(), "", *self.channels.constant_lines()])


@told_kinds
def diagnose_channels(logs: Any, **reading: Unpack[OtherReadingOptions]) -> ChannelDiagnosis:
    """Name what is wrong with a sine and a cosine channel.

    ::

        z_(-1) = -1.5 s² / h²,   z_0 = 6 s Re(d) / h²,   z_2 = 3 conj(s) d / h²

    for a sensor ``s`` off the axis and a magnet ``d`` off its centre, at the distance ``h``.

    Parameters
    ----------
    logs : path, table, CalibrationRun, or iterable of them
        With columns ``sine``, ``cosine``; a reference, ``temperature_C`` and ``run`` where known.
    **reading
        As in `trueangle.read_runs`.

    Returns
    -------
    ChannelDiagnosis

    Raises
    ------
    FileError, ArgumentError, NoModelError
        Channels that draw no curve, in one line.

    Examples
    --------
    >>> phase = np.linspace(0.0, 2.0 * np.pi, 500)
    >>> noise = 1e-4 * np.random.default_rng(0).normal(size=(2, 500))
    >>> log = {"sine": 1.04 * np.sin(phase) + noise[0], "cosine": np.cos(phase) + noise[1]}
    >>> [cause.cause for cause in ta.diagnose_channels(log).causes]
    ['channel_gain']
    """
    return channel_diagnosis(as_recordings(logs, {**reading, "period": None}))


def channel_diagnosis(
    recordings: Sequence[Recording], found: ChannelEstimate | None = None
) -> ChannelDiagnosis:
    """The same of recordings; ``found`` is their estimate without a reference, where there is one.

    Raises
    ------
    NoModelError
        No channels, or some that draw no curve.
    """
    first = recordings[0]
    pairs = [recording.tracks[:2] for recording in recordings]
    sine, cosine = track_readings(recordings)[:2]
    if found is None:
        found = estimate_channels(sine, cosine, first.named, periods=first.periods)
    known = all(r.reference is not None for r in recordings)
    channels = _by_reference(recordings, found.channels) if known else found.channels
    several = enumerate(recordings if len(recordings) > 1 else ())
    runs = [(r.label or str(i), _constants_of(r, known, found.channels)) for i, r in several]
    changes = tuple(changes_between([(label, c) for label, c in runs if c is not None], known))
    drift = {}
    if all(r.temperature is not None for r in recordings):
        temperature = np.concatenate([np.asarray(r.temperature) for r in recordings])
        drift["per kelvin"] = per_kelvin(sine, cosine, temperature, first.named)
    if first.periods > 1:
        drift["between the periods of a turn"] = between_periods(pairs, found.channels, first.named)
    return ChannelDiagnosis(
        _causes(channels, known, found, several=bool(changes)),
        changes,
        {by: rows for by, rows in drift.items() if rows},
        known,
        found.coverage,
        channels,
    )


def _by_reference(recordings: Sequence[Recording], channels: Channels) -> Channels:
    """Constants by the reference, in its sense."""
    signals = [(*r.tracks[:2], np.degrees(np.asarray(r.reference))) for r in recordings]
    signed = following(channels, *signals[0])[1]
    return referenced_channels(signals, signed, recordings[0].named)


def _constants_of(recording: Recording, known: bool, channels: Channels) -> Channels | None:
    """Constants of one run; None where it settles none."""
    with contextlib.suppress(NoModelError):
        if known:
            return _by_reference([recording], channels)
        sine, cosine = recording.tracks[:2]
        return estimate_channels(sine, cosine, recording.named).channels
    return None


def _causes(
    channels: Channels, known: bool, found: ChannelEstimate, several: bool
) -> tuple[ChannelCause, ...]:
    """Causes whose size is significant, by the angle error that they make."""
    p, std = channels.periods_per_turn, standard_errors(channels)
    unit = math.degrees(1.0) / p
    z = {h.order: (abs(complex(h.re, h.im)), h.std) for h in channels.harmonics}
    offset, std_offset = abs(channels.offset), float(max(std[:2]))
    image, std_image = abs(channels.image), 0.5 * math.hypot(std[3], math.radians(std[4]))
    magnet, std_magnet = z.pop(2, (0.0, 0.0))
    # Where the sensor may be, by what gain and phase may be: the size of a magnet's shift hangs
    # on it.
    sensor = math.sqrt((image + 2.0 * std_image) / 1.5)
    rows = []

    def add(
        name: str, order: int, size: float, error: float, says: str, *, at: float, rivals: Any = ()
    ) -> None:
        if size > max(SURE * at, LEAST):
            digits = max(0, 1 - math.floor(math.log10(100.0 * at))) if at > 0.0 else 3
            size_of = f"{100.0 * size:.{digits}f} +- {100.0 * at:.{digits}f} % of the amplitude"
            says = f"{says} ({size_of}): {error * unit:.2g} deg of order {order * p}"
            rows.append(
                ChannelCause(name, (float(order * p),), size, at, error * unit, says, rivals)
            )

    disc = "the magnet" if p == 1 else "the magnet or disc"
    if known:
        off = _off(magnet / (3.0 * sensor), p)
        add("magnet_eccentricity", 1, magnet, magnet, f"{disc} is off centre{off}", at=std_magnet)
        rest = max(offset - 2.0 * magnet, 0.0)  # twice z_2 at most is the magnet's
        rest *= offset < CENTRED
        add("channel_offset", 1, rest, rest, "the channels have an offset", at=std_offset)
    elif offset < CENTRED:
        off = _off(offset / (9.0 * sensor), p)
        words = f"the channels have an offset, or {disc} is off centre{off}"
        rivals = ("magnet_eccentricity",)
        # A magnet's error is a third of what the curve shows, an offset's is all of it.
        add("channel_offset", 1, offset, 0.5 * offset, words, at=std_offset, rivals=rivals)
    gain = abs(channels.image.real) >= abs(channels.image.imag)
    ratio = max(channels.gain_ratio, 1.0 / channels.gain_ratio)
    words = (
        f"the {'cosine' if channels.gain_ratio > 1.0 else 'sine'} channel is weak, {1 / ratio:.2g} "
        "of the other"
        # Gain ratio of the channels from which one is weak.
        if ratio > 1.5
        else f"gain (sine over cosine {channels.gain_ratio:.4g}) or phase "
        f"({channels.phase_deg:+.2g} deg) of the channels is off, or the sensor is off the "
        f"axis{_off(sensor, p)}"
    )
    name = "channel_gain" if gain else "channel_phase"
    add(name, 2, image, image, words, at=std_image, rivals=("sensor_eccentricity",))
    for k, (size, at) in z.items():
        words = f"harmonic {k} of the curve: a channel saturates or the field is no sine"
        add("channel_harmonic", abs(k - 1), size, size, words, at=at)
    for channel, count in found.recorded.clipped.items():
        share = count / (found.readings + count)
        words = f"the {channel} channel is clipped in {counted(count, 'reading')}: lower its gain"
        rows.append(ChannelCause("clipping", (4.0 * p,), share, 0.0, 0.0, words))
    noise = max(found.noise)
    # Noise of one reading, relative to the amplitude, from which the signal is weak.
    if noise > 0.01 and not several:
        words = f"noise is {100 * noise:.2g} % of the amplitude: the gap may be too wide"
        rows.append(ChannelCause("weak_signal", (), noise, 0.0, noise * unit, words))
    return tuple(sorted(rows, key=lambda row: -row.error_deg))


def _off(share: float, periods: int) -> str:
    """How far off the axis, by the field of a dipole; nothing where that is not expanded."""
    # Displacement over distance, up to which the field of a dipole is expanded.
    if periods > 1 or share > 0.5:
        return ""
    return (
        f" by about {share:.2g} of the distance from the magnet's middle to the sensor "
        f"({2.0 * share:.1g} mm at 2 mm)"
    )
