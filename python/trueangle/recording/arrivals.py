"""Lines as they arrive: read by a thread for each source, with the time of their arrival."""

from __future__ import annotations

import json
import math
import re
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..formats.seriallog import NUMBER
from ..support.arrays import Array
from .sources import SourceOptions, open_source

#: Lines that agree on their layout.
_ENOUGH: Final = 3
_NUMBER: Final = re.compile(rb"(?<![\w.])%s(?![\w.])" % NUMBER)
#: What is between two numbers where several blanks are one: a mark, and the name of the second.
_BLANKS: Final = re.compile(rb"([ \t])[ \t]+")
_GAP: Final = re.compile(
    rb" ?([,;\t]?)[ \t]?(?:([A-Za-z_][\w.\[\]/-]*(?: [\w.\[\]/-]+){0,4})[ \t]?[:=])?[ \t]?"
)
#: A name of a column, which no sentence is.
_NAME: Final = re.compile("-?[A-Za-z_][^,;\t\ufffd]*(?<![.:!?])")


class LineLayout(NamedTuple):
    """How lines are read.

    Attributes
    ----------
    kind : str
        As it is shown: ``"CSV"``, ``"name:value pairs"``, ``"numbers"``, ``"JSON"``, ``"pattern"``.
    names : tuple of str
    row : pattern or None
        What a line that is a row holds, a named group for each name; None of JSON.
    header : bytes or None
        The line that named the columns: it is no row where it comes again.
    """

    kind: str
    names: tuple[str, ...]
    row: re.Pattern[bytes] | None = None
    header: bytes | None = None

    def values(self, lines: Sequence[bytes]) -> Array:
        """Numbers of each line, shape (n, columns); NaN of one that is no row."""
        cells = chain.from_iterable(map(self._cells, lines))
        return np.fromiter(map(float, cells), float).reshape(len(lines), len(self.names))

    def _cells(self, line: bytes) -> Sequence[bytes | float]:
        if self.row is None:
            found = _numbers(line)
            return [found.get(name, math.nan) for name in self.names]
        match = self.row.search(line)
        cells = [*match.groupdict(b"").values()] if match else []
        if self.kind == "pattern" and not all(map(_NUMBER.fullmatch, cells)):
            cells = []
        return cells or [math.nan] * len(self.names)


def layout_of(lines: Sequence[bytes], hurry: bool = False) -> LineLayout | None:
    r"""The layout on which three lines agree; in a hurry, that of most lines.

    Examples
    --------
    >>> layout_of([b"Ready.", b"step:8 raw:123", b"step:9 raw:125", b"step:10 raw:127"]).names
    ('step', 'raw')
    >>> layout_of([b"reference_deg,indicated_deg", b"1,2", b"2,3", b"3,4"]).kind
    'CSV'
    """
    seen = [_seen(line) for line in lines]
    counts = Counter(filter(None, seen))
    enough = [found for found, count in counts.items() if count >= _ENOUGH]
    if not (enough or (hurry and counts)):
        return None
    best = (enough or [counts.most_common(1)[0][0]])[0]
    if isinstance(best[0], str):
        return LineLayout("JSON", best)
    marks, named = zip(*best, strict=True)
    mark = (*marks[1:], b"")[0]
    kind = "name:value pairs" if any(named) else "CSV" if mark else "numbers"
    heads = ((line.strip(), _head(line, mark)) for line in reversed(lines[: seen.index(best)]))
    header, head = next((h for h in heads if h[1] and len(h[1]) == len(best)), (None, ()))
    given = [name.decode() or f"column{i}" for i, name in enumerate(named, 1)]
    return layout_of_columns(kind, head or tuple(given), best, header)


