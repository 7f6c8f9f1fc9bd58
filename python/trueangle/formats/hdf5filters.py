"""Filters of HDF5 that trust what a file says of them: held to the data set before they run.

The n-bit and the scale-offset filter of libhdf5 read as many parameters, and unpack as many values,
as the file states; where that is wrong, the process ends. Layout of the parameters: H5Znbit.c and
H5Zscaleoffset.c of HDF5 1.14.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from ..errors import FileError

_NBIT: Final = 5
_SCALE_OFFSET: Final = 6
#: Parameters of a plain number: their count, whether nothing is packed, values in a chunk, its
#: class, bytes, order, bits and the first of them.
_PLAIN: Final = 8
_NUMBER: Final = 1
#: Parameters of scale and offset: the third is the values in a chunk, the fifth their bytes.
_SCALED: Final = 20


def check_filters(path: Path, data: Any, name: str) -> None:
    """Refuse a data set whose filters do not fit it.

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
            fits = len(given) == _SCALED and given[2] == count and given[4] == size
        if not fits:
            kind = "n-bit" if number == _NBIT else "scale-offset"
            raise FileError(
                path,
                f"is damaged: parameters of its {kind} filter do not fit its {count} values of "
                f"{size} bytes to a chunk; write it without that filter (h5repack -f NONE)",
                column=name,
            )
