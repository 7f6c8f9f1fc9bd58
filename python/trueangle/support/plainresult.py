"""Results that show themselves, and results as plain values and as JSON text."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import groupby, pairwise
from typing import Any, Final, TypeAlias

from .layout import unfolded_text

#: Blanks that separate the cells of a line.
_APART: Final = re.compile(r" {2,}")
_WORD: Final = re.compile(r"\S+")

#: Cells of a line from which it belongs to a table; two are a name and what it is.
_CELLS: Final = 3


_NUMBER: Final = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?|[-\N{EN DASH}]")


def notebook_html(result: object) -> str:
    """The summary of a result with its tables as tables, and its picture where it has one.

    Examples
    --------
    >>> class Result:
    ...     def __str__(self):
    ...         return "noise   3 arcsec"
    >>> print(notebook_html(Result()))
    <div class="trueangle"><table><tr><th style="text-align:left">noise</th>\
<td style="text-align:left">3 arcsec</td></tr></table></div>
    """
    with unfolded_text():
        lines = str(result).splitlines()
    parts = []
    for cells, group in groupby(zip(_counts(lines), lines, strict=True), key=lambda row: row[0]):
        rows = [line for _, line in group]
        if cells == _CELLS:
            parts.append(f"<table>{_table(rows)}</table>")
        elif cells == _CELLS - 1:
            named = [_APART.split(line.strip(), maxsplit=1) for line in rows]
            parts.append(f"<table>{_rows(named, heads=1)}</table>")
        else:
            parts += [_line(line) for line in rows]
    return f'<div class="trueangle">{"".join(parts)}{_picture(result)}</div>'


def _counts(lines: Sequence[str]) -> list[int]:
    """Cells of every line, `_CELLS` for more; a line within a table belongs to it."""
    found = [min(len(_APART.split(line.strip())), _CELLS) for line in lines]
    for i in range(1, len(found) - 1):
        if found[i - 1] == found[i + 1] == _CELLS and lines[i].strip():
            found[i] = _CELLS
    return found


def _line(line: str) -> str:
    """A line of words with its indentation; a blank line becomes empty space."""
    indent = len(line) - len(line.lstrip())
    # Indentation, in em, for each blank at the beginning of a line.
    style = f' style="padding-left:{0.5 * indent:g}em"' if indent else ""
    return f"<div{style}>{escape(line.strip()) or '&nbsp;'}</div>"


def _table(lines: Sequence[str]) -> str:
    """Lines of columns: those before the first number are its head."""
    first = next((n for n, line in enumerate(lines) if _has_numbers(line)), 0)
    data = [line.rstrip() for line in lines[first:]]
    spans = _spans(data)
    rows = [[line[a:b].strip() for a, b in spans] for line in data]
    return _rows([_head(line, spans, data) for line in lines[:first]], heads=len(spans)) + _rows(
        rows
    )


def _has_numbers(line: str) -> bool:
    """Whether most words of a line are numbers: then it is no head of a table."""
    words = line.split()
    return 2 * sum(_NUMBER.fullmatch(word) is not None for word in words) >= len(words)


def _spans(lines: Sequence[str]) -> list[tuple[int, int]]:
    """Places of columns: what blanks in every line part; two of a line that is alone."""
    width = max(map(len, lines))
    used = [any(line[i : i + 1].strip() for line in lines) for i in range(width)]
    apart = 2 if len(lines) == 1 else 1
    starts = [i for i in range(width) if used[i] and not any(used[max(0, i - apart) : i])]
    ends = [max(i for i in range(a, b) if used[i]) + 1 for a, b in pairwise([*starts, width])]
    return list(zip(starts, ends, strict=True))


def _head(line: str, spans: Sequence[tuple[int, int]], data: Sequence[str]) -> list[str]:
    """Words of a head by the columns below them: they begin or end where these do."""
    starts = {a: i for i, (a, b) in enumerate(spans) if not _NUMBER.fullmatch(data[0][a:b].strip())}
    found = [""] * len(spans)
    last = len(spans) - 1
    for word in _WORD.finditer(line):
        below = next((i for i, (_, end) in enumerate(spans) if word.end() <= end), last)
        at = starts.get(word.start(), below)
        found[at] = f"{found[at]} {word[0]}".strip()
    return found


def _rows(rows: Sequence[Sequence[str]], heads: int = 0) -> str:
    """Rows of a table of their own; the first ``heads`` cells of each are header cells."""
    return "".join(
        "<tr>"
        + "".join(
            f'<{tag} style="text-align:{_side(cell)}">{escape(cell)}</{tag}>'
            for i, cell in enumerate(row)
            for tag in ("th" if i < heads else "td",)
        )
        + "</tr>"
        for row in rows
    )


def _side(cell: str) -> str:
    return "right" if _NUMBER.fullmatch(cell) else "left"


def _picture(result: object) -> str:
    """The picture of a result as an element of a page; nothing where it has none."""
    face = sys.modules[__name__.partition(".")[0]]
    return str(face.plots.thumbnail(result))


#: Fields of a row that are angles, in the unit of a period; they are written in arcsec.
Angle: TypeAlias = float
#: NaN in place of one that is not known.
AngleOrNaN: TypeAlias = float

#: Characters of a result's ``repr`` at most: one line of a screen.
WIDTH = 100


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
            # Characters of a text that a ``repr`` shows by itself.
            elif isinstance(value, int) or (isinstance(value, str) and 0 < len(value) < 30):
                yield f"{field.name}={value!r}"

    def __repr__(self) -> str:
        name, brief = type(self).__name__, " ".join(self._brief().split())
        left = WIDTH - len(name) - 2
        return f"{name}({brief if len(brief) <= left else brief[: left - 3] + '...'})"

    def __str__(self) -> str:
        summary = getattr(self, "summary", None)
        return repr(self) if summary is None else str(summary())

    def _repr_html_(self) -> str:

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
