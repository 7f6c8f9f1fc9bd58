"""Which files are meant by paths, folders and patterns."""

from __future__ import annotations

import glob
import os
import re
import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Final

from ..errors import ArgumentError, FileError
from ..formats.formats import known_format
from ..support.files import check_input, restore

#: Where `trueangle correct` notes in a folder what it has done there.
MANIFEST: Final = "trueangle-manifest.jsonl"


def find_logs(
    paths: Iterable[str | PathLike[str]], *, whole: bool = True
) -> list[tuple[Path, Path]]:
    """Files with the name each has below what was given; folders in natural order.

    In a folder every file of a known format counts, also in folders below, hidden files
    excepted; a folder that is a ROS 2 bag is one log. A pattern (``*``, ``?``, ``[0-9]``,
    ``**``) that is no file's name is expanded to what it matches. Without ``whole`` pipes, and
    names of no file, are returned as they are.

    Raises
    ------
    ArgumentError
        A file that is not there, a folder without logs, a pattern that nothing matches, no
        file at all.
    """
    found: list[tuple[Path, Path]] = []
    for path in matched_paths(paths):
        if whole:
            try:
                check_input(path, whole=True)
            except FileNotFoundError:
                raise ArgumentError(f"{path}: no such file") from None
        if not path.is_dir() or known_format(path):
            found.append((path, Path(path.name)))
            continue
        inside = sorted(_walk(path), key=_natural)
        if not inside:
            raise ArgumentError(f"{path}: no logs of a known format in this folder")
        for log in inside:
            check_input(log, whole=True)
        found += [(log, log.relative_to(path)) for log in inside]
    if not found:
        raise ArgumentError("logs is empty: at least one log is needed")
    return found


def matched_paths(paths: Iterable[str | PathLike[str]]) -> list[Path]:
    """The paths, and in place of every pattern what it matches, in natural order.

    Raises
    ------
    ArgumentError
        Nothing matches.
    """
    found: list[Path] = []
    for entry in paths:
        text = os.fspath(entry) if isinstance(entry, str | PathLike) else entry
        if not isinstance(text, str) or not glob.has_magic(text) or os.path.lexists(text):
            found.append(Path(entry))
            continue
        here = sorted(map(Path, glob.iglob(text, recursive=True)), key=_natural)
        if not here:
            raise ArgumentError(f"{text}: no file matches this pattern")
        found += here
    return found


def _walk(folder: Path, above: tuple[tuple[int, int], ...] = ()) -> Iterable[Path]:
    here = (*above, _identity(folder))
    restore(folder)
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == MANIFEST:
            continue
        if not path.exists():
            warnings.warn(f"{path}: is a link to nothing and is omitted", stacklevel=4)
            continue
        if known_format(path):
            yield path
        elif path.is_dir() and _identity(path) not in here:  # a link may lead up again
            yield from _walk(path, here)


def _identity(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_dev, found.st_ino


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts log2 before log10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def unit_of_path(path: Path, pattern: str | None) -> str | None:
    r"""The unit that a path names: the first group of ``pattern`` in it, or all that it finds.

    Raises
    ------
    FileError
        The pattern finds nothing.

    Examples
    --------
    >>> unit_of_path(Path("cell7/joint-A12.csv"), r"joint-(\w+)")
    'A12'
    """
    if pattern is None:
        return None
    found = re.search(pattern, path.as_posix())
    if found is None:
        raise FileError(path, f"the pattern of `unit_from=` finds nothing in this path: {pattern}")
    return found[1] if found.re.groups and found[1] is not None else found[0]
