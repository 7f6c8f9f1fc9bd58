"""What files hold, as lines to be compared: every name, and numbers to six digits."""

from __future__ import annotations

import csv
import io
import json
import re
import textwrap
from collections.abc import Iterator
from html.parser import HTMLParser
from itertools import groupby
from typing import Any

import numpy as np

from pdftext import pdf_text

#: Digits of a number in the view of a file; and below it nothing but rounding is told.
DIGITS = 6
NOTHING = 1e-9

#: So many numbers in a row are shown one by one.
FEW = 12


def file_lines(text: str, ending: str) -> list[str]:
    """The view of a file's text by its ending."""
    if ending == ".json":
        return list(_json_lines("", json.loads(text)))
    if ending in (".csv", ".txt") and "," in text:
        return _table_lines(text)
    if ending == ".html":
        return _page_lines(text)
    return list(_squeezed(text.splitlines()))


#: Neighbouring lines that differ in their numbers alone are shown as one from so many on.
ALIKE = 5
_FIGURE = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def _squeezed(lines: list[str]) -> Iterator[str]:
    """Lines, and of a table its form and a line for each of its columns, or for all of a row."""
    for form, group in groupby(lines, lambda line: re.sub("#(, #)+,?", "#, #", _form(line))):
        rows = list(group)
        cells = [[float(x) for x in _FIGURE.findall(row)] for row in rows]
        if len(rows) < ALIKE or not cells[0]:
            yield from rows
            continue
        yield f"{len(rows)} lines: {form.strip()}"
        is_list = "#, #" in form or len(cells[0]) > 4
        columns = [[x for row in cells for x in row]] if is_list else zip(*cells, strict=True)
        yield from (f"  {numbers_line(column)}" for column in columns)


def _form(line: str) -> str:
    return _FIGURE.sub("#", line)


def pdf_lines(data: bytes) -> list[str]:
    """The text of a PDF: sentences as they flow, cells of tables side by side."""
    found = [""]
    for piece in pdf_text(data).splitlines():
        if found[-1].endswith(" ") or piece[:1] in (" ", ",", ".", ""):
            found[-1] += piece
        elif max(len(piece), len(found[-1].rpartition(" | ")[2])) < 28 and len(found[-1]) < 80:
            found[-1] += f" | {piece}"
        else:
            found.append(piece)
    return [line for text in found for line in textwrap.wrap(text.removeprefix(" | "), 96)]


def shown(value: Any, digits: int = DIGITS) -> str:
    """A number to so many digits, anything else as JSON has it."""
    if isinstance(value, float):
        if abs(value) < NOTHING:
            return "0"
        return f"{value:.{digits}g}"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def numbers_line(values: Any, digits: int = DIGITS) -> str:
    """Many numbers as how many they are, their ends, mean, spread and what their order makes."""
    values = np.asarray(values, dtype=float)
    whole = values[np.isfinite(values)]
    if not whole.size:
        return f"{values.size} numbers, none finite"
    place = np.linspace(-1.0, 1.0, values.size)[np.isfinite(values)]
    told = {
        "first": values[0], "last": values[-1], "least": whole.min(), "most": whole.max(),
        "mean": whole.mean(), "rms": np.sqrt(np.mean(whole**2)), "slope": np.mean(place * whole),
    }  # fmt: skip
    missing = f" ({values.size - whole.size} missing)" if whole.size < values.size else ""
    return f"{values.size} numbers{missing}: " + ", ".join(
        f"{name} {shown(float(value), digits)}" for name, value in told.items()
    )


def few_numbers(values: Any, digits: int = DIGITS) -> str:
    """Numbers one by one while they are few."""
    if len(values) > FEW // 2:
        return numbers_line(values, digits)
    return ", ".join(shown(float(value), digits) for value in values)


