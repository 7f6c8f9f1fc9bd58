"""What every effect is: named parameters, a signal, what it needs and hides behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError
from ...joint.pattern import Surroundings, line_columns, line_sum
from ...joint.signals import Signals

__all__ = ["Array", "Effect", "Surroundings", "line_columns", "line_sum"]

Array = NDArray[np.float64]


class Effect:
    """Base of the effects; each is a frozen dataclass whose fields are its parameters.

    Class attributes
    ----------------
    kind : str
        Its name in the vocabulary of causes.
    sentence : str
        The physics in one sentence.
    needs : tuple of str
        Columns without which it cannot be seen: "time", "temperature", "torque", "mount".
    factor : str
        What has to take several values for it to show, and whose labels are shuffled in
        the negative control: "direction", "velocity", "temperature", "torque", "mount",
        "angle", "run", "time", "none".
    confounded_with : mapping of str to str
        Causes it can be taken for, each with the measurement that tells them apart.
    measure : str
        What to measure where the data cannot show it at all.
    transfers : bool
        A model of it lowers the error of runs that were not used to fit it.
    correctable : bool
        A controller can correct it while the joint runs.
    """

    kind: ClassVar[str]
    sentence: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    factor: ClassVar[str] = "angle"
    confounded_with: ClassVar[Mapping[str, str]] = {}
    measure: ClassVar[str] = ""
    transfers: ClassVar[bool] = True
    correctable: ClassVar[bool] = True

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        """The effect's error at every reading, arcsec; random where its nature is random."""
        raise NotImplementedError

    def expected(self, signals: Signals, around: Surroundings) -> Array:
        """The part of `signal` that can be predicted: zeros for random effects."""
        if not self.transfers:
            return np.zeros(len(signals))
        return self.signal(signals, around, np.random.default_rng(0))

    def noise_factor(self, signals: Signals, around: Surroundings) -> Array | None:
        """Factor on the standard deviation of the noise, or None."""
        return None

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Self:
        """Effect from a table of the simulation file (without ``kind``).

        Raises
        ------
        ArgumentError
            A parameter that is unknown, missing or of the wrong kind.
        """
        known = {field.name: field for field in fields(cls)}  # type: ignore[arg-type]
        for name in table:
            if name not in known:
                raise ArgumentError(
                    f"effect '{cls.kind}' has no parameter '{name}'; "
                    f"it has {', '.join(known) or 'none'}"
                )
        values: dict[str, Any] = {}
        for name, field in known.items():
            if name in table:
                values[name] = _checked(cls.kind, name, table[name], str(field.type))
            elif field.default is MISSING and field.default_factory is MISSING:
                raise ArgumentError(f"effect '{cls.kind}' needs the parameter '{name}'")
        return cls(**values)

    def to_table(self) -> dict[str, Any]:
        """The table `from_table` reads, ``kind`` first, defaults left out."""
        table: dict[str, Any] = {"kind": self.kind}
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if field.default is MISSING or value != field.default:
                table[field.name] = _plain(value)
        return table


def _checked(kind: str, name: str, value: Any, wanted: str) -> Any:
    where = f"effect '{kind}', parameter '{name}'"
    if wanted.startswith("tuple"):
        if not isinstance(value, list | tuple):
            raise ArgumentError(f"{where} must be a list of numbers, got {value!r}")
        if wanted.startswith("tuple[tuple"):
            lines = tuple(
                tuple(_number(where, x) for x in line) if isinstance(line, list | tuple) else ()
                for line in value
            )
            if any(len(line) != 3 for line in lines):
                raise ArgumentError(
                    f"{where} must be a list of [order, amplitude, phase_deg], got {value!r}"
                )
            return lines
        return tuple(_number(where, x) for x in value)
    if wanted.startswith("str"):
        if not isinstance(value, str):
            raise ArgumentError(f"{where} must be a text, got {value!r}")
        return value
    number = _number(where, value)
    if wanted.startswith("int"):
        if number != int(number):
            raise ArgumentError(f"{where} must be a whole number, got {value!r}")
        return int(number)
    return number


def _number(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise ArgumentError(f"{where} must be a finite number, got {value!r}")
    return float(value)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value
