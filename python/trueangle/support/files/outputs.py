"""Writing files: only regular ones, never an input; published at once, errors by their own name."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import IO

from ...errors import FileError, KindError
from .inputs import irregular_file_kind, is_null_device, named_again, sha256_of
from .kinds import FileKind, log_endings
from .workplace import PARTIAL as PARTIAL
from .workplace import hidden_name as hidden_name
from .workplace import made_beside, remove_leftovers, renamed, workplace

#: Errors of the system that occur in writing only.
_OF_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def check_output(
    path: str | PathLike[str],
    kind: FileKind | None = None,
    inputs: Iterable[str | PathLike[str]] = (),
    hashes: Iterable[str] = (),
    *,
    regular: bool = False,
    in_new_folder: bool = False,
) -> Path:
    """Where an output goes: the file that ``path`` leads to, links followed.

    Parameters
    ----------
    path : path
    kind : Kind, optional
        What is written; its endings are checked.
    inputs : iterable of paths
        What was read: it is not overwritten.
    hashes : iterable of str
        sha256 of what was read, where its place is not known.
    regular : bool
        Refuse the null device too: what is written is read back.
    in_new_folder : bool
        Its folder will be made.

    Returns
    -------
    Path
        A regular file, the null device, or nothing yet in a folder that is there.

    Raises
    ------
    FileError
        A folder, device, pipe or socket; an input; an ending that promises another format;
        the file that the command prints into.
    OSError
        No such folder, no permission.
    """
    if not isinstance(path, str | PathLike):
        raise KindError(f"path must be the name of a file, got {path!r:.60}")
    text = os.fspath(path)
    if text == "-":
        raise FileError(path, "standard output is not written to; name a file (./- for this name)")
    if not text or "\0" in text:
        raise FileError(repr(text), "is not a name of a file")
    if kind is not None:
        kind.check(path)
    try:
        found = os.stat(path)
    except FileNotFoundError:
        found = None
    target = Path(os.path.realpath(path))
    if found is None:
        if text.endswith(os.sep):
            raise FileError(path, "names a folder; name a file in it")
        if not in_new_folder and not target.parent.is_dir():
            parent = Path(path).parent
            missing = target.parent if parent.is_dir() else parent
            raise FileNotFoundError(errno.ENOENT, "No such folder", str(missing))
    elif stat.S_ISDIR(found.st_mode):
        raise FileError(path, "is a folder; name a file in it")
    elif is_null_device(found) and not regular:
        return target
    elif not stat.S_ISREG(found.st_mode):
        raise FileError(
            path, f"is {irregular_file_kind(found.st_mode)}: only files are written; name a file"
        )
    elif not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "is write-protected", text)
    again = named_again(path, inputs, log_endings())
    if again is not None:
        also = "" if again == text else f" (as {again})"
        raise FileError(path, f"is also read{also}: it would be overwritten; name another file")
    if found is not None:
        if _is_printed_into(found):
            raise FileError(path, "is the file of this program's own output; name another file")
        known = {digest for digest in hashes if digest}
        if known and sha256_of(target) in known:
            raise FileError(
                path, "holds what was read (same content): it would be overwritten; name another"
            )
    return target


@contextlib.contextmanager
def written_atomically(
    path: str | PathLike[str],
    *,
    kind: FileKind | None = None,
    inputs: Iterable[str | PathLike[str]] = (),
    hashes: Iterable[str] = (),
) -> Iterator[IO[str]]:
    """Text file that takes the name ``path`` only once it is complete and synced.

    It is written next to the file that ``path`` leads to (links are followed and stay) under
    a hidden name and renamed at the end; an exception inside the block, or a full disk,
    leaves ``path`` as it was. The null device takes everything and keeps its place.
    `check_output`, which takes the other arguments, decides what may be written.
    """
    target = check_output(path, kind, inputs, hashes)
    if target.exists() and not target.is_file():  # the null device
        with open(target, "w", encoding="utf-8", newline="\n") as nowhere:
            yield nowhere
        return
    remove_leftovers([target])
    with named_output(path, _file_beside(target)) as beside:
        with open(beside, "r+", encoding="utf-8", newline="\n") as file:
            yield file
        publish(beside, target)


@contextlib.contextmanager
def external_output(target: Path) -> Iterator[Path]:
    """Path of a file to be made by another program, which has the name ``target`` at the end.

    It is alone in a new folder next to ``target``; for the null device the folder is elsewhere.
    """
    if target.exists() and not target.is_file():  # the null device
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder, target.name)
        return
    remove_leftovers([target])
    with named_output(target, workplace(target)) as aside:
        yield aside
        publish(aside, target)


def _file_beside(target: Path) -> contextlib.AbstractContextManager[Path]:
    """A new empty file next to ``target``; see `made_beside`."""

    def make(beside: Path) -> int:
        handle = os.open(beside, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
        if os.name != "nt":
            return handle
        os.close(handle)  # pragma: no cover - an open file has no new name there
        return -1  # pragma: no cover

    return made_beside(target, make)


def publish(aside: str | PathLike[str], target: str | PathLike[str]) -> None:
    """Sync the finished file or folder ``aside`` to the disk and rename it ``target``.

    A symbolic link stays; what it leads to is replaced, a folder as `renamed` describes. A
    file that is replaced hands on its permissions; the null device takes the file and stays.
    Where the disk does not take the new name, the old state comes back.
    """
    target = os.path.realpath(target)
    try:
        found = os.stat(target)
    except FileNotFoundError:
        found = None
    if found is not None:
        if is_null_device(found):
            os.unlink(aside)
            return
        if stat.S_ISREG(found.st_mode):
            os.chmod(aside, stat.S_IMODE(found.st_mode) & 0o777)
    with _named_by(aside):
        for inside in Path(aside).rglob("*"):
            sync_to_disk(inside)
        sync_to_disk(aside)
        with renamed(Path(aside), Path(target)):
            sync_to_disk(Path(target).parent)


def sync_to_disk(path: str | PathLike[str]) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    if os.name == "nt" and os.path.isdir(path):  # pragma: no cover - folders have no handle there
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        # Some network file systems cannot sync folders: the rename itself is done.
        if not (os.path.isdir(path) and error.errno in (errno.EINVAL, errno.ENOTSUP)):
            raise
    finally:
        os.close(handle)


def _is_printed_into(found: os.stat_result) -> bool:
    """Whether standard output or error goes to this file: printing on would lose it."""
    for handle in (1, 2):
        try:
            printed = os.fstat(handle)
        except OSError:
            continue
        if stat.S_ISREG(printed.st_mode) and os.path.samestat(found, printed):
            return True
    return False


@contextlib.contextmanager
def named_output(
    path: str | PathLike[str],
    making: contextlib.AbstractContextManager[Path],
    read: str | PathLike[str] | None = None,
) -> Iterator[Path]:
    """The place that ``making`` makes to write ``path`` in; errors of the system name the file.

    Libraries report a full disk in their own words, or as damage of what they read: whether the
    disk is full is tested by writing. An error without a name that does not occur in writing only
    is one of reading ``read`` (default: ``path``).
    """
    try:
        with making as place:
            try:
                yield place
            except Exception:
                _check_room(place)
                raise
    except OSError as error:
        named = None if error.filename is None else os.fsdecode(error.filename)
        if not error.errno or not (named is None or PARTIAL in named):
            raise
        of_reading = named is None and error.errno not in _OF_WRITING
        told = path if read is None or not of_reading else read
        raise OSError(error.errno, error.strerror, os.fspath(told)) from None


def _check_room(place: Path) -> None:
    """Write at the end of every file of a place that is given up, and to a new file.

    Raises
    ------
    OSError
        Of the first that takes nothing more.
    """
    aside = place.parent if place.parent.name.endswith(PARTIAL) else None
    found = [place] if aside is None else [p for p in aside.rglob("*") if p.is_file()]
    for file in found if aside is None else [*found, aside / "more"]:
        with _named_by(file), open(file, "ab", buffering=0) as more:
            # Bytes that a file must take for its disk not to be full.
            block = memoryview(bytes(1 << 16))
            while block:
                block = block[more.write(block) :]
            os.fsync(more.fileno())


@contextlib.contextmanager
def _named_by(path: str | PathLike[str]) -> Iterator[None]:
    """Report errors of the system without a name, or with another, under this name."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from None
