"""One array of numpy (.npy): a column, several side by side, or records with names."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..errors import FileError
from .budget import FileExtent
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection, refuse_corrected, row_labels

#: Readings taken together.
BLOCK = 1 << 18


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the fields, else ``column1``, ``column2`` and so on."""
    with _opened(path) as array:
        return _names(array)


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of columns; see `format.FormatModule`."""
    with _opened(path) as array:
        return FileExtent(len(array), 8 * len(array) * len(names))


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns ``names`` in batches; see `format.FormatModule`."""
    with _opened(path) as array:
        for start in range(0, len(array), BLOCK):
            part = array[start : start + BLOCK]
            yield {name: _values(part, array, name) for name in wanted.names}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected columns last; see `format.FormatModule`.

    Records get further fields; plain columns become those of one table, whose order is kept.
    """
    with _opened(task.source) as array, task.target.open("wb") as output:
        names = _names(array)
        additions = task.choose(names)
        kind, width = _enlarged(array, additions)
        shape = (len(array),) if kind.names else (len(array), width + len(additions))
        write_header(output, kind, shape)
        check = 0
        for start in range(0, len(array), BLOCK):
            part = array[start : start + BLOCK]
            put = np.empty((len(part), *shape[1:]), kind)
            if kind.names:
                for name in array.dtype.names or ():
                    put[name] = part[name]
            else:
                put[:, :width] = part.reshape(len(part), -1)
            for i, addition in enumerate(additions):
                signals = {s: _values(part, array, n) for s, n in addition.signals.items()}
                after = addition.correct(_values(part, array, addition.column), signals)
                if not kind.names and start == 0:
                    columns = {name: _values(part, array, name) for name in names}
                    refuse_corrected(task.source, columns, addition, after)
                put[addition.added if kind.names else (slice(None), width + i)] = after
            check = zlib.crc32(put.data.cast("B"), check)
            output.write(put.data)
            task.watch(len(part), (start + len(part)) / len(array))
        return Contents(len(array), {"bytes": f"{check:08x}"})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and a checksum of the array as it reads back."""
    check = 0
    with _opened(path) as array:
        for start in range(0, len(array), BLOCK):
            part = np.ascontiguousarray(array[start : start + BLOCK])
            check = zlib.crc32(part.tobytes(), check)
        return Contents(len(array), {"bytes": f"{check:08x}"})


def read_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the array that begins here.

    Raises
    ------
    ValueError
        No array of numpy, or one that holds objects or nothing at all: numpy divides by the
        width of a type, and the process would end where that is 0.
    """
    version = npy.read_magic(file)
    reading = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = reading(file)
    if kind.hasobject or not kind.itemsize or min(shape, default=0) < 0:
        raise ValueError(f"an array of the type {kind.str!r} and the shape {shape}")
    return shape, kind


def write_header(file: IO[bytes], kind: np.dtype[Any], shape: tuple[int, ...]) -> None:
    """Begin an array in the order of C."""
    told = {"descr": npy.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    try:
        npy.write_array_header_1_0(file, told)
    except ValueError:  # names of more than 64 kB
        npy.write_array_header_2_0(file, told)


@contextmanager
def _opened(path: Path) -> Iterator[NDArray[Any]]:
    """The array in mapped memory, its errors reported with its name."""
    with damage_told(path, "an array of numpy"):
        with path.open("rb") as file:
            read_header(file)
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(array, np.ndarray) or array.ndim not in (1, 2) or not array.size:
            raise FileError(path, "one column, or several side by side, are needed")
        if array.ndim == 2 and array.shape[0] == 1:
            array = array.T  # a row is a column
        if array.dtype.names is not None and array.ndim == 2:
            if array.shape[1] > 1:
                raise FileError(path, f"records one after the other are needed, got {array.shape}")
            array = array[:, 0]
        if array.dtype.names is None and array.dtype.kind not in "fiu":
            raise FileError(path, f"numbers are needed, the array holds {array.dtype}")
        yield array


def _names(array: NDArray[Any]) -> list[str]:
    if array.dtype.names is not None:
        kinds = {name: array.dtype[name] for name in array.dtype.names}
        return [name for name, kind in kinds.items() if not kind.shape and kind.names is None]
    return [f"column{i + 1}" for i in range(1 if array.ndim == 1 else array.shape[1])]


def _values(part: NDArray[Any], array: NDArray[Any], name: str) -> Any:
    if array.dtype.names is not None:
        values = np.asarray(part[name])
        if values.dtype.kind in "SU":
            return row_labels(values.tolist())
    else:
        values = np.asarray(part.reshape(len(part), -1)[:, _names(array).index(name)])
    return np.ascontiguousarray(values.astype(values.dtype.newbyteorder("="), copy=False))


def _enlarged(array: NDArray[Any], additions: Sequence[Addition]) -> tuple[np.dtype[Any], int]:
    """Type of the copy, and its columns before the added ones."""
    if array.dtype.names is not None:
        fields: list[Any] = [(name, array.dtype.fields[name][0]) for name in array.dtype.names]  # type: ignore[index]
        return np.dtype([*fields, *((a.added, "<f8") for a in additions)]), 0
    width = 1 if array.ndim == 1 else array.shape[1]
    single = array.dtype.newbyteorder("=") == np.float32
    return np.dtype(np.float32 if single else np.float64), width
