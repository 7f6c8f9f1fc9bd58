"""The first lines of a text file, decoded: what stands before the readings is among them."""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import IO, NamedTuple

from ..errors import FileError

#: Bytes and lines within which the readings must begin.
_HEAD = 1 << 18
_LINES = 1000
#: Bytes of a line, at most: memory follows the longest.
LONGEST_LINE = 1 << 24


class TextLine(NamedTuple):
    """A line as it is in the file, and as text without its end."""

    raw: bytes
    text: str
    #: Number of the line, from 1.
    place: int


def first_lines(path: Path, file: IO[bytes]) -> tuple[list[TextLine], str]:
    """The first lines of a file and their encoding, UTF-8 or Western Europe's code page.

    Raises
    ------
    FileError
        Another encoding; names the line.
    """
    found: list[TextLine] = []
    encoding = "utf-8"
    data = file.read(_HEAD)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise FileError(path, "is UTF-16 text; save it as CSV in UTF-8", line=1)
    parts = data.splitlines(keepends=True) if b"\n" not in data else _split(data)
    if len(data) == _HEAD:
        while len(parts) == 1 and not parts[0].endswith(b"\n"):
            more = file.readline(LONGEST_LINE)
            parts[0] += more
            if not more or len(parts[0]) > LONGEST_LINE:
                break
        parts = parts[:-1] if len(parts) > 1 else parts
    for i, raw in enumerate(parts[:_LINES]):
        body = raw.removeprefix(codecs.BOM_UTF8) if i == 0 else raw
        try:
            text = body.decode(encoding)
        except UnicodeDecodeError:
            if encoding != "utf-8" or not _is_western(data):
                raise FileError(
                    path, "is not UTF-8 text; save it as CSV in UTF-8", line=i + 1
                ) from None
            encoding = "cp1252"
            text = body.decode("cp1252", "replace")
        found.append(TextLine(raw, text.rstrip("\r\n"), i + 1))
    return found, encoding


def _split(data: bytes) -> list[bytes]:
    parts = data.split(b"\n")
    return [*(part + b"\n" for part in parts[:-1]), *([parts[-1]] if parts[-1] else [])]


def _is_western(data: bytes) -> bool:
    """True where every byte beyond ASCII is a letter or sign of Western Europe's code page.

    Then it is °, µ, ± or a letter with an accent, in a preamble or a unit.
    """
    return all(byte < 0x80 or byte >= 0xA0 for byte in data) and data.count(b"\xff") == 0
