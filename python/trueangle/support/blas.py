"""Threads of numpy's linear algebra: one where products are many and small."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

#: Names of the functions by which builds of OpenBLAS return and set their number of threads.
NAMES = tuple(
    (f"{before}openblas_get_num_threads{after}", f"{before}openblas_set_num_threads{after}")
    for before in ("scipy_", "")
    for after in ("64_", "")
)

_lock = threading.Lock()
_inside = 0
_before = 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let the OpenBLAS that came with numpy work in one thread for a while.

    Threads wait for each other in a loop, which costs a second processor and more time than they
    save where products take some microseconds. Threads are restored at the end of the last of
    several calls that overlap; holds for the whole process. Nothing is done where numpy brought
    no OpenBLAS, or where ``OPENBLAS_NUM_THREADS=1`` limits it to one thread.

    Examples
    --------
    >>> with one_blas_thread():
    ...     product = np.ones((3, 3)) @ np.ones((3, 3))
    >>> float(product[0, 0])
    3.0
    """
    global _inside, _before
    found = None if os.environ.get("OPENBLAS_NUM_THREADS") == "1" else blas_threads()
    if found is None:
        yield
        return
    count, change = found
    with _lock:
        if _inside == 0:
            _before = count()
            change(1)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                change(_before)


@cache
def blas_threads() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """Functions that return and set the threads of numpy's own OpenBLAS; None without one."""
    package = Path(np.__file__).parent
    folders = (package.parent / "numpy.libs", package / ".dylibs")
    paths = [path for folder in folders for path in sorted(folder.glob("*openblas*"))]
    if not paths:
        return None
    import ctypes

    for path in paths:
        try:
            library = ctypes.CDLL(str(path))
        except OSError:
            continue
        for asks, sets in NAMES:
            if hasattr(library, asks) and hasattr(library, sets):
                return getattr(library, asks), getattr(library, sets)
    return None
