"""The formats: one line each in `FORMATS`, one module each that reads and copies it."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import FileError
from ..support.files import declare_endings, ending_of, promised_format, refuse_own
from .format import Format
from .textfile import head_of_text

#: Type, rows, columns, imaginary part, length of the name, of either order of bytes.
_MATLAB4 = (
    rb"\A(?s:[\x00-\x33]\0\0\0.{8}[\0\1]\0\0\0.\0\0\0"
    rb"|\0\0[\x03\x04].{9}\0\0\0[\0\1]\0\0\0.)"
)
#: A name and a number, and the same name again some lines later.
_NAMED = rb"(?:[\d:.]+ *-> *)?[ \t]*%s[ \t]*[:=][ \t]*[-+]?\.?\d"
_SERIAL = b"^%s[^\n]*\n(?:[^\n]*\n){0,5}?%s" % (_NAMED % rb"([A-Za-z_]\w*)", _NAMED % rb"\1")


def _packed(*endings: str) -> tuple[str, ...]:
    """Endings of text, and of text packed by gzip and zstd."""
    return tuple(ending + packed for packed in ("", ".gz", ".zst") for ending in endings)


FORMATS = (
    Format("parquet", {"Parquet": (".parquet", ".pq")}, "arrow", magics=(b"PAR1",)),
    Format(
        "arrow",
        {"Arrow": (".arrow", ".feather", ".ipc"), "an Arrow stream": (".arrows",)},
        "arrow",
        magics=(b"ARROW1",),
    ),
    Format(
        "hdf5",
        {"HDF5": (".h5", ".hdf5", ".hdf", ".he5"), "MATLAB": (".mat",), "NetCDF": (".nc",)},
        "hdf5",
        magics=(b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"),
        # The signature of HDF5 behind a user block, as MATLAB writes one.
        pattern=rb"\A(?s:.{512}|.{1024}|.{2048})\x89HDF\r\n\x1a\n",
    ),
    Format("matlab", {"MATLAB": (".mat",)}, "matlab", None, (b"MATLAB 5.0",), _MATLAB4),
    Format(
        "rosbag",
        {"a ROS bag": (".bag",), "a ROS 2 bag": (".db3",), "MCAP": (".mcap",)},
        "ros",
        unit="rad",
        magics=(b"#ROSBAG", b"SQLite format 3", b"\x89MCAP"),
    ),
    Format("mdf", {"MDF4": (".mf4", ".mdf")}, "mdf", magics=(b"MDF     ", b"UnFinMF ")),
    Format("wpilog", {"a data log of WPILib": (".wpilog",)}, magics=(b"WPILOG",)),
    Format("npy", {"numpy": (".npy",)}, magics=(b"\x93NUMPY",)),
    # An archive whose first part is an array.
    Format("npz", {"numpy": (".npz",)}, pattern=rb"\APK\x03\x04(?s:.{26})[^\0\n]{1,300}?\.npy"),
    # A process variable and a date, as camonitor begins a line.
    Format(
        "camonitor",
        {"EPICS": (".camonitor",)},
        pattern=rb"\A\S+[ \t]+\d{4}-\d\d-\d\d \d\d:\d\d:\d\d",
    ),
    # The first line of PHD2, and of what writes its logs too.
    Format(
        "guidelog",
        {"a guide log": ()},
        pattern=rb"\A[^\n]*PHD2 (?:log )?version|^(?:Guiding|Calibration) Begins at \d{4}-",
    ),
    Format("seriallog", {"a serial log": ()}, pattern=_SERIAL),
    Format(
        "csvfile",
        {
            "CSV": _packed(".csv"),
            "tab-separated text": _packed(".tsv", ".tab"),
            "": (*_packed(".txt"), ".xlsx", ".xlsm"),
        },
    ),
)
for _format in FORMATS:
    declare_endings(_format.promises)

#: What a file is of that no other format knows.
_TEXT = FORMATS[-1]
#: Bytes looked at for what a file begins with.
_HEAD = 1 << 12


def find_format(path: Path) -> Format:
    """Format of ``path`` by its first bytes, else by its ending; text where neither shows it.

    Raises
    ------
    FileError
        A folder that is no log, or the ending of something that is none.
    """
    found = format_of_content(path)
    ending = ending_of(path)
    named = path.with_suffix("") if ending in (".gz", ".zst") else path
    is_other = found is _TEXT and promised_format(named) is not None
    if known_format(path) is None and (path.is_dir() or is_other):
        endings = ", ".join(ending for entry in FORMATS for ending in entry.endings)
        what = f"the ending {ending}" if ending else "a folder"
        raise FileError(path, f"no log format has {what}; known are {endings}")
    return found


def known_format(path: Path) -> Format | None:
    """Format of ``path`` by its ending, or None for other files and for plain folders."""
    ending = ending_of(path)
    if path.is_dir():
        ending = ".db3" if (path / "metadata.yaml").is_file() else "/"
    found = [entry for entry in FORMATS if ending in entry.endings]
    if len(found) > 1 and path.is_file():  # several formats share MATLAB's ending
        head = head_of_text(path, _HEAD)
        found.sort(key=lambda entry: not _begins(entry, head))
    return found[0] if found else None


def format_of_content(path: Path) -> Format:
    """Format of ``path`` by its first bytes, else by its ending, else text.

    Raises
    ------
    FileError
        A model or a fleet; a packed file that holds no text.
    """
    if not path.is_dir():
        head = head_of_text(path, _HEAD)
        refuse_own(path, head, "readings")
        for entry in FORMATS:
            if _begins(entry, head):
                return entry
    return known_format(path) or _TEXT


def _begins(entry: Format, head: bytes) -> bool:
    return head.startswith(entry.magics) or bool(
        entry.pattern and re.search(entry.pattern, head, re.MULTILINE)
    )
