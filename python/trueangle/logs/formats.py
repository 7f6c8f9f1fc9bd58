"""Formats of logs: moved to `trueangle.formats`."""

from ..formats.format import Batch, Choose, Contents, Labels, Watch
from ..formats.format import Format as LogFormat
from ..formats.formats import FORMATS, find_format, known_format

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
