"""What a format is: how files are recognised, selected, read, copied with columns and a note."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import __version__
from ..errors import FileError, MissingExtraError
from .budget import FileExtent
from .textfile import text_extent

#: Columns that are texts whatever they look like, in formats that do not state types.
TEXTS = ("run", "unit")

#: Called after every batch with the rows done and the part of the file done, 0 to 1.
Watch: TypeAlias = Callable[[int, float], None]


class Labels(NamedTuple):
    """A column of texts: the place of each one's text in ``names``."""

    codes: NDArray[np.intp]
    names: Sequence[str | None]


#: Columns by name: numbers, or labels where the column holds text.
Batch: TypeAlias = dict[str, Any]


class Contents(NamedTuple):
    """What a file holds: its rows (or messages) and a checksum by column, topic or the like."""

    rows: int
    checksums: Mapping[str, str]


class Addition(Protocol):
    """A column that a copy gets next to those of its source."""

    @property
    def column(self) -> str:
        """The column that it is made from and looks like."""

    @property
    def added(self) -> str:
        """Its own name."""

    @property
    def signals(self) -> Mapping[str, str]:
        """Further columns that it is made from."""

    @property
    def entry(self) -> Mapping[str, Any]:
        """How it was made, as plain values."""

    def correct(
        self, indicated: NDArray[Any], signals: Mapping[str, NDArray[Any]] | None = None
    ) -> NDArray[Any]:
        """Its next values, from those of the column and of the further ones."""


#: Finds what is to be added among the columns of a file.
Choose: TypeAlias = Callable[[Sequence[str]], Sequence[Addition]]


def note(additions: Sequence[Addition]) -> str:
    """How the added columns were made, as the JSON text that copies carry."""
    entries = [dict(addition.entry) for addition in additions]
    return json.dumps({"package": f"trueangle {__version__}", "corrected": entries})


def refuse_corrected(
    path: Path, columns: Mapping[str, NDArray[Any]], addition: Addition, corrected: NDArray[Any]
) -> None:
    """Refuse a table whose columns have no names of their own and hold what is to be added.

    Raises
    ------
    FileError
        It was corrected before, with this model.
    """
    own = columns.get(addition.column)
    if own is None or np.array_equal(corrected, own, equal_nan=True):
        return  # a model that changes nothing
    for name, values in columns.items():
        if np.array_equal(values, corrected.astype(values.dtype), equal_nan=True):
            problem = "holds these corrected angles already: this log was corrected before"
            raise FileError(path, problem, column=name)


def check_lengths(path: Path, kind: str, sizes: Mapping[str, int]) -> None:
    """Refuse columns of several lengths, in formats that call a column a ``kind``.

    Raises
    ------
    FileError
    """
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise FileError(path, f"{kind} differ in length: {listed}; export the file again")


class Selection(NamedTuple):
    """What is read of a file: columns, of a topic and of one of its segments, if it has them.

    Formats of text take ``texts`` for labels and refuse, where ``strict``, numbers that are not
    finite.
    """

    names: Sequence[str]
    topic: str | None = None
    stretch: Any = None
    texts: Collection[str] = TEXTS
    strict: bool = False


class CopyTask(NamedTuple):
    """A copy to be written, with the chosen columns added."""

    source: Path
    target: Path
    choose: Choose
    watch: Watch
    topic: str | None = None
    output_topic: str | None = None


