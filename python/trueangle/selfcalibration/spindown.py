"""``spin-down``: one log of a turning encoder, its time stamps as the only reference.

What it can never see: the zero; an error that moves with the speed as a true pattern does
(windage torque with a pattern grows as the square of the speed); orders that a loop closed on
the encoder follows; at one speed, ripple of the motion at the encoder's own orders.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from ..errors import NoModelError
from ..support.arrays import Array
from ..support.layout import counted, order_ranges
from .loop import followed_orders, followed_share, widened_by_loop
from .model import ENCODER, reference_free_calibration
from .orderchoice import choose_selfcal_orders, highest_order, noise_spectrum_at
from .recording import Recording
from .result import Blind, OrderEstimate, SelfCalibration, order_estimates
from .ripple import LARGEST_COST, averaged_over_ripple, cost_of_ripple
from .segments import SegmentReadings, cut_stretches
from .steady import SteadyFit, fit_steady
from .verification import held_out_patterns

#: An order that retains less, jointly with the motion, is not attributed to the encoder.
LEAST_RETAINED: Final = 0.02

#: Below this many turns per knot's own wave a warning is due.
_CURRENT: Final = "the motor current"


def spin_down(
    recordings: Sequence[Recording],
    orders: str | Sequence[float] = "auto",
    *,
    loop: str = "unknown",
    bandwidth: float | None = None,
    ripple: str | Sequence[float] = "auto",
    period: float = 360.0,
) -> SelfCalibration:
    """Patterns from time stamps; see `trueangle.selfcal`."""
    stretches = cut_stretches(recordings)
    readings = SegmentReadings(stretches)
    notes: list[str] = []
    most = highest_order(readings)
    chosen = (
        choose_selfcal_orders(readings) if isinstance(orders, str) else tuple(map(float, orders))
    )
    if any(k > 2.0 * most for k in chosen):
        raise NoModelError(
            f"order {max(chosen):g} is above half the sampling rate: sample faster, "
            f"turn slower, or limit orders to {most}"
        )
    if not chosen:
        raise NoModelError("no order is significant: record more turns, or name the `orders=`")
    with_current = _add_current(readings, loop)
    rippling, separable = _ripple_orders(readings, chosen, ripple)
    fit = fit_steady(readings, chosen, rippling)
    colour = noise_spectrum_at(fit, (*chosen, *rippling))
    scale = np.ones(fit.unknowns.size)
    scale[: 2 * colour.size] = np.sqrt(np.repeat(colour, 2))
    unknowns, white = fit.unknowns, fit.projected.covariance
    covariance = white * np.outer(scale, scale)
    beside: dict[str, Any] = {}
    if rippling and ripple == "auto":
        unknowns, covariance, probable = averaged_over_ripple(
            unknowns, covariance, chosen, rippling
        )
    else:
        probable = np.ones(len(rippling))
    m = 2 * len(chosen)
    colour = colour[: len(chosen)]
    pattern_covariance = covariance[:m, :m]
    noise = math.sqrt(fit.projected.variance)
    limit = noise * math.sqrt(2.0 / float(fit.valid.sum()))
    alone = fit.projected.alone[:m]
    with np.errstate(divide="ignore"):
        spread = np.diagonal(covariance)[:m] / scale[:m] ** 2
        retained = np.minimum(fit.projected.variance / (spread * alone), 1.0)
    retained = np.where(fit.projected.seen[:m], retained, 0.0)
    table = order_estimates(chosen, unknowns[:m], pattern_covariance, retained, limit)
    if rippling:
        rows = slice(m, m + 2 * len(rippling))
        found = order_estimates(
            rippling,
            unknowns[rows],
            covariance[rows, rows],
            np.ones(2 * len(rippling)),
            limit,
            "the speed ripple",
        )
        beside["ripple"] = [
            {**entry.to_dict(), "probability": float(p)}
            for entry, p in zip(found, probable, strict=True)
        ]
        beside["ripple_at_turns_per_s"] = readings.mean_speed
    given, sums, blind = _sorted_out(
        table, readings, loop, bandwidth, separable, ripple, with_current
    )
    if given and bandwidth is not None and not with_current:
        first = given[0].order
        share = followed_share(first * float(np.quantile(readings.speed, 0.02)), loop, bandwidth)
        notes.append(
            f"a loop that rolls off slowly (first order) still follows {share:.0%} of order "
            f"{first:g} and less of those above: the standard errors allow for it"
        )
    notes += _notes(fit, readings, colour, chosen, given, sums, separable, ripple)
    tests = held_out_patterns(fit, [o.order for o in given or sums or table])
    notes += _test_notes(tests, rippling)
    in_model = list(given)
    if loop == "open":
        in_model += sums
        if sums:
            summed = order_ranges([o.order for o in sums])
            notes.append(f"the model corrects the sum of encoder and ripple at orders {summed}")
    return reference_free_calibration(
        given,
        "spin-down",
        blind,
        notes,
        recordings,
        readings=readings.size,
        noise=noise,
        period=period,
        turns=sum(s.turns for s in stretches),
        held_out=tests,
        beside=beside,
        sums=sums,
        modelled=in_model,
    )


def _ripple_orders(
    readings: SegmentReadings, orders: tuple[float, ...], ripple: str | Sequence[float]
) -> tuple[tuple[float, ...], bool]:
    """Orders that get ripple columns, and whether the speeds distinguish ripple from pattern."""
    separable = cost_of_ripple(readings.ripple) <= LARGEST_COST
    if isinstance(ripple, str):
        return (orders if ripple == "auto" and separable else ()), separable
    return (tuple(map(float, ripple)) if separable else ()), separable


def _add_current(readings: SegmentReadings, loop: str) -> bool:
    """The motion that the motor current makes, where the log has it and a loop is closed."""
    if loop != "closed":
        return False
    parts = []
    for stretch in readings.stretches:
        current = stretch.recording.current
        if current is None:
            return False
        parts.append(_twice_integrated(stretch.time, current[stretch.rows]))
    extra = np.concatenate(parts)
    size = float(np.sqrt(np.mean(extra**2)))
    if size == 0.0:
        return False
    readings.extra = extra[None, :] / size
    readings.extra_names = (_CURRENT,)
    return True


def _twice_integrated(time: Array, values: Array) -> Array:
    """Place of a mass under a force that is linear between its readings, less a line."""
    force = values - values.mean()
    dt = np.diff(time)
    gained = 0.5 * dt * (force[:-1] + force[1:])
    speed = np.concatenate([[0.0], np.cumsum(gained)])
    speed -= speed.mean()
    moved = dt * speed[:-1] + dt * dt * (2.0 * force[:-1] + force[1:]) / 6.0
    return np.concatenate([[0.0], np.cumsum(moved)])


def _sorted_out(
    table: list[OrderEstimate],
    readings: SegmentReadings,
    loop: str,
    bandwidth: float | None,
    separable: bool,
    ripple: str | Sequence[float],
    with_current: bool,
) -> tuple[list[OrderEstimate], list[OrderEstimate], list[Blind]]:
    """Numbers that are the encoder's, numbers of several things, and the blind orders."""
    blind = [Blind.zero("no reading without a reference shows it")]
    orders = [o.order for o in table]
    slowest = float(np.quantile(readings.speed, 0.02))
    followed: tuple[float, ...] = ()
    if not with_current:
        followed, why = followed_orders(orders, loop, bandwidth, slowest)
        if why is not None:
            blind.append(why)
    lost = tuple(o.order for o in table if o.retained < LEAST_RETAINED and o.order not in followed)
    if lost:
        what = "the motion that the current explains" if with_current else "the shaft's own drift"
        blind.append(
            Blind(
                lost,
                f"order {order_ranges(lost)} of {ENCODER} and {what} are confounded: the fit "
                f"retains less than {LEAST_RETAINED:.0%}",
                "turn faster or more steadily, with more inertia",
            )
        )
    given, sums = [], []
    first = next((o for o in table if o.order == 1.0), None)
    may_ripple: list[OrderEstimate] = []
    for o in table:
        if o.order in lost:
            continue
        if o.order in followed:
            sums.append(_renamed(o, f"{ENCODER} or the loop"))
        elif ripple != "none" and not separable and _may_be_ripple(o, first):
            may_ripple.append(o)
            sums.append(_renamed(o, f"{ENCODER} or the speed ripple"))
        else:
            share = 0.0 if with_current else followed_share(o.order * slowest, loop, bandwidth)
            given.append(widened_by_loop(o, share))
    if may_ripple:
        low, high = np.quantile(readings.speed, [0.05, 0.95])
        blind.append(
            Blind(
                tuple(o.order for o in may_ripple),
                f"encoder or ripple: at one speed (ratio {high / low:.2f}) order k of {ENCODER} "
                "and order k of the speed ripple are confounded",
                "let it coast from this speed to a third of it or below, or add a segment at "
                "another speed (ratio 3 or more)",
            )
        )
    return given, sums, blind


