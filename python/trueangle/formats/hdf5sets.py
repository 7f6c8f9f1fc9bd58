"""Data sets of an HDF5 file: whether their values may be read, and stretches of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from . import budget
from .format import check_lengths, row_labels
from .hdf5filters import check_filters

#: Places of HDF5's table of chunks in memory; a prime.
_SLOTS = 521
#: Share of a data set beyond the budget that must be stored.
_LEAST_STORED = 0.5


def data_sets(path: Path, file: h5py.File, names: Sequence[str]) -> dict[str, h5py.Dataset]:
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
    if is_elsewhere(data):
        raise _elsewhere(path, name)
    _check_stored(path, data, name)
    return data


def is_elsewhere(data: h5py.Dataset) -> bool:
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


def cached(file: h5py.File, name: str) -> h5py.Dataset:
    """A data set that keeps its last chunk where chunks are packed, and none where they are not.

    HDF5 itself keeps chunks of up to 1 MB: it would copy small ones once more on their way, and
    unpack larger ones again for every block that takes a part of them.
    """
    data = file[name]
    if is_elsewhere(data):  # which a note may name
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


def is_number(data: h5py.Dataset) -> bool:
    """Whether it holds numbers."""
    return data.dtype.kind in "fiu"


def is_number_or_text(data: h5py.Dataset) -> bool:
    """Whether `part` reads it: numbers, or texts of a fixed or any length."""
    return is_number(data) or h5py.check_string_dtype(data.dtype) is not None


def part(data: h5py.Dataset, start: int, stop: int) -> Any:
    """A segment of a vector: numbers in the byte order of this machine, or labels."""
    values: NDArray[Any] = data[_place(data, start, stop)].reshape(-1)
    if not is_number(data):
        return row_labels(values.tolist())
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def put(data: h5py.Dataset, start: int, stop: int, values: NDArray[Any]) -> None:
    """Write a stretch of a vector, in whatever direction it lies."""
    place = _place(data, start, stop)
    shape = tuple(
        stop - start if s.start is not None else n for s, n in zip(place, data.shape, strict=True)
    )
    data[place] = values.reshape(shape)
