"""Whether two names mean one file, and the kind of what is no regular file."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from os import PathLike


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
    output: str | PathLike[str],
    inputs: Iterable[str | PathLike[str]],
    endings: Iterable[str],
) -> str | None:
    """The input that ``output`` is, or None.

    A folder among the inputs stands for the files in and below it that have one of the
    ``endings``.
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
    """What a thing that is no regular file is, as a message says it."""
    names = (
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISFIFO, "a pipe"),
        (stat.S_ISSOCK, "a socket"),
        (stat.S_ISCHR, "a device"),
        (stat.S_ISBLK, "a device"),
    )
    return next((name for test, name in names if test(mode)), "no regular file")
