"""Reading files: what may be read and how much, names of one file, hashes, partitions."""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple
from urllib.parse import unquote

from ...errors import FileError, KindError
from .workplace import restore

#: Most bytes of files that are read whole. The covariance of a model of 1800 orders, the
#: largest part of any model, takes 256 MiB as text; a simulation is written by hand; larger
#: tables of readings go through the readers of logs, in constant memory.
MODEL_BYTES: Final = 256 << 20
SIMULATION_BYTES: Final = 16 << 20
RUNS_BYTES: Final = 1 << 30

#: Bytes read at a time where the size is not known before.
_CHUNK: Final = 1 << 20


#: Mark of a missing value.
_NOTHING: Final = "__HIVE_DEFAULT_PARTITION__"


class InputFile(NamedTuple):
    """A file that readings came from: its name and the sha256 of its bytes."""

    file: str
    sha256: str


def check_input(path: str | PathLike[str], *, whole: bool = False) -> os.stat_result:
    """Refuse what cannot be read to an end: devices and sockets.

    Regular files, folders, pipes, terminals and the null device are let in; with ``whole``
    (formats that are read more than once or in any order) regular files and folders only.

    Raises
    ------
    FileError
    KindError
        No name of a file.
    OSError
        Nothing of this name.
    """
    if not isinstance(path, str | PathLike):  # a number would be an open file
        raise KindError(f"path must be the name of a file, got {path!r:.60}")
    try:
        try:
            found = os.stat(path)
        except FileNotFoundError:
            # A bag whose replacement was killed half-way has its name again.
            if not restore(Path(os.path.realpath(path)).parent):
                raise
            found = os.stat(path)
    except ValueError:
        raise FileError(path, "is not a name of a file: it holds a NUL character") from None
    mode = found.st_mode
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return found
    if whole:
        raise FileError(
            path,
            f"is {irregular_file_kind(mode)}, which can be read only once; write it to a file "
            "first",
        )
    if stat.S_ISFIFO(mode) or is_null_device(found):
        return found
    if stat.S_ISCHR(mode) and _is_terminal(path):
        return found
    raise FileError(path, f"is {irregular_file_kind(mode)}, not a file; name a file or a pipe")


def read_whole(path: str | PathLike[str], limit: int, what: str) -> bytes:
    """All bytes of a file or pipe, at most ``limit``.

    Waiting for a pipe ends with Ctrl-C, at most a tenth of a second later.

    ``limit`` is one of the constants of this module, ``what`` names what the file should hold: ``"a
    model"``.

    Raises
    ------
    FileError
        A folder, a device, more than ``limit`` bytes.
    OSError
        Nothing of this name, no permission.
    """
    found = check_input(path)
    if stat.S_ISDIR(found.st_mode):
        raise FileError(path, "is a folder; name a file in it")
    if found.st_size > limit:
        raise FileError(
            path, f"has {found.st_size} bytes, but {what} is read up to {_size(limit)} only"
        )
    parts, total = [], 0
    with open(path, "rb", buffering=0) as file:
        # Files of a size: in one piece, without a copy. Pipes and growing files: to the end.
        wanted = found.st_size or _CHUNK
        waits = not stat.S_ISREG(found.st_mode)
        while part := (_wait_for(file) if waits else file).read(wanted):
            parts.append(part)
            total += len(part)
            wanted = _CHUNK
            if total > limit:
                raise FileError(
                    path, f"is longer than {_size(limit)}, the most that is read of {what}"
                )
    return parts[0] if len(parts) == 1 else b"".join(parts)


def _wait_for(file: io.FileIO) -> io.FileIO:
    """Return once a pipe has bytes or has ended.

    A signal between Python's last look for signals and the system call of ``read`` only leaves
    a mark that nobody looks at until bytes come. Short waits look at it ten times a second.
    """
    import select  # pipes only

    if hasattr(select, "poll"):  # Windows waits for sockets only
        poll = select.poll()
        poll.register(file, select.POLLIN)
        # Milliseconds between two looks for Ctrl-C while a pipe is waited for.
        while not poll.poll(100):
            pass
    return file


def sha256_of(path: str | PathLike[str]) -> str:
    """Hexadecimal sha256 of a regular file, in constant memory."""
    import hashlib  # brings OpenSSL with it

    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_null_device(found: os.stat_result) -> bool:
    """Whether this is the device that swallows everything."""
    if not stat.S_ISCHR(found.st_mode):
        return False
    try:
        return found.st_rdev == os.stat(os.devnull).st_rdev
    except OSError:  # pragma: no cover - a system without one
        return False


def _is_terminal(path: str | PathLike[str]) -> bool:
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOCTTY", 0))
    except OSError:
        return False
    try:
        return os.isatty(handle)
    finally:
        os.close(handle)


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count < 1 << 30 else f"{count >> 30} GiB"


def partition_keys(path: str | PathLike[str]) -> dict[str, str]:
    """Keys and values of the folders right above a file, the outermost first.

    Examples
    --------
    >>> partition_keys("cells/unit=a%201/run=3/data.parquet")
    {'unit': 'a 1', 'run': '3'}
    >>> partition_keys("cells/data.parquet")
    {}
    """
    pairs = (folder.partition("=") for folder in _folders(path))
    return {unquote(key): unquote(value) for key, _, value in pairs if value != _NOTHING}


def partition_name(path: str | PathLike[str]) -> str:
    """The name of a file, with the folders that distinguish it from others of this name.

    Examples
    --------
    >>> partition_name("cells/unit=a/run=3/data.parquet"), partition_name("cells/a.csv")
    ('unit=a/run=3/data.parquet', 'a.csv')
    """
    return "/".join([*_folders(path), Path(path).name])


def _folders(path: str | PathLike[str]) -> list[str]:
    found: list[str] = []
    for folder in reversed(Path(path).parts[:-1]):
        key, equals, _ = folder.partition("=")
        if not key or not equals:
            break
        found.insert(0, folder)
    return found


def same_file(first: str | PathLike[str], second: str | PathLike[str]) -> bool:
    """Whether both names lead to one file: by spelling, symbolic link or hard link.

    Device and inode decide where both are there, the resolved paths where one is not yet.

    Examples
    --------
    >>> same_file("a.csv", "./a.csv"), same_file("a.csv", "b.csv")
    (True, False)
    """
    try:
        return os.path.samestat(os.stat(first), os.stat(second))
    except OSError:
        return os.path.realpath(first) == os.path.realpath(second)


def named_again(
    output: str | PathLike[str], inputs: Iterable[str | PathLike[str]], endings: Iterable[str]
) -> str | None:
    """The input that ``output`` is, or None.

    A folder among the inputs means the files in and below it that have one of the ``endings``.
    """
    known = tuple(endings)
    for entry in inputs:
        if same_file(output, entry):
            return os.fspath(entry)
        if os.path.isdir(entry) and os.path.exists(output):
            for inside in _files(entry):
                if inside.lower().endswith(known) and same_file(output, inside):
                    return inside
    return None


def _files(folder: str | PathLike[str]) -> Iterator[str]:
    for parent, _folders, names in os.walk(folder):
        yield from (os.path.join(parent, name) for name in names)


def irregular_file_kind(mode: int) -> str:
    """The kind of a thing that is not a regular file, in words for a message."""
    names = (
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISFIFO, "a pipe"),
        (stat.S_ISSOCK, "a socket"),
        (stat.S_ISCHR, "a device"),
        (stat.S_ISBLK, "a device"),
    )
    return next((name for test, name in names if test(mode)), "no regular file")
