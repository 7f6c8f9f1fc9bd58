"""Hidden places next to an output in which it is made, locks, and leftovers of killed processes.

A place is locked as long as its process lives, and the system takes the lock from one that
dies: whoever writes to the same name next removes what is locked by nobody.
"""

from __future__ import annotations

import contextlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows has no flock
    fcntl = None  # type: ignore[assignment]

#: Ending of what is being written next to its name.
PARTIAL: Final = ".trueangle-partial"
#: Ending of a folder that is being replaced, in the place where the new one was made.
_REPLACED: Final = ".replaced"
#: Linux's renameat2: paths are relative to the working folder; both names change places.
_AT_FDCWD: Final = -100


def hidden_beside(target: Path) -> Path:
    """A new name next to ``target``, unique by its 64 random bits."""
    return target.with_name(f"{hidden_name(target)}.{os.urandom(8).hex()}{PARTIAL}")


def hidden_name(target: Path) -> str:
    """What all of `hidden_beside` begin with."""
    # Characters of a name that its hidden neighbour repeats: names may have 255 bytes in all.
    return f".{target.name[:50]}"


@contextmanager
def made_beside(target: Path, make: Callable[[Path], int]) -> Iterator[Path]:
    """A new hidden file or folder next to ``target``, locked until the end.

    ``make`` makes it and opens it (-1 where that cannot be); its handle is closed at the end.
    What is still there then is removed, and a folder that was moved into it and not replaced
    goes back. Between the making and the lock another process may take it for a dead one's:
    then it is made again.
    """
    handle = -1
    # Known before it is made: Ctrl-C may come with the call that makes it.
    beside = hidden_beside(target)
    # Tries to make what others removed at once; some folders (/proc) take nothing at all.
    try:
        for _ in range(100):
            with contextlib.suppress(FileNotFoundError):
                handle = make(beside)
                if handle < 0:  # a system without such locks
                    break
                _lock(handle)
                if os.path.samestat(os.fstat(handle), os.stat(beside)):
                    break
            if not target.parent.is_dir():  # the folder itself has gone
                raise FileNotFoundError(2, os.strerror(2), str(target.parent))
            if handle >= 0:
                os.close(handle)
                handle = -1
            beside = hidden_beside(target)
        else:
            raise FileNotFoundError(2, "no file can be made in this folder", str(target.parent))
        yield beside
    finally:
        try:
            _remove(beside, [target])
        finally:
            if handle >= 0:
                os.close(handle)


def _lock(handle: int) -> None:
    if fcntl is not None:
        with contextlib.suppress(OSError):  # file systems without locks
            fcntl.flock(handle, fcntl.LOCK_EX)


@contextmanager
def workplace(target: Path) -> Iterator[Path]:
    """Path of the same name in a new hidden folder next to ``target``, removed at the end.

    For a symbolic link ``target`` is the file it leads to: `publish` renames next to that.
    """
    target = Path(os.path.realpath(target))

    def make(folder: Path) -> int:
        folder.mkdir(mode=0o700)
        # Windows opens no folders.
        return -1 if fcntl is None else os.open(folder, os.O_RDONLY)

    with made_beside(target, make) as folder:
        yield folder / target.name


@contextmanager
def lock_path(path: Path) -> Iterator[bool]:
    """Hold a lock on a file or folder until the end; False when another process has it.

    False as well where it has lost its name meanwhile.
    """
    if fcntl is None:  # pragma: no cover - Windows
        yield True
        return
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except FileNotFoundError:
        yield False
        return
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            free = os.path.samestat(os.fstat(handle), os.stat(path))
        except (BlockingIOError, FileNotFoundError):
            free = False
        yield free
    finally:
        os.close(handle)


@contextmanager
def renamed(aside: Path, target: Path) -> Iterator[None]:
    """Let ``aside`` have the name ``target``; an error of the system in the block undoes it.

    A folder is replaced in one step where the system can let both change names. Else there is a
    moment in which ``target`` is not there: `restore` and `remove_leftovers` undo it. A file is
    kept by a second name meanwhile, where the file system gives one.
    """
    is_new, kept = not target.exists(), hidden_beside(target)
    try:
        if target.is_dir():
            if not exchange_names(aside, target):
                os.replace(target, aside.with_name(aside.name + _REPLACED))
                os.replace(aside, target)
        else:
            with contextlib.suppress(OSError):
                os.link(target, kept)
            os.replace(aside, target)
        try:
            yield
        except OSError:
            if kept.exists():
                os.replace(kept, target)
            elif is_new or (target.is_dir() and not exchange_names(aside, target)):
                os.replace(target, aside)
            raise
    finally:
        kept.unlink(missing_ok=True)


def exchange_names(first: Path, second: Path) -> bool:
    """Let two files or folders change names in one step; False where that cannot be done."""
    import ctypes  # where a folder is replaced only

    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    names = os.fsencode(first), os.fsencode(second)
    # 2: the names change places.
    return bool(rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], 2) == 0)


def restore(folder: Path) -> bool:
    """Give folders their names again that killed processes had moved aside; whether any was.

    Of those in ``folder`` only.
    """
    try:
        names = [name for name in os.listdir(folder) if name.endswith(PARTIAL)]
    except OSError:
        return False
    found = False
    for name in names:
        # Looked for before it is locked: most are of files, or of work that goes on.
        if any(_moved(folder / name)):
            with contextlib.suppress(OSError), lock_path(folder / name) as free:
                found |= free and _put_back(folder / name)
    return found


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
            # What cannot be locked may be alive.
            with contextlib.suppress(OSError), lock_path(parent / name) as free:
                if free:
                    _remove(parent / name, of)


def _remove(place: Path, targets: Iterable[Path]) -> None:
    """Remove a file or place aside; a folder that was moved into it and not replaced goes back."""
    with contextlib.suppress(OSError):  # not made, or named already
        os.unlink(place)
        return
    if not place.is_dir():
        return
    import shutil  # with every library that packs: for folders only

    for target in targets:
        replaced = place / f"{target.name}{_REPLACED}"
        if replaced.exists() and not target.exists():
            os.replace(replaced, target)
    shutil.rmtree(place, ignore_errors=True)


def _moved(place: Path) -> Iterator[Path]:
    """Folders that were moved into a place aside and whose name nothing has."""
    try:
        names = os.listdir(place)
    except OSError:
        return
    for name in names:
        target = place.with_name(name.removesuffix(_REPLACED))
        if name.endswith(_REPLACED) and name != _REPLACED and not target.exists():
            yield place / name


def _put_back(place: Path) -> bool:
    found = list(_moved(place))
    for folder in found:
        os.replace(folder, place.with_name(folder.name.removesuffix(_REPLACED)))
    return bool(found)
