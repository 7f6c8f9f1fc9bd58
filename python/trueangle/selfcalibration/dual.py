"""``dual``: motor and output encoder of a geared joint.

``o - m/i = error_o(theta) - error_m(i theta)/i + gear + play + c``: at every order only the sum
is identifiable, and it is reported under all its names. Patterns are functions of the motor's
angle: harmonics of the output's own reading would explain that reading by itself. A ratio that
is given is a count of teeth: it is not estimated unless that is requested.

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

from ..errors import ArgumentError, NoModelError
from ..estimation.linear import linear_residual
from ..runs.travel import Span, travelled_span
from ..support.arrays import Array
from .dense import patterns_apart
from .dualfit import (
    BESIDE_RATIO,
    DualFit,
    DualSample,
    RatioEstimate,
    choose_dual_lines,
    dual_groups,
    dual_rows,
    estimate_dual_ratio,
    fit_dual_lines,
)
from .gearlines import (
    SLIP,
    GearedChannels,
    SharedLine,
    geared_channels,
    lines_of_gear,
    motion_varies,
    slope_ratio,
)
from .model import reference_free_calibration
from .projected import harmonic_unknowns
from .recording import Recording
from .result import (
    ARCSEC,
    Blind,
    HeldOutPattern,
    OrderEstimate,
    SelfCalibration,
    blind_words,
    order_estimates,
)
from .verification import chance_of_parts

#: Standard errors beyond which a ratio differs from the given or a whole one: a probability of
#: 6e-5.
_FAR: Final = 4.0

#: Over less than a turn no ratio is used that needs orders 1 and 2 of more than a degree: a
#: ratio that needs neither is likelier than so eccentric an encoder.
_ECCENTRIC: Final = math.radians(1.0)

#: Where no estimate of the ratio was requested, a given one is reported as doubtful beyond this
#: many standard errors if it also differs by this share.
_DOUBTED: Final = 6.0


class _UsedRatio(NamedTuple):
    """The ratio that is used, what the readings state about it, and its note."""

    used: float
    measured: RatioEstimate
    note: str


def dual(
    recordings: Sequence[Recording],
    orders: str | Sequence[float],
    *,
    gear_ratio: float | None,
    fit_ratio: bool,
    period: float,
) -> SelfCalibration:
    """Sums at every order with their names; see `trueangle.selfcal`."""
    if gear_ratio is not None and not (math.isfinite(gear_ratio) and gear_ratio != 0.0):
        raise ArgumentError(f"gear_ratio must be motor turns per output turn, got {gear_ratio!r}")
    channels = geared_channels(recordings)
    _check_travel(recordings[0].named, channels, gear_ratio)
    start = slope_ratio(channels) if gear_ratio is None else float(gear_ratio)
    turns = sum(float(np.ptp(m)) for m in channels.motor) / abs(start) / (2.0 * math.pi)
    found = _ratio(channels, start, orders, turns, gear_ratio is not None, fit_ratio)
    ratio = found.used
    lines = lines_of_gear(orders, ratio, turns)
    if isinstance(orders, str):
        kept, lost = choose_dual_lines(channels, ratio, lines)
    else:
        kept, lost = lines, []
    if not kept:
        raise NoModelError(
            f"{recordings[0].named}: no order of either shaft is significant; record more "
            "travel (whole output turns)"
        )
    fit = fit_dual_lines(channels, ratio, kept)
    dense = fit.dense
    count = sum(o.size for o in channels.output)
    noise = math.sqrt(dense.projected.variance)
    table = order_estimates(
        [line.order for line in kept],
        dense.patterns,
        dense.covariance,
        dense.projected.retained(),
        noise * math.sqrt(2.0 / count),
        [line.of for line in kept],
    )
    places = [(m / ratio + z) for m, z in zip(channels.motor, fit.zeros, strict=True)]
    whole = all(line.output for line in kept) or float(ratio).is_integer()
    span = travelled_span([x * period / (2.0 * math.pi) for x in places], period, whole)
    # What was read at its ends is corrected to within the noise of them.
    room = 0.0 if span.full else _FAR * noise * period / (2.0 * math.pi)
    blind = _blind(kept, lost, ratio, turns)
    notes = [note for note in (found.note, _arc_note(span, kept, period)) if note]
    notes += _notes(fit, ratio, channels)
    pairs_ = list(zip(kept, table, strict=True))
    return reference_free_calibration(
        table,
        "dual",
        blind,
        notes,
        recordings,
        readings=count,
        noise=noise,
        period=period,
        turns=turns,
        held_out=_held_out(channels, ratio, fit),
        beside=_beside(fit, found, channels),
        modelled=[o for line, o in pairs_ if line.output],
        motor=(
            abs(ratio),
            [_at_output(o, line, fit.zeros[0]) for line, o in pairs_ if not line.output],
        ),
        span=(span.start - room, span.stop + room),
    )


def _check_travel(named: str, channels: GearedChannels, gear_ratio: float | None) -> None:
    """Refuse runs over less than one turn of the motor: its orders are trends there."""
    turns = max(float(np.ptp(m)) for m in channels.motor) / (2.0 * math.pi)
    if turns < 1.0 - SLIP:  # positions evenly over a turn do not repeat the first
        ratio = "" if gear_ratio is None else f", gear_ratio={gear_ratio:g}"
        raise NoModelError(
            f"{named}: the motor made only {turns:.2g} turns in the longest run. Orders of the "
            "motor require 1 turn of it in one run, orders of the output 1 turn of the output. "
            f'Record more: `ta.planning.plan_self("dual"{ratio})` plans the travel'
        )


def _ratio(
    channels: GearedChannels,
    start: float,
    orders: str | Sequence[float],
    turns: float,
    given: bool,
    asked: bool,
) -> _UsedRatio:
    """The ratio to use: as given, else whole unless the readings exclude that."""
    measured = estimate_dual_ratio(channels, start, orders, turns)
    whole = math.copysign(max(round(abs(measured.value)), 1), start)
    far = _FAR * measured.std
    told = f"{measured.value:.7g} (std {measured.std:.2g})"
    if not math.isfinite(measured.std):
        note = "the readings do not separate the gear ratio from orders of the output"
        note += f": {start:g} is kept" if given else "; give it as `gear_ratio=`"
        return _UsedRatio(start if given else whole, measured, note if asked or not given else "")
    if given and not asked:
        off = abs(measured.value - start)
        doubted = off > _DOUBTED * measured.std and off > 1e-4 * abs(start)
        note = f"the readings show a gear ratio of {told}, not {start:g}, which is kept; "
        note += "`fit_ratio=True` takes what they show"
        return _UsedRatio(start, measured, note if doubted else "")
    if given and abs(measured.value - start) <= far:
        return _UsedRatio(
            start, measured, f"the readings show a gear ratio of {told}; {start:g} stays"
        )
    note = f"the gear ratio is estimated: {told}"
    if given:
        note += f", not {start:g}"
    used = whole if abs(measured.value - whole) <= far else measured.value
    if far > 0.5:
        low, high = sorted(abs(measured.value + sign * far) for sign in (-1.0, 1.0))
        note += (
            f"; over this travel any from {low:.4g} to {high:.4g} explains the readings as well: "
            "give the count of teeth as `gear_ratio=`"
        )
    if not given and turns < 1.0 and _eccentricity(channels, used, turns) > _ECCENTRIC:
        used = estimate_dual_ratio(channels, start, orders, turns, ()).value
        note += "; orders 1 and 2 of more than a degree apart"
    return _UsedRatio(used, measured, f"{note}, taken as {used:.7g}")


def _eccentricity(channels: GearedChannels, ratio: float, turns: float) -> float:
    """Amplitude, in radians, of orders 1 and 2 that a ratio needs."""
    lines = [line for line in lines_of_gear(BESIDE_RATIO, ratio, turns) if not line.motor]
    return math.hypot(*fit_dual_lines(channels, ratio, lines).dense.patterns)


def _at_output(o: OrderEstimate, line: SharedLine, zero: float) -> OrderEstimate:
    """A motor's order as a function of the corrected output of the first run."""
    turned = complex(o.cosine, o.sine) * np.exp(1j * line.order * zero)
    return replace(o, cosine=turned.real, sine=turned.imag)


