"""EPICS logs as ``camonitor`` prints them: a process variable, its time stamp and its value a line.

A row is one line: the time, the value of the variable that changed, and nothing of the others.
Text variables (states, names) may appear between them; waveforms and enumerations begin with their
number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import FileError
from .csvcells import cell_number as read_number
from .format import Batch, Contents, CopyTask, Selection
from .textfile import open_text

#: Name, date, time, value; what follows (alarms) is of no concern.
LINE = re.compile(rb"(\S+)\s+(\d{4}-\d\d-\d\d)\s(\d\d:\d\d:\d\d(?:\.\d{1,9})?)\s+(\S+)")
_TIME = "time_s"
#: Lines taken together.
_BLOCK = 1 << 16
#: Times count from here: a later start keeps more digits of a second.
_EPOCH = np.datetime64("2000-01-01T00:00:00", "ns")


def columns(path: Path, topic: str | None = None) -> list[str]:
    """The time and the variables that begin with a number, in the order in which they come."""
    names: dict[str, bool] = {}
    for name, _stamp, value, _line in _lines(path):
        names.setdefault(name, isinstance(value, float))
    return [_TIME, *(name for name, is_number in names.items() if is_number)]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns in batches, NaN where another variable changed; see `format.FormatModule`."""
    lines = (line for line in _lines(path) if line[0] in wanted.names or wanted.names == [_TIME])
    while block := [line for _, line in zip(range(_BLOCK), lines, strict=False)]:
        found, stamps, values, places = zip(*block, strict=True)
        bad = next((i for i, value in enumerate(values) if isinstance(value, str)), None)
        if bad is not None and found[bad] in wanted.names:
            problem = f"a number is needed, got {values[bad][:60]!r}"
            raise FileError(path, problem, line=places[bad], column=found[bad])
        number = np.array([np.nan if isinstance(value, str) else value for value in values])
        name_of = np.array(found, dtype=object)
        times = (np.array(stamps, dtype="datetime64[ns]") - _EPOCH) / np.timedelta64(1, "s")
        yield {
            name: times if name == _TIME else np.where(name_of == name, number, np.nan)
            for name in wanted.names
        }


def copy(task: CopyTask) -> Contents:
    """Refused: a line has no room for another column."""
    raise FileError(
        task.source,
        "a log of camonitor cannot hold corrected angles; join it to a "
        "table first (`ta.join(...)`), or correct the joined runs",
    )


def contents(path: Path, topic: str | None = None) -> Contents:
    """Readings; nothing is ever added to be summed up."""
    return Contents(sum(1 for _ in _lines(path)), {})


def _lines(path: Path) -> Iterator[tuple[str, str, float | str, int]]:
    """Variable, time stamp, value and number of every line; blank and lost ones pass."""
    with open_text(path) as file:
        number = 0
        # Longest line that is read.
        while line := file.readline(1 << 16):
            number += 1
            if not line.strip() or line.startswith(b"#") or b"***" in line:
                continue
            found = LINE.match(line)
            try:
                name, date, clock, text = (part.decode() for part in found.groups())  # type: ignore[union-attr]
                stamp = f"{date}T{clock}"
                np.datetime64(stamp)
            except (AttributeError, ValueError):
                got = line.decode("utf-8", "replace").strip()[:60]
                problem = f"a variable, date, time and value are needed, got {got!r}"
                raise FileError(path, problem, line=number) from None
            plain = read_number(text, ".")
            yield name, stamp, text if plain is None else plain, number
