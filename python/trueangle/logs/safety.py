"""Outputs that are complete or not there: written aside, synced, verified, renamed."""

from __future__ import annotations

from pathlib import Path

from ..support.files.outputs import publish
from ..support.files.workplace import lock_path, remove_leftovers, workplace

__all__ = ["Stamp", "lock_path", "publish", "remove_leftovers", "stamp", "workplace"]

Stamp = tuple[int, int]


def stamp(path: Path) -> Stamp:
    """Size in bytes and time of the last change (ns) of a file, or of all in a folder."""
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    stats = [file.stat() for file in files]
    return sum(s.st_size for s in stats), max((s.st_mtime_ns for s in stats), default=0)
