"""An angle error as a constant, harmonics and terms: what a model holds, and what follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

import trueangle._core as _core

from ..errors import ArgumentError
from ..joint.shafts import Shaft
from ..runs.rawchannels import Channels
from ..support.angles import check_period, checked_sign
from ..support.argumentkinds import all_of_type
from ..support.arrays import Array
from ..support.signals import AT_RUN_TIME
from .evaluation import Evaluation, SpanGuard
from .records import FitRecord, Provenance
from .validity import ROUNDING, check_fit, check_invertible, check_number, checked_covariance

if TYPE_CHECKING:
    from .term import Term

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