class FormatModule(Protocol):
    """What the module of a format defines.

    In addition a module may define ``stretches(path)``: parts of a file, of which `read` takes
    one and yields its batches only; parts may be read in parallel. Formats of text may define
    ``line_of(path, row)`` and ``header_line(path)``: the line that a row or the names come from.
    Formats whose columns may differ in length define ``together(path, needed, others)``: those of
    ``others`` that are as long as the needed ones. Formats with further types define
    ``unread(path)``: names of columns that hold neither numbers nor labels. Formats of text whose
    length is estimated from their first lines need no ``extent``.
    """

    def columns(self, path: Path, topic: str | None) -> list[str]:
        """Names of the columns that hold numbers or labels."""

    def read(self, path: Path, wanted: Selection) -> Iterator[Batch]:
        """Some columns in batches of bounded size, NaN where a value is missing."""

    def extent(self, path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
        """Rows of a file and bytes of columns in memory, by what the file states about itself."""

    def copy(self, task: CopyTask) -> Contents:
        """Write the target as the source with the chosen columns added.

        Returns what was handed to the writer, to be compared with `contents` of the file.
        """

    def contents(self, path: Path, topic: str | None) -> Contents:
        """Read a file back whole."""


@dataclass(frozen=True)
class Format:
    """A format: its module, how its files are recognised and the extra that it needs.

    ``promises`` holds its endings by what each is called; those of "" promise nothing.
    ``magics`` are first bytes of its files, ``pattern`` matches them; ``unit`` is that of all
    angles of formats that define it.
    """

    module_name: str
    promises: Mapping[str, tuple[str, ...]]
    extra: str | None = None
    unit: str | None = None
    magics: tuple[bytes, ...] = ()
    pattern: bytes | None = None

    @property
    def name(self) -> str:
        """What messages call it."""
        return next(iter(self.promises), "").removeprefix("a ")

    @property
    def endings(self) -> tuple[str, ...]:
        """All endings of its files."""
        return tuple(ending for endings in self.promises.values() for ending in endings)

    @cached_property
    def module(self) -> FormatModule:
        """The module that reads and copies it.

        Raises
        ------
        MissingExtraError
            Its libraries are not installed.
        """
        try:
            module: Any = importlib.import_module(f".{self.module_name}", __package__)
        except ModuleNotFoundError as cause:
            if self.extra is None or (cause.name or "").startswith("trueangle"):
                raise
            raise MissingExtraError(
                f"{self.name} files need {cause.name}: pip install 'trueangle[{self.extra}]'"
            ) from None
        found: FormatModule = module
        return found

    def stretches(self, path: Path) -> list[Any]:
        """Parts of a file, in their order, that `read` takes on their own."""
        cut = getattr(self.module, "stretches", None)
        return [None] if cut is None else list(cut(path))

    def extent(self, path: Path, names: Sequence[str], topic: str | None) -> FileExtent:
        """Rows of a file and bytes of columns in memory, as far as that is known before."""
        find = getattr(self.module, "extent", None)
        return text_extent(path) if find is None else find(path, names, topic)

    def unread(self, path: Path) -> list[str]:
        """Columns that hold neither numbers nor labels."""
        find = getattr(self.module, "unread", None)
        return [] if find is None else list(find(path))

    @contextmanager
    def at_header(self, path: Path) -> Iterator[None]:
        """Let errors of the header, reported for line 1, name the line where the names are."""
        try:
            yield
        except FileError as error:
            find = getattr(self.module, "header_line", None)
            line = 1 if find is None or error.line != 1 else find(path)
            if line == 1:
                raise
            kind = type(error)
            raise kind(error.path, error.problem, line=line, column=error.column) from None

    def line_of(self, path: Path, row: int) -> int:
        """The line of a row counted from 0; formats without lines count as if under a header."""
        find = getattr(self.module, "line_of", None)
        return row + 2 if find is None else int(find(path, row))


def decoded_text(text: Any) -> Any:
    """Bytes as the text they encode, without the zeros that pad it; all else as it is."""
    return text.decode("utf-8", "replace").rstrip("\0") if isinstance(text, bytes) else text


def row_labels(texts: Iterable[Any]) -> Labels:
    """Texts, their bytes, or None, as labels."""
    codes: dict[Any, int] = {}
    found = [codes.setdefault(decoded_text(text), len(codes)) for text in texts]
    return Labels(np.array(found, dtype=np.intp), list(codes))
