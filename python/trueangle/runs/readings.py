"""All readings of one file, of any format, before they are runs."""

from __future__ import annotations

import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from ..formats.budget import DecodedSizeError, check_decoded
from ..formats.columns import find_columns, warn_of_unread
from ..formats.csvcells import cell_number
from ..formats.format import TEXTS, Batch, Format, Labels, Selection
from ..formats.formats import format_of_content
from ..support.decoding import elapsed_seconds, parsed_time
from ..support.files import (
    RUNS_BYTES,
    InputFile,
    check_input,
    partition_keys,
    partition_name,
    read_whole,
    sha256_of,
)
from ..support.roles import LABELS, RoleColumn, role_code, role_kind, wanted_columns

T = TypeVar("T")


#: Columns of files by path, topic and the columns that are texts, where a file is read once.
_Kept: TypeAlias = dict[tuple[str, str | None, frozenset[str]], dict[str, NDArray[Any]]]
_ONCE: ContextVar[_Kept | None] = ContextVar("columns of files", default=None)


@contextmanager
def reading_files_once() -> Iterator[None]:
    """Read files once, even if readings of another joint are requested from them later.

    Meanwhile all columns are kept that a table of runs may hold.
    """
    token = _ONCE.set({})
    try:
        yield
    finally:
        _ONCE.reset(token)


class FileReadings(NamedTuple):
    """Rows of one file as they are, before they are runs.

    Attributes
    ----------
    path : Path
    format : Format
    roles : dict of str to Column
        What is known about the columns.
    columns : dict of str to array
        By name; texts as arrays of objects.
    source : Source
    """

    path: Path
    format: Format
    roles: dict[str, RoleColumn]
    columns: dict[str, NDArray[Any]]
    source: InputFile

    @property
    def named(self) -> dict[str, tuple[str, str | None]]:
        """Name and unit of the column of each role, a reversed sensor's with a minus."""
        return {
            role: ("-" * column.is_reversed + column.name, column.unit)
            for role, column in self.roles.items()
        }

    def error(self, problem: str, column: str | None = None, row: int | None = None) -> FileError:
        """The error that reports ``problem`` of a column, at the line of a row."""
        line = 1 if row is None else self.format.line_of(self.path, row)
        return FileError(self.path, problem, line=line, column=column)

    def raw(self, column: RoleColumn) -> NDArray[np.float64]:
        """A column as finite numbers, NaN where a cell is empty."""
        values = self.columns[column.name]
        if values.dtype == object and column.role == "time":
            seconds, bad = elapsed_seconds(values.tolist())
            if bad is None:
                return seconds
            got = repr(values[bad])[:60]
            problem = f"seconds, or dates and times (ISO 8601, all with a zone or none), got {got}"
            raise self.error(f"needs {problem}", column.name, bad)
        if values.dtype == object:
            row = next((i for i, value in enumerate(values) if _is_no_number(value)), None)
            labels = [self.roles[role].name for role in LABELS if role in self.roles]
            # A label was read as text; as a signal too it must hold numbers only.
            if row is not None or column.name not in labels:
                got = repr(values[row or 0])[:60]
                raise self.error(f"a number is needed, got {got}", column.name, row or 0)
        numbers = np.asarray(values, dtype=np.float64)
        infinite = np.flatnonzero(np.isinf(numbers))
        if infinite.size:
            row = int(infinite[0])
            problem = f"readings must be finite, got {numbers[row]}; drop the row"
            raise self.error(problem, column.name, row)
        return numbers

    def values(
        self, column: RoleColumn, period: float, counts_per_turn: float | None
    ) -> NDArray[np.float64]:
        """A column in the unit of a run of ``period``, refused where its own is not known."""
        if role_kind(column.role) == "angle" and column.unit is None:
            code = role_code(column.role, column.name, "deg")
            raise self.error(f"its unit is not known; give it: {code}", column.name)
        if column.unit == "count" and counts_per_turn is None:
            beside = "_reference" if column.role == "reference" else ""
            problem = f"counts need their number per turn: give `counts_per_turn{beside}=`"
            raise self.error(problem, column.name)
        return column.values(self.raw(column), period, counts_per_turn)


