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
from typing import Final

from ..errors import ArgumentError, FileError
from ..support.arrays import Array
from ..support.layout import counted

#: Bytes of a page: what a call of the system puts into one is there as a whole, or not at all.
_PAGE: Final = 4096
#: Seconds between two times that the disk has all.
_SYNC: Final = 1.0


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
        self._filled = filled
        self._handle: int | None = None
        self._size, self._longest, self._waiting = 0, 0, b""
        self._synced = time.monotonic()

    def add(self, lines: bytes, count: int) -> None:
        """Add whole lines; what has waited for a second is written."""
        self._waiting += lines
        self.lines += count
        if time.monotonic() - self._synced >= _SYNC:
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
        if self._handle is None:
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
            self._handle = os.open(self.path, flags, 0o666)
            self._size = os.fstat(self._handle).st_size
        pieces, self._waiting = self._pieces(self._waiting), b""
        try:
            for piece in pieces:
                if os.write(self._handle, piece) < len(piece):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                self._size += len(piece)
            with contextlib.suppress(OSError):  # the null device, some network file systems
                os.fsync(self._handle)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, self._size)
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def _pieces(self, data: bytes) -> Iterator[bytes]:
        """Whole lines, as many as the page of the file takes."""
        start = 0
        self._longest = max(self._longest, 1 + max(map(len, data.split(b"\n"))))
        while start < len(data):
            room = _PAGE - self._size % _PAGE
            end = data.rfind(b"\n", start, start + room) + 1
            if not end:  # longer than what the page has left
                end = data.index(b"\n", start) + 1
            piece, left = data[start:end], room - (end - start)
            start = end
            if self._filled and left > 0 and (start < len(data) or left < self._longest):
                piece = piece[:-1] + b" " * left + b"\n"
            yield piece

    def close(self) -> None:
        """Write what waits, and close."""
        try:
            self.flush()
        finally:
            if self._handle is not None:
                os.close(self._handle)
                self._handle = None


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
        rejected = path if is_device else path.with_name(path.name + ".rejected")
        self.rows, self.rejected = WholeFile(path), WholeFile(rejected, filled=False)
        self._header: list[str] = []
        there = [p for p in (path, rejected) if p.is_file() and p.stat().st_size]
        if there and not append:
            raise FileError(
                there[0], "is there already: name another file, or add a run to it (`append=True`)"
            )
        labels = self._continued(path) if path in there else set()
        if label in labels:
            raise ArgumentError(f"label: {path} has a run {label!r}; give another label")
        numbers = map(str, itertools.count(len(labels) + 1))
        self.label = label or next(number for number in numbers if number not in labels)

    def _continued(self, path: Path) -> set[str]:
        """The labels of a file that is there; it ends with a whole row then."""
        with open(path, "r+b") as file:
            size = sum(len(line) for line in file if line.endswith(b"\n"))
            file.truncate(size)
        with open(path, encoding="utf-8", newline="") as text:
            rows = csv.reader(text)
            self._header = next(rows, [])
            if self._header and "run" not in self._header:
                problem = "has no column run: only what was recorded is continued"
                raise FileError(path, problem, line=1)
            return {cell for row in rows for cell in row[self._header.index("run") :][:1]}

    def begin(self, names: Sequence[str]) -> None:
        """State the columns, those of the rows behind the label of the run.

        Raises
        ------
        FileError
            The file has other columns.
        """
        header = ["run", *names]
        if self._header and self._header != header:
            raise FileError(
                self.rows.path,
                f"has the columns {', '.join(self._header)}, and {', '.join(header)} come; name "
                "another file",
                line=1,
            )
        label = _line([self.label])[:-1].replace(b"%", b"%%")
        self._row = label + b",%.15g" * len(names) + b"\n"
        if not self._header:
            self.rows.add(_line(header), 0)

    def add(self, values: Array) -> None:
        """Add rows, shape (n, columns)."""
        self.rows.add(self._row * len(values) % tuple(values.ravel().tolist()), len(values))

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
        try:
            self.rows.close()
        finally:
            self.rejected.close()


def _line(cells: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode()
