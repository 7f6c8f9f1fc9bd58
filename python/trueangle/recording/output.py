"""The file of what is recorded: whole rows at every moment, synced once a second."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from ..errors import ArgumentError, FileError

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
        try:
            for piece in self._pieces():
                if os.write(self._handle, piece) < len(piece):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                self._size += len(piece)
            self._waiting = b""
            with contextlib.suppress(OSError):  # the null device, some network file systems
                os.fsync(self._handle)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, self._size)
            self._waiting = b""
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def _pieces(self) -> Iterator[bytes]:
        """Whole lines, as many as the page of the file takes."""
        data, start = self._waiting, 0
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
        self._header: list[str] | None = None
        self._given, self.label = label, label or "1"
        there = [p for p in (path, rejected) if p.is_file() and p.stat().st_size]
        if there and not append:
            raise FileError(
                there[0], "is there already: name another file, or add a run to it (`append=True`)"
            )
        if path in there:
            self._continue(path)

    def _continue(self, path: Path) -> None:
        """Find the columns and labels of a file that is there, and end it with a whole row."""
        with open(path, "r+b") as file:
            size = file.seek(0, os.SEEK_END)
            end = size
            while end and (file.seek(end - 1), file.read(1))[1] != b"\n":
                end -= 1
            file.truncate(end)
        with open(path, encoding="utf-8", newline="") as text:
            rows = csv.reader(text)
            self._header = next(rows, None)
            if not self._header:
                return
            if "run" not in self._header:
                raise FileError(
                    path, "has no column run: only what was recorded is continued", line=1
                )
            place = self._header.index("run")
            labels = {row[place] for row in rows if len(row) > place}
        if self._given in labels:
            raise ArgumentError(f"label: {path} has a run {self._given!r}; give another label")
        number = len(labels) + 1
        while self._given is None and str(number) in labels:
            number += 1
        self.label = self._given or str(number)

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
        self._start = _line([self.label])[:-1] + b","
        if not self._header:
            self.rows.add(_line(header), 0)
        self._header = header

    def add(self, columns: Sequence[Sequence[bytes]]) -> None:
        """Add rows, column by column."""
        rows = [*zip(*columns, strict=True)]
        start = self._start
        self.rows.add(b"".join([start + b",".join(row) + b"\n" for row in rows]), len(rows))

    def reject(self, lines: Sequence[bytes]) -> None:
        """Keep lines that are no rows, as they came."""
        self.rejected.add(b"".join([line + b"\n" for line in lines]), len(lines))

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
