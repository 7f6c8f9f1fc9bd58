"""The formats: one line each in `FORMATS`, one module each that reads and copies it."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import FileError
from .format import Format

__all__ = ["FORMATS", "find_format", "format_of_content", "known_format"]

#: A process variable and a date, as camonitor begins a line.
_CAMONITOR = rb"\S+\s+\d{4}-\d\d-\d\d \d\d:\d\d:\d\d"

FORMATS = (
    Format("Parquet", (".parquet", ".pq"), "parquet", "arrow", magics=(b"PAR1",)),
    Format(
        "Arrow", (".arrow", ".arrows", ".feather", ".ipc"), "arrow", "arrow", magics=(b"ARROW1",)
    ),
    Format(
        "HDF5",
        (".h5", ".hdf5", ".hdf", ".he5", ".mat", ".nc"),
        "hdf5",
        "hdf5",
        magics=(b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"),
    ),
    Format("MATLAB", (".mat",), "matlab", "matlab", magics=(b"MATLAB 5.0",)),
    Format(
        "ROS bag",
        (".bag", ".db3", ".mcap"),
        "rosbag",
        "ros",
        unit="rad",
        magics=(b"#ROSBAG", b"SQLite format 3", b"\x89MCAP"),
    ),
    Format("MDF4", (".mf4", ".mdf"), "mdf", "mdf", magics=(b"MDF     ", b"UnFinMF ")),
    Format("numpy array", (".npy",), "npy", magics=(b"\x93NUMPY",)),
    Format("numpy archive", (".npz",), "npz", magics=(b"PK\x03\x04",)),
    Format("EPICS log", (".camonitor",), "camonitor", pattern=_CAMONITOR),
    Format("CSV", (".csv", ".tsv", ".txt"), "csvfile"),
)

#: Bytes looked at for what a file begins with.
_HEAD = 128


def find_format(path: Path) -> Format:
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


def known_format(path: Path) -> Format | None:
    """Format of ``path``, or None for other files and for plain folders."""
    ending = path.suffix.lower()
    if path.is_dir():
        ending = ".db3" if (path / "metadata.yaml").is_file() else "/"
    found = [entry for entry in FORMATS if ending in entry.endings]
    if len(found) > 1 and path.is_file():  # MATLAB's ending stands for two formats
        head = _head(path)
        found.sort(key=lambda entry: not head.startswith(entry.magics))
    return found[0] if found else None


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD)


def format_of_content(path: Path) -> Format:
    """Format of ``path`` by its first bytes, else by its ending, else text."""
    if not path.is_dir():
        head = _head(path)
        for entry in FORMATS:
            if head.startswith(entry.magics) or (entry.pattern and re.match(entry.pattern, head)):
                return entry
    return known_format(path) or FORMATS[-1]
