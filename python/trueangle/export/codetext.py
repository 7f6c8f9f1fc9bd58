"""Text of programs: parts from the files in `code/`, filled in; numbers as literals and in rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parent / "code"

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


def filled(text: str, **values: object) -> str:
    r"""``text`` with values in the places of ``@name@``, one after the other.

    What stands alone in a line has that line's indentation in every line of it, and takes the
    line with it where it is empty.

    Examples
    --------
    >>> print(filled("{\n    @body@\n    @more@\n    return @x@;\n}", body="1;\n2;", more="", x=3))
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


def rows(values: Sequence[str], width: int = 8, lead: str = "    ") -> str:
    """Numbers in lines, separated by commas."""
    return ",\n".join(lead + ", ".join(values[i : i + width]) for i in range(0, len(values), width))
