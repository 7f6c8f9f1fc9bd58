"""The formats: one line each in `FORMATS`, one module each that reads and copies it."""

from __future__ import annotations

from pathlib import Path

from ..errors import FileError
from .format import Format

__all__ = ["FORMATS", "find_format", "format_of_content", "known_format"]

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
        magics=(b"\x89HDF\r\n\x1a\n",),
    ),
    Format(
        "ROS bag",
        (".bag", ".db3", ".mcap"),
        "rosbag",
        "ros",
        unit="rad",
        magics=(b"#ROSBAG", b"SQLite format 3", b"\x89MCAP"),
    ),
    Format("MDF4", (".mf4", ".mdf"), "mdf", "mdf", magics=(b"MDF     ", b"UnFinMF ")),
    Format("numpy archive", (".npz",), "npz", magics=(b"PK\x03\x04",)),
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
    return next((entry for entry in FORMATS if ending in entry.endings), None)


def format_of_content(path: Path) -> Format:
    """Format of ``path`` by its first bytes, else by its ending, else text."""
    if not path.is_dir():
        with path.open("rb") as file:
            head = file.read(_HEAD)
        for entry in FORMATS:
            if head.startswith(entry.magics):
                return entry
    return known_format(path) or FORMATS[-1]