def read_readings(
    path: str | PathLike[str], signals: Mapping[str, Any] | None = None, topic: str | None = None
) -> FileReadings:
    """All rows of one file with the columns that are known, needed or not.

    For logs without a reference, such as those that a self-calibration starts from.

    Raises
    ------
    FileError
        As `read_runs`, but no column is needed.
    """
    wanted = wanted_columns(signals)
    return named_source(Path(path), lambda file: readings_of(file, wanted, topic))


def named_source(path: Path, read: Callable[[Path], T]) -> T:
    """What ``read`` makes of a file; a pipe is written to a file first, and keeps its name."""
    found = check_input(path)
    if stat.S_ISREG(found.st_mode) or (path.is_dir() and (path / "metadata.yaml").is_file()):
        if found.st_size > RUNS_BYTES:
            raise FileError(
                path,
                f"has {found.st_size} bytes, but a table of runs is read up to "
                f"{RUNS_BYTES >> 30} GiB; `ta.fit_logs(...)` reads more, in "
                "constant memory",
            )
        with format_of_content(path).at_header(path):
            return read(path)
    with _spooled(path) as file:
        try:
            with format_of_content(file).at_header(file):
                return read(file)
        except FileError as error:
            raise type(error)(path, error.problem, line=error.line, column=error.column) from None


@contextmanager
def _spooled(path: Path) -> Iterator[Path]:
    import tempfile  # pipes only

    data = read_whole(path, RUNS_BYTES, "a table of runs")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, os.path.basename(path) or "runs")
        file.write_bytes(data)
        yield file


def readings_of(path: Path, wanted: Mapping[str, Any], topic: str | None) -> FileReadings:
    """All rows of a regular file; ``wanted`` as `columns.wanted_columns` makes it."""
    kind = format_of_content(path)
    header = kind.module.columns(path, topic)
    if len(set(header)) < len(header):
        doubled = next((name for name, n in Counter(header).items() if name and n > 1), None)
        if doubled is not None:
            raise FileError(path, "the column appears twice", line=1, column=doubled)
    # Of a partitioned folder; what the file itself states comes first.
    keys = {k: v for k, v in partition_keys(path).items() if k not in header}
    roles = find_columns(path, [*header, *keys], wanted)
    warn_of_unread(path, kind.unread(path), roles)
    needed = list(dict.fromkeys(c.name for c in roles.values() if c.name not in keys))
    known = set(needed)
    # Most columns of unknown role that are kept: a wide log has thousands.
    others = [name for name in header if name not in known][:256]
    together = getattr(kind.module, "together", None)
    if together is not None:  # formats whose columns need not be equally long
        if not needed and len(header) > 1:  # which columns belong together is unknown
            empty = dict.fromkeys(header, np.empty(0))
            return FileReadings(path, kind, roles, empty, _source(path))
        others = together(path, needed, others)
    labels = {column.name for column in roles.values() if column.role in LABELS}
    try:
        columns = _whole(kind, path, needed, others, labels, topic)
    except FileError:
        # A column is searched for dates only if it was not read as numbers.
        if "time" not in roles or not _is_dated(kind, path, roles["time"].name, topic):
            raise
        labels.add(roles["time"].name)
        columns = _whole(kind, path, needed, others, labels, topic)
    size = next((len(values) for values in columns.values()), 0)
    columns |= {key: _repeated(value, size, key in TEXTS) for key, value in keys.items()}
    return FileReadings(path, kind, roles, columns, _source(path))


def _whole(
    kind: Format,
    path: Path,
    needed: list[str],
    others: list[str],
    labels: set[str],
    topic: str | None,
) -> dict[str, NDArray[Any]]:
    """`_columns`, those kept of an earlier read, or without the others where they are too large."""
    kept, key = _ONCE.get(), (str(path), topic, frozenset(labels))
    found = {} if kept is None else kept.get(key, {})
    # What was text then may be needed as numbers now: reading it reports what is wrong.
    if needed and all(n in found and (found[n].dtype != object or n in labels) for n in needed):
        return {name: found[name] for name in (*needed, *others) if name in found}
    try:
        columns = _columns(kind, path, needed, others, labels, topic)
    except DecodedSizeError:
        if not needed or not others:
            raise
        columns = _columns(kind, path, needed, [], labels, topic)
    if kept is not None:
        whole = (*kept.values(), columns)
        if sum(values.nbytes for table in whole for values in table.values()) <= RUNS_BYTES:
            kept[key] = columns
    return columns


