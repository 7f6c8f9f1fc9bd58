"""HDF5 and MATLAB v7.3 logs: the file is copied whole and corrected data sets are added."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from ..support.deadline import put_off_ending
from .budget import FileExtent
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection, note
from .hdf5sets import (
    Hdf5Places,
    cached,
    data_sets,
    is_elsewhere,
    is_number,
    is_number_or_text,
    part,
    put,
)
from .stored import ROWS, Checksum

#: Readings taken together: what is read of them stays in the cache of the processor.
_BLOCK = 1 << 17
#: Rows of a part that is read on its own, and parts at most: each opens the file.
_PART, _MOST_PARTS = 1 << 20, 64
#: The number of parts is a multiple of this, if it is that large: 2 or 4 threads end together.
_EVEN = 4
#: Attribute of a corrected data set that records how it was made.
_ATTRIBUTE = "trueangle"


class RowRange(NamedTuple):
    """One of ``parts`` parts of every data set, in their order."""

    number: int
    parts: int

    def rows(self, size: int, sets: Iterable[h5py.Dataset]) -> range:
        """Its rows: whole chunks, where there are as many, which are unpacked once."""
        chunk = max((max(data.chunks or (1,)) for data in sets), default=1)
        chunks = -(-size // chunk)
        # Rounded up: of fewer chunks than parts the first part has one.
        edges = (-(-chunks * k // self.parts) * chunk for k in (self.number, self.number + 1))
        return range(size)[slice(*edges)]


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Paths of all data sets of numbers and texts, without the leading slash."""
    with _opened(path) as file:
        return _names(file)


