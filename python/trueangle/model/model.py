"""The harmonic model of an angle error: evaluate it, correct by it, save it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import trueangle._core as _core

from ..errors import ArgumentError
from ..joint.shafts import Shaft
from ..support.angles import check_period
from ..support.arrays import Array
from ..support.kinds import all_of_type, of_type, told_kinds
from ..support.plainresult import result_picture
from ..support.signals import AT_RUN_TIME
from .evaluation import Evaluation, SpanGuard
from .records import FitRecord, Provenance
from .step import ExchangeableStep, Step, exchangeable
from .text import model_summary, one_line, save_model
from .validity import ROUNDING, check_fit, check_invertible, check_number, checked_covariance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .corrector import Corrector
    from .term import Term

__all__ = ["Argument", "HarmonicModel", "Step", "check_invertible"]

Argument: TypeAlias = Literal["reference", "indicated"]


@told_kinds
@dataclass(frozen=True, eq=False, repr=False)
class HarmonicModel(Evaluation):
    """Angle error as a constant, harmonics of one or more shafts and terms; immutable.

    ::

        ε(x) = C₀ + Σ_s Σ_k A_sk cos(k f_s x) + B_sk sin(k f_s x)

    with ``x`` counted in turns of ``2 pi``; error = indicated - reference. ``terms`` add
    what follows travel, velocity, temperature and torque (`trueangle.terms`).

    Parameters
    ----------
    shafts : iterable of Shaft
    constant : float
        ``C_0``.
    period : float
        One turn in the unit of every angle, amplitude and of the constant.
    argument : {"reference", "indicated"}
        Which angle ``x`` is: the true one, then correcting solves
        ``theta + error(theta) = indicated``, or the joint's own reading.
    covariance : array_like, optional
        Of ``[C_0, A, B of each order of each shaft in turn]``.
    condition_number : float, optional
        Of the design the fit has seen.
    fit : FitRecord, optional
    provenance : Provenance, optional
    terms : iterable of Term, optional

    Raises
    ------
    ArgumentError
        Numbers that are not finite, orders that are not increasing, and the like.
    NotInvertibleError
        ``argument="reference"`` and ``|d error / d angle|`` may reach 1.

    Examples
    --------
    >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> round(model.error(90.0), 12)
    0.5
    >>> round(model.correct(90.5), 9)
    90.0
    """

    shafts: tuple[Shaft, ...]
    constant: float = 0.0
    period: float = 2.0 * math.pi
    argument: Argument = "reference"
    covariance: Array | None = field(default=None, repr=False)
    condition_number: float | None = None
    fit: FitRecord | None = None
    provenance: Provenance = field(default_factory=Provenance)
    terms: tuple[Term, ...] = ()

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "period", check_period(self.period))
        put(self, "constant", float(self.constant))
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

    # -- one sample after another --------------------------------------------------

    def corrector(self) -> Corrector:
        """`correct` that carries its state from batch to batch and step to step.

        For the batches of a long log, and for joints whose reversal error depends on
        travel before; see `trueangle.model.corrector.Corrector`.
        """
        from .corrector import Corrector

        return Corrector(self)

    def compensator(self) -> ExchangeableStep:
        """``step(indicated) -> corrected`` for one sample at a time.

        The cheapest call there is: a bound method of the compiled core, no allocation
        but the result, the same number as `correct` of a float or an array of doubles or
        integers, to the last bit. It does not warn about the span.

        With terms it is ``step(indicated, velocity=, temperature=, torque=, direction=, current=)``
        and keeps the state of travel; `corrector` gives the same step and a ``reset``. Signals
        that the model does not need are ignored, as by `correct`. A step can be pickled.

        ``step.swap(model)`` corrects by another model from the next step on, in every thread that
        holds the step: a step in another thread ends with the model it began with. Both have the
        same period, and terms or none. What is known of the travel stays where the terms of the
        other model can hold it, else it begins anew. The new model is made ready first (some
        tenths of a millisecond), by the thread that swaps.

        Examples
        --------
        >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
        >>> step = model.compensator()
        >>> round(step(90.5), 9)
        90.0
        >>> step.swap(model.replace(constant=0.25))
        >>> round(step(90.75), 9)
        90.0
        """
        core = self._prepared()
        step: ExchangeableStep = exchangeable(core.step, partial(_swap, core, self))
        return step

    def _prepared(self) -> Any:
        """What corrects one sample at a time, in the core."""
        return self._core_corrector() if self.terms else self._series.compensator()

    # -- description --------------------------------------------------------------

    def __repr__(self) -> str:
        return one_line(self)

    def summary(self) -> str:
        """The harmonics by shaft and order, in arcseconds, and what is known of the fit."""
        return model_summary(self)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """The error over the angle with its 95 % band (`trueangle.plots.model_error`).

        Needs ``trueangle[plot]``.

        Parameters
        ----------
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        axes: Axes = result_picture(self, ax, **options)
        return axes

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
        """The stretch the model was fitted on when that was not the whole turn.

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

    def replace(self, **changes: Any) -> HarmonicModel:
        """A copy with some fields changed, checked anew."""
        return replace(self, **changes)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file (JSON): complete or not at all.

        Floats are written so that they read back bit for bit.
        """
        save_model(self, path)

    # -- identity -----------------------------------------------------------------

    def _values(self) -> tuple[Any, ...]:
        cov = None if self.covariance is None else self.covariance.tobytes()
        rest = (entry.name for entry in fields(self) if entry.name != "covariance")
        return (*(getattr(self, name) for name in rest), cov)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HarmonicModel):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, ({entry.name: getattr(self, entry.name) for entry in fields(self)},)


def _rebuild(values: dict[str, Any]) -> HarmonicModel:
    return HarmonicModel(**values)


def _swap(core: Any, first: HarmonicModel, model: HarmonicModel) -> None:
    """Let ``core``, made for the ``first`` model, correct by another one."""
    of_type("model", model, HarmonicModel, "a HarmonicModel")
    if model.period != first.period:
        raise ArgumentError(
            f"swap: model has the period {model.period:g}, and the step {first.period:g}"
        )
    if bool(model.terms) != bool(first.terms):
        has = "terms, and the step none" if model.terms else "no terms, and the step some"
        raise ArgumentError(f"swap: model has {has}: take its own compensator()")
    core.swap(model._core_corrector() if model.terms else model._series)