def _blind(
    kept: Sequence[SharedLine], lost: Sequence[SharedLine], ratio: float, turns: float
) -> list[Blind]:
    blind = [
        Blind.zero("the zero: only the difference of two readings is measured"),
        Blind(
            tuple(line.order for line in kept),
            "only sums are identifiable: output encoder with gear (orders of the output), motor "
            "encoder with gear (orders of the motor)",
            "calibrate the motor's encoder alone by a spin-down, change the load (the gear "
            "follows, encoders do not), or turn a magnet against its shaft",
        ),
    ]
    both = [line for line in kept if line.output and line.motor]
    if both:
        names = ", ".join(f"output {line.output} with motor {line.motor}" for line in both)
        exact = float(ratio).is_integer()
        blind.append(
            Blind(
                tuple(line.order for line in both),
                f"the ratio of {abs(ratio):g} is whole: {names} are one number each"
                if exact
                else f"over {turns:.2g} turns {names} are one number each",
                "a spin-down of the motor alone, or gears of a ratio that is not whole"
                if exact
                else "more turns of the output",
            )
        )
    if lost:
        blind.append(
            Blind(
                tuple(line.order for line in lost),
                f"{turns:.2g} turns of the output hold too little of them to separate them from "
                "the zero and the other orders",
                "travel over whole turns of the output",
            )
        )
    return blind