def _source(path: Path) -> InputFile:
    return InputFile(partition_name(path), "" if path.is_dir() else sha256_of(path))


def _repeated(value: str, size: int, is_text: bool) -> NDArray[Any]:
    """A column of one value: a number where it is written as one and is no label."""
    found = None if is_text or not _is_number(value) else cell_number(value, ".")
    return np.full(size, value, dtype=object) if found is None else np.full(size, found)


def _columns(
    kind: Format,
    path: Path,
    needed: list[str],
    others: list[str],
    labels: set[str],
    topic: str | None,
) -> dict[str, NDArray[Any]]:
    """Whole columns; ``others`` are texts where they are not all numbers."""
    names = [*needed, *others]
    if names:
        check_decoded(path, kind.extent(path, names, topic).size, len(names))
    numeric = _numeric(kind, path, others, topic)
    try:
        return _joined(kind, path, names, labels | set(others) - numeric, topic)
    except FileError as error:
        if error.column not in numeric:
            raise
        return _joined(kind, path, names, labels | set(others), topic)


def _numeric(kind: Format, path: Path, names: list[str], topic: str | None) -> set[str]:
    """Columns of a text file that look like numbers in its first rows."""
    if not names or not hasattr(kind.module, "line_of"):
        return set()
    first = next(iter(kind.module.read(path, Selection(names, topic, texts=names))), {})
    return {
        name
        for name, found in first.items()
        if not isinstance(found, Labels) or all(map(_is_number, found.names))
    }


def _is_dated(kind: Format, path: Path, name: str, topic: str | None) -> bool:
    """Whether a column of a text file begins with a date and time."""
    if not hasattr(kind.module, "line_of"):
        return False
    found = next(iter(kind.module.read(path, Selection([name], topic, texts=[name]))), {}).get(name)
    names = found.names if isinstance(found, Labels) else ()
    return any(parsed_time(text) is not None for text in [t for t in names if t][:1])


def _is_number(text: str | None) -> bool:
    """A number that is written as one: 007 is a name."""
    if text is None:
        return True
    return cell_number(text, ",") is not None and not _NUMBERED.match(text)


_NUMBERED = re.compile(r"[+-]?0\d")


def _joined(
    kind: Format, path: Path, names: list[str], texts: set[str], topic: str | None
) -> dict[str, NDArray[Any]]:
    """Whole columns."""
    parts: dict[str, list[Any]] = {name: [] for name in names}
    rows = size = 0
    for batch in kind.module.read(path, Selection(names, topic, texts=texts, strict=True)):
        for name in names:
            bad = _undecoded(batch[name])
            if bad is not None:
                line = kind.line_of(path, rows + bad)
                problem = "is not UTF-8 text; save it as CSV in UTF-8"
                raise FileError(path, problem, line=line, column=name)
            parts[name].append(_plain_values(batch, name))
            size += parts[name][-1].nbytes
        check_decoded(path, size, len(names))
        rows += len(parts[names[0]][-1]) if names else 0
    return {name: np.concatenate(found) if found else np.empty(0) for name, found in parts.items()}


def _is_no_number(value: Any) -> bool:
    """Whether a value is not a number, nor a text of a number, nor missing."""
    if value is None:
        return False
    try:
        float(value)
    except (TypeError, ValueError):
        return True
    return False


def _undecoded(values: Any) -> int | None:
    """The first row with a text that cannot be encoded; None without one."""
    if not isinstance(values, Labels) or _is_text("".join(map(str, values.names))):
        return None
    code = next(i for i, text in enumerate(values.names) if not _is_text(str(text)))
    return int(np.argmax(values.codes == code))


def _is_text(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:  # bytes that were not UTF-8 are in it as surrogates
        return False
    return True


def _plain_values(batch: Batch, name: str) -> NDArray[Any]:
    """Numbers as they are; texts as objects, since an array of texts is as wide as the longest."""
    values = batch[name]
    if isinstance(values, Labels):
        texts = np.empty(len(values.names) + 1, dtype=object)
        texts[:-1] = values.names
        return np.asarray(texts[values.codes])
    return np.asarray(values)
