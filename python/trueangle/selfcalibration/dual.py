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
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..distributions import f_tail
from ..errors import ArgumentError, NoModelError
from .dense import DenseFit, Rows, fit_dense
from .modelling import made_model
from .projected import Column, pairs
from .recording import Recording
from .result import ARCSEC, Blind, HeldOut, OrderEstimate, SelfCalibration, estimates
from .summary import listed

__all__ = ["dual"]

Array = NDArray[np.float64]

#: Orders of each shaft that are tried by default.
_HIGHEST: Final = 8

#: An order of which less is left beside line, direction and the others is not told.
_LEAST: Final = 0.02

#: An estimated ratio within so many standard errors of a whole number is taken for it.
_WHOLE: Final = 4.0

#: Turns by which two orders must part over the travel to be two numbers.
_SLIP: Final = 0.05

#: Output turns from which its low orders stand apart from the ratio.
_WHOLE_TURNS: Final = 1.5

#: Fits in which the ratio settles beside the patterns.
_RATIOS: Final = 3

#: Speed is a regressor of its own where it varies by this share of the highest.
_VARIED: Final = 0.2

_CHUNK: Final = 8192


class _Line(NamedTuple):
    """One order of the output, with every shaft that has it."""

    order: float
    output: int  # order of the output, 0 for none
    motor: int  # order of the motor, 0 for none

    @property
    def of(self) -> str:
        if self.output and self.motor:
            return (
                f"output {self.output} + motor {self.motor} "
                "(output encoder, motor encoder or gear: one number)"
            )
        if self.output:
            return f"output {self.output} (output encoder or gear)"
        return f"motor {self.motor} (motor encoder or gear)"


class _Channels(NamedTuple):
    motor: list[Array]
    output: list[Array]
    time: list[Array | None]


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
    channels = _channels(recordings)
    estimated = gear_ratio is None
    ratio = _ratio(channels) if gear_ratio is None else float(gear_ratio)
    turns = sum(float(np.ptp(m)) for m in channels.motor) / abs(ratio) / (2.0 * math.pi)
    for _ in range(_RATIOS if estimated else 1):
        lines = _lines(orders, ratio, turns)
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
    if estimated and whole and doubt * turns < _SLIP and abs(abs(ratio) - whole) < _WHOLE * doubt:
        ratio = math.copysign(float(whole), ratio)
    lines = _lines(orders, ratio, turns)
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


def _at_output(o: OrderEstimate, line: _Line, channels: _Channels, ratio: float) -> OrderEstimate:
    """A motor's order as a function of the output's reading in the first run."""
    zero = float(np.median(channels.output[0] - channels.motor[0] / ratio))
    turned = complex(o.cosine, o.sine) * np.exp(1j * line.order * zero)
    return replace(o, cosine=turned.real, sine=turned.imag)


def _channels(recordings: Sequence[Recording]) -> _Channels:
    motor, output, time = [], [], []
    for r in recordings:
        reading = r.indicated if r.indicated is not None else r.reference
        if r.motor is None or reading is None:
            raise NoModelError(
                f"{r.named}: both readings are needed, motor_deg (not reduced) and indicated_deg "
                "(the output encoder)"
            )
        motor.append(_unwrapped(r.motor))
        output.append(_unwrapped(reading))
        time.append(r.time)
    return _Channels(motor, output, time)


def _unwrapped(angle: Array) -> Array:
    if float(np.ptp(angle)) > 1.02 * 2.0 * math.pi:
        return angle
    return np.asarray(np.unwrap(angle, period=2.0 * math.pi))


def _ratio(channels: _Channels) -> float:
    """Motor turns per output turn, by the slope of one reading over the other."""
    top = bottom = 0.0
    for m, o in zip(channels.motor, channels.output, strict=True):
        dm, do = m - m.mean(), o - o.mean()
        top += float(dm @ dm)
        bottom += float(dm @ do)
    if bottom == 0.0:
        raise NoModelError(
            "the output does not move with the motor: give --gear-ratio, or record motion"
        )
    return top / bottom


