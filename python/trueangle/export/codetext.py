"""Text of programs: parts of files in `code/`, filled in; lists of numbers, written and read."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from ..support.arrays import Array
from .reading import table_error

_FOLDER = Path(__file__).parent / "code"

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

#: The line before a part, with its name: a comment in C and in Rust.
_HEADING = re.compile(r"^//@ (.+)\n", re.MULTILINE)


@cache
def code_file(name: str) -> str:
    """The text of a file in `code/`."""
    return (_FOLDER / name).read_text("utf-8")


@cache
def code_parts(name: str) -> dict[str, str]:
    """Parts of a file in `code/` by the names in the lines before them."""
    _, *found = _HEADING.split(code_file(name))
    return {
        part: text.strip("\n") + "\n" for part, text in zip(found[::2], found[1::2], strict=True)
    }


def filled_code(text: str, **values: object) -> str:
    r"""``text`` with values in the places of ``@name@``, one after the other.

    All lines of a value that is alone in a line get that line's indentation; an empty one removes
    the line.

    Examples
    --------
    >>> text = "{\n    @body@\n    @more@\n    return @x@;\n}"
    >>> print(filled_code(text, body="1;\n2;", more="", x=3))
    {
        1;
        2;
        return 3;
    }
    """
    for name, value in values.items():
        place, told = f"@{name}@", str(value)

        def alone(found: re.Match[str], told: str = told) -> str:
            lines = told.removesuffix("\n").split("\n")
            return "".join(f"{found[1]}{line}".rstrip(" ") + "\n" for line in lines) if told else ""

        text = re.sub(rf"^( *){place}\n", alone, text, flags=re.MULTILINE)
        text = text.replace(place, told)
    return text


def float_literal(value: float, digits: int = 9) -> str:
    """A number with a point or an exponent, as C and Rust want it of a float.

    Examples
    --------
    >>> float_literal(2.0), float_literal(1e-9), float_literal(1 / 3, 17)
    ('2.0', '1e-09', '0.33333333333333331')
    """
    text = f"{value:.{digits}g}"
    return text if any(c in text for c in ".en") else text + ".0"


def number_rows(values: Sequence[str], width: int = 8, lead: str = "    ") -> str:
    """Numbers in lines, separated by commas."""
    return ",\n".join(lead + ", ".join(values[i : i + width]) for i in range(0, len(values), width))


def longest_array(text: str, path: str, name: str) -> tuple[Array, int, int]:
    """Numbers of the longest brace list of a C source, the line it begins in, their decimals.

    Raises
    ------
    FileError
        There is none, or something in it is not a number.
    """
    plain = re.sub(r"//[^\n]*|/\*.*?\*/", lambda m: "\n" * m[0].count("\n"), text, flags=re.S)
    found = max(re.finditer(r"\{([^{}]*)\}", plain), key=lambda m: len(m[1]), default=None)
    if found is None:
        raise table_error(path, f"holds no array in braces: the table of {name} is wanted")
    line = plain.count("\n", 0, found.start()) + 1
    numbers, decimals, at = [], 0, line
    for cell in re.split(r"(,)", found[1]):
        word = cell.strip().rstrip("fFuUlL")
        if cell != "," and word:
            if not _NUMBER.fullmatch(word) or not math.isfinite(float(word)):
                at += cell.count("\n", 0, len(cell) - len(cell.lstrip()))
                raise table_error(path, f"{word[:30]!r} is not a number of a table", at)
            numbers.append(float(word))
            decimals = max(decimals, len(re.split(r"[eE]", word)[0].partition(".")[2]))
        at += cell.count("\n")
    if len(numbers) < 4:
        raise table_error(path, f"a table of {len(numbers)} numbers is none of {name}", line)
    return np.array(numbers), line, decimals
