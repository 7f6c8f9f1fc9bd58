"""Places of variables in MATLAB files; elements of level 5 checked before a library reads them.

scipy's compiled reader trusts the sizes in a file: where they are damaged it may end the whole
process. So every element is held to the bytes that are there and to what its array needs. The
layout is that of MathWorks' "MAT-File Format".
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from math import prod
from typing import Final, NamedTuple

from . import budget

#: Bytes of the header of a file, whose last two give the byte order.
HEADER: Final = 128
#: Bytes of a value by the type of an element.
_SIZES: Final = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
#: Bytes of a number of level 4 by the tens of a matrix's type.
_LEVEL4: Final = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
#: Classes of arrays.
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMBERS: Final = range(6, 16)
_FUNCTION, _OPAQUE = 16, 17
_COMPLEX: Final = 0x0800
#: Arrays within arrays.
_DEEPEST: Final = 32


class _Element(NamedTuple):
    kind: int
    start: int
    stop: int
    after: int


def check_elements(data: bytes) -> None:
    """Hold every element to the bytes that are there.

    Of files of level 4 the matrices are held to them; what has neither header passes.

    Raises
    ------
    ValueError
        An element that ends beyond its parent, or an array that its elements cannot fill; names
        the byte where it begins.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[HEADER - 2 : HEADER])
    if is_version4(data):
        matrix_places(data)
    if order is None or is_version4(data):
        return
    left = budget.DECODED_BYTES
    for element in _elements(data, HEADER, len(data), order):
        if element.kind == _COMPRESSED:
            whole = _inflated(data[element.start : element.stop], left)
            left -= len(whole)
            _check_variable(whole, order)
        else:
            _check_matrix(data, element, order, 0)


def array_places(data: bytes) -> list[tuple[str, int]]:
    """Name and first byte of every array of a whole file; packed ones go without their name."""
    order = "<" if data[HEADER - 2 : HEADER] == b"IM" else ">"
    found, start = [], HEADER
    for element in _elements(data, HEADER, len(data), order):
        name = ""
        if element.kind == _MATRIX:
            parts = [*islice(_elements(data, element.start, element.stop, order), 3)]
            if len(parts) == 3:  # flags, extent, name
                name = data[parts[2].start : parts[2].stop].decode("latin-1")
        found.append((name, start))
        start = element.after
    return found


def is_version4(data: bytes) -> bool:
    """Whether a file has no header, as those of level 4, which begin with a matrix."""
    return b"\0" in data[:4]