def layout_of_columns(
    kind: str,
    names: tuple[str, ...],
    gaps: Sequence[tuple[bytes, bytes]] = (),
    header: bytes | None = None,
) -> LineLayout:
    """The layout of lines of numbers, with a mark and a name before each: of CSV without any."""
    # Each has one way to match: a long line of rubbish costs its length.
    row = rb"^\s*"
    for i, (mark, name) in enumerate(gaps or [(b",", b"")] * len(names)):
        between = rb" *%s[ \t]*" % mark if mark else rb"[ \t]+"
        label = rb"%s[ \t]*[:=][ \t]*" % re.escape(name) if name else b""
        row += (between if i else b"") + label + rb"(?P<c%d>%s)" % (i, NUMBER)
    return LineLayout(kind, names, re.compile(row + rb"(?:[ \t]*[,;])?\s*$"), header)


def layout_of_pattern(pattern: str) -> LineLayout:
    """The layout that a regular expression with named groups states; found anywhere in a line.

    Raises
    ------
    ArgumentError
        It is no such expression.
    """
    try:
        found = re.compile(pattern.encode())
    except re.error as error:
        raise ArgumentError(f"pattern {pattern!r} is no regular expression: {error}") from None
    if not found.groupindex:
        raise ArgumentError(
            f"pattern {pattern!r} names no group; name columns as in 'S(?P<step>\\d+) "
            "R(?P<raw>\\d+)'"
        )

    return LineLayout("pattern", tuple(found.groupindex), found)


def _seen(line: bytes) -> tuple[Any, ...] | None:
    """What one line alone shows of the layout: marks and names of its numbers, or those of JSON."""
    text = line.strip()
    if text.startswith(b"{"):
        return tuple(_numbers(text)) or None
    *gaps, end = _NUMBER.split(_BLANKS.sub(rb"\1", text))
    found = [match.groups(b"") for match in map(_GAP.fullmatch, gaps) if match]
    is_row = 0 < len(found) == len(gaps) and not found[0][0] and not end.strip(b" ,;")
    return tuple(found) if is_row else None


def _head(line: bytes, mark: bytes) -> tuple[str, ...]:
    """Names of columns, if a line has some."""
    text = line.strip()
    parts = text.removesuffix(mark).split(mark) if mark else text.split()
    names = tuple(part.decode("utf-8", "replace").strip().strip('"') for part in parts)
    words = all(name.isprintable() and _NAME.fullmatch(name) for name in names)
    return names if words and len(set(names)) == len(names) else ()


def _numbers(text: bytes) -> dict[str, float]:
    """Numbers of an object by their names, those of objects within it behind a dot."""

    def flat(values: Any, before: str) -> Iterator[tuple[str, float]]:
        for name, value in values.items() if isinstance(values, dict) else ():
            if type(value) in (int, float):
                yield before + name, value
            yield from flat(value, f"{before}{name}.")

    try:
        return dict(flat(json.loads(text), ""))
    except (ValueError, RecursionError):
        return {}


#: Seconds between two reads of a fast source, between two looks at what was read, and of silence
#: after which a line is whole.
_PAUSE: Final = 0.002
TICK: Final = 0.05
#: Seconds between two times at least: those of a run differ.
_STEP: Final = 1e-6
#: Bytes of a line, and lines that are looked at for their layout.
_LOOKED_AT: Final = 200


class Rows(NamedTuple):
    """Rows of one source, shape (n, columns), and the seconds of their arrival."""

    values: Array
    time: Array

    def at(self, places: Any) -> Rows:
        """Those at some places: numbers or truth values."""
        return Rows(self.values[places], self.time[places])

    def followed_by(self, later: Rows) -> Rows:
        """These and later ones."""
        if not self.time.size:
            return later
        return Rows(*(np.concatenate(pair) for pair in zip(self, later, strict=True)))