def _beside(fit: DualFit, ratio: _UsedRatio, channels: GearedChannels) -> dict[str, Any]:
    reversing, timed = map(int, motion_varies(channels, ratio.used))
    std = ratio.measured.std
    found: dict[str, Any] = {
        "gear_ratio": ratio.used,
        "gear_ratio_measured": ratio.measured.value,
        "gear_ratio_std": std if math.isfinite(std) else None,
    }
    values, errors = fit.dense.nuisances, fit.dense.nuisance_std
    if reversing:
        found["reversal_error_arcsec"] = 2.0 * float(values[0]) * ARCSEC
        found["reversal_error_std_arcsec"] = 2.0 * float(errors[0]) * ARCSEC
    if timed:
        found["delay_s"] = -float(values[reversing])
        found["delay_std_s"] = float(errors[reversing])
    return found


def _arc_note(span: Span, kept: Sequence[SharedLine], period: float) -> str:
    """What orders of the output mean where a turn was not travelled."""
    low = [float(line.output) for line in kept if line.output and not line.motor]
    if not low or span.stop - span.start >= period:
        return ""
    return (
        f"over {span.describe(period)} {blind_words(low)} of the output describe the error "
        "within this travel; beyond it they are extrapolated"
    )


def _notes(fit: DualFit, ratio: float, channels: GearedChannels) -> list[str]:
    notes = fit.dense.notes
    if not motion_varies(channels, ratio)[0]:
        notes.append("one direction of travel only: reversal error is not identifiable")
    notes.append(
        "the model assigns the error to the output: it makes the output agree with the motor"
    )
    return notes


def _held_out(channels: GearedChannels, ratio: float, fit: DualFit) -> dict[str, HeldOutPattern]:
    """One part of the readings predicts the other: halves, or blocks in turn over one pass."""
    # Readings from which parts of them predict each other.
    if min(o.size for o in channels.output) < 200:
        return {}
    halves = all(_same_places(m) for m in channels.motor)
    # Blocks in turn that predict each other where a run passes every place once.
    blocks = 2 if halves else 20
    columns = [c for line in fit.lines for c in harmonic_unknowns(line.of, [line.order])]
    rows = list(dual_rows(channels, ratio, fit.lines, fit.zeros))
    groups = list(dual_groups(channels, ratio, DualSample(blocks, 0)))
    both = patterns_apart(rows, groups, columns)
    first = np.split(both.patterns, 2)[0]
    judged = ~np.concatenate(groups)
    nuisances = np.concatenate([p.nuisances for p in rows])[judged]
    plain = np.concatenate([p.target for p in rows])[judged]
    predicted = plain - np.concatenate([p.patterns @ first for p in rows])[judged]
    before, after = (
        math.sqrt(float(np.mean(linear_residual(nuisances, y) ** 2))) for y in (plain, predicted)
    )
    names = ("the first half", "the second half") if halves else ("odd blocks", "even blocks")
    return {
        "halves" if halves else "blocks": HeldOutPattern(
            *names, before * ARCSEC, after * ARCSEC, chance_of_parts(both)
        )
    }


def _same_places(motor: Array) -> bool:
    """Whether both halves of a run travel the same arc, or a turn and more each."""
    first, second = np.array_split(motor, 2)
    shared = min(first.max(), second.max()) - max(first.min(), second.min())
    # Both halves of a run are the same places where they share this part of the travel.
    return bool(shared >= 0.8 * float(np.ptp(motor)))
