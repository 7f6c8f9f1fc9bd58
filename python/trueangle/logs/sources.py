"""Logs before they are read: how many rows they hold, and where each output goes."""

from __future__ import annotations

import os
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import ArgumentError, FileError, TrueAngleError
from ..formats.formats import find_format, known_format
from ..runs.paths import find_logs
from ..support.files import RUNS_BYTES, check_output, kind_of_log, promised_format, same_file


class LogTarget(NamedTuple):
    """A log, its output, and the folder whose manifest notes it (None: none is kept)."""

    source: Path
    target: Path
    manifest: Path | None


def logs_hold_at_most(paths: Iterable[Path], most: int, topic: str | None = None) -> bool:
    """Whether logs hold at most ``most`` rows, by their own headers and sizes."""
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
    # Rows that a byte of a packed file holds, at most, where nothing else is known.
    if path.is_file() and size <= most // 64:
        return size
    try:
        return find_format(path).extent(path, (), topic).rows
    except TrueAngleError:
        return 0  # reading it whole reports what is wrong


def output_places(
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
        found = [
            LogTarget(log, folder / kind_of_log(log).fitting(name), folder) for log, name in logs
        ]
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
