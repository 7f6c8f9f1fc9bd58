"""``channels``: the closed curve of a sine and a cosine channel.

What it can never see: the zero; of every order the difference of the two coefficients of the curve
that make it. An offset of the electronics and a magnet off its centre draw nearly one curve, and
make opposite errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import NoCurveError, NoModelError, NotInvertibleError
from ..estimation.channels import ChannelEstimate, estimate_channels
from ..estimation.tracks import Mismatch, with_second_track
from ..runs.checks.channelreadings import CENTRED
from ..runs.rawchannels import Channels
from ..support.arrays import Array
from ..support.layout import counted
from .channelcauses import channel_diagnosis
from .channelcheck import channel_faults, sense
from .model import reference_free_model
from .recording import Recording, track_readings
from .result import ARCSEC, Blind, OrderEstimate, SelfCalibration, blind_words
from .spindown import spin_down


def channel_patterns(
    recordings: Sequence[Recording],
    orders: str | Sequence[float] = "auto",
    *,
    loop: str = "unknown",
    bandwidth: float | None = None,
    period: float = 360.0,
) -> SelfCalibration:
    """Constants of the channels; with time stamps of several turns the pattern of the angle too."""
    first = recordings[0]
    pairs = [recording.tracks[:2] for recording in recordings]
    readings = track_readings(recordings)
    named, (sine, cosine) = first.named, readings[:2]
    found = estimate_channels(sine, cosine, named, periods=first.periods, period=period)
    channels, followed = _in_sense(found.channels, recordings, pairs)
    mismatch = None
    if first.periods2 is not None:
        channels = with_second_track(channels, readings, first.periods2, first.named)
        mismatch = Mismatch.of(channels, readings)
    if first.excitation_deg is not None:
        channels = channels.replace(excitation_deg=first.excitation_deg)
    unit = abs(channels.constants[-1]) * 2.0 * math.pi / period * ARCSEC
    angles = [channels.unwrapped(*pair) for pair in pairs]
    turns = sum(float(np.ptp(angle)) for angle in angles) / period
    diagnosis = channel_diagnosis(recordings, found)
    apart = ["the curves of the runs differ: calibrate each run alone"] if diagnosis.changes else []
    faults = channel_faults(found, recordings, 0.0)
    notes = [] if mismatch is None else [mismatch.says]
    notes += [followed, *(f"{fault.says}; {fault.mend}" for fault in faults), *apart]
    if found.correlated > 1.0:
        notes.append(
            f"residuals are autocorrelated: {found.correlated:.0f} readings carry the "
            "information of one"
        )
    timed = _by_time(
        [
            replace(r, indicated=a * 2.0 * math.pi / period, indicated_sign=1)
            for r, a in zip(recordings, angles, strict=True)
        ],
        orders,
        turns,
        loop,
        bandwidth,
        period,
        notes,
    )
    table = _table(channels, found)
    known = set() if timed is None else {o.order for o in timed.orders}
    if timed is not None:
        table = sorted(
            [*timed.orders, *(o for o in table if o.order not in known)], key=lambda o: o.order
        )
    blind = [Blind.zero("no reading without a reference shows it"), *_blind(channels, unit, known)]
    noise = math.hypot(*found.noise) / math.sqrt(2.0) * unit
    try:
        model = reference_free_model(
            table,
            "channels",
            [f"{blind_words(b.orders)}: {b.because}" for b in blind],
            notes,
            recordings,
            readings=found.readings,
            noise=noise / ARCSEC,
            period=period,
            channels=channels,
        )
    except NotInvertibleError:
        raise NoCurveError(
            f"{first.named}: the curve is too far from an ellipse; check the wiring of the channels"
        ) from None
    return SelfCalibration(
        method="channels",
        model=model,
        orders=tuple(table),
        sums=(),
        blind=tuple(blind),
        held_out={} if timed is None else timed.held_out,
        notes=tuple(notes),
        noise_arcsec=noise,
        readings=found.readings,
        turns=turns,
        beside={
            "noise_relative": {"cosine": found.noise[0], "sine": found.noise[1]},
            "radius_left_relative": found.radius_left,
            "clipped": found.recorded.clipped,
            **({} if mismatch is None else {"mismatch_periods": mismatch._asdict()}),
        },
        coverage_deg=found.coverage,
        limit_arcsec=found.limit * unit,
        diagnosis=diagnosis,
    )


def _in_sense(
    channels: Channels, recordings: Sequence[Recording], pairs: Sequence[Sequence[Array]]
) -> tuple[Channels, str]:
    """The channels in the sense of another angle of the log, else of the travel."""
    rising, by = sense(channels, recordings)
    if by:
        words = f"the channels' phase {'rises' if rising >= 0.0 else 'falls'} with the {by} angle"
        return channels.replace(direction=1 if rising >= 0.0 else -1), words
    phases = [channels.unwrapped(*pair) / channels.constants[-1] for pair in pairs]
    travelled = sum(float(phase[-1] - phase[0]) for phase in phases)
    if abs(travelled) < 0.5 * math.pi:
        return channels, "the readings hardly travel: the angle is taken to rise with the phase"
    word = "rises" if travelled > 0.0 else "falls"
    return (
        channels.replace(direction=1 if travelled > 0.0 else -1),
        f"the channels' phase {word} through the readings, and the angle is taken to rise: where "
        "the shaft turned backwards the sign of the angle is the other one",
    )


def _by_time(
    recordings: Sequence[Recording],
    orders: str | Sequence[float],
    turns: float,
    loop: str,
    bandwidth: float | None,
    period: float,
    notes: list[str],
) -> SelfCalibration | None:
    """The pattern of the decoded angle by its time stamps, which resolve what the curve cannot."""
    # Turns from which time stamps are needed for the orders that the curve cannot give.
    if recordings[0].time is None or turns < 5.0 or recordings[0].periods > 1:
        return None
    try:
        found = spin_down(recordings, orders, loop=loop, bandwidth=bandwidth, period=period)
    except NoModelError as error:
        notes.append(f"the time stamps add nothing: {error}")
        return None
    if not found.orders:
        return None
    notes.append(
        f"time stamps of {turns:.0f} turns give {counted(found.orders, 'order')} of the decoded "
        "angle"
    )
    return found


def _table(channels: Channels, found: ChannelEstimate) -> list[OrderEstimate]:
    """Orders of the angle that the harmonics of the curve make, with what these leave of them."""
    unit = ARCSEC * 2.0 * math.pi / channels.period
    orders, cosine, sine = channels.error_harmonics()
    series = channels.error_series()
    variances = np.zeros(series.size)
    for i, h in enumerate(channels.harmonics):
        for part in (h._replace(re=h.re + h.std), h._replace(im=h.im + h.std)):
            others = (*channels.harmonics[:i], part, *channels.harmonics[i + 1 :])
            moved = channels.replace(harmonics=others).error_series() - series
            variances += 0.5 * np.abs(channels.constants[-1] * moved) ** 2
    stds = [math.sqrt(variances[k - 1]) for k in orders]
    least = math.hypot(*found.noise) / math.sqrt(found.readings) * abs(channels.constants[-1])
    return [
        OrderEstimate(
            order=float(k * channels.periods_per_turn),
            cosine=a * unit,
            sine=b * unit,
            std=std * unit,
            retained=1.0,
            std_factor=std / least if least > 0.0 else math.inf,
            of="the channels",
        )
        for k, a, b, std in zip(orders, cosine, sine, stds, strict=True)
    ]


def _blind(channels: Channels, unit: float, known: set[float]) -> list[Blind]:
    """Orders whose sign the curve does not show: offset against an eccentric magnet, and so on."""
    p = float(channels.periods_per_turn)
    measure = "fit with a reference, or record time_s over five turns and more of smooth motion"
    rows = [
        (
            1.0,
            abs(channels.offset),
            "an offset of {share} of the amplitude is corrected as one of the electronics; a "
            "magnet or disc that is off its centre draws the same curve",
        ),
        (
            2.0,
            abs(channels.image),
            "gain and phase ({share} of the amplitude) are corrected as those of the channels; a "
            "third harmonic of the field draws the same curve",
        ),
    ]
    rows += [
        (
            1.0 - h.order,
            abs(complex(h.re, h.im)),
            f"harmonic {h.order} ({{share}} of the amplitude) is corrected as one of the channels; "
            f"harmonic {2 - h.order} draws the same curve",
        )
        for h in channels.harmonics
        if h.order < 0
    ]
    return [
        Blind(
            (k * p,),
            f"{words.format(share=f'{100.0 * size:.2g} %')}, and then the correction makes this "
            f"order larger, by up to {2.0 * size * unit / 3600.0:.2g} deg",
            measure,
        )
        for k, size, words in rows
        if k * p not in known and size < CENTRED
    ]
