"""The sources: one line each in `SOURCES`, one class each that reads it."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from typing import Final

from ...errors import FileError
from .canbus import CanBus
from .network import TcpStream, UdpPort
from .serialport import SerialPort
from .source import Source, SourceOptions
from .stream import GrowingFile, LineStream

__all__ = ["SOURCES", "Source", "SourceOptions", "is_live", "open_source"]


def _mode(address: str) -> int:
    try:
        return os.stat(address).st_mode
    except (OSError, ValueError):
        return 0


def _is_file(address: str) -> bool:
    return stat.S_ISREG(_mode(address))


def _is_pipe(address: str) -> bool:
    return address == "-" or stat.S_ISFIFO(_mode(address))


def _is_port(address: str) -> bool:
    return "://" in address or stat.S_ISCHR(_mode(address)) or address.upper().startswith("COM")


#: How an address is known, and what reads it; the first that knows it does.
SOURCES: Final[tuple[tuple[Callable[[str], bool], Callable[[str, SourceOptions], Source]], ...]] = (
    (lambda address: address.startswith("can:"), CanBus),
    (lambda address: address.startswith("tcp://"), TcpStream),
    (lambda address: address.startswith("udp://"), UdpPort),
    (_is_pipe, LineStream),
    (_is_file, GrowingFile),
    (_is_port, SerialPort),
)


def is_live(address: str) -> bool:
    """Whether an address names a source that is no file.

    Examples
    --------
    >>> is_live("udp://:5005"), is_live("joint.csv")
    (True, False)
    """
    return not _is_file(address) and any(knows(address) for knows, _ in SOURCES)


def open_source(address: str, options: SourceOptions) -> Source:
    """Open a source by its address.

    Raises
    ------
    FileError
        No source has this address.
    MissingExtraError
        The library that reads it is not installed.
    OSError
        It cannot be opened.

    Examples
    --------
    >>> source = open_source("udp://127.0.0.1:0", SourceOptions())
    >>> source.read(0.0)
    b''
    >>> source.close()
    """
    for knows, opened in SOURCES:
        if knows(address):
            return opened(address, options)
    raise FileError(
        address,
        "no such source; it is a serial port (/dev/ttyUSB0, COM3), - (standard input), "
        "tcp://HOST:PORT, udp://:PORT, can:vcan0 or a file",
    )