def matrix_places(data: bytes) -> list[tuple[str, int]]:
    """Name and first byte of every matrix of a whole file of level 4."""
    order, found, start = "<" if data[2:4] == b"\0\0" else ">", [], 0
    while start < len(data):
        head = data[start : start + 20].ljust(20, b"\xff")  # one that is cut off: sizes below zero
        kind, rows, width, imaginary, length = struct.unpack(f"{order}5i", head)
        begin = start + 20 + length
        name = data[start + 20 : begin].rstrip(b"\0").decode("latin-1")
        found.append((name, start))
        values = rows * width * (2 if imaginary == 1 else 1)
        start = begin + values * _LEVEL4.get(kind // 10 % 10, 8)
        if min(rows, width, length) < 0 or start > len(data):
            raise ValueError(f"the matrix {name!r} ends beyond the file")
    return found


def _inflated(data: bytes, most: int) -> bytes:
    inflate = zlib.decompressobj()
    whole = inflate.decompress(data, max(most, 1))
    if not inflate.eof:
        told = f"all of them unpack to more than {budget.DECODED_BYTES >> 20} MiB"
        raise ValueError(f"a compressed variable is cut off, or {told}")
    return whole


def _check_variable(data: bytes, order: str) -> None:
    first = next(_elements(data, 0, len(data), order), None)
    if first is None:
        raise ValueError("a compressed variable is empty")
    _check_matrix(data, first, order, 0)


def _elements(data: bytes, start: int, stop: int, order: str) -> Iterator[_Element]:
    """Elements one after the other, each within ``start`` and ``stop``."""
    while start < stop:
        if stop - start < 8:
            raise ValueError(f"byte {start}: {stop - start} bytes are no element")
        kind, size = struct.unpack_from(f"{order}II", data, start)
        begin, after = start + 8, start + 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
        if kind >> 16:  # a small element: type and size share four bytes, the value has four
            kind, size = kind & 0xFFFF, kind >> 16
            begin, after = start + 4, start + 8
            if size > 4:
                raise ValueError(f"byte {start}: a small element of {size} bytes")
        if begin + size > stop:
            raise ValueError(f"byte {start}: an element of {size} bytes, {stop - begin} are left")
        yield _Element(kind, begin, begin + size, after)
        start = after


def _check_matrix(data: bytes, matrix: _Element, order: str, depth: int) -> None:
    """An array: flags, extent, name, and what its class has."""
    where = f"byte {matrix.start}"
    if matrix.kind != _MATRIX:
        raise ValueError(f"{where}: an element of type {matrix.kind} where an array must be")
    if depth > _DEEPEST:
        raise ValueError(f"{where}: arrays within arrays, more than {_DEEPEST} deep")
    if matrix.start == matrix.stop:
        return  # an empty one
    parts = _elements(data, matrix.start, matrix.stop, order)
    flags = _next(parts, where, _UINT32)
    if flags.stop - flags.start != 8:
        raise ValueError(f"{where}: an array without its flags")
    (word,) = struct.unpack_from(f"{order}I", data, flags.start)
    which = word & 0xFF
    if which == _OPAQUE:
        for _ in parts:  # of an undocumented class: only that all lies within
            pass
        return
    extent = _next(parts, where, _INT32, _UINT32)  # some writers leave the sign off
    sizes = struct.unpack_from(f"{order}{(extent.stop - extent.start) // 4}i", data, extent.start)
    if len(sizes) < 2 or min(sizes) < 0:
        raise ValueError(f"{where}: an array of the extent {sizes}")
    count = prod(sizes)
    _next(parts, where)  # its name, in whatever letters
    if which in _NUMBERS or which == _CHAR:
        for _ in range(2 if word & _COMPLEX else 1):
            values = _next(parts, where)
            size = _SIZES.get(values.kind)
            held = (values.stop - values.start) // size if size else -1
            if size is None or (held != count and not (which == _CHAR and held <= 4 * count)):
                raise ValueError(f"{where}: {held} values for an array of {count}")
    elif which == _SPARSE:
        for kinds in ((_INT32,), (_INT32,), *([()] * (2 if word & _COMPLEX else 1))):
            _next(parts, where, *kinds)
    elif which in (_CELL, _STRUCT, _OBJECT, _FUNCTION):
        _check_members(data, parts, which, count, order, where, depth)
    else:
        raise ValueError(f"{where}: an array of the unknown class {which}")


def _check_members(
    data: bytes,
    parts: Iterator[_Element],
    which: int,
    count: int,
    order: str,
    where: str,
    depth: int,
) -> None:
    """Check cells, or the fields of every structure, which are arrays themselves."""
    if which == _FUNCTION:
        count = 1
    if which == _OBJECT:
        _next(parts, where, _INT8)  # the name of its class
    if which in (_STRUCT, _OBJECT):
        length = _next(parts, where, _INT32)
        if length.stop - length.start != 4:
            raise ValueError(f"{where}: a structure without the length of its fields' names")
        (letters,) = struct.unpack_from(f"{order}i", data, length.start)
        names = _next(parts, where, _INT8)
        if letters <= 0 or (names.stop - names.start) % letters:
            raise ValueError(f"{where}: names of fields of {letters} letters")
        count *= (names.stop - names.start) // letters
    for _ in range(count):
        _check_matrix(data, _next(parts, where, _MATRIX), order, depth + 1)


def _next(parts: Iterator[_Element], where: str, *kinds: int) -> _Element:
    """The next element, of one of these types."""
    found = next(parts, None)
    if found is None:
        raise ValueError(f"{where}: an array that ends before its last element")
    if kinds and found.kind not in kinds:
        raise ValueError(f"{where}: an element of type {found.kind}, {kinds[0]} is wanted")
    return found
