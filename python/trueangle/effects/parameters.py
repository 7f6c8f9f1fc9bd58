"""Parameters of effects from the tables of simulation files, each one checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean


class TabledParameters:
    """A table of a simulation file: a dataclass whose fields are its parameters."""

    kind: ClassVar[str]

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
                    f"effect '{cls.kind}' has no parameter '{name}'; it has "
                    f"{', '.join(known) or 'none'}{did_you_mean(name, known)}"
                )
        values: dict[str, Any] = {}
        for name, field in known.items():
            if name in table:
                values[name] = _checked(cls.kind, name, table[name], str(field.type))
            elif field.default is MISSING and field.default_factory is MISSING:
                raise ArgumentError(f"effect '{cls.kind}' needs the parameter '{name}'")
        return cls(**values)

    def to_table(self) -> dict[str, Any]:
        """The table `from_table` reads, ``kind`` first, defaults omitted."""
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
    """Tuples as lists, as files have them."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value
