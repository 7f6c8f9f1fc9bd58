"""Was the speed held by the encoder under test? Then the loop followed, and hides, its error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from ..errors import ArgumentError
from ..selfcalibration import LOOPS
from ..support.suggestions import check_choice
from .result import Blind, OrderEstimate

#: Below this multiple of its bandwidth a velocity loop follows more than a tenth of an error.
FOLLOWS_BELOW: Final = 2.0


def check_loop(loop: str, bandwidth: float | None) -> None:
    """Raise on a loop that is none of `LOOPS` and on an impossible bandwidth."""
    check_choice("loop", loop, LOOPS)
    if bandwidth is not None:
        if not (isinstance(bandwidth, (int, float)) and math.isfinite(bandwidth) and bandwidth > 0):
            raise ArgumentError(f"loop_bandwidth must be positive hertz, got {bandwidth!r}")
        if loop == "open":
            raise ArgumentError("loop_bandwidth is given for an open loop: which is it?")


def followed_orders(
    orders: Sequence[float], loop: str, bandwidth: float | None, slowest: float
) -> tuple[tuple[float, ...], Blind | None]:
    """Orders that the loop may have followed, and how to report it.

    With closed-loop transfer T the shaft moves by ``-Tε`` and the log shows
    ``(1 - T)ε``: hidden where T = 1, amplified where T has turned in phase.

    The ``bandwidth`` is in hertz, with ``"unknown"`` what it would be if the loop was closed;
    ``slowest`` is the slowest speed in the readings, turns per second.
    """
    if loop == "open":
        return (), None
    if bandwidth is None or loop == "unknown":
        how = (
            "the speed was held by a loop of unknown bandwidth"
            if loop == "closed"
            else "how the speed was held is not known"
        )
        return tuple(orders), Blind(
            tuple(orders),
            f"encoder or loop: {how}; a loop closed on this encoder moves the shaft by its error, "
            "and the log shows only the residual",
            'if the drive was off or ran open loop, give `loop="open"`; if a loop held the speed, '
            'give its bandwidth (`loop="closed", loop_bandwidth=HZ`)',
        )
    refused = tuple(k for k in orders if k * slowest < FOLLOWS_BELOW * bandwidth)
    if not refused:
        return (), None
    fast = FOLLOWS_BELOW * bandwidth / min(refused)
    return refused, Blind(
        refused,
        f"encoder or loop: at {slowest:.3g} turns/s these orders pass below twice the loop's "
        f"bandwidth of {bandwidth:g} Hz, where it follows more than a tenth of them",
        f"coast down with the drive off, drive open loop, or turn faster than {fast:.3g} turns/s",
    )


def followed_share(hertz: float, loop: str, bandwidth: float | None) -> float:
    """The most that a loop follows above its bandwidth, if it rolls off by first order only.

    Examples
    --------
    >>> followed_share(6.0, "closed", 1.5)
    0.25
    """
    if loop != "closed" or bandwidth is None:
        return 0.0
    return min(1.0, bandwidth / hertz)


def widened_by_loop(estimate: OrderEstimate, share: float) -> OrderEstimate:
    """The estimate where a share of up to ``share`` may come from the loop.

    In any phase: the standard deviation of a disc of that radius, along one direction.
    """
    if share == 0.0 or estimate.std == 0.0:
        return estimate
    std = math.hypot(estimate.std, 0.5 * share * estimate.amplitude)
    return replace(estimate, std=std, std_factor=estimate.std_factor * std / estimate.std)
