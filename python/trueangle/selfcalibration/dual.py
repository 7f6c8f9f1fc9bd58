"""``dual``: motor and output encoder of a geared joint.

``o - m/i = error_o(theta) - error_m(i theta)/i + gear + play + c``: at every order only the sum
is seen, and its number stands under all its names. Patterns are functions of the motor's
angle: harmonics of the reading that is explained would explain it by itself.

What it can never see: which of output encoder, gear and motor encoder an order belongs to;
where the ratio is whole, output order k i and motor order k are one; the zero; orders that
the travel does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..distributions import f_tail
from ..errors import ArgumentError, NoModelError
from .dense import DenseFit, Rows, fit_dense
from .gearlines import SLIP, Channels, Line, channels_of, lines_of, motion, slope_ratio, varied
from .modelling import made_model
from .projected import Column, pairs
from .recording import Recording
from .result import ARCSEC, Blind, HeldOut, OrderEstimate, SelfCalibration, estimates
from .summary import listed

__all__ = ["dual"]

Array = NDArray[np.float64]

#: An order of which less is left beside line, direction and the others is not told.
_LEAST: Final = 0.02

#: An estimated ratio within so many standard errors of a whole number is taken for it.
_WHOLE: Final = 4.0

#: Output turns from which its low orders stand apart from the ratio.
_WHOLE_TURNS: Final = 1.5

#: Fits in which the ratio settles beside the patterns.
_RATIOS: Final = 3

_CHUNK: Final = 8192


def dual(
    recordings: Sequence[Recording],
    orders: str | Sequence[float] = "auto",
    *,
    gear_ratio: float | None = None,
    period: float = 360.0,
) -> SelfCalibration:
    """Sums at every order with their names; see `trueangle.selfcal`."""
    if gear_ratio is not None and not (math.isfinite(gear_ratio) and gear_ratio != 0.0):
        raise ArgumentError(f"gear_ratio must be motor turns per output turn, got {gear_ratio!r}")
    channels = channels_of(recordings)
    estimated = gear_ratio is None
    ratio = slope_ratio(channels) if gear_ratio is None else float(gear_ratio)
    turns = sum(float(np.ptp(m)) for m in channels.motor) / abs(ratio) / (2.0 * math.pi)
    for _ in range(_RATIOS if estimated else 1):
        lines = lines_of(orders, ratio, turns)
        if turns < _WHOLE_TURNS:  # the output's own orders would pass for a slope
            lines = [line for line in lines if line.motor]
        fit = _fit(channels, ratio, lines)
        # What the slope says of the ratio: o = theta (1 + slope).
        measured = ratio / (1.0 + float(fit.nuisances[0]))
        slope_std = float(fit.nuisance_std[0])
        if estimated:
            ratio = measured
    whole = round(abs(ratio))
    doubt = abs(ratio) * slope_std
    if estimated and whole and doubt * turns < SLIP and abs(abs(ratio) - whole) < _WHOLE * doubt:
        ratio = math.copysign(float(whole), ratio)
    lines = lines_of(orders, ratio, turns)
    fit = _fit(channels, ratio, lines)
    retained = fit.projected.retained()
    lost = [
        line for i, line in enumerate(lines) if float(retained[2 * i : 2 * i + 2].min()) < _LEAST
    ]
    kept = [line for line in lines if line not in lost]
    if isinstance(orders, str):
        kept = _significant(fit, lines, kept)
    if not kept:
        raise NoModelError(
            f"{recordings[0].named}: no order of either shaft stands out of what is left; record "
            "more travel (whole output turns)"
        )
    fit = _fit(channels, ratio, kept)
    count = sum(o.size for o in channels.output)
    noise = math.sqrt(fit.projected.variance)
    table = estimates(
        [line.order for line in kept],
        fit.patterns,
        fit.covariance,
        fit.projected.retained(),
        noise * math.sqrt(2.0 / count),
        [line.of for line in kept],
    )
    blind = _blind(kept, lost, ratio, channels)
    notes = _notes(fit, ratio, measured, abs(measured) * slope_std, estimated, channels)
    pairs_ = list(zip(kept, table, strict=True))
    model = made_model(
        [o for line, o in pairs_ if line.output],
        "dual",
        [f"{listed(b.orders)}: {b.because}" for b in blind],
        notes,
        recordings,
        readings=count,
        noise=noise,
        period=period,
        motor=(
            abs(ratio),
            [_at_output(o, line, channels, ratio) for line, o in pairs_ if not line.output],
        ),
    )
    return SelfCalibration(
        method="dual",
        model=model,
        orders=tuple(table),
        sums=(),
        blind=tuple(blind),
        held_out=_held_out(channels, ratio, kept),
        notes=tuple(notes),
        noise_arcsec=noise * ARCSEC,
        readings=count,
        turns=sum(float(np.ptp(m)) for m in channels.motor) / abs(ratio) / (2.0 * math.pi),
        beside=_beside(fit, ratio, measured, abs(measured) * slope_std, channels),
    )


def _at_output(o: OrderEstimate, line: Line, channels: Channels, ratio: float) -> OrderEstimate:
    """A motor's order as a function of the output's reading in the first run."""
    zero = float(np.median(channels.output[0] - channels.motor[0] / ratio))
    turned = complex(o.cosine, o.sine) * np.exp(1j * line.order * zero)
    return replace(o, cosine=turned.real, sine=turned.imag)


def _fit(
    channels: Channels, ratio: float, lines: Sequence[Line], half: int | None = None
) -> DenseFit:
    columns: list[Column] = [c for line in lines for c in pairs(line.of, [line.order])]
    parts = _parts(channels, ratio, lines, half)
    return fit_dense(parts, columns)


def _parts(
    channels: Channels, ratio: float, lines: Sequence[Line], half: int | None = None
) -> list[Rows]:
    """Nuisances: ratio, direction, velocity where time is known, a zero per run."""
    runs = len(channels.motor)
    reversing, timed = varied(channels, ratio)
    parts = []
    for j, (m, o, t) in enumerate(zip(*channels, strict=True)):
        theta = m / ratio
        centre = float(np.mean(theta))
        way, speed = motion(theta, t)
        # By whole turns the output's zero is any; its patterns count from its own reading.
        zero = float((o - theta)[0])
        target = o - theta - zero
        place = theta + float(np.median(o - theta))
        size = o.size
        nuisances = np.zeros((size, 1 + reversing + timed + runs))
        nuisances[:, 0] = theta - centre
        if reversing:
            nuisances[:, 1] = way
        if timed:
            nuisances[:, 1 + reversing] = speed
        nuisances[:, 1 + reversing + timed + j] = 1.0
        rows = np.empty((size, 2 * len(lines)))
        for i, line in enumerate(lines):
            angle = line.order * place if line.output else line.motor * np.sign(ratio) * m
            rows[:, 2 * i], rows[:, 2 * i + 1] = np.cos(angle), np.sin(angle)
        part = (
            slice(0, size)
            if half is None
            else slice(0, size // 2)
            if half == 0
            else slice(size // 2, size)
        )
        for a in range(part.start, part.stop, _CHUNK):
            b = min(a + _CHUNK, part.stop)
            parts.append(Rows(rows[a:b], nuisances[a:b], target[a:b]))
    return parts


def _significant(fit: DenseFit, lines: Sequence[Line], among: Sequence[Line]) -> list[Line]:
    from ..distributions import chi_squared_quantile

    limit = chi_squared_quantile(1.0 - 0.01 / max(len(lines), 1), 2.0)
    kept = []
    for i, line in enumerate(lines):
        if line not in among:
            continue
        pair = slice(2 * i, 2 * i + 2)
        value, block = fit.patterns[pair], fit.covariance[pair, pair]
        if float(value @ np.linalg.pinv(block, hermitian=True) @ value) > limit:
            kept.append(line)
    return kept


def _blind(
    kept: Sequence[Line], lost: Sequence[Line], ratio: float, channels: Channels
) -> list[Blind]:
    blind = [
        Blind(
            (0.0,),
            "the zero: only the difference of two readings is seen",
            "set the zero at a mark or an index pulse",
        ),
        Blind(
            tuple(line.order for line in kept),
            "only sums are seen: output encoder together with gear (orders of the output), motor "
            "encoder together with gear (orders of the motor)",
            "calibrate the motor's encoder alone by a spin-down, change the load (the gear "
            "follows, encoders do not), or turn a magnet against its shaft",
        ),
    ]
    both = [line for line in kept if line.output and line.motor]
    if both:
        names = ", ".join(f"output {line.output} with motor {line.motor}" for line in both)
        blind.append(
            Blind(
                tuple(line.order for line in both),
                f"the ratio of {abs(ratio):g} is whole: {names} are one number each",
                "a spin-down of the motor alone, or gears of a ratio that is not whole",
            )
        )
    if lost:
        travel = sum(float(np.ptp(m)) for m in channels.motor) / abs(ratio) / (2.0 * math.pi)
        blind.append(
            Blind(
                tuple(line.order for line in lost),
                f"{travel:.2g} turns of the output hold too little of them beside zero, ratio and "
                "the other orders",
                "travel over whole turns of the output",
            )
        )
    return blind


def _beside(
    fit: DenseFit, ratio: float, measured: float, std: float, channels: Channels
) -> dict[str, Any]:
    reversing, timed = varied(channels, ratio)
    found: dict[str, Any] = {
        "gear_ratio": ratio,
        "gear_ratio_measured": measured,
        "gear_ratio_std": std,
    }
    if reversing:
        found["reversal_error_arcsec"] = 2.0 * float(fit.nuisances[1]) * ARCSEC
        found["reversal_error_std_arcsec"] = 2.0 * float(fit.nuisance_std[1]) * ARCSEC
    if timed:
        found["delay_s"] = -float(fit.nuisances[1 + reversing])
        found["delay_std_s"] = float(fit.nuisance_std[1 + reversing])
    return found


def _notes(
    fit: DenseFit,
    ratio: float,
    measured: float,
    std: float,
    estimated: bool,
    channels: Channels,
) -> list[str]:
    notes = []
    if estimated:
        notes.append(
            f"the gear ratio is estimated: {measured:.6g} (std {std:.2g}), taken as {ratio:.7g}"
        )
    elif abs(measured - ratio) > 5.0 * std and abs(measured / ratio - 1.0) > 1e-4:
        notes.append(
            f"the readings show a gear ratio of {measured:.6g} (std {std:.2g}), not {ratio:g}"
        )
    if fit.correlated:
        notes.append("neighbouring residuals agree: standard errors are taken from blocks")
    if not varied(channels, ratio)[0]:
        notes.append("one direction of travel only: reversal error is not seen")
    notes.append(
        "the model takes what is seen for the output's: it makes the output agree with the motor"
    )
    return notes


def _held_out(channels: Channels, ratio: float, lines: Sequence[Line]) -> dict[str, HeldOut]:
    """First half of every run against the second."""
    if min(o.size for o in channels.output) < 200:
        return {}
    first = _fit(channels, ratio, lines, 0)
    plain = _fit(channels, ratio, [], 1)
    left = []
    parts = _parts(channels, ratio, lines, 1)
    nuisances = np.concatenate([p.nuisances for p in parts])
    target = np.concatenate([p.target - p.patterns @ first.patterns for p in parts])
    left = target - nuisances @ np.linalg.lstsq(nuisances, target, rcond=1e-12)[0]
    before = math.sqrt(float(np.mean(plain.residuals**2)))
    after = math.sqrt(float(np.mean(left**2)))
    own = _fit(channels, ratio, lines, 1)
    ratio_f = after**2 / max(own.projected.variance, 1e-300)
    free = float(own.residuals.size) / (1.0 if not own.correlated else own.residuals.size / 40.0)
    return {
        "halves": HeldOut(
            "the first half",
            "the second half",
            before * ARCSEC,
            after * ARCSEC,
            f_tail(ratio_f / (1.0 + 4.0 * len(lines) / free), free, free),
        )
    }
