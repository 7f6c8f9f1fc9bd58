"""An angle error as a constant, harmonics and terms: what a model holds, and what follows."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

import trueangle._core as _core

from ..errors import ArgumentError, OutsideSpanWarning
from ..joint.shafts import Shaft
from ..runs.rawchannels import Channels
from ..support.angles import check_period, checked_sign
from ..support.argumentkinds import all_of_type
from ..support.arrays import Array
from ..support.plainresult import ShownResult
from ..support.signals import AT_RUN_TIME, GivenSignals, check_signal_names
from .records import FitRecord, Provenance
from .term import Term
from .validity import ROUNDING, check_fit, check_invertible, check_number, checked_covariance

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


Argument: TypeAlias = Literal["reference", "indicated"]


@dataclass(frozen=True, eq=False, repr=False)
class ErrorModel(Evaluation):
    """What a `HarmonicModel` holds, checked, and what is known by it."""

    shafts: tuple[Shaft, ...]
    constant: float = 0.0
    period: float = 2.0 * math.pi
    argument: Argument = "reference"
    covariance: Array | None = field(default=None, repr=False)
    condition_number: float | None = None
    fit: FitRecord | None = None
    provenance: Provenance = field(default_factory=Provenance)
    terms: tuple[Term, ...] = ()
    indicated_sign: int = 1
    channels: Channels | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "period", check_period(self.period))
        put(self, "constant", float(self.constant))
        put(self, "indicated_sign", checked_sign(self.indicated_sign))
        put(self, "shafts", all_of_type("shafts", self.shafts, Shaft, "a trueangle.Shaft"))
        if self.argument not in ("reference", "indicated"):
            raise ArgumentError(
                f"argument must be 'reference' or 'indicated', got {self.argument!r}"
            )
        series = self._series  # refuses numbers that no series may have
        if self.argument == "reference":
            check_invertible(series.slope_bound)
        if self.covariance is not None:
            put(self, "covariance", checked_covariance(self.covariance, len(self.orders)))
        if self.condition_number is not None:
            check_number("condition_number", self.condition_number, 1.0 - ROUNDING, math.inf)
        if self.fit is not None:
            check_fit(self.fit, self.period)
        if self.terms != ():
            self._check_terms()
        if self.channels is not None and self.channels.period != self.period:
            raise ArgumentError(
                f"channels give angles of period {self.channels.period:g}, and the model takes "
                f"those of period {self.period:g}"
            )

    def _check_terms(self) -> None:
        from .terms import TERMS, Term  # most models have none

        def meant(value: object) -> str:
            term = TERMS.get(getattr(value, "kind", ""))
            name = "" if term is None else term.__name__.removesuffix("Term")
            return f"its term is trueangle.terms.{name}" if name else ""

        wanted = f"a term of trueangle.terms, in the unit of the model (period {self.period:g})"
        terms = all_of_type("terms", self.terms, Term, wanted, meant)
        object.__setattr__(self, "terms", terms)
        if terms:
            self._core_corrector()  # refuses terms that leave no unique correction

    @cached_property
    def _unused_corrector(self) -> _core.Corrector:
        return _core.Corrector(self._series, list(self.terms))

    def _core_corrector(self) -> _core.Corrector:
        return self._unused_corrector.fresh()

    @cached_property
    def _warn(self) -> SpanGuard:
        return SpanGuard(self.partial_span, self.is_periodic)

    @cached_property
    def _series(self) -> _core.Series:
        names = [shaft.name for shaft in self.shafts]
        if len(set(names)) != len(names):
            raise ArgumentError(f"shaft names must differ, got {', '.join(names)}")
        return _core.Series(
            self.period,
            self.constant,
            [shaft.cycles_per_turn for shaft in self.shafts],
            [list(shaft.orders) for shaft in self.shafts],
            [list(shaft.cosine) for shaft in self.shafts],
            [list(shaft.sine) for shaft in self.shafts],
            self.argument,
        )

    @property
    def orders(self) -> tuple[float, ...]:
        """Output orders ``k * cycles_per_turn`` of all harmonics, shaft by shaft."""
        return tuple(k * s.cycles_per_turn for s in self.shafts for k in s.orders)

    @property
    def amplitudes(self) -> Array:
        """``C_k`` of all harmonics, shaft by shaft."""
        return np.concatenate([np.zeros(0), *(shaft.amplitudes for shaft in self.shafts)])

    @property
    def phases(self) -> Array:
        """``phi_k`` in radians of all harmonics, shaft by shaft."""
        return np.concatenate([np.zeros(0), *(shaft.phases for shaft in self.shafts)])

    @property
    def is_periodic(self) -> bool:
        """True when the error repeats after one output turn: all cycles are whole."""
        return self._series.is_periodic and all(term.is_periodic for term in self.terms)

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals without which the model cannot correct: "velocity", "temperature" ...

        Where "direction" is among them, a velocity will do as well; "coupled_JOINT" is the
        indicated angle of another joint.
        """
        needed = dict.fromkeys(name for term in self.terms for name in term.needs)
        further = (name for name in needed if name not in AT_RUN_TIME)
        return (*(name for name in AT_RUN_TIME if name in needed), *further)

    @property
    def uses_signals(self) -> tuple[str, ...]:
        """`signals` and those it takes where given: direction and velocity for travel."""
        used = dict.fromkeys(self.signals)
        if self.follows_travel:
            used |= {"direction": None, "velocity": None}
        further = (name for name in used if name not in AT_RUN_TIME)
        return (*(name for name in AT_RUN_TIME if name in used), *further)

    @property
    def follows_travel(self) -> bool:
        """True when a correction depends on the travel before it: backlash, hysteresis."""
        return any(term.follows_travel for term in self.terms)

    @property
    def partial_span(self) -> tuple[float, float] | None:
        """The segment the model was fitted on when that was not the whole turn.

        First and last angle, whole turns kept, where the error does not repeat after a turn: of
        a term that holds over its own travel only (`Term.travel`), else of the fit.
        """
        travels = [term.travel for term in self.terms if term.travel is not None]
        if travels and self._series.is_periodic:
            starts, stops = zip(*travels, strict=True)
            return max(starts), min(stops)
        if self.fit is None:
            return None
        start, stop = self.fit.span
        whole = self.is_periodic and stop - start >= self.period
        return None if whole else (start, stop)

    def band(self, theta: ArrayLike) -> Array:
        """Standard deviation of the fitted error at ``theta``, from the covariance.

        ::

            u(ε(x))² = g(x)ᵀ cov g(x)

        with ``g`` the row of regressors at ``x``.

        Raises
        ------
        ArgumentError
            The model has no covariance.
        """
        if self.covariance is None:
            raise ArgumentError("the model has no covariance: it was not made by a fit")
        x = np.asarray(theta, dtype=np.float64)
        band = _core.band(
            np.ascontiguousarray(x).reshape(-1),
            self.period,
            [shaft.cycles_per_turn for shaft in self.shafts],
            [list(shaft.orders) for shaft in self.shafts],
            self.covariance.reshape(-1),
        )
        return band.reshape(x.shape)

    def in_sensor_sense(self) -> Self:
        """The model of what the sensor reads, in the sense in which the sensor counts.

        ::

            r = -y,    ε_r(φ) = -ε(-φ),    φ = -θ

        of a reversed sensor (``indicated_sign`` -1), else the model itself. A velocity, a
        direction and the angles of the fit's record count as the sensor does; torque, current,
        temperature and the angles of other joints are as they were.

        Examples
        --------
        >>> import trueangle as ta
        >>> shaft = ta.Shaft("output", 1, [1], [0.3], [0.5])
        >>> model = ta.HarmonicModel([shaft], 0.1, period=360.0, indicated_sign=-1)
        >>> round(model.in_sensor_sense().correct(-90.5) + model.correct(90.5), 12)
        0.0
        """
        if self.indicated_sign > 0:
            return self
        covariance = self.covariance
        if covariance is not None:
            flips = np.array([-1.0, *(-1.0, 1.0) * len(self.orders)])
            covariance = covariance * np.outer(flips, flips)
        return replace(
            self,
            shafts=tuple(replace(s, cosine=tuple(-a for a in s.cosine)) for s in self.shafts),
            constant=-self.constant,
            covariance=covariance,
            fit=None if self.fit is None else self.fit.mirrored(),
            terms=tuple(term.mirrored() for term in self.terms),
            indicated_sign=1,
        )

    # -- identity -----------------------------------------------------------------

    def _values(self) -> tuple[Any, ...]:
        cov = None if self.covariance is None else self.covariance.tobytes()
        rest = (entry.name for entry in fields(self) if entry.name != "covariance")
        return (*(getattr(self, name) for name in rest), cov)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ErrorModel):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())