def _renamed(o: OrderEstimate, of: str) -> OrderEstimate:
    return OrderEstimate(o.order, o.cosine, o.sine, o.std, o.retained, o.std_factor, of)


def _may_be_ripple(o: OrderEstimate, first: OrderEstimate | None) -> bool:
    """Whether torque at this order, no greater than at order 1, could explain all of the error.

    The same torque moves the shaft by 1/k^2 of what it does at order 1, where at most the whole
    measured order is ripple.
    """
    if o.order <= 1.0 or first is None:
        return True
    return o.amplitude <= max(first.amplitude, 2.0 * first.std) / o.order**2


def _notes(
    fit: SteadyFit,
    readings: SegmentReadings,
    colour: Array,
    chosen: Sequence[float],
    given: Sequence[OrderEstimate],
    sums: Sequence[OrderEstimate],
    separable: bool,
    ripple: str | Sequence[float],
) -> list[str]:
    notes = []
    loud = [(k, c) for k, c in zip(chosen, colour, strict=True) if c > 1.5]
    if loud:
        k, c = max(loud, key=lambda pair: pair[1])
        notes.append(
            f"the residual is not white: {c:.1f} times the white noise near order {k:g}; the "
            "standard errors allow for it"
        )
    wild = int((~fit.valid).sum())
    if wild:
        notes.append(f"{counted(wild, 'outlier')} rejected")
    per_turn = sum(fit.motion.knots.intervals) / sum(s.turns for s in readings.stretches)
    notes.append(
        f"motion: {counted(readings.stretches, 'segment')}, "
        f"{per_turn:.2g} knots per turn, smoothing by evidence"
    )
    if not separable and ripple != "none" and given:
        first = max((o.amplitude for o in (*given, *sums) if o.order == 1.0), default=math.nan)
        bound = "" if math.isnan(first) else f" ({first:.3g}/k^2 arcsec)"
        notes.append(
            f"one speed: orders {order_ranges([o.order for o in given])} are the encoder's if the "
            f"torque ripple at them is at most that at order 1{bound}"
        )
    return notes


def _test_notes(tests: dict[str, Any], rippling: Sequence[float]) -> list[str]:
    notes = []
    for name, test in tests.items():
        if test.p > 0.001:
            continue
        if name == "speeds":
            says = (
                "ripple columns allow for it"
                if rippling
                else "the speed ripples: record a ratio of speeds of 3 or more"
            )
            notes.append(f"slow and fast parts show different patterns: {says}")
        elif name == "odd_even_turns":
            notes.append(
                "odd and even turns show different patterns: the error does not repeat every turn"
            )
        elif name == "directions":
            notes.append("forward and backward show different patterns: play or friction")
    return notes
