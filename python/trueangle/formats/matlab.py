"""MATLAB files from version 4 to v7: variables that are vectors; copies get more at the end.

scipy's compiled reader trusts the sizes in a file: where they are damaged it may end the whole
process. So every element is held to the bytes that are there and to what its array needs. The
layout is that of MathWorks' "MAT-File Format".
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Collection, Iterator, Sequence
from itertools import islice
from math import prod
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, savemat, whosmat

from ..errors import FileError
from . import budget
from .budget import FileExtent
from .damage import damage_told
from .format import Batch, Contents, CopyTask, Selection, check_lengths, note, row_labels

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


#: Variable of a copy that records how its corrected ones were made.
NOTE = "trueangle_note"


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the variables that are vectors, fields of structures as ``structure/field``."""
    return list(_vectors(path))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of variables; see `format.FormatModule`."""
    found = _vectors(path)
    rows = [len(found[name]) for name in names or found]
    return FileExtent(max(rows, default=0), 8 * sum(rows) if names else 0)


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are as long as the variables ``needed``."""
    found = _vectors(path)
    sizes = {len(found[name]) for name in needed}
    return [name for name in others if len(found[name]) in sizes]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Variables ``names`` as one batch: this format has no parts; see `format.FormatModule`."""
    found = _vectors(path)
    check_lengths(path, "variables", {name: len(found[name]) for name in wanted.names})
    yield {name: _values(found[name]) for name in wanted.names}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected variables; see `format.FormatModule`.

    The bytes of the source stay as they are.
    """
    data = task.source.read_bytes()
    old = is_version4(data)
    if data[2:4] != b"\0\0" if old else data[HEADER - 2 : HEADER] != b"IM":
        raise FileError(
            task.source,
            "has a damaged header or its bytes the other way round; save it with -v7 or -v7.3",
        )
    found = _vectors(task.source)
    additions = task.choose([name for name in found if found[name].dtype.kind in "fiu"])
    there = {name for name, _shape, _kind in whosmat(task.source)}
    made: dict[str, Any] = {}
    rows = 0
    for addition in additions:
        column = found[addition.column]
        signals = {signal: _values(found[name]) for signal, name in addition.signals.items()}
        after = addition.correct(_values(column), signals)
        name = _variable(addition.added)
        if name in there or name in made:
            raise FileError(task.source, "exists already; correct the original", column=name)
        made[name] = after[:, None]
        rows = max(rows, len(column))
        task.watch(len(column), 1.0)
    extra = io.BytesIO()
    made_note = {_note_name(there): note(additions)}
    savemat(extra, {**made, **made_note}, format="4" if old else "5", long_field_names=not old)
    with task.target.open("wb") as file:
        file.write(data)
        file.write(extra.getvalue()[0 if old else HEADER :])
    sums = {"source": f"{zlib.crc32(data):08x}:{len(data)}"}
    return Contents(rows, sums | {name: _sum(values) for name, values in made.items()})


def _variable(name: str) -> str:
    """A name that MATLAB accepts: it begins with a letter; others are omitted without a message."""
    name = name.replace("/", "_")
    return name if name[:1].isalpha() else f"x{name}"


def contents(path: Path, topic: str | None = None) -> Contents:
    """Checksums of the corrected variables and of all bytes before them."""
    data = path.read_bytes()
    places = matrix_places(data) if is_version4(data) else array_places(data)
    notes = [i for i, (name, _) in enumerate(places) if name.startswith(NOTE)]
    last = notes[-1] if notes else len(places)
    told = _loaded(path, [places[last][0]]) if notes else {}
    first = last - _count_of_added(next((str(text[0]) for text in told.values()), ""))
    kept = _loaded(path, [name for name, _ in places[first:last]])
    end = places[first][1] if first < len(places) else len(data)
    sums = {"source": f"{zlib.crc32(data[:end]):08x}:{end}"}
    rows = max((len(values) for values in kept.values()), default=0)
    return Contents(rows, sums | {name: _sum(values) for name, values in kept.items()})


def _note_name(names: Collection[str]) -> str:
    """The name of a further note: readers of such files keep one variable of a name."""
    count = sum(name.startswith(NOTE) for name in names)
    return f"{NOTE}_{count + 1}" if count else NOTE


def _count_of_added(note: str) -> int:
    """Variables that a copy put before its note; none where that is damaged."""
    try:
        told = json.loads(note)
    except (ValueError, RecursionError):
        return 0
    entries = told.get("corrected") if isinstance(told, dict) else None
    return len(entries) if isinstance(entries, list) else 0


def _loaded(path: Path, names: list[str]) -> dict[str, NDArray[Any]]:
    with damage_told(path, "a MATLAB file"):
        found = loadmat(path, variable_names=names) if names else {}
    return {name: found[name] for name in names if name in found}


def _sum(values: NDArray[Any]) -> str:
    return f"{zlib.crc32(np.ascontiguousarray(values).tobytes()):08x}"


def _vectors(path: Path) -> dict[str, NDArray[Any]]:
    with damage_told(path, "a MATLAB file", "; save it again, with -v7 or -v7.3"):
        check_elements(path.read_bytes())
        variables = loadmat(path, struct_as_record=True, squeeze_me=False, chars_as_strings=True)
    found: dict[str, NDArray[Any]] = {}
    for name, value in variables.items():
        if not name.startswith("__") and not name.startswith(NOTE):
            _add(found, name, value)
    return found


def _add(found: dict[str, NDArray[Any]], name: str, value: Any) -> None:
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names is not None and value.size == 1:
        for field in value.dtype.names:
            _add(found, f"{name}/{field}", value[field].reshape(-1)[0])
    elif value.dtype.kind in "fiu" and value.size > 1 and max(value.shape) == value.size:
        found[name] = value.reshape(-1)
    elif value.dtype.kind == "U" and value.ndim == 1 and value.size > 1:
        found[name] = value
    elif value.dtype.hasobject and value.size > 1 and max(value.shape) == value.size:
        cells = [np.asarray(cell).reshape(-1) for cell in value.reshape(-1)]
        if all(cell.size == 1 and cell.dtype.kind == "U" for cell in cells):
            found[name] = np.array([str(cell[0]) for cell in cells], dtype=object)


def _values(vector: NDArray[Any]) -> Any:
    if vector.dtype.kind in "UO":
        return row_labels([str(text).strip() for text in vector])
    return vector.astype(vector.dtype.newbyteorder("="), copy=False)
