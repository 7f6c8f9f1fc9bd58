"""Files of text, the one door to their bytes: plain, packed by gzip or zstd, a sheet of Excel."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

from ..errors import (
    FileError,
    MessageLinesWarning,
    MissingExtraError,
    OtherSheetsWarning,
    level_of_caller,
)
from .budget import FileExtent
from .damage import damage_told

#: First bytes of packed files, what packs them and what unpacks them.
_PACKED = {b"\x1f\x8b": ("gzip", "gunzip"), b"\x28\xb5\x2f\xfd": ("zstd", "unzstd")}
#: First bytes of an Excel file: an archive that begins with a part of a workbook.
_EXCEL = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"customXml/")
#: Where an archive names its first part.
_NAME = 30
#: Bytes of a text from which its length of lines is estimated; more of a packed one, read in parts.
_HEAD, _HEAD_PACKED = 1 << 16, 1 << 22


class TextFile(io.BufferedReader):
    """The bytes of a text, however they are stored.

    Attributes
    ----------
    size : int
        Bytes of the file, those of the text where it is a sheet.
    unpack : str
        The program that unpacks the file; empty where it is not packed.
    other_sheets : tuple of str
        Sheets of the file that are not read.
    """

    def __init__(
        self, raw: Any, stored: Any, size: int, unpack: str = "", other_sheets: tuple[str, ...] = ()
    ) -> None:
        super().__init__(raw, 1 << 16)
        self._stored = stored
        self.size = size
        self.unpack = unpack
        self.other_sheets = other_sheets

    @property
    def part(self) -> float:
        """The part of the file that has been read, 0 to 1."""
        if self.closed:  # at its end
            return 1.0
        place = self._stored.tell() if self.unpack else self.tell()
        return place / self.size if self.size else 1.0

    def close(self) -> None:
        """Close the file that the text is stored in as well."""
        super().close()
        self._stored.close()

    def warn_of_sheets(self, path: Path) -> None:
        """Report the sheets that are not read."""
        if self.other_sheets:
            warnings.warn(
                f"{path}: only the first sheet that holds cells is read, not "
                f"{', '.join(map(repr, self.other_sheets))}; save another sheet as CSV to read it",
                OtherSheetsWarning,
                stacklevel=level_of_caller(),
            )


class _Unpacked(io.RawIOBase):
    """What a packed file holds; damage is reported with the file's name."""

    def __init__(self, path: Path, kind: str, stream: IO[bytes]) -> None:
        self._path, self._kind, self._stream = path, kind, stream

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def readinto(self, room: Any) -> int:
        with damage_told(self._path, f"a {self._kind} file", "; copy it again"):
            data = self._stream.read(len(room))
            room[: len(data)] = data
            return len(data)

    def seek(self, place: int, whence: int = 0) -> int:
        return self._stream.seek(place, whence)


def open_text(path: Path) -> TextFile:
    """The bytes of a text, at their beginning.

    Raises
    ------
    FileError
        An Excel file that is damaged or too large.
    MissingExtraError
        What unpacks the file is not installed.
    """
    stored = path.open("rb", buffering=0)
    try:
        head = stored.read(_NAME + max(map(len, _EXCEL)))
        stored.seek(0)
        size = os.fstat(stored.fileno()).st_size
        for magic, (kind, unpack) in _PACKED.items():
            if head.startswith(magic):
                stream = _opener(kind)(stored, "rb")
                return TextFile(_Unpacked(path, kind, stream), stored, size, unpack)
        if head.startswith(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"):
            raise FileError(path, "is an Excel file of 1997 to 2003; save it as .xlsx or as CSV")
        is_archive = head.startswith(b"PK\x03\x04")
        named = path.suffix.lower() in (".xlsx", ".xlsm")
        if is_archive and (named or head[_NAME:].startswith(_EXCEL)):
            from .excel import sheet_text

            stored.close()
            text, others = sheet_text(path)
            sheet = io.BytesIO(text)
            return TextFile(sheet, sheet, len(text), other_sheets=others)
        return TextFile(stored, stored, size)
    except BaseException:
        stored.close()
        raise


def create_text(path: Path) -> Any:
    """A new file for the bytes of a text, packed according to its ending.

    Raises
    ------
    FileError
        The ending of an Excel file: none is written.
    MissingExtraError
        What packs the file is not installed.
    """
    ending = path.suffix.lower()
    if ending in (".xlsx", ".xlsm"):
        raise FileError(path.name, "no Excel file is written; name a CSV file with -o")
    if ending == ".gz":
        import gzip

        # As gzip does; the same log gives the same bytes.
        return gzip.GzipFile(path, "wb", 6, mtime=0)
    if ending == ".zst":
        return _opener("zstd")(path, "wb")
    return path.open("wb")


def head_of_text(path: Path, size: int) -> bytes:
    """The first bytes of a file, unpacked.

    Raises
    ------
    FileError
        A packed file that holds no text.
    """
    with open_text(path) as file:
        head = file.read(size)
        if file.unpack and b"\0" in head:
            problem = f"only text is read packed; unpack it: {file.unpack} {path}"
            raise FileError(path, problem)
        return head


def text_extent(path: Path) -> FileExtent:
    """Rows of a text, estimated from its first lines; numbers are counted while it is read."""
    with open_text(path) as file:
        head = file.read(_HEAD_PACKED if file.unpack else _HEAD)
        return FileExtent(int((head.count(b"\n") + 1) / file.part), 0)


def _opener(kind: str) -> Callable[..., Any]:
    if kind == "gzip":
        import gzip

        return gzip.open
    try:
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
    except ModuleNotFoundError as cause:
        raise MissingExtraError(
            f"zstd files need {cause.name}: pip install 'trueangle[zstd]'"
        ) from None
    return zstd.open


def warn_of_messages(path: Path, messages: Sequence[tuple[int, str]]) -> None:
    """Warn how many lines hold no readings, and show the first, with its number and words."""
    if messages:
        line, text = min(messages)
        one = len(messages) == 1
        warnings.warn(
            f"{path}: {len(messages)} line{'' if one else 's'} of words without readings "
            f"{'is' if one else 'are'} omitted, the first at line {line}: {text[:60]!r}",
            MessageLinesWarning,
            stacklevel=9,
        )
