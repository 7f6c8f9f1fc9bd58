"""`blind_spots`: which causes a design of runs can separate, for any readings."""

from __future__ import annotations

from ..estimation.regression import Regression
from .ambiguity import Ambiguity
from .effect import EFFECTS

#: Factors of a design in the order in which their blind spots are reported.
FACTORS = (
    "direction",
    "velocity",
    "temperature",
    "torque",
    "coupled",
    "mount",
    "run",
    "time",
    "angle",
    "none",
    "grid",
)


def blind_spots(regression: Regression) -> list[Ambiguity]:
    """What the design of the runs cannot show; the readings are not looked at."""
    found: list[Ambiguity] = []
    for effect in EFFECTS.values():
        found += effect.blind_spots(regression, found)
    return sorted(found, key=lambda spot: blind_spot_place(FACTORS, spot))


def blind_spot_place(factors: tuple[str, ...], spot: Ambiguity) -> int:
    """Index of a blind spot's factor among others; their number where it is not among them."""
    return factors.index(spot.factor) if spot.factor in factors else len(factors)
