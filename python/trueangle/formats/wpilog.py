"""Data logs of FRC robots (WPILOG): entries by name, each with its own time stamps.

A row is one time: values of what was recorded then, and nothing of the others. Copies get a
further entry at the end. Format: WPILib Data Log File Format Specification, version 1.0
(wpiutil/doc/datalog.adoc of https://github.com/wpilibsuite/allwpilib).
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .budget import FileExtent, check_part
from .format import Batch, Contents, CopyTask, Selection, note

_TIME = "time_s"
_MAGIC = b"WPILOG"
#: Types of entries that are numbers.
_KINDS = {"double": "<f8", "float": "<f4", "int64": "<i8", "boolean": "?"}
_ELEMENT = re.compile(r"(.*)\[(\d+)\]", re.DOTALL)
_STAMP = np.dtype("<i8")
#: Control records.
_START, _FINISH = 0, 1


@dataclass
class _WpiChannel:
    """A channel: its type, and where its records are."""

    name: str
    kind: str
    times: list[int] = field(default_factory=list)
    places: list[tuple[int, int]] = field(default_factory=list)


class _Records(NamedTuple):
    """A file taken apart."""

    data: bytes
    entries: dict[str, _WpiChannel]
    numbers: set[int]


def columns(path: Path, topic: str | None = None) -> list[str]:
    """The time and the entries of numbers, elements of arrays as ``name[0]``."""
    return [_TIME, *_names(_opened(path))]


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Records of numbers and bytes of columns; see `format.FormatModule`."""
    log = _opened(path)
    asked = {_entry_of(log, name)[0].name for name in names if name != _TIME} or log.entries
    rows = sum(len(log.entries[name].times) for name in asked)
    return FileExtent(rows, 8 * rows * len(names))


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns as one batch, NaN where an entry has no record; see `format.FormatModule`."""
    log = _opened(path)
    series = {name: _series(path, log, name) for name in wanted.names if name != _TIME}
    if not series:
        series = {name: _series(path, log, name) for name in _names(log)}
    times = np.unique(np.concatenate([np.empty(0, _STAMP), *(own for own, _ in series.values())]))
    found: Batch = {}
    for name in wanted.names:
        if name == _TIME:
            found[name] = times * 1e-6
            continue
        own, values = series[name]
        column = np.full(times.size, np.nan)
        column[np.searchsorted(times, own)] = values
        found[name] = column
    yield found


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with an entry of corrected angles at the end; see `format.FormatModule`."""
    log = _opened(task.source)
    additions = task.choose([_TIME, *_names(log)])
    parts, rows = [log.data], sum(len(entry.times) for entry in log.entries.values())
    number = max(log.numbers, default=0)
    for addition in additions:
        number += 1
        times, values = _series(task.source, log, addition.column)
        signals = {s: _at(task.source, log, name, times) for s, name in addition.signals.items()}
        after = addition.correct(values, signals).astype("<f8")
        first = int(times[0]) if times.size else 0
        parts.append(_started(number, addition.added, note([addition]), first))
        for time, value in zip(times.tolist(), after.tolist(), strict=True):
            parts.append(_record(number, time, struct.pack("<d", value)))
        rows += times.size
        task.watch(times.size, 1.0)
    data = b"".join(parts)
    task.target.write_bytes(data)
    return Contents(rows, {"bytes": f"{zlib.crc32(data):08x}"})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Records of numbers, and a checksum of all bytes."""
    log = _opened(path)
    rows = sum(len(entry.times) for entry in log.entries.values())
    return Contents(rows, {"bytes": f"{zlib.crc32(log.data):08x}"})


def _opened(path: Path) -> _Records:
    """Entries of numbers and where their records are.

    Raises
    ------
    FileError
        Damage, reported with the byte of the record; a file without entries of numbers.
    """
    check_part(path, path.stat().st_size, "file")
    data = path.read_bytes()
    if len(data) < 12 or not data.startswith(_MAGIC):
        raise FileError(path, "is not a data log of WPILib")
    if data[7] != 1:
        raise FileError(path, f"is a data log of version {data[7]}.{data[6]}; version 1 is read")
    place = 12 + int.from_bytes(data[8:12], "little")
    entries: dict[str, _WpiChannel] = {}
    started: dict[int, _WpiChannel | None] = {}
    numbers: set[int] = set()
    size = len(data)
    while place < size:
        lengths = data[place]
        id_end = place + 2 + (lengths & 3)
        size_end = id_end + 1 + (lengths >> 2 & 3)
        begin = size_end + 1 + (lengths >> 4 & 7)
        number = int.from_bytes(data[place + 1 : id_end], "little")
        end = begin + int.from_bytes(data[id_end:size_end], "little")
        if end > size or lengths & 128:
            raise FileError(path, f"is damaged: the record at byte {place} goes beyond its end")
        if number == 0:
            _control(path, data[begin:end], started, entries, numbers, place)
        else:
            if number not in started:
                raise FileError(
                    path, f"is damaged: the record at byte {place} is of an entry never started"
                )
            entry = started[number]
            if entry is not None:
                time = int.from_bytes(data[size_end:begin], "little")
                # Microseconds: of a time beyond them a signed number of eight bytes has no room.
                if time >= 1 << 63:
                    raise FileError(
                        path, f"is damaged: the record at byte {place} is of the time {time} us"
                    )
                entry.times.append(time)
                entry.places.append((begin, end))
        place = end
    return _Records(data, entries, numbers)


def _control(
    path: Path,
    data: bytes,
    started: dict[int, _WpiChannel | None],
    entries: dict[str, _WpiChannel],
    numbers: set[int],
    place: int,
) -> None:
    """Take in a control record; entries that are no numbers are started as None."""
    if len(data) < 5:
        raise FileError(path, f"is damaged: the control record at byte {place} is cut short")
    number = int.from_bytes(data[1:5], "little")
    if data[0] == _FINISH:
        started.pop(number, None)
    if data[0] != _START:
        return
    texts, at = [], 5
    for _ in range(3):
        length = int.from_bytes(data[at : at + 4], "little")
        if at + 4 + length > len(data):
            raise FileError(path, f"is damaged: the control record at byte {place} is cut short")
        texts.append(data[at + 4 : at + 4 + length].decode("utf-8", "replace"))
        at += 4 + length
    name, kind, _metadata = texts
    numbers.add(number)
    if kind.removesuffix("[]") not in _KINDS:
        started[number] = None
        return
    entry = entries.setdefault(name, _WpiChannel(name, kind))
    if entry.kind != kind:
        raise FileError(
            path, f"is started as {entry.kind} and as {kind} again at byte {place}", column=name
        )
    started[number] = entry


def _names(log: _Records) -> list[str]:
    """Columns of the entries with records; arrays by the length of their first."""
    found: list[str] = []
    for name, entry in log.entries.items():
        if not entry.kind.endswith("[]"):
            found.append(name)
        elif entry.places:
            begin, end = entry.places[0]
            width = np.dtype(_KINDS[entry.kind[:-2]]).itemsize
            found += [f"{name}[{i}]" for i in range(min((end - begin) // width, 256))]
    return found


def _entry_of(log: _Records, name: str) -> tuple[_WpiChannel, int]:
    """The entry of a column, and the place in its array."""
    if name in log.entries and not log.entries[name].kind.endswith("[]"):
        return log.entries[name], 0
    found = _ELEMENT.fullmatch(name)
    assert found is not None  # `columns` lists no other
    return log.entries[found[1]], int(found[2])


def _series(path: Path, log: _Records, name: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Times in microseconds and values of a column, in the order of time."""
    entry, element = _entry_of(log, name)
    kind = np.dtype(_KINDS[entry.kind.removesuffix("[]")])
    offset = element * kind.itemsize
    values = np.full(len(entry.places), np.nan)
    for i, (begin, end) in enumerate(entry.places):
        if begin + offset + kind.itemsize > end:
            problem = f"the record at byte {begin} holds {end - begin} bytes only"
            if not entry.kind.endswith("[]"):
                raise FileError(path, problem, column=name)
            continue  # a shorter array has no such element
        values[i] = np.frombuffer(log.data, kind, 1, begin + offset)[0]
    times = np.array(entry.times, dtype=_STAMP)
    order = np.argsort(times, kind="stable")
    # Of records at one time the last one counts.
    kept = np.append(np.diff(times[order]) != 0, True) if times.size else order
    return times[order][kept], values[order][kept]


def _at(path: Path, log: _Records, name: str, times: NDArray[np.int64]) -> NDArray[np.float64]:
    """Values of a column that hold at some times: the last before each."""
    if name == _TIME:
        return np.asarray(times * 1e-6, dtype=np.float64)
    own, values = _series(path, log, name)
    place = np.searchsorted(own, times, side="right") - 1
    found = np.full(times.size, np.nan)
    found[place >= 0] = values[place[place >= 0]]
    return found


def _started(number: int, name: str, metadata: str, time: int) -> bytes:
    """A control record that starts an entry of numbers."""
    texts = b"".join(
        struct.pack("<I", len(text.encode())) + text.encode() for text in (name, "double", metadata)
    )
    return _record(0, time, bytes([_START]) + struct.pack("<I", number) + texts)


def _record(number: int, time: int, payload: bytes) -> bytes:
    """A record with the shortest header."""
    fields = [
        value.to_bytes(max(1, (value.bit_length() + 7) // 8), "little")
        for value in (number, len(payload), time)
    ]
    lengths = sum((len(f) - 1) << shift for f, shift in zip(fields, (0, 2, 4), strict=True))
    return bytes([lengths]) + b"".join(fields) + payload
