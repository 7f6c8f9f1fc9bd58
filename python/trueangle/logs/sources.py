"""Which logs are meant by paths and folders, and where each output goes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import ArgumentError
from .formats import known_format
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
        if path.is_file() or known_format(path):
            found.append((path, Path(path.name)))
            continue
        inside = sorted(_walk(path), key=_natural)
        if not inside:
            raise ArgumentError(f"{path}: no logs of a known format in this folder")
        found += [(log, log.relative_to(path)) for log in inside]
    return found


def places(
    paths: Iterable[str | PathLike[str]], output: str | PathLike[str] | None, in_place: bool
) -> list[Place]:
    """Where every log goes; never onto a log, but in place.

    Several logs, a folder, or an ``output`` that is a folder or ends with a slash go into
    the folder ``output``, which is made.

    Raises
    ------
    ArgumentError
        Two logs of one name, an output that is an input, both or none of ``output`` and
        ``in_place``.
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
        found = [Place(log, folder / name, folder) for log, name in logs]
    else:
        found = [Place(logs[0][0], Path(output), None)]
    _check(found, in_place)
    for place in found:
        if place.manifest is not None:
            place.target.parent.mkdir(parents=True, exist_ok=True)
    return found


def _check(found: list[Place], in_place: bool) -> None:
    taken: dict[Path, Path] = {}
    sources = {place.source.resolve() for place in found}
    for source, target, _ in found:
        other = taken.setdefault(target.resolve(), source)
        if other is not source:
            raise ArgumentError(
                f"{target}: two logs of this name ({other}, {source}); "
                "correct them into other folders"
            )
        if not in_place and target.resolve() in sources:
            raise ArgumentError(
                f"{source}: the output {target} would overwrite a log; name another with -o"
            )


def _is_folder(output: str | PathLike[str]) -> bool:
    path = Path(output)
    ends_so = isinstance(output, str) and output.endswith("/")
    return ends_so or (path.is_dir() and known_format(path) is None)


def _walk(folder: Path) -> Iterable[Path]:
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == MANIFEST:
            continue
        if known_format(path):
            yield path
        elif path.is_dir():
            yield from _walk(path)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts log2 before log10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
