"""Where an HDF5 file keeps the values of a data set as they are, to be read without the library.

HDF5 reads for one thread at a time, and its Python fills the memory before.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import FileIO
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from .stored import stored_values

#: Rows of a chunk from which it is worth while to ask where it lies.
_LEAST_CHUNK = 1 << 13


class Hdf5Places(NamedTuple):
    """Where the values of a data set lie in the file, which stores them as they are."""

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
        if properties.get_layout() != h5py.h5d.CHUNKED or data.chunks[0] < _LEAST_CHUNK:
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
