"""Which causes this design of runs can tell apart, worked out before naming any."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects import EFFECTS
from ..effects.blindness import Blindness
from ..estimation.regression import Extension, Regression

__all__ = ["Blindness", "blind_spots", "doubts_about"]

#: Factors of a design in the order in which their blind spots are told.
FACTORS = (
    "direction",
    "velocity",
    "temperature",
    "torque",
    "mount",
    "run",
    "time",
    "angle",
    "none",
    "grid",
)

#: Factors in the order in which they cast doubt on what another cause explains.
DOUBTS = ("grid", "mount", "torque", "velocity")


def blind_spots(regression: Regression) -> list[Blindness]:
    """What the design of the runs cannot tell; the readings are not looked at."""
    found: list[Blindness] = []
    for effect in EFFECTS.values():
        found += effect.blind_spots(regression, found)
    return sorted(found, key=lambda spot: _place(spot, FACTORS))


def doubts_about(
    extension: Extension, regression: Regression, spots: Sequence[Blindness]
) -> Blindness | None:
    """The reason not to name a supported cause, or None."""
    cause = extension.cause
    if EFFECTS[cause].is_doubted:
        for spot in spots:
            if spot.hides(cause) and not (
                (spot.common or spot.is_open) and EFFECTS[cause].told(extension, regression)
            ):
                return spot
    doubts = (effect.doubt(extension, regression, spots) for effect in EFFECTS.values())
    found = [doubt for doubt in doubts if doubt is not None]
    return min(found, key=lambda spot: _place(spot, DOUBTS), default=None)


def _place(spot: Blindness, order: tuple[str, ...]) -> int:
    return order.index(spot.factor) if spot.factor in order else len(order)