def unread(path: Path) -> list[str]:
    """Paths of the other data sets; see `format.FormatModule`."""
    with _opened(path) as file:
        return _names(file, lambda data: not is_number_or_text(data))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of data sets; see `format.FormatModule`."""
    with _opened(path) as file:
        rows = [int(file[name].size) for name in names or _names(file)]
        size = sum(int(file[name].size) * max(file[name].dtype.itemsize, 8) for name in names)
    return FileExtent(max(rows, default=0), size)


def stretches(path: Path) -> list[RowRange | None]:
    """Parts of the data sets; HDF5 reads one at a time, while others are worked on."""
    with _opened(path) as file:
        size = max((file[name].size for name in _names(file)), default=0)
    parts = min(size // _PART, _MOST_PARTS)
    parts -= parts % _EVEN if parts > _EVEN else 0
    return [RowRange(i, parts) for i in range(parts)] or [None]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Data sets ``names`` in batches; see `format.FormatModule`."""
    with _opened(path) as file:
        sets = data_sets(path, file, wanted.names)
        size = next(iter(sets.values())).size if sets else 0
        stretch: RowRange | None = wanted.stretch
        rows = range(size) if stretch is None else stretch.rows(size, sets.values())
        found = {name: Hdf5Places.of(data, rows) for name, data in sets.items()}
        places = {name: data for name, data in found.items() if data is not None}
        if len(places) == len(sets):
            with path.open("rb", buffering=0) as raw:
                for start in rows[::ROWS]:
                    stop = min(start + ROWS, rows.stop)
                    yield {name: data.read(raw, start, stop) for name, data in places.items()}
            return
        sets.clear()  # a data set that is open keeps the cache that it has
        packed = {name: cached(file, name) for name in wanted.names}
        for start in rows[::_BLOCK]:
            stop = min(start + _BLOCK, rows.stop)
            yield {name: part(data, start, stop) for name, data in packed.items()}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected data sets; see `format.FormatModule`."""
    with _opened(task.source) as file:  # refuse what cannot be corrected before it is copied
        channels = task.choose(_names(file, is_number))
        for channel in channels:
            data_sets(task.source, file, [channel.column, *channel.signals.values()])
        total = max(sum(file[channel.column].size for channel in channels), 1)
    shutil.copyfile(task.source, task.target)
    before = contents(task.source)  # an earlier correction, of another joint
    rows, done = before.rows, 0
    sums: dict[str, Checksum] = {}
    # HDF5 that an interrupt leaves in the middle of a write ends the process with a fault.
    with (
        put_off_ending() as stopped,
        _WrittenFile(task.target, "r+b") as output,
        _opened(task.target, output) as file,
    ):
        for channel in channels:
            indicated = cached(file, channel.column)
            used = {signal: cached(file, name) for signal, name in channel.signals.items()}
            _create_like(file, indicated, channel)
            corrected = cached(file, channel.added)
            checks = [sums.setdefault(name, Checksum()) for name in (channel.column, channel.added)]
            for start in range(0, indicated.size, _BLOCK):
                stop = min(start + _BLOCK, indicated.size)
                given = part(indicated, start, stop)
                signals = {signal: part(data, start, stop) for signal, data in used.items()}
                # Numbers of 16 bits are corrected to 32, and kept in 64.
                after = channel.correct(given, signals).astype(corrected.dtype, copy=False)
                put(corrected, start, stop, after)
                output.check()
                if stopped():
                    raise KeyboardInterrupt
                for check, values in zip(checks, (given, after), strict=True):
                    check.update(values)
                done += stop - start
                task.watch(stop - start, done / total)
            rows = max(rows, indicated.size)
    output.check()
    texts = {name: found.text() for name, found in sums.items()}
    return Contents(rows, {**before.checksums, **texts})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksums of the corrected data sets and their sources as they read back."""
    rows = 0
    sums: dict[str, Checksum] = {}
    with _opened(path) as file:
        notes = {name: _text(file[name], _ATTRIBUTE) for name in _names(file)}
        corrected = [name for name, told in notes.items() if told is not None]
        sources = [_source_of(notes[name]) for name in corrected]
        for name in dict.fromkeys([*sources, *corrected]):
            data = cached(file, name)
            found = sums[name] = Checksum()
            for start in range(0, data.size, _BLOCK):
                found.update(part(data, start, min(start + _BLOCK, data.size)))
            rows = max(rows, data.size)
    return Contents(rows, {name: found.text() for name, found in sums.items()})


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are as long as the data sets ``needed``."""
    with _opened(path) as file:
        sizes = {file[name].size for name in needed}
        return [
            name
            for name in others
            if file[name].size in sizes
            and max(file[name].shape) == file[name].size
            and not is_elsewhere(file[name])
        ]


@contextmanager
def _opened(path: Path, output: _WrittenFile | None = None) -> Iterator[h5py.File]:
    """The file, to be read or written, its errors reported with its name."""
    hint = "; MATLAB saves HDF5 with -v7.3 only" if path.suffix == ".mat" else ""
    with damage_told(path, "HDF5", hint):
        try:
            with h5py.File(output or path, "r+" if output else "r") as file:
                yield file
        except OSError as cause:
            if path.is_file() and output is None:
                raise OSError(str(cause).partition("\n")[0]) from None
            raise


class _WrittenFile(io.FileIO):
    """A file that HDF5 can always close: over one that it cannot it ends the process.

    The first failure to write is kept, and what comes after it goes nowhere; so does what comes
    after an interrupt has closed the file, as h5py keeps HDF5's own open until its last reference.
    """

    failure: OSError | None = None

    def __repr__(self) -> str:
        return str(self.name)

    def seek(self, *place: int) -> int:
        return 0 if self.closed else super().seek(*place)

    def write(self, data: Any) -> int:
        rest = memoryview(data)
        try:
            while rest and self.failure is None and not self.closed:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.failure = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        return 0 if self.closed else super().truncate(size)

    def flush(self) -> None:
        """Nothing waits to be written."""

    def check(self) -> None:
        """Raise the failure, if there was one."""
        if self.failure is not None:
            raise self.failure


def _names(
    file: h5py.File, is_wanted: Callable[[h5py.Dataset], bool] = is_number_or_text
) -> list[str]:
    found: list[str] = []

    def visit(name: str | bytes, item: Any) -> None:
        # A name of bytes is not a text, and cannot be requested.
        is_named = isinstance(name, str) and isinstance(item, h5py.Dataset)
        if is_named and item.ndim and is_wanted(item):
            found.append(str(name))

    file.visititems(visit)
    return found


def _create_like(file: h5py.File, indicated: h5py.Dataset, channel: Addition) -> None:
    """Make an empty data set next to ``indicated``, laid out and compressed like it."""
    is_single = indicated.dtype.kind == "f" and indicated.dtype.itemsize == 4
    kind = np.float32 if is_single else np.float64
    made = file.create_dataset(
        channel.added,
        indicated.shape,
        kind,
        maxshape=indicated.maxshape if indicated.chunks else None,
        chunks=indicated.chunks,
        compression=indicated.compression,
        compression_opts=indicated.compression_opts,
        shuffle=indicated.shuffle or None,
        fletcher32=indicated.fletcher32 or None,
    )
    if "MATLAB_class" in indicated.attrs:
        made.attrs["MATLAB_class"] = np.bytes_("single" if is_single else "double")
    for name in ("units", "DIMENSION_LABELS"):
        told = _text(indicated, name)
        if told is not None:
            made.attrs[name] = told
    made.attrs[_ATTRIBUTE] = note([channel])


def _text(data: h5py.Dataset, attribute: str) -> Any | None:
    """The value of an attribute, one or more texts; None where it is something else.

    Of values that are no text the library may end the process where the file is damaged.
    """
    if attribute not in data.attrs:
        return None
    kind = data.attrs.get_id(attribute).get_type()
    return data.attrs[attribute] if kind.get_class() == h5py.h5t.STRING else None


def _source_of(told: Any) -> str:
    (entry,) = json.loads(told)["corrected"]
    name: str = entry["from"]
    return name
