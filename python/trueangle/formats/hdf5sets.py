"""Data sets of an HDF5 file: whether and where their values may be read, and segments of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from io import FileIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from . import budget
from .format import check_lengths, row_labels
from .stored import stored_values

_NBIT: Final = 5
_SCALE_OFFSET: Final = 6
#: Parameters of a plain number: their count, whether nothing is packed, values in a chunk, its
#: class, bytes, order, bits and the first of them.
_PLAIN: Final = 8
_NUMBER: Final = 1


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

    Where such a chain leads back to itself the library follows it until the process ends. So
    this is tested before anything is read from the values.
    """
    return bool(data.is_virtual or data.external)


def _elsewhere(path: Path, name: str) -> FileError:
    return FileError(
        path,
        "its values are in other data sets or files (a virtual or external data set), "
        "which are not read. Write them into this file (h5repack or h5py)",
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
        _check_filters(path, data, name)
        most = math.prod(-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True))
        share = data.id.get_num_chunks() / most if size > budget.DECODED_BYTES else 1.0
    # Share of a data set beyond the budget that must be stored.
    if size > budget.DECODED_BYTES and share < 0.5:
        raise FileError(
            path,
            f"declares {data.size} values, but {100.0 * share:.2g} % of them are stored, the "
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
    _check_filters(Path(file.filename), data, name)
    chunk = math.prod(data.chunks) * data.dtype.itemsize
    packed = data.id.get_create_plist().get_nfilters() > 0
    access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
    # Places of HDF5's table of chunks in memory; a prime.
    access.set_chunk_cache(521, chunk if packed else 0, 1.0)
    del data  # one that is open keeps the cache that it has
    return h5py.Dataset(h5py.h5d.open(file.id, name.encode(), access))


def _place(data: h5py.Dataset, start: int, stop: int) -> tuple[slice, ...]:
    """Selection of a segment of a vector, also of one stored as 1 x n or n x 1 (MATLAB)."""
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
    """Write a segment of a vector, along any axis."""
    place = _place(data, start, stop)
    shape = tuple(
        stop - start if s.start is not None else n for s, n in zip(place, data.shape, strict=True)
    )
    data[place] = values.reshape(shape)


def _check_filters(path: Path, data: Any, name: str) -> None:
    """Refuse a data set whose filters do not fit it.

    The n-bit and the scale-offset filter of libhdf5 read as many parameters, and unpack as many
    values, as the file states; where that is wrong, the process ends. Layout of the parameters:
    H5Znbit.c and H5Zscaleoffset.c of HDF5 1.14.

    Raises
    ------
    FileError
        Names the data set and the filter.
    """
    properties = data.id.get_create_plist()
    size = data.dtype.itemsize
    count = math.prod(data.chunks)
    for i in range(properties.get_nfilters()):
        number, _flags, given, _name = properties.get_filter(i)
        fits = True
        if number == _NBIT:
            fits = len(given) == _PLAIN and given[0] == _PLAIN and given[2] == count
            fits = fits and given[3] == _NUMBER and given[4] == size
            fits = fits and given[6] > 0 and given[6] + given[7] <= 8 * size
        elif number == _SCALE_OFFSET:
            # Parameters of scale and offset: the third is the values in a chunk, the fifth their
            # bytes.
            fits = len(given) == 20 and given[2] == count and given[4] == size
        if not fits:
            kind = "n-bit" if number == _NBIT else "scale-offset"
            raise FileError(
                path,
                f"is damaged: parameters of its {kind} filter do not fit its {count} values of "
                f"{size} bytes to a chunk; write it without that filter (h5repack -f NONE)",
                column=name,
            )


class Hdf5Places(NamedTuple):
    """Where the values of a data set lie in the file, which stores them as they are.

    HDF5 reads for one thread at a time, and its Python fills the memory before.
    """

    dtype: np.dtype[Any]
    chunk: int
    #: Of every chunk from the one that holds row ``first``.
    bytes: Sequence[int]
    first: int

    @classmethod
    def of(cls, data: h5py.Dataset, rows: range) -> Hdf5Places | None:
        """Those of some rows; None where HDF5 has to look at them.

        It has where they are packed, converted, filled in, in other files, in small chunks or
        behind a user block, from which some versions count and others do not.
        """
        properties = data.id.get_create_plist()
        if (
            data.ndim != 1
            or data.dtype.kind not in "fiu"
            or data.file.userblock_size
            or data.is_virtual
            or data.external
            or properties.get_nfilters()
            or not data.id.get_type().equal(h5py.h5t.py_create(data.dtype))
        ):
            return None
        if properties.get_layout() == h5py.h5d.CONTIGUOUS:
            place = data.id.get_offset()
            return None if place is None else cls(data.dtype, data.size, [place], 0)
        # Rows of a chunk from which it is worth while to ask where it lies.
        if properties.get_layout() != h5py.h5d.CHUNKED or data.chunks[0] < (1 << 13):
            return None
        chunk = data.chunks[0]
        first = rows.start - rows.start % chunk
        places = [
            data.id.get_chunk_info_by_coord((row,)).byte_offset
            for row in range(first, rows.stop, chunk)
        ]
        return None if None in places else cls(data.dtype, chunk, places, first)

    def read(self, file: FileIO, start: int, stop: int) -> NDArray[Any]:
        """The rows from ``start`` to ``stop``."""
        parts = []
        while start < stop:
            number, within = divmod(start - self.first, self.chunk)
            count = min(self.chunk - within, stop - start)
            place = self.bytes[number] + within * self.dtype.itemsize
            parts.append(stored_values(file, place, self.dtype, count))
            start += count
        return parts[0] if len(parts) == 1 else np.concatenate(parts)
