"""Which logs are meant by paths and folders, and where each output goes."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import ArgumentError, FileError, TrueAngleError
from ..formats.formats import find_format, known_format
from ..support.files import (
    RUNS_BYTES,
    check_input,
    check_output,
    kind_of_log,
    promised_format,
    restore,
    same_file,
)
from .manifest import MANIFEST

__all__ = ["LogTarget", "find_logs", "hold_at_most", "places"]

#: Rows that a byte of a packed file holds, at most, where nothing else is known.
_PACKED = 64


class LogTarget(NamedTuple):
    """A log, its output, and the folder whose manifest notes it (None: none is kept)."""

    source: Path
    target: Path
    manifest: Path | None


def find_logs(paths: Iterable[str | PathLike[str]]) -> list[tuple[Path, Path]]:
    """Logs with the name each has below what was given; folders in natural order.

    In a folder every file of a known format is a log, also in folders below, hidden files
    excepted; a folder that is a ROS 2 bag is one log.

    Raises
    ------
    ArgumentError
        A file that is not there, a folder without logs, no file at all.
    """
    found: list[tuple[Path, Path]] = []
    for entry in paths:
        path = Path(entry)
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


def hold_at_most(paths: Iterable[Path], most: int, topic: str | None = None) -> bool:
    """Whether logs hold at most so many rows, by what they say of themselves."""
    for path in paths:
        if not path.is_dir() and path.stat().st_size > RUNS_BYTES:
            return False
        most -= _rows(path, most, topic)
        if most < 0:
            return False
    return True


def _rows(path: Path, most: int, topic: str | None) -> int:
    """Rows of a log, about; of a small one its bytes, without a look into it."""
    size = path.stat().st_size
    if path.is_file() and size <= most // _PACKED:
        return size
    try:
        return find_format(path).module.extent(path, (), topic).rows
    except TrueAngleError:
        return 0  # who reads it whole says what is wrong


def places(
    paths: Iterable[str | PathLike[str]],
    output: str | PathLike[str] | None,
    in_place: bool,
    models: Iterable[str | PathLike[str]] = (),
) -> list[LogTarget]:
    """Where every log goes; never onto a log, but in place, and never onto one of the models.

    Several logs, a folder, or an ``output`` that is a folder or ends with a slash go into
    the folder ``output``, which is made.

    Raises
    ------
    ArgumentError
        Two logs of one name, both or none of ``output`` and ``in_place``.
    FileError
        An output that is an input, no regular file, or has the ending of another format.
    """
    given = list(paths)
    if in_place == (output is not None):
        raise ArgumentError("give either `output=` or `in_place=True`")
    logs = find_logs(given)
    if output is None:
        several = len(logs) > 1
        found = [LogTarget(log, log, log.parent if several else None) for log, _name in logs]
    elif len(logs) > 1 or _is_folder(output) or logs[0][0] != Path(given[0]):
        folder = Path(output)
        if not folder.is_dir() and promised_format(folder) and not str(output).endswith(os.sep):
            raise FileError(
                output,
                f"{len(logs)} logs go into a folder, and this is the name of a file; "
                "name a folder (with / at its end)",
            )
        found = [LogTarget(log, folder / name, folder) for log, name in logs]
    else:
        found = [LogTarget(logs[0][0], Path(output), None)]
    _check(found, in_place, list(models))
    for place in found:
        if place.manifest is not None:
            place.target.parent.mkdir(parents=True, exist_ok=True)
    return found


def _check(found: list[LogTarget], in_place: bool, models: list[str | PathLike[str]]) -> None:
    taken: dict[str, Path] = {}
    sources = {_identity(place.source): place.source for place in found}
    for source, target, manifest in found:
        other = taken.setdefault(os.path.realpath(target), source)
        if other is not source:
            raise ArgumentError(
                f"{target}: two logs of this name ({other}, {source}); "
                "correct them into other folders"
            )
        log = sources.get(_identity(target)) if target.exists() else None
        if log is not None and not in_place:
            raise FileError(
                source,
                f"the output {target} would overwrite "
                + ("this log" if same_file(log, source) else f"the log {log}")
                + "; name another with -o",
            )
        if target.is_dir() and source.is_dir():
            continue  # a bag that is a folder, corrected before
        kind = None if in_place or source.is_dir() else kind_of_log(source)
        check_output(target, kind, models, regular=True, in_new_folder=manifest is not None)


def _identity(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_dev, found.st_ino


def _is_folder(output: str | PathLike[str]) -> bool:
    path = Path(output)
    ends_so = isinstance(output, str) and output.endswith("/")
    return ends_so or (path.is_dir() and known_format(path) is None)


def _walk(folder: Path, above: tuple[tuple[int, int], ...] = ()) -> Iterable[Path]:
    here = (*above, _identity(folder))
    restore(folder)
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == MANIFEST:
            continue
        if not path.exists():
            warnings.warn(f"{path}: is a link to nothing and is left out", stacklevel=4)
            continue
        if known_format(path):
            yield path
        elif path.is_dir() and _identity(path) not in here:  # a link may lead up again
            yield from _walk(path, here)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts log2 before log10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
