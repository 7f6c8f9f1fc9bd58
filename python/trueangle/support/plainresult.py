"""Results that show themselves, and results as plain values and as JSON text."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping
from typing import Any, TypeAlias

#: Fields of a row that are angles, in the unit of a period; they are written in arcsec.
Angle: TypeAlias = float
#: NaN in place of one that is not known.
AngleOrNaN: TypeAlias = float

#: Characters of a result's ``repr`` at most: one line of a screen.
WIDTH = 100

#: Characters of a text that a ``repr`` shows by itself.
_SHORT = 30


class ShownResult:
    """A result that shows itself: one line as ``repr``, its summary as text and in notebooks.

    A class defines its line by ``_brief``, the two or three numbers that matter, and has a
    ``summary``; without them its plain fields are shown.
    """

    __slots__ = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # `dataclass` leaves alone what a class defines itself.
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = ShownResult.__repr__  # type: ignore[method-assign]

    def _brief(self) -> str:
        """What is in the brackets of the line."""
        return ", ".join(self._plain_fields())

    def _plain_fields(self) -> Iterator[str]:
        known: dict[str, Any] = getattr(self, "__dataclass_fields__", {})
        for field in known.values():
            value = getattr(self, field.name)
            if not field.repr:
                continue
            if isinstance(value, float):
                yield f"{field.name}={value:.4g}"
            elif isinstance(value, int) or (isinstance(value, str) and 0 < len(value) < _SHORT):
                yield f"{field.name}={value!r}"

    def __repr__(self) -> str:
        name, brief = type(self).__name__, " ".join(self._brief().split())
        left = WIDTH - len(name) - 2
        return f"{name}({brief if len(brief) <= left else brief[: left - 3] + '...'})"

    def __str__(self) -> str:
        summary = getattr(self, "summary", None)
        return repr(self) if summary is None else str(summary())

    def _repr_html_(self) -> str:
        from .notebook import notebook_html

        return notebook_html(self)


class PlainResult(ShownResult):
    """A result whose ``to_dict`` holds plain values: strings, numbers, lists and mappings."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """The result as plain values; what is not a finite number is None."""
        raise NotImplementedError

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json_text(self.to_dict(), indent=2)


def finite_or_none(value: float) -> float | None:
    """A number that JSON can hold, else None."""
    return float(value) if math.isfinite(value) else None


def plain_fields(result: Any, keys: str) -> dict[str, Any]:
    """Attributes of a result as plain values, in the order of ``keys``: ``"NAME KEY=NAME ..."``."""
    named = [key.partition("=") for key in keys.split()]
    return {key: plain_value(getattr(result, name or key)) for key, _, name in named}


def plain_value(value: Any) -> Any:
    """Plain values that JSON can hold: results by ``to_dict``, rows as objects, numbers as keys.

    What is not a finite number is None.
    """
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {k if isinstance(k, str) else f"{k:g}": plain_value(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_value(one) for one in value]
    return finite_or_none(value) if isinstance(value, float) else value


def plain_row(row: Any, scale: float) -> dict[str, Any]:
    """The fields of a row as plain values; angles (`Angle`) times ``scale``, ``NAME_arcsec``."""
    found: dict[str, Any] = {}
    for name, kind in declared_fields(type(row)).items():
        value = getattr(row, name)
        if kind.startswith("Angle"):
            name, value = f"{name}_arcsec", None if value is None else scale * value
        elif kind.startswith("tuple"):
            value = [plain_row(one, scale) for one in value]
        found[name] = finite_or_none(value) if isinstance(value, float) else value
    return found


def declared_fields(kind: type) -> dict[str, str]:
    """Names and declarations of the fields of a row's class, which may be a named tuple."""
    declared = kind.__annotations__.items()
    return {name: str(getattr(of, "__forward_arg__", of)) for name, of in declared}


def json_text(value: Any, indent: int | None = None) -> str:
    """Plain values as JSON text; a number that is not finite, which JSON has no word for, is null.

    Examples
    --------
    >>> json_text({"factor": math.inf, "orders": (1, 2.5)})
    '{"factor": null, "orders": [1, 2.5]}'
    """
    return _dumps(plain_value(value), indent=indent, allow_nan=False)


def _dumps(value: Any, **how: Any) -> str:
    import json  # a help needs none of it

    return json.dumps(value, **how)


def result_picture(result: object, *args: Any, **options: Any) -> Any:
    """The picture of a result, by `trueangle.plots`; needs ``trueangle[plot]``.

    What computes does not import what draws: the package's face finds it when it is called.
    """
    face = sys.modules[__name__.partition(".")[0]]
    return face.plots.drawn(result, *args, **options)


def pretty_json(value: Any, indent: int = 0) -> str:
    """JSON with one line per key and per list of plain numbers."""
    pad = "  " * (indent + 1)
    end = "\n" + "  " * indent
    if isinstance(value, Mapping) and value:
        items = [f"{pad}{_dumps(key)}: {pretty_json(v, indent + 1)}" for key, v in value.items()]
        return "{\n" + ",\n".join(items) + end + "}"
    nested = isinstance(value, (list, tuple)) and any(isinstance(v, (Mapping, list)) for v in value)
    if nested:
        return "[\n" + ",\n".join(pad + pretty_json(v, indent + 1) for v in value) + end + "]"
    return _dumps(value, allow_nan=False)
