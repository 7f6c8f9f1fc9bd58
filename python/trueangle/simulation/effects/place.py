"""Effects of the place: the pattern's argument and a local defect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings

__all__ = ["ArgumentShift", "LocalDefect"]


@dataclass(frozen=True)
class ArgumentShift(Effect):
    r"""The pattern is a function of the indicated, not of the true angle.

    .. math:: \varepsilon = -c\,[e - p(\theta)],\quad e = p(\theta + e)
              \approx p + p\,p'

    Parameters
    ----------
    coefficient : float
        c: -1 (the pattern belongs to the indicated angle) or 0.
    """

    coefficient: float = -1.0

    kind: ClassVar[str] = "argument_error"
    sentence: ClassVar[str] = (
        "The pattern was taken as a function of one angle and belongs to the other (indicated "
        "against true): it differs by the product of the pattern and its slope."
    )
    confounded_with: ClassVar[dict[str, str]] = {
        "sidebands": "free angles, with lines at the sums and differences of the known orders",
        "missing_order": "free angles, with lines at the sums and differences of known orders",
    }
    measure: ClassVar[str] = "free angles dense enough for the sums of the gear's orders"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        pattern = around.pattern
        change = pattern.indicated_value(signals.theta) - pattern.value(signals.theta)
        return np.asarray(-self.coefficient * change)

    @staticmethod
    def regressors(signals: Signals, around: Surroundings) -> Array:
        """Column whose coefficient is c."""
        pattern = around.pattern
        change = pattern.indicated_value(signals.theta) - pattern.value(signals.theta)
        return np.asarray(-change[:, None])


@dataclass(frozen=True)
class LocalDefect(Effect):
    r"""A bump at one place of a shaft: :math:`a\,e^{-(\varphi - c)^2/2w^2}`.

    Parameters
    ----------
    place_deg : float
        c, in degrees of that shaft.
    width_deg : float
        w (one standard deviation), in degrees of that shaft.
    height_arcsec : float
        a.
    shaft : str
    """

    place_deg: float
    width_deg: float
    height_arcsec: float
    shaft: str = "output"

    kind: ClassVar[str] = "local_defect"
    sentence: ClassVar[str] = (
        "A damaged tooth, pole or graduation line: a bump at one place of one shaft, the same "
        "in every pass."
    )
    confounded_with: ClassVar[dict[str, str]] = {
        "outliers": "a second pass over the same place",
        "missing_order": "free angles, finer than the bump",
    }
    measure: ClassVar[str] = "a second pass over the place in steps finer than the bump"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        cycles = around.joint.output_order(self.shaft, 1)
        return self.height_arcsec * self.bump(
            signals.theta * cycles, self.place_deg, self.width_deg
        )

    @staticmethod
    def bump(phase: Array, place_deg: float, width_deg: float) -> Array:
        """The bump of height 1 at shaft angles ``phase`` (radians)."""
        away = np.degrees(phase) - place_deg
        away -= 360.0 * np.round(away / 360.0)
        return np.asarray(np.exp(-0.5 * (away / width_deg) ** 2))
