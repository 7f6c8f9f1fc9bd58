"""What corrects one sample at a time, as a type."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..support.signals import GivenSignals

Model_contra = TypeVar("Model_contra", contravariant=True)
Robot_contra = TypeVar("Robot_contra", contravariant=True)


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
        **coupled: float | None,
    ) -> float:
        """The true angle of an indicated one."""


class ExchangeableStep(Step, Protocol[Model_contra]):
    """A step that goes on with another model."""

    def swap(self, model: Model_contra) -> None:
        """Correct by another model from the next step on (`HarmonicModel.compensator`)."""


class JointsStep(Protocol[Robot_contra]):
    """The corrected angles of all joints of a robot for their indicated ones."""

    def __call__(
        self,
        positions: ArrayLike,
        /,
        out: NDArray[np.float64] | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> NDArray[np.float64]:
        """The true angles, in the order of the joints; in ``out`` where it is given."""

    def swap(self, robot: Robot_contra) -> None:
        """Correct by another robot's models from the next step on (`Robot.compensator`)."""


def exchangeable_step(step: Callable[..., Any], swap: Callable[[Any], None]) -> Any:
    """A step with terms, or of all joints, that can ``swap`` what it corrects by.

    A bound function of the core holds no attributes; a partial of it does, and passes calls on
    at some tens of nanoseconds: much less than such a step takes, and too much for one without
    terms, which has an object in the core (``Compensator.step_with``).
    """
    held = partial(step)
    held.swap = swap  # type: ignore[attr-defined]
    return held
