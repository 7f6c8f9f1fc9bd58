"""MATLAB files from version 4 to v7: variables that are vectors; copies get more at the end."""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, savemat, whosmat

from ..errors import FileError
from .budget import FileExtent
from .damage import damage_told
from .format import Batch, Contents, CopyTask, Selection, check_lengths, note, row_labels
from .matlabelements import HEADER, array_places, check_elements, is_version4, matrix_places

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
