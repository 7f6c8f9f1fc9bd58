"""Work done by further threads: ahead of its use, or side by side."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

T = TypeVar("T")
R = TypeVar("R")


def read_ahead(items: Iterable[T], depth: int = 1) -> Iterator[T]:
    """The same items in the same order, made by another thread up to ``depth`` ahead.

    Compiled readers release the interpreter, so making an item and using the one before
    take the time of the slower. An exception while making reaches the user of the items;
    when the user stops early, making stops after the item in hand.

    Examples
    --------
    >>> list(read_ahead(k * k for k in range(4)))
    [0, 1, 4, 9]
    """
    made: queue.Queue[Any] = queue.Queue(depth)
    stopped = threading.Event()

    def put(entry: tuple[str, Any]) -> bool:
        while not stopped.is_set():
            try:
                made.put(entry, timeout=0.1)
            except queue.Full:
                continue
            return True
        return False

    def make() -> None:
        try:
            for item in items:
                if not put(("item", item)):
                    return
        except BaseException as error:
            put(("error", error))
        else:
            put(("end", None))

    thread = threading.Thread(target=make, name="trueangle-ahead", daemon=True)
    thread.start()
    try:
        while True:
            kind, value = made.get()
            if kind == "end":
                return
            if kind == "error":
                raise value
            yield value
    finally:
        stopped.set()
        thread.join()


def side_by_side(work: Callable[[T], R], items: Iterable[T], workers: int) -> Iterator[R]:
    """``work(item)`` of every item in their order, up to ``workers`` at a time.

    Items are taken only a few ahead. The first exception reaches the user of the results,
    and nothing more is begun.

    Examples
    --------
    >>> list(side_by_side(abs, [-1, 2, -3], workers=2))
    [1, 2, 3]
    """
    if workers == 1:
        yield from map(work, items)
        return
    waiting: deque[Future[R]] = deque()
    with ThreadPoolExecutor(workers, "trueangle-work") as pool:
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                # Items in hand or waiting for each worker.
                if len(waiting) >= 2 * workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
