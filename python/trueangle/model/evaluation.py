"""A model evaluated: its error at an angle, the angle behind an indicated one, its span guarded."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OutsideSpanWarning
from ..support.plainresult import ShownResult
from ..support.signals import GivenSignals, check_signal_names

if TYPE_CHECKING:
    import trueangle._core as _core

    from .term import Term

Path: TypeAlias = Literal["table", "cubics", "exact", "direct", "counts"]

#: Start, stop, and whether every turn looks the same.
Stretch: TypeAlias = tuple[float, float, bool]


class Evaluation(ShownResult):
    """What a model's series and terms amount to at given angles."""

    if TYPE_CHECKING:
        # What the model holds.
        period: float
        terms: tuple[Term, ...]

        @property
        def _series(self) -> _core.Series: ...
        @property
        def _warn(self) -> SpanGuard: ...
        def _core_corrector(self) -> _core.Corrector: ...

    @overload
    def error(
        self,
        theta: float,
        out: None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[float]],
    ) -> float: ...
    @overload
    def error(
        self,
        theta: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> NDArray[Any]: ...
    def error(
        self,
        theta: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> float | NDArray[Any]:
        """Error of the joint at angle ``theta``, in the unit of ``period``.

        Parameters
        ----------
        theta : float or array_like
            The model's `argument`: any shape, any number of turns. float32 gives
            float32, integers (counts) and everything else float64.
        out : ndarray, optional
            Where to put the result, of the result's shape and type; may be ``theta``.
        threads : int, optional
            At most; by default all allowed to the process for large arrays.
        path : {"table", "cubics", "exact", "direct", "counts"}, optional
            Forces a way of evaluation, of a model without terms ("cubics": float32 only).
        direction, velocity, temperature, torque, current : float or array_like, optional
            Signals at the samples, broadcast: sign of travel (0 keeps the last one),
            angle units per second, degrees Celsius, newton metres, amperes. `signals` names
            those the model needs; others are ignored.

        Returns
        -------
        float or ndarray
            A float for a float. NaN and infinite angles give NaN.

        Raises
        ------
        ArgumentError
            ``out`` of the wrong shape or type, or partly overlapping ``theta``.
        MissingSignalError
            Names a signal that was not given and the term that needs it.

        Notes
        -----
        Backlash and hysteresis take the samples in the order given (C order), the first
        one before any motion; without ``direction`` and ``velocity`` they follow the
        angle itself. `corrector` carries that state over batches.

        Within 3e-15 of the sum of amplitudes for angles up to a million radians and
        orders up to 512; the cost does not depend on the number of orders when every
        shaft turns a whole number of times per turn. float32 takes cubics in single
        precision, within 2.4e-7 of the sum of amplitudes and the constant at any angle;
        ``path="table"`` computes it in double precision and rounds once.
        """
        if signals:
            check_signal_names(signals)
        if self.terms:
            return self._core_corrector().error(theta, out, threads=threads, path=path, **signals)
        return self._series.error(theta, out, threads, path)

    @overload
    def correct(
        self,
        indicated: float,
        out: None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[float]],
    ) -> float: ...
    @overload
    def correct(
        self,
        indicated: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> NDArray[Any]: ...
    def correct(
        self,
        indicated: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: Path | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> float | NDArray[Any]:
        """True angle behind an indicated one: ``indicated - error(true angle)``.

        With ``argument="reference"`` this solves ``theta + error(theta) = indicated``
        to below 1e-12 of a turn; with ``"indicated"`` it is ``indicated -
        error(indicated)``. Turns are kept: the result is not wrapped.

        Parameters and errors are those of `error`.

        Warns
        -----
        OutsideSpanWarning
            Once per model, when it was fitted on part of a turn only and a corrected
            angle lies outside that part.
        """
        if signals:
            check_signal_names(signals)
        stretch = self._warn.stretch
        if self.terms:
            corrected, outside = self._core_corrector().correct(
                indicated, out, threads=threads, path=path, stretch=stretch, **signals
            )
        elif stretch is None:
            return self._series.correct(indicated, out, threads, path)
        else:
            corrected, outside = self._series.correct_within(indicated, stretch, out, threads, path)
        if outside:
            self._warn(outside, np.size(corrected))
        return corrected


class SpanGuard:
    """Warns once when corrected angles leave the segment a model was fitted on.

    The core counts them while it corrects.
    """

    def __init__(self, span: tuple[float, float] | None, repeats: bool = True) -> None:
        #: What the core is to look at; None where there is nothing to report (any more).
        self.stretch: Stretch | None = None if span is None else (*span, repeats)

    def __call__(self, outside: int, total: int) -> None:
        """Warn of ``outside`` of ``total`` angles; only the first time."""
        if not outside or self.stretch is None:
            return
        start, stop, _ = self.stretch
        self.stretch = None
        warnings.warn(
            f"{outside} of {total} corrected angles lie outside the {start:.6g} to {stop:.6g} "
            "the model was fitted on: there it is extrapolated and may be far off (reported "
            "once per model)",
            OutsideSpanWarning,
            stacklevel=3,
        )
