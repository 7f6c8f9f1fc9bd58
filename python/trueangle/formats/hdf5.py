"""HDF5 and MATLAB v7.3 logs: the file is copied whole and corrected data sets are added."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from . import budget
from .budget import FileExtent
from .checksum import Checksum
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection, check_lengths, note
from .hdf5filters import check_filters
from .hdf5places import Hdf5Places
from .stored import ROWS

#: Readings taken together: what is read of them stays in the cache of the processor.
_BLOCK = 1 << 17
#: Rows of a part that is read on its own, and parts at most: each opens the file.
_PART, _MOST_PARTS = 1 << 20, 64
#: A multiple of so many parts, where there are as many: two or four threads end together.
_EVEN = 4
#: Places of HDF5's table of chunks in memory; a prime.
_SLOTS = 521
#: Share of a data set beyond the budget that must be stored.
_LEAST_STORED = 0.5
#: Attribute of a corrected data set that says how it was made.
_ATTRIBUTE = "trueangle"


class RowRange(NamedTuple):
    """One of so many parts of every data set, in their order."""

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
    """Paths of all data sets of numbers, without the leading slash."""
    with _opened(path) as file:
        return _names(file)


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
        sets = _data_sets(path, file, wanted.names)
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
        packed = {name: _cached(file, name) for name in wanted.names}
        for start in rows[::_BLOCK]:
            stop = min(start + _BLOCK, rows.stop)
            yield {name: _part(data, start, stop) for name, data in packed.items()}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected data sets; see `format.FormatModule`."""
    with _opened(task.source) as file:  # refuse what cannot be corrected before it is copied
        channels = task.choose(_names(file))
        for channel in channels:
            _data_sets(task.source, file, [channel.column, *channel.signals.values()])
        total = max(sum(file[channel.column].size for channel in channels), 1)
    shutil.copyfile(task.source, task.target)
    before = contents(task.source)  # an earlier correction, of another joint
    rows, done = before.rows, 0
    sums: dict[str, Checksum] = {}
    with _opened(task.target, "r+") as file:
        for channel in channels:
            indicated = _cached(file, channel.column)
            used = {signal: _cached(file, name) for signal, name in channel.signals.items()}
            _create_like(file, indicated, channel)
            corrected = _cached(file, channel.added)
            checks = [sums.setdefault(name, Checksum()) for name in (channel.column, channel.added)]
            for start in range(0, indicated.size, _BLOCK):
                stop = min(start + _BLOCK, indicated.size)
                given = _part(indicated, start, stop)
                signals = {signal: _part(data, start, stop) for signal, data in used.items()}
                # Numbers of 16 bits are corrected to 32, and kept in 64.
                after = channel.correct(given, signals).astype(corrected.dtype, copy=False)
                _put(corrected, start, stop, after)
                for check, values in zip(checks, (given, after), strict=True):
                    check.update(values)
                done += stop - start
                task.watch(stop - start, done / total)
            rows = max(rows, indicated.size)
    texts = {name: found.text() for name, found in sums.items()}
    return Contents(rows, {**before.checksums, **texts})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksums of the corrected data sets and their sources as they read back."""
    rows = 0
    sums: dict[str, Checksum] = {}
    with _opened(path) as file:
        corrected = [name for name in _names(file) if _ATTRIBUTE in file[name].attrs]
        sources = [_source_of(file[name]) for name in corrected]
        for name in dict.fromkeys([*sources, *corrected]):
            data = _cached(file, name)
            found = sums[name] = Checksum()
            for start in range(0, data.size, _BLOCK):
                found.update(_part(data, start, min(start + _BLOCK, data.size)))
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
            and not _is_elsewhere(file[name])
        ]


@contextmanager
def _opened(path: Path, mode: str = "r") -> Iterator[h5py.File]:
    """The file, its errors told with its name."""
    hint = "; MATLAB saves HDF5 with -v7.3 only" if path.suffix == ".mat" else ""
    with damage_told(path, "HDF5", hint):
        try:
            with h5py.File(path, mode) as file:
                yield file
        except (OSError, RuntimeError) as cause:  # the library tells of a full disk in words
            if "errno = 28" in str(cause) or getattr(cause, "errno", None) == errno.ENOSPC:
                raise _disk_full(path) from None
            if isinstance(cause, OSError) and path.is_file():
                raise OSError(_first_line(cause)) from None
            raise


def _disk_full(path: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


def _names(file: h5py.File) -> list[str]:
    found: list[str] = []

    def visit(name: str | bytes, item: Any) -> None:
        if isinstance(name, bytes):  # it is no text, and nobody can ask for it
            return
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu" and item.ndim:
            found.append(name)

    file.visititems(visit)
    return found


def _data_sets(path: Path, file: h5py.File, names: Sequence[str]) -> dict[str, h5py.Dataset]:
    """Data sets that belong together."""
    sets = {name: _data_set(path, file, name) for name in names}
    check_lengths(path, "data sets", {name: data.size for name, data in sets.items()})
    return sets


def _data_set(path: Path, file: h5py.File, name: str) -> h5py.Dataset:
    data = file[name]
    if max(data.shape, default=0) != data.size:
        raise FileError(
            path, f"one angle after the other is needed, its shape is {data.shape}", column=name
        )
    if _is_elsewhere(data):
        raise _elsewhere(path, name)
    _check_stored(path, data, name)
    return data


def _is_elsewhere(data: h5py.Dataset) -> bool:
    """Whether its values are those of other data sets or files.

    The library follows such a chain without an end where it leads back to itself, until the
    process ends; nothing is asked of its values before this.
    """
    return bool(data.is_virtual or data.external)


def _elsewhere(path: Path, name: str) -> FileError:
    return FileError(
        path,
        "its values are in other data sets or files (a virtual or external data set), which are "
        "not followed; write them into this file (h5repack, or h5py with its values)",
        column=name,
    )


def _check_stored(path: Path, data: h5py.Dataset, name: str) -> None:
    """Refuse a large data set that is hardly stored: all else of it is filled in.

    A file of kilobytes can call for terabytes of nothing, which a copy would write out.
    """
    size = int(data.size) * data.dtype.itemsize
    if data.chunks is None:
        share = 1.0 if data.id.get_storage_size() else 0.0
    else:
        budget.check_part(path, math.prod(data.chunks) * data.dtype.itemsize, "chunk", name)
        check_filters(path, data, name)
        most = math.prod(-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True))
        share = data.id.get_num_chunks() / most if size > budget.DECODED_BYTES else 1.0
    if size > budget.DECODED_BYTES and share < _LEAST_STORED:
        raise FileError(
            path,
            f"says to hold {data.size} values, but {100.0 * share:.2g} % of them are stored, the "
            "others are filled in; write it with all of its values",
            column=name,
        )


def _cached(file: h5py.File, name: str) -> h5py.Dataset:
    """A data set that keeps its last chunk where chunks are packed, and none where they are not.

    HDF5 itself keeps chunks of up to 1 MB: it would copy small ones once more on their way, and
    unpack larger ones again for every block that takes a part of them.
    """
    data = file[name]
    if _is_elsewhere(data):  # which a note may name
        raise _elsewhere(Path(file.filename), name)
    if data.chunks is None:
        return data
    check_filters(Path(file.filename), data, name)
    chunk = math.prod(data.chunks) * data.dtype.itemsize
    packed = data.id.get_create_plist().get_nfilters() > 0
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    access.set_chunk_cache(_SLOTS, chunk if packed else 0, 1.0)
    del data  # one that is open keeps the cache that it has
    return h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access))


def _place(data: h5py.Dataset, start: int, stop: int) -> tuple[slice, ...]:
    """Selection of a stretch of a vector, also of one stored as 1 x n or n x 1 (MATLAB)."""
    along = int(np.argmax(data.shape))
    return tuple(slice(start, stop) if i == along else slice(None) for i in range(data.ndim))


def _part(data: h5py.Dataset, start: int, stop: int) -> NDArray[Any]:
    values: NDArray[Any] = data[_place(data, start, stop)].reshape(-1)
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _put(data: h5py.Dataset, start: int, stop: int, values: NDArray[Any]) -> None:
    place = _place(data, start, stop)
    shape = tuple(
        stop - start if s.start is not None else n for s, n in zip(place, data.shape, strict=True)
    )
    data[place] = values.reshape(shape)


def _create_like(file: h5py.File, indicated: h5py.Dataset, channel: Addition) -> None:
    """Make an empty data set beside ``indicated``, laid out and compressed like it."""
    kind = (
        np.float32
        if indicated.dtype.kind == "f" and indicated.dtype.itemsize == 4
        else (np.float64)
    )
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
        made.attrs["MATLAB_class"] = np.bytes_("single" if kind is np.float32 else "double")
    for name in ("units", "DIMENSION_LABELS"):
        if name in indicated.attrs:
            made.attrs[name] = indicated.attrs[name]
    made.attrs[_ATTRIBUTE] = note([channel])


def _source_of(corrected: h5py.Dataset) -> str:
    (entry,) = json.loads(corrected.attrs[_ATTRIBUTE])["corrected"]
    name: str = entry["from"]
    return name
