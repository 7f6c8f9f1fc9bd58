"""Formats of logs: one line each in `FORMATS`, one module each that reads and copies it."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError, MissingExtraError
from .joints import Channel

__all__ = [
    "FORMATS",
    "Batch",
    "Choose",
    "Contents",
    "Labels",
    "LogFormat",
    "Watch",
    "find_format",
    "known_format",
]

#: Called after every batch with the rows done and the part of the file done, 0 to 1.
Watch: TypeAlias = Callable[[int, float], None]
#: Finds the channels among the columns of a log.
Choose: TypeAlias = Callable[[Sequence[str]], list[Channel]]


class Labels(NamedTuple):
    """A column of texts: the place of each one's text in ``names``."""

    codes: NDArray[np.intp]
    names: Sequence[str | None]


#: Columns by name: numbers, or labels where the column holds text.
Batch: TypeAlias = dict[str, Any]


class Contents(NamedTuple):
    """What a log holds: its rows (or messages) and a checksum by column, topic or the like."""

    rows: int
    checksums: Mapping[str, str]


class FormatModule(Protocol):
    """What the module of a format defines."""

    def columns(self, path: Path, topic: str | None) -> list[str]:
        """Names of the columns that could be angles or signals."""

    def read(self, path: Path, names: Sequence[str], topic: str | None) -> Iterator[Batch]:
        """Some columns in batches of bounded size, NaN where a value is missing.

        Modules that define ``stretches(path)`` take one of them as a fourth argument: then
        the batches of that stretch only. Stretches of a log may be read side by side.
        """

    def copy(
        self,
        source: Path,
        target: Path,
        choose: Choose,
        watch: Watch,
        topic: str | None,
        output_topic: str | None,
    ) -> Contents:
        """Write ``target`` as ``source`` with the corrected columns added.

        Returns what was handed to the writer, to be compared with `contents` of the file.
        """

    def contents(self, path: Path, topic: str | None) -> Contents:
        """Read a log back whole."""


@dataclass(frozen=True)
class LogFormat:
    """A format: the endings of its files, its module and the extra that it needs.

    ``unit`` is that of all angles of formats that define it.
    """

    name: str
    endings: tuple[str, ...]
    module_name: str
    extra: str | None
    unit: str | None = None

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
                f"{self.name} logs need {cause.name}: pip install 'trueangle[{self.extra}]'"
            ) from None
        found: FormatModule = module
        return found

    def stretches(self, path: Path) -> list[Any]:
        """Parts of a log, in their order, that `read` takes on their own."""
        cut = getattr(self.module, "stretches", None)
        return [None] if cut is None else list(cut(path))

    def read(
        self, path: Path, names: Sequence[str], topic: str | None, stretch: Any
    ) -> Iterator[Batch]:
        """Batches of one of the `stretches`."""
        more = () if stretch is None else (stretch,)
        return self.module.read(path, names, topic, *more)


FORMATS = (
    LogFormat("Parquet", (".parquet", ".pq"), "parquetlog", "arrow"),
    LogFormat("Arrow", (".arrow", ".arrows", ".feather", ".ipc"), "arrowlog", "arrow"),
    LogFormat("HDF5", (".h5", ".hdf5", ".hdf", ".he5", ".mat", ".nc"), "hdf5log", "hdf5"),
    LogFormat("ROS bag", (".bag", ".db3", ".mcap"), "rosbaglog", "ros", unit="rad"),
    LogFormat("MDF4", (".mf4", ".mdf"), "mdflog", "mdf"),
    LogFormat("CSV", (".csv", ".tsv", ".txt"), "csvlog", None),
)


def find_format(path: Path) -> LogFormat:
    """Format of ``path`` by its ending; of a folder, that of a ROS 2 bag.

    Raises
    ------
    FileError
        No format has this ending.
    """
    found = known_format(path)
    if found is None:
        endings = ", ".join(ending for entry in FORMATS for ending in entry.endings)
        raise FileError(path, f"no log format has this ending; known are {endings}")
    return found


def known_format(path: Path) -> LogFormat | None:
    """Format of ``path``, or None for other files and for plain folders."""
    ending = path.suffix.lower()
    if path.is_dir():
        ending = ".db3" if (path / "metadata.yaml").is_file() else "/"
    return next((entry for entry in FORMATS if ending in entry.endings), None)
