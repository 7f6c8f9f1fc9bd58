"""Correction of samples one after another or in batches, with the state that this needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Protocol, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.signals import GivenSignals, check_signal_names
from .errormodel import ErrorModel

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


class _Velocity:
    """Backward differences of angle over time, carried over batches.

    Examples
    --------
    >>> velocity = _Velocity(360.0)
    >>> velocity([358.0, 359.0, 1.0], [0.0, 0.5, 1.0])
    array([2., 2., 4.])
    >>> velocity([2.0, 2.0], [1.5, 1.5])
    array([2., 2.])
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Reset the state."""
        self._angle = self._time = np.nan
        self._last = np.nan

    @property
    def state(self) -> tuple[float, float, float]:
        """The last angle, time and velocity; NaN where there is none yet."""
        return self._angle, self._time, self._last

    @state.setter
    def state(self, numbers: tuple[float, float, float]) -> None:
        self._angle, self._time, self._last = numbers

    def __call__(self, angle: ArrayLike, time: ArrayLike) -> Array:
        """Velocity at every sample; samples that are not finite leave no trace."""
        x = np.asarray(angle, dtype=np.float64)
        t = np.asarray(time, dtype=np.float64)
        if x.shape != t.shape or x.ndim > 1:
            raise ArgumentError(
                f"time must have the shape of the angles {x.shape}, one dimension, got {t.shape}"
            )
        velocity = np.full(x.shape, np.nan).ravel()
        good = np.flatnonzero(np.isfinite(x.ravel() + t.ravel()))
        if good.size:
            x, t = x.ravel()[good], t.ravel()[good]
            steps = wrap(np.diff(x, prepend=self._angle), self._period)
            spans = np.diff(t, prepend=self._time)
            velocity[good] = self._filled(steps, spans)
            self._angle, self._time = float(x[-1]), float(t[-1])
            self._last = float(velocity[good[-1]])
        return velocity.reshape(np.shape(angle))

    def _filled(self, steps: Array, spans: Array) -> Array:
        """``steps / spans``; where no time has passed, the velocity before, else after."""
        usable = spans > 0.0
        rates = np.where(usable, steps, np.nan) / np.where(usable, spans, 1.0)
        places = np.flatnonzero(usable)
        if places.size == 0:
            return np.full(steps.size, 0.0 if np.isnan(self._last) else self._last)
        before = np.searchsorted(places, np.arange(steps.size), side="right") - 1
        filled = rates[places[np.maximum(before, 0)]]
        if not np.isnan(self._last):
            filled[before < 0] = self._last
        return filled


class Corrector:
    """Corrects batches and single samples, one after the other, of one log or one joint.

    Made by `HarmonicModel.corrector`. Backlash and hysteresis depend on travel before:
    the state is carried from call to call, so that batches of a log give bit for bit what
    the whole log gives at once, and single steps the same.

    A corrector belongs to one thread: called by two at once it raises `RuntimeError` or
    takes the samples in an order that nobody chose. Models, and `step` of a model without
    terms, hold no state and may be shared by any number of threads.

    Parameters
    ----------
    model : HarmonicModel

    Examples
    --------
    A log in two batches, with the play crossed in the second one:

    >>> import trueangle as ta
    >>> model = ta.HarmonicModel([], period=360.0, terms=[ta.Backlash(0.5)])
    >>> corrector = model.corrector()
    >>> corrector([10.5, 11.5, 12.5], velocity=1.0)
    array([10., 11., 12.])
    >>> corrector([11.5, 10.5], velocity=-1.0)
    array([12., 11.])
    >>> corrector.reset()
    """

    def __init__(self, model: ErrorModel) -> None:
        self._model = model
        self._core = model._core_corrector()
        self._velocity = _Velocity(model.period)

    @property
    def step(self) -> Step:
        """``step(indicated, velocity=, temperature=, torque=, direction=, current=) -> corrected``.

        One sample, in the state of this corrector: a bound method of the compiled core
        without allocation but the result; ``coupled_JOINT`` is the indicated angle of another
        joint that a term is about. A signal the model needs and does not get is a
        `MissingSignalError`; others are ignored.
        """
        return self._core.step

    def __reduce__(self) -> tuple[Any, ...]:  # copies continue from this one's state
        return _rebuild, (self._model, self.state)

    def reset(self) -> None:
        """Reset the state: the next sample is the first one."""
        self._core.reset()
        self._velocity.reset()

    @property
    def state(self) -> tuple[float, ...]:
        """All that later samples need to know about the past, as numbers to keep and to set.

        Raises
        ------
        ArgumentError
            When set: not the state of a corrector of this model.
        """
        return (*self._velocity.state, *self._core.store())

    @state.setter
    def state(self, numbers: Iterable[float]) -> None:
        angle, time, last, *travel = (*numbers,)
        self._core.restore(travel)
        self._velocity.state = angle, time, last

    def __call__(
        self,
        indicated: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        time: ArrayLike | None = None,
        threads: int | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> float | NDArray[Any]:
        """True angles behind the next indicated ones; see `HarmonicModel.correct`.

        Parameters
        ----------
        indicated : float or array_like
            In the order taken (C order); steps below half a turn.
        out : ndarray, optional
        time : array_like, optional
            Seconds of every sample: in place of a velocity that is not given, backward
            differences of the indicated angle. At equal times the last velocity holds; the
            very first sample takes that of the second.
        threads : int, optional
        direction, velocity, temperature, torque, current : float or array_like, optional
            Signals, broadcast against ``indicated``. Those that the model does not use
            are ignored.

        Returns
        -------
        float or ndarray
            Of the broadcast shape. NaN for samples with an angle or a signal that is not
            finite, which leave the state alone.

        Raises
        ------
        MissingSignalError
            Names the signal and the term that needs it.
        ArgumentError
            Shapes that do not fit.
        """
        check_signal_names(signals)
        if (
            time is not None
            and signals.get("velocity") is None
            and "velocity" in self._model.uses_signals
        ):
            signals["velocity"] = self._velocity(indicated, time)
        return self._core.correct(indicated, out, threads=threads, **signals)[0]


def _rebuild(model: ErrorModel, state: tuple[float, ...]) -> Corrector:
    corrector = Corrector(model)
    corrector.state = state
    return corrector
