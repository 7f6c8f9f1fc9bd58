"""Text of programs: parts of files in `code/`, filled in; lists of numbers, written and read."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from ..errors import ArgumentError, FileError
from ..runs.rawchannels import Channels
from ..support.arrays import Array

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
        raise FileError(path, f"holds no array in braces: the table of {name} is wanted")
    line = plain.count("\n", 0, found.start()) + 1
    numbers, decimals, at = [], 0, line
    for cell in re.split(r"(,)", found[1]):
        word = cell.strip().rstrip("fFuUlL")
        if cell != "," and word:
            if not _NUMBER.fullmatch(word) or not math.isfinite(float(word)):
                at += cell.count("\n", 0, len(cell) - len(cell.lstrip()))
                raise FileError(path, f"{word[:30]!r} is not a number of a table", line=at)
            numbers.append(float(word))
            decimals = max(decimals, len(re.split(r"[eE]", word)[0].partition(".")[2]))
        at += cell.count("\n")
    if len(numbers) < 4:
        raise FileError(path, f"a table of {len(numbers)} numbers is none of {name}", line=line)
    return np.array(numbers), line, decimals


#: Periods that harmonics may move the choice of one, which is wrong from 0.5 on.
_MOST: Final = 0.25


def decoding(
    channels: Channels, parts: Mapping[str, str], turn: float, named: Callable[[str], str]
) -> str:
    """The functions, from ``decode`` and ``tracks`` of ``parts``; a turn is ``turn``.

    ``named`` makes the name of each: of the one that takes all readings from "decode". Of two
    tracks ``lift`` makes the sum that is rounded positive, by a multiple of the first periods.
    """
    if channels.second is None:
        return _of_one(channels, parts["decode"], turn, named("decode"))
    first, second = channels, channels.second
    p, q = first.periods_per_turn, second.periods_per_turn
    names = {"one": named("first_decode"), "two": named("second_decode")}
    tracks = filled_code(
        parts["tracks"],
        decode=named("decode"),
        **names,
        product=p * q,
        lift=p * (3 + q // p) * 2**32 + 2**31 - round(p * first.second_zero_deg / 360.0 * 2**32),
        first=p,
        half=p // 2,
        inverse=pow(q, -1, p),
    )
    each = zip((first, second), names.values(), strict=True)
    return "\n".join([*(_of_one(track, parts["decode"], turn, n) for track, n in each), tracks])


def _of_one(channels: Channels, part: str, turn: float, name: str) -> str:
    *numbers, factor = channels.constants
    names = ("offset_cosine", "offset_sine", "per_cosine", "per_sine", "slope")
    values = dict(zip(names, numbers, strict=True), factor=factor / channels.period * turn)
    return filled_code(part, decode=name, **{n: float_literal(v, 17) for n, v in values.items()})


def check_choice(channels: Channels) -> None:
    """Check that a program, which decodes tracks without their harmonics, chooses their period.

    Raises
    ------
    ArgumentError
        Harmonics that take half of the margin and more.
    """
    if channels.second is None:
        return
    first, second = (float(np.abs(t.error_series()).sum()) for t in (channels, channels.second))
    p, q = channels.periods_per_turn, channels.second.periods_per_turn
    moved = (q * first + p * second) / (2.0 * math.pi)
    if moved > _MOST:
        raise ArgumentError(
            f"the harmonics of the two tracks shift the choice of a period by up to {moved:.2g} "
            f"periods; programs allow {_MOST:g}; calibrate the "
            f"first track alone, `periods_per_turn={p}`"
        )
