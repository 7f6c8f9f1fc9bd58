"""Outputs that are complete or not there: written aside, synced, verified, renamed."""

from __future__ import annotations

import os
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..files.outputs import PARTIAL, hidden_beside, hidden_name, sync

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no flock
    fcntl = None  # type: ignore[assignment]

__all__ = ["Stamp", "locked", "publish", "remove_leftovers", "stamp", "workplace"]

Stamp = tuple[int, int]


def stamp(path: Path) -> Stamp:
    """Size in bytes and time of the last change (ns) of a file, or of all in a folder."""
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    stats = [file.stat() for file in files]
    return sum(s.st_size for s in stats), max((s.st_mtime_ns for s in stats), default=0)


@contextmanager
def workplace(target: Path) -> Iterator[Path]:
    """Path of the same name in a new hidden folder beside ``target``, removed at the end.

    Of a symbolic link that is the file it leads to: `publish` renames beside it.
    The folder is locked as long as its process lives: `remove_leftovers` spares it.
    """
    target = Path(os.path.realpath(target))
    # Known before it is made: Ctrl-C may come with the call that makes it.
    folder = hidden_beside(target)
    try:
        folder.mkdir(mode=0o700)
        with locked(folder):
            yield folder / target.name
    finally:
        _remove(folder, [target])


@contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Hold a lock on a file or folder until the end; False when another process has it.

    The system takes the lock from a process that dies.
    """
    if fcntl is None:  # pragma: no cover - Windows
        yield True
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(handle)


def publish(aside: Path, target: Path) -> None:
    """Sync ``aside`` to the disk and give it the name ``target``, replacing what is there.

    A symbolic link stays; what it leads to is replaced.
    """
    target = Path(os.path.realpath(target))
    for file in [aside] if aside.is_file() else list(aside.rglob("*")):
        sync(file)
    sync(aside)
    if target.is_dir() and aside.is_dir():
        # A folder cannot be replaced in one step: `remove_leftovers` undoes a half.
        os.replace(target, _replaced(aside))
    os.replace(aside, target)
    sync(target.parent)


def remove_leftovers(targets: Iterable[Path]) -> None:
    """Remove what killed processes left of ``targets``; put replaced folders back.

    Every folder is listed once, however many of the targets it has.
    """
    wanted: dict[Path, dict[str, list[Path]]] = defaultdict(lambda: defaultdict(list))
    for target in targets:
        target = Path(os.path.realpath(target))
        wanted[target.parent][hidden_name(target)].append(target)
    for parent, by_name in wanted.items():
        try:
            names = os.listdir(parent)
        except OSError:  # it may be written to and not read
            continue
        for name in names:
            # After the name that `hidden_beside` repeats come a point and what it draws.
            of = name.endswith(PARTIAL) and by_name.get(name[: -len(PARTIAL)].rpartition(".")[0])
            if not of:
                continue
            with locked(parent / name) as free:
                if free:
                    _remove(parent / name, of)


def _remove(workplace: Path, targets: Iterable[Path]) -> None:
    """Remove a workplace; a folder that was moved into it and not replaced goes back."""
    for target in targets:
        replaced = _replaced(workplace / target.name)
        if replaced.exists() and not target.exists():
            os.replace(replaced, target)
    shutil.rmtree(workplace, ignore_errors=True)


def _replaced(aside: Path) -> Path:
    return aside.with_name(aside.name + ".replaced")