class Arrivals:
    """What arrives from a source, in rows; a thread reads so that a slow disk loses nothing.

    Parameters
    ----------
    address : str
        See `trueangle.recording.sources.open_source`.
    options : SourceOptions
        With the pattern of its lines.
    start : float
        Of the clock (`time.monotonic`) from which seconds count.

    Attributes
    ----------
    rejected : list of bytes
        Lines that are no rows, until they are taken.
    problem : OSError or None
        What ended the source, where it did not end by itself.
    """

    def __init__(self, address: str, options: SourceOptions, start: float) -> None:
        self.layout = None if options.pattern is None else layout_of_pattern(options.pattern)
        self._source = source = open_source(address, options)
        if source.names:
            self.layout = layout_of_columns("CSV", source.names)
        self.rejected: list[bytes] = []
        self.problem: OSError | None = None
        self._start = start
        self._opened, self._before = time.monotonic() - start, math.nan
        self._read: deque[tuple[float, bytes]] = deque()
        self._lines: list[bytes] = []
        self._times: list[float] = []
        self._tail, self._is_cut = b"", False
        self._intervals = np.zeros(3)  # lines, and sums of their intervals and squares
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """The source has ended; what it gave can be taken."""
        return not self._thread.is_alive()

    @property
    def is_behind(self) -> bool:
        """More has been read than one look takes."""
        return bool(self._read)

    @property
    def jitter(self) -> float:
        """Standard deviation of a time of arrival, seconds, were the lines sent evenly."""
        count, total, squares = self._intervals.tolist()
        spread = squares / count - (total / count) ** 2 if count > 1 else math.nan
        return math.sqrt(max(spread, 0.0) / 2.0)

    def close(self) -> None:
        """Stop reading; what has been read can still be taken."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join(2.0)
            self._source.close()

    def _work(self) -> None:
        before = 0.0
        try:
            while not self._stopped.is_set() and (data := self._source.read()) is not None:
                now = time.monotonic()
                if data:
                    self._read.append((now - self._start, data))
                    if now - before < 2.0 * _PAUSE:  # many lines in one read are cheaper
                        time.sleep(_PAUSE)
                    before = now
        except OSError as error:
            self.problem = error

    def look(self) -> bool:
        """Take lines apart that have arrived; whether their layout is known by now."""
        over = self.is_over
        # Lines that are taken at once: memory does not depend on pauses of this program.
        while self._read and len(self._lines) < 1024:
            self._split(*self._read.popleft())
        if over and not self._read and self._tail and not self._stopped.is_set():
            self.rejected.append(self._tail)  # no line: it was not ended
            self._tail = b""
        if self.layout is None and self._lines:
            waited = time.monotonic() - self._start - self._times[0]
            # Seconds after which a layout is found by the lines there are.
            self.layout = layout_of(self._lines[:_LOOKED_AT], over or waited > 0.2)
            if self.layout is None and (over or len(self._lines) > _LOOKED_AT):
                gone = len(self._lines) - (0 if over else _LOOKED_AT // 2)
                self.rejected += self._lines[:gone]  # the oldest are not looked at again
                del self._lines[:gone], self._times[:gone]
        return self.layout is not None

    def _split(self, now: float, data: bytes) -> None:
        """Take lines apart, and give each its time.

        Of several in one read the last came now, the others evenly since the read before, at the
        mean interval at most.
        """
        if math.isnan(self._before):
            # After such a silence a line is whole.
            self._is_cut = self._source.midway and now - self._opened < 0.02
            self._before = now
        data = (self._tail + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        *lines, self._tail = data.split(b"\n")
        # A line that long is none.
        if len(self._tail) > 4096:
            lines, self._tail = [*lines, self._tail], b""
        if lines and self._is_cut:
            self.rejected.append(lines.pop(0))
            self._is_cut = False
        if not lines:
            return
        gap, n, (count, total, _) = now - self._before, len(lines), self._intervals
        step = min(gap / n, total / count if count else gap)
        if gap > 0.0:
            self._intervals += n, gap, (n - 1) * step**2 + (gap - (n - 1) * step) ** 2
        step, self._before = max(step, _STEP), max(now, self._before + n * _STEP)
        self._lines += lines
        self._times += [self._before - i * step for i in reversed(range(n))]

    def take(self) -> Rows:
        """Rows that arrived until the last look, whose layout is known."""
        assert self.layout is not None
        lines, rows = self._lines, Rows(self.layout.values(self._lines), np.array(self._times))
        self._lines, self._times = [], []
        good = np.isfinite(rows.values).all(axis=1)
        wrong = [lines[i] for i in np.flatnonzero(~good)]
        self.rejected += [x for x in wrong if x.strip() not in (b"", self.layout.header)]
        return rows.at(good)