def _lines(orders: str | Sequence[float], ratio: float, turns: float) -> list[_Line]:
    """Orders of both shafts; those that the travel cannot tell apart stand once."""
    size = abs(ratio)
    numbers = range(1, _HIGHEST + 1) if isinstance(orders, str) else [int(k) for k in orders]
    lines = {float(k): _Line(float(k), k, 0) for k in numbers}
    for j in range(1, _HIGHEST + 1):
        order = j * size
        near = round(order)
        if near >= 1 and abs(order - near) * turns < _SLIP:
            lines[float(near)] = _Line(float(near), near, j)
        else:
            lines[order] = _Line(order, 0, j)
    return [lines[k] for k in sorted(lines)]


def _fit(
    channels: _Channels, ratio: float, lines: Sequence[_Line], half: int | None = None
) -> DenseFit:
    columns: list[Column] = [c for line in lines for c in pairs(line.of, [line.order])]
    parts = _parts(channels, ratio, lines, half)
    return fit_dense(parts, columns)


def _parts(
    channels: _Channels, ratio: float, lines: Sequence[_Line], half: int | None = None
) -> list[Rows]:
    """Nuisances: ratio, direction, velocity where time is known, a zero per run."""
    runs = len(channels.motor)
    reversing, timed = _varied(channels, ratio)
    parts = []
    for j, (m, o, t) in enumerate(zip(*channels, strict=True)):
        theta = m / ratio
        centre = float(np.mean(theta))
        way, speed = _motion(theta, t)
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


def _varied(channels: _Channels, ratio: float) -> tuple[bool, bool]:
    """Whether both directions were travelled, and at speeds that differ.

    At one speed the column would hold nothing but the motor's own error, differentiated.
    """
    motions = [_motion(m / ratio, t) for m, t in zip(channels.motor, channels.time, strict=True)]
    ways = np.unique(np.concatenate([np.unique(way) for way, _ in motions]))
    speed = np.abs(np.concatenate([v for _, v in motions]))
    known = all(t is not None for t in channels.time)
    varied = known and float(speed.std()) > _VARIED * float(np.quantile(speed, 0.99))
    return bool({-1.0, 1.0} <= set(ways.tolist())), bool(varied)


def _motion(theta: Array, time: Array | None) -> tuple[Array, Array]:
    """Direction of travel (-1, 1) and speed of the output in radians per second."""
    step = np.diff(theta, prepend=theta[0])
    width = 5
    smooth = np.convolve(step, np.ones(width) / width, "same")
    sign = np.sign(smooth)
    moving = np.flatnonzero(sign)
    if moving.size == 0:
        return np.zeros(theta.size), np.zeros(theta.size)
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(sign.size), moving[0]))
    way = sign[last]
    if time is None:
        return np.asarray(way), np.zeros(theta.size)
    spread = max(1, min(10, theta.size // 10))
    speed = np.zeros(theta.size)
    dt = time[2 * spread :] - time[: -2 * spread]
    speed[spread:-spread] = (theta[2 * spread :] - theta[: -2 * spread]) / np.where(
        dt > 0.0, dt, np.inf
    )
    speed[:spread], speed[-spread:] = speed[spread], speed[-spread - 1]
    return np.asarray(way), speed


def _significant(fit: DenseFit, lines: Sequence[_Line], among: Sequence[_Line]) -> list[_Line]:
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
    kept: Sequence[_Line], lost: Sequence[_Line], ratio: float, channels: _Channels
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
    fit: DenseFit, ratio: float, measured: float, std: float, channels: _Channels
) -> dict[str, Any]:
    reversing, timed = _varied(channels, ratio)
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
    channels: _Channels,
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
    if not _varied(channels, ratio)[0]:
        notes.append("one direction of travel only: reversal error is not seen")
    notes.append(
        "the model takes what is seen for the output's: it makes the output agree with the motor"
    )
    return notes


def _held_out(channels: _Channels, ratio: float, lines: Sequence[_Line]) -> dict[str, HeldOut]:
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
