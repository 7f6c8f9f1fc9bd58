"""What every term is: named parameters in the model's unit, the signals and lines it follows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

from ..errors import ArgumentError
from ..support.angles import from_arcsec
from ..support.suggestions import did_you_mean
from .forms import Form, Lines

#: Every term by its kind: a class joins by being defined.
TERMS: dict[str, type[Term]] = {}


@dataclass(frozen=True, repr=False)
class Term:
    """Base of the terms; each is a frozen dataclass whose fields are its parameters.

    A term adds its error to that of the harmonics. Angles are in the unit of the model
    that holds it; ``phi = theta - velocity * delay`` is the angle the encoder saw.

    Class attributes
    ----------------
    kind : str
        Its name in model files, from the vocabulary of causes.
    signals : tuple of str
        Signals it cannot do without: "velocity", "temperature", "torque" (`needs`, where
        that depends on the parameters).
    follows_travel : bool
        It keeps the direction of travel from sample to sample.
    is_built_on_harmonics : bool
        It contains the harmonics of its model.
    optional : tuple of str
        Parameters that model files name only where they differ from the default.
    odd : tuple of str
        Parameters with the other sign where angles are counted the other way (`mirrored`).

    Raises
    ------
    ArgumentError
        A parameter that is no finite number, or outside its range.
    """

    noun: ClassVar[str] = "the term of a correction model"
    kind: ClassVar[str]
    signals: ClassVar[tuple[str, ...]] = ()
    follows_travel: ClassVar[bool] = False
    is_built_on_harmonics: ClassVar[bool] = False
    optional: ClassVar[tuple[str, ...]] = ()
    odd: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "kind" in cls.__dict__:
            TERMS[cls.kind] = cls

    def __repr__(self) -> str:
        shown = (
            f"{field.name}={getattr(self, field.name)!r}"
            for field in fields(self)
            if field.name not in self._left_out()
        )
        return f"{type(self).__name__.removesuffix('Term')}({', '.join(shown)})"

    def _left_out(self) -> set[str]:
        """Optional parameters that have their default."""
        return {
            field.name
            for field in fields(self)
            if field.name in self.optional and getattr(self, field.name) == field.default
        }

    def __post_init__(self) -> None:
        for field in fields(self):
            value = self._checked(field.name, str(field.type), getattr(self, field.name))
            object.__setattr__(self, field.name, value)
        self.check()

    @property
    def needs(self) -> tuple[str, ...]:
        """Signals without which this term cannot be computed."""
        return self.signals

    @property
    def is_periodic(self) -> bool:
        """True when the term repeats after one output turn."""
        return all(order == int(order) for order in getattr(self, "orders", ()))

    @property
    def travel(self) -> tuple[float, float] | None:
        """Range over the turns outside of which the term is constant; None without one."""
        return None

    def check(self) -> None:
        """Raise where parameters are out of range; they are finite numbers by then."""

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Self:
        """Term from the object of a model file, without its ``kind``.

        Raises
        ------
        ArgumentError
            Names a parameter that is unknown, missing or impossible.
        """
        known = {field.name: field for field in fields(cls)}
        for name in table:
            if name not in known:
                raise ArgumentError(
                    f"{cls.kind} has no parameter '{name}'; it has "
                    f"{', '.join(known)}{did_you_mean(name, known)}"
                )
        for name, field in known.items():
            if field.default is MISSING and name not in table:
                raise ArgumentError(f"{cls.kind} needs the parameter '{name}'")
        return cls(**table)

    def to_table(self) -> dict[str, Any]:
        """The object of the model file: ``kind`` and every parameter."""
        left_out = self._left_out()
        values = {name: value for name, value in asdict(self).items() if name not in left_out}
        return {"kind": self.kind, **values}

    def mirrored(self) -> Self:
        """The term with angles, velocity and direction counted the other way.

        ::

            ε'(φ, v, d, ...) = -ε(-φ, -v, -d, ...)

        Torque, current, temperature and the angles of other joints are as they were.
        """
        values = {name: getattr(self, name) for name in self.odd}
        changed: Any = {
            name: tuple(-x for x in value) if isinstance(value, tuple) else -value
            for name, value in values.items()
        }
        return replace(self, **changed)

    def forms(self) -> tuple[Form, ...]:
        """The forms of the compiled core that add up to this term."""
        raise NotImplementedError

    @property
    def lines(self) -> Lines:
        """``(order, cosine, sine)`` of its lines."""
        columns = (getattr(self, name, ()) for name in ("orders", "cosine", "sine"))
        return tuple(zip(*columns, strict=True))

    def _out_of_range(self, name: str, wanted: str) -> ArgumentError:
        return ArgumentError(f"{self.kind}: {name} must be {wanted}, got {getattr(self, name)!r}")

    def _checked(self, name: str, wanted: str, value: Any) -> Any:
        if wanted == "str" or (value is None and wanted.endswith("None")):
            return value
        if wanted.startswith("tuple"):
            is_one = getattr(value, "ndim", 1) == 0  # an array of no dimension has no items
            if is_one or not isinstance(value, Iterable) or isinstance(value, str):
                raise ArgumentError(f"{self.kind}: {name} must be a list of numbers, got {value!r}")
            return tuple(self._number(f"{name}[{i}]", x) for i, x in enumerate(value))
        return self._number(name, value)

    def _number(self, name: str, value: Any) -> float:
        try:
            number = math.nan if isinstance(value, bool | str) else float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise ArgumentError(f"{self.kind}: {name} must be a finite number, got {value!r}")
        return number

    def _check_lines(self) -> None:
        orders, cosine, sine = (getattr(self, name) for name in ("orders", "cosine", "sine"))
        if not len(orders) == len(cosine) == len(sine):
            raise ArgumentError(
                f"{self.kind}: orders, cosine and sine must be equally long, got "
                f"{len(orders)}, {len(cosine)} and {len(sine)}"
            )
        if any(order <= 0.0 for order in orders):
            raise self._out_of_range("orders", "positive")


def line_values(lines: Sequence[Sequence[float]], period: float) -> dict[str, tuple[float, ...]]:
    """``orders, cosine, sine`` of lines ``C sin(mθ + φ)``.

    ``lines`` are ``[output order, C in arcsec, phase in degrees]``.
    """
    return {
        "orders": tuple(float(order) for order, _, _ in lines),
        "cosine": tuple(
            from_arcsec(c, period) * math.sin(math.radians(phase)) for _, c, phase in lines
        ),
        "sine": tuple(
            from_arcsec(c, period) * math.cos(math.radians(phase)) for _, c, phase in lines
        ),
    }