def _plain(value: Any) -> str | None:
    """What stands on one line: a value, or a list of values."""
    if isinstance(value, dict):
        return None
    if not isinstance(value, list):
        return shown(value)
    if len(value) > FEW and all(isinstance(v, int | float) or v is None for v in value):
        return numbers_line([np.nan if v is None else v for v in value])
    if any(isinstance(v, dict | list) for v in value):
        return None
    return "[" + ", ".join(map(shown, value)) + "]"


def _json_lines(path: str, value: Any) -> Iterator[str]:
    """One line for every object, with its path."""
    if isinstance(value, dict):
        told = {name: _plain(entry) for name, entry in value.items()}
        line = ", ".join(f"{name} {text}" for name, text in told.items() if text is not None)
        if line or not value:
            yield f"{path}: {line}"
        for name, text in told.items():
            if text is None:
                yield from _json_lines(f"{path}.{name}", value[name])
    elif (text := _plain(value)) is not None:
        yield f"{path}: {text}"
    else:
        for k, entry in enumerate(value):
            yield from _json_lines(f"{path}[{k}]", entry)


def _numbers(cells: list[str]) -> list[float] | None:
    try:
        return [float(cell) if cell else np.nan for cell in cells]
    except ValueError:
        return None


def _table_lines(text: str) -> list[str]:
    """The lines above a table, and a line for each of its columns."""
    above = [line for line in text.splitlines() if line.startswith("#")]
    rows = list(csv.reader(line for line in io.StringIO(text) if not line.startswith("#")))
    lines = [*above, f"{len(rows) - 1} rows"]
    for name, *cells in zip(*rows, strict=False):
        numbers = _numbers(cells)
        if numbers is None or len(numbers) <= FEW:
            kinds = list(dict.fromkeys(cells))
            lines.append(f"{name}: " + ", ".join(kinds[:FEW]) + (" ..." * (len(kinds) > FEW)))
        else:
            lines.append(f"{name}: {numbers_line(numbers)}")
    return lines


class _Page(HTMLParser):
    """Words of a page, a line for each of its blocks; data of its scripts are left out."""

    INLINE = frozenset({"a", "abbr", "b", "code", "em", "i", "span", "strong", "sub", "sup", "td"})

    def __init__(self) -> None:
        super().__init__()
        self.words = ""
        self._silent = 0

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self._silent += tag in ("script", "style")
        self.words += " " if tag in self.INLINE else "\n"
        told = [text for name, text in attrs if name in ("alt", "aria-label", "title")]
        self.words += "".join(f"({text}) " for text in told)

    def handle_endtag(self, tag: str) -> None:
        self._silent -= tag in ("script", "style")
        self.words += " " if tag in self.INLINE else "\n"

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.words += re.sub(r"\s+", " ", data)


def _page_lines(text: str) -> list[str]:
    page = _Page()
    page.feed(text)
    lines = (re.sub(r" +", " ", line).strip() for line in page.words.splitlines())
    return [line for line in lines if line]


#: Attributes that say something a reader sees, and classes that do.
_TELLING = ("class", "colspan", "data-run", "href", "open", "rowspan", "srcdoc", "style")
_CLASSES = frozenset(
    {"doubtful", "gain", "kept", "no-gain", "no-model", "no-print", "on-paper", "unchecked"}
)


class _Markup(HTMLParser):
    """Tags whose attributes mark, colour, join or open something, with what they say."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        told = []
        for name, text in attrs:
            if name == "class":
                text = " ".join(word for word in text.split() if word in _CLASSES)
            elif name == "srcdoc":
                text = " | ".join(_page_lines(text)[2:4])
            if name in _TELLING and (text or name == "open"):
                told.append(f"{name} {text or ''}".rstrip())
        if told:
            self.lines.append(f"{tag} {', '.join(told)}")


def markup_lines(text: str) -> list[str]:
    """What the tags of a page say beside its words; the same line once, with how often."""
    page = _Markup()
    page.feed(text)
    found = [(line, len(list(group))) for line, group in groupby(page.lines)]
    return [line if count == 1 else f"{line} ({count} times)" for line, count in found]
