"""What corrects one sample at a time, as a type."""

from __future__ import annotations

from typing import Protocol, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..formats.signals import GivenSignals

__all__ = ["AllJoints", "Step"]


class Step(Protocol):
    """One corrected angle for one indicated one; signals that are not needed are ignored."""

    def __call__(
        self,
        indicated: float,
        /,
        velocity: float | None = None,
        temperature: float | None = None,
        torque: float | None = None,
        direction: float | None = None,
        current: float | None = None,
    ) -> float:
        """The true angle of an indicated one."""


class AllJoints(Protocol):
    """The corrected angles of all joints of a robot for their indicated ones."""

    def __call__(
        self,
        positions: ArrayLike,
        /,
        out: NDArray[np.float64] | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> NDArray[np.float64]:
        """The true angles, in the order of the joints; in ``out`` where it is given."""
