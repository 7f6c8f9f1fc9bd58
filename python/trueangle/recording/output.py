"""The file of what is recorded: whole rows at every moment, synced once a second."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import itertools
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

from ..errors import ArgumentError, FileError
from ..support.arrays import Array
from ..support.layout import counted

#: Bytes of a page: what a call of the system puts into one is there as a whole, or not at all.
_PAGE: Final = 4096


class WholeFile:
    """A file that is appended to by whole lines; made with its first one.

    Lines are kept until `flush`. A kill takes a call of the system apart where a page of the
    file ends, so each call stays within one and no line goes on in the next: the line before ends
    in blanks instead. What fails is taken back to the last whole line.

    Parameters
    ----------
    path : Path
    filled : bool
        Let lines end in blanks so; else they stay as they are, and a kill may cut the last.

    Attributes
    ----------
    lines : int
        Lines added.
    """

    def __init__(self, path: Path, filled: bool = True) -> None:
        self.path, self.lines = path, 0
        self._filled, self._longest = filled, 0
        self._file: BinaryIO | None = None
        self._waiting, self._synced = b"", time.monotonic()

    def add(self, lines: bytes, count: int) -> None:
        """Add whole lines; what has waited for a second is written."""
        self._waiting += lines
        self.lines += count
        # Seconds between two times that the disk has all.
        if time.monotonic() - self._synced >= 1.0:
            self.flush()

    def flush(self) -> None:
        """Write what waits, and wait for the disk.

        Raises
        ------
        OSError
            A full disk: the file ends with a whole line.
        """
        self._synced = time.monotonic()
        if not self._waiting:
            return
        if self._file is None:
            self._file = open(self.path, "ab", buffering=0)  # noqa: SIM115
        handle, (data, self._waiting) = self._file.fileno(), (self._waiting, b"")
        size = os.fstat(handle).st_size
        try:
            for piece in self._pieces(data, size):
                if os.write(handle, piece) < len(piece):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                size += len(piece)
            with contextlib.suppress(OSError):  # the null device, some network file systems
                os.fsync(handle)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(handle, size)
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def _pieces(self, data: bytes, size: int) -> Iterator[bytes]:
        """Whole lines, as many as the page of a file of this size takes."""
        start = 0
        self._longest = max(self._longest, 1 + max(map(len, data.split(b"\n"))))
        while start < len(data):
            room = _PAGE - size % _PAGE
            # One that is longer than what the page has left goes alone.
            end = data.rfind(b"\n", start, start + room) + 1 or data.index(b"\n", start) + 1
            piece, left, start = data[start:end], room - (end - start), end
            if self._filled and left > 0 and (start < len(data) or left < self._longest):
                piece = piece[:-1] + b" " * left + b"\n"
            size += len(piece)
            yield piece

    def close(self) -> None:
        """Write what waits, and close."""
        try:
            self.flush()
        finally:
            if self._file is not None:
                self._file.close()


class RunsFile:
    """Runs that are recorded into one CSV, and next to it the lines that were no rows.

    Parameters
    ----------
    path : Path
    label : str or None
        Of the run; without one the next number.
    append : bool
        A file that is there gets a further run; else it is refused.

    Raises
    ------
    FileError
        The file is there, or is none of this kind.
    ArgumentError
        It has a run of this label.
    """

    def __init__(self, path: Path, label: str | None, append: bool) -> None:
        is_device = path.exists() and not path.is_file()
        beside = path if is_device else path.with_name(path.name + ".rejected")
        self.rows, self.rejected = WholeFile(path), WholeFile(beside, filled=False)
        is_there = path.is_file() and path.stat().st_size > 0
        if is_there and not append:
            raise FileError(
                path, "is there already: name another file, or add a run to it (`append=True`)"
            )
        if beside.is_file() and not is_there:  # of an attempt without a row
            beside.unlink()
        self._header, labels = _continued(path) if is_there else ([], set[str]())
        if label in labels:
            raise ArgumentError(f"label: {path} has a run {label!r}; give another label")
        numbers = map(str, itertools.count(len(labels) + 1))
        self.label = label or next(number for number in numbers if number not in labels)

    def begin(self, names: Sequence[str]) -> None:
        """Set the columns: the label of the run, then those of the rows.

        Raises
        ------
        FileError
            The file has other columns.
        """
        header = ["run", *names]
        if self._header and self._header != header:
            own, come = ", ".join(self._header), ", ".join(header)
            problem = f"has the columns {own}, and {come} come; name another file"
            raise FileError(self.rows.path, problem, line=1)
        self._row = _line([self.label])[:-1].replace(b"%", b"%%") + b",%.15g" * len(names) + b"\n"
        self._head = b"" if self._header else _line(header)

    def add(self, values: Array) -> None:
        """Add rows, shape (n, columns)."""
        rows = self._row * len(values) % tuple(values.ravel().tolist())
        self.rows.add(self._head + rows, len(values))
        self._head = b""

    def reject(self, lines: Sequence[bytes]) -> None:
        """Keep lines that are no rows, as they came."""
        self.rejected.add(b"".join([line + b"\n" for line in lines]), len(lines))

    @property
    def rejections(self) -> str:
        """How many lines were no rows, and where they are kept."""
        kept = f" ({self.rejected.path})" if self.rejected.lines else ""
        return f"{counted(self.rejected.lines, 'line')} rejected{kept}"

    def close(self) -> None:
        """End both files."""
        with contextlib.closing(self.rejected):
            self.rows.close()


def _continued(path: Path) -> tuple[list[str], set[str]]:
    """Columns and labels of a file that is there; it ends with a whole row then."""
    with open(path, "r+b") as file:
        file.truncate(sum(len(line) for line in file if line.endswith(b"\n")))
    with open(path, encoding="utf-8", newline="") as text:
        rows = csv.reader(text)
        header = next(rows, [])
        if header and "run" not in header:
            raise FileError(path, "has no column run: only what was recorded is continued", line=1)
        place = header.index("run") if header else 0
        return header, {cell for row in rows for cell in row[place : place + 1]}


def _line(cells: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode()
