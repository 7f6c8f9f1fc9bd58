"""Parameters of effects from the tables of simulation files, each one checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean

if TYPE_CHECKING:
    from .effect import Effect


def checked_parameters(effect: type[Effect], table: Mapping[str, Any]) -> dict[str, Any]:
    """Values for the fields of ``effect`` from a table without its ``kind``.

    Raises
    ------
    ArgumentError
        A parameter that is unknown, missing or of the wrong kind.
    """
    known = {field.name: field for field in fields(effect)}  # type: ignore[arg-type]
    for name in table:
        if name not in known:
            raise ArgumentError(
                f"effect '{effect.kind}' has no parameter '{name}'{did_you_mean(name, known)}; "
                f"it has {', '.join(known) or 'none'}"
            )
    values: dict[str, Any] = {}
    for name, field in known.items():
        if name in table:
            values[name] = _checked(effect.kind, name, table[name], str(field.type))
        elif field.default is MISSING and field.default_factory is MISSING:
            raise ArgumentError(f"effect '{effect.kind}' needs the parameter '{name}'")
    return values


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


def plain_parameters(value: Any) -> Any:
    """Tuples as lists, as files have them."""
    if isinstance(value, tuple):
        return [plain_parameters(item) for item in value]
    return value
