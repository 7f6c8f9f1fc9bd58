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
        text = body.decode(errors="surrogateescape")
        if not _is_utf8(text):
            text = western_text(text)
            if not _is_utf8(text):
                raise FileError(path, "is not UTF-8 text; save it as CSV in UTF-8", line=i + 1)
            encoding = "cp1252"
        found.append(TextLine(raw, text.rstrip("\r\n"), i + 1))
    return found, encoding


def _split(data: bytes) -> list[bytes]:
    parts = data.split(b"\n")
    return [*(part + b"\n" for part in parts[:-1]), *([parts[-1]] if parts[-1] else [])]


def western_text(text: str) -> str:
    """Text whose bytes that are no UTF-8 stand in it as surrogates, of Western Europe's code page.

    It is that where every byte beyond ASCII is a letter or sign: °, µ, ± or a letter with an
    accent, in a preamble, a unit or a label. Other text stays as it is.
    """
    if _is_utf8(text):
        return text
    data = text.encode(errors="surrogateescape")
    is_western = all(byte < 0x80 or 0xA0 <= byte < 0xFF for byte in data)
    return data.decode("cp1252") if is_western else text


def _is_utf8(text: str) -> bool:
    return text.isascii() or not any("\udc80" <= sign <= "\udcff" for sign in text)
