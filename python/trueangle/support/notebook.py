"""A result as a notebook shows it: its summary with tables, and one small picture.

The words, numbers and digits are those of the summary, so that a result reads the same wherever
it is shown.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from html import escape
from itertools import groupby, pairwise
from typing import Final

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
