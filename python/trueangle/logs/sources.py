"""Which logs are meant by paths and folders, and where each output goes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import ArgumentError, FileError
from ..files import check_input, check_output, kind_of_log, promised_format, same_file
from ..formats.formats import known_format
from .manifest import MANIFEST

__all__ = ["Place", "find_logs", "places"]


class Place(NamedTuple):
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
        A file that is not there, a folder without logs.
    """
    found: list[tuple[Path, Path]] = []
    for entry in paths:
        path = Path(entry)
        if not path.exists():
            raise ArgumentError(f"{path}: no such file")
        if not path.is_dir() or known_format(path):
            check_input(path, whole=True)
            found.append((path, Path(path.name)))
            continue
        inside = sorted(_walk(path), key=_natural)
        if not inside:
            raise ArgumentError(f"{path}: no logs of a known format in this folder")
        for log in inside:
            check_input(log, whole=True)
        found += [(log, log.relative_to(path)) for log in inside]
    return found


def places(
    paths: Iterable[str | PathLike[str]],
    output: str | PathLike[str] | None,
    in_place: bool,
    models: Iterable[str | PathLike[str]] = (),
) -> list[Place]:
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
        raise ArgumentError("give either an output (-o) or in place (--in-place)")
    logs = find_logs(given)
    if output is None:
        several = len(logs) > 1
        found = [Place(log, log, log.parent if several else None) for log, _name in logs]
    elif len(logs) > 1 or _is_folder(output) or logs[0][0] != Path(given[0]):
        folder = Path(output)
        if not folder.is_dir() and promised_format(folder) and not str(output).endswith(os.sep):
            raise FileError(
                output,
                f"{len(logs)} logs go into a folder, and this is the name of a file; "
                "name a folder (with / at its end)",
            )
        found = [Place(log, folder / name, folder) for log, name in logs]
    else:
        found = [Place(logs[0][0], Path(output), None)]
    _check(found, in_place, list(models))
    for place in found:
        if place.manifest is not None:
            place.target.parent.mkdir(parents=True, exist_ok=True)
    return found


def _check(found: list[Place], in_place: bool, models: list[str | PathLike[str]]) -> None:
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
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == MANIFEST:
            continue
        if known_format(path):
            yield path
        elif path.is_dir() and _identity(path) not in here:  # a link may lead up again
            yield from _walk(path, here)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts log2 before log10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
