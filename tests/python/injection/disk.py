"""What a disk holds after the power fails: only what was synced is sure to be there.

While a `Disk` records, every sync and rename of the process is a moment at which the power
may fail. Two disks are then possible at worst, and any mixture of them: one that has all
names but of every file only what was last synced, one that has only the names of folders
that were synced.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple


class File(NamedTuple):
    """Bytes of a file and the time it was last changed."""

    content: bytes
    changed: int


class State(NamedTuple):
    """A tree that the disk may hold, by path; and what was done last."""

    moment: str
    files: dict[str, File]


class Disk:
    """What would be left of ``folder``, moment by moment."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.eager: list[State] = []
        self.lazy: list[State] = []
        self._synced: dict[int, File] = {}
        self._names: dict[str, dict[str, int]] = {}
        for path in folder.rglob("*"):
            if path.is_file():
                self._synced[path.stat().st_ino] = _file(path)
        for path in (folder, *folder.rglob("*")):
            if path.is_dir():
                self._names[self._relative(path)] = _names(path)

    def _relative(self, path: Path) -> str:
        return path.relative_to(self.folder).as_posix()

    def _moment(self, what: str) -> None:
        eager = {}
        for path in self.folder.rglob("*"):
            if path.is_file():
                eager[self._relative(path)] = self._synced.get(path.stat().st_ino, _EMPTY)
        self.eager.append(State(what, eager))
        lazy = {}
        for folder, names in self._names.items():
            for name, inode in names.items():
                lazy[f"{folder}/{name}".removeprefix("./")] = self._synced.get(inode, _EMPTY)
        self.lazy.append(State(what, lazy))

    def _sync(self, handle: int) -> None:
        path = Path(os.readlink(f"/proc/self/fd/{handle}"))
        if not path.is_relative_to(self.folder):
            return
        if path.is_dir():
            self._names[self._relative(path)] = _names(path)
        else:
            self._synced[os.fstat(handle).st_ino] = _file(path)

    @contextmanager
    def recorded(self, monkeypatch) -> Iterator[None]:
        """Record every sync and rename of this process."""
        sync, replace = os.fsync, os.replace

        def synced(handle):
            self._moment("before a sync")
            sync(handle)
            self._sync(handle)
            self._moment("after a sync")

        def replaced(old, fresh, **more):
            replace(old, fresh, **more)
            self._moment(f"after {Path(fresh).name} had its name")

        with monkeypatch.context() as patched:
            patched.setattr(os, "fsync", synced)
            patched.setattr(os, "replace", replaced)
            yield
        self._moment("at the end")


_EMPTY = File(b"", 0)


def _file(path: Path) -> File:
    return File(path.read_bytes(), path.stat().st_mtime_ns)


def _names(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_ino for path in folder.iterdir() if path.is_file()}


def laid_out(state: State, folder: Path) -> None:
    """Make the tree of a state in ``folder``, in place of what is there."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, file in state.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(file.content)
        os.utime(path, ns=(file.changed, file.changed))
