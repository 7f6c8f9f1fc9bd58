"""The sources of lines: ports, sockets, pipes, growing files, and rows from a CAN bus."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import re
import select
import socket
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import urlsplit

from ..errors import ArgumentError, FileError, MissingExtraError
from ..formats.seriallog import NUMBER

#: Bytes of one read, at most; seconds that one waits, and a server is waited for.
MOST: Final = 1 << 16
WAIT: Final = 0.1

#: ``ID:byte:length:scale``; behind the length ``s`` is signed, ``b`` is big-endian.
_FIELD: Final = re.compile(rb"(0x[\da-fA-F]+|\d+):(\d+):([1-8])([sb]{0,2}):(%s)" % NUMBER)
#: ``ID#DATA`` as `cansend` takes it.
_FRAME: Final = re.compile(r"([\da-fA-F]{1,8})#((?:[\da-fA-F]{2}){0,8})")


class SourceOptions(NamedTuple):
    """What a source is opened with.

    Attributes
    ----------
    baud : int
        Of serial ports.
    dbc : str, optional
        Description of the messages of a CAN bus.
    fields : tuple of str
        Columns that are requested: a CAN bus takes its signals from them.
    pattern : str, optional
        Columns of a line as named groups; else the layout is found by the first lines.
    send : str, optional
        A line that is sent to the device at the start.
    """

    baud: int = 115200
    dbc: str | None = None
    fields: tuple[str, ...] = ()
    pattern: str | None = None
    send: str | None = None


class Source(NamedTuple):
    """Bytes that arrive.

    Attributes
    ----------
    read : callable
        What has arrived, after 0.1 s at most; None where the source has ended. An `OSError` where
        the device is gone.
    close : callable
    midway : bool
        Whether the first line may have begun before the source was opened.
    names : tuple of str
        Of the columns, where the source knows them; its lines are CSV then.
    """

    read: Callable[[], bytes | None]
    close: Callable[[], object]
    midway: bool = False
    names: tuple[str, ...] = ()


def kind_of(address: str) -> str:
    """What an address names: can, tcp, udp, pipe, file, port, or nothing.

    Examples
    --------
    >>> [kind_of(address) for address in ("udp://:5005", "-", "COM3", "nosuch.csv")]
    ['udp', 'pipe', 'port', '']
    """
    scheme, path = re.match("(can|tcp|udp):", address), Path(address)
    if scheme:
        return scheme[1]
    if address == "-" or path.is_fifo():
        return "pipe"
    if "://" in address or path.is_char_device() or address.upper().startswith("COM"):
        return "port"
    return "file" if path.is_file() else ""


def open_source(address: str, options: SourceOptions) -> Source:
    """Open a source by its address, a port exclusively, and send what is requested.

    Raises
    ------
    FileError, ArgumentError
        No source has this address, it cannot be opened, or lines are only read from it.
    MissingExtraError
        The library that reads it is not installed.
    OSError
        A server or file that cannot be opened.

    Examples
    --------
    >>> source = open_source("udp://127.0.0.1:0", SourceOptions())
    >>> source.read()
    b''
    >>> source.close()
    """
    kind, text = kind_of(address), options.send
    if text is not None and kind in ("udp", "pipe", "file"):
        raise ArgumentError(f"send: nothing can be sent to {address}")
    sent = b"" if text is None else f"{text}\n".encode()
    if kind == "can":
        return _can_bus(address, options)
    if kind in ("tcp", "udp"):
        return _socket(address, kind, sent)
    if kind == "port":
        serial = _library("serial", "serial ports need pyserial")
        try:
            port = serial.serial_for_url(address, options.baud, timeout=WAIT, exclusive=True)
        except (OSError, ValueError) as error:
            problem = f"cannot be opened: {error}; is it plugged in and free of other programs?"
            raise FileError(address, f"{problem}{_ports()}") from None
        if sent:
            port.write(sent)
        return Source(
            lambda: port.read(max(1, min(port.in_waiting, MOST))), port.close, midway=True
        )
    if not kind:
        raise FileError(
            address,
            "no such source; it is a serial port (/dev/ttyUSB0, COM3), - (standard input), "
            f"tcp://HOST:PORT, udp://:PORT, can:vcan0 or a file{_ports()}",
        )
    handle = sys.stdin.fileno() if address == "-" else address
    file: Any = open(handle, "rb", buffering=0, closefd=address != "-")  # noqa: SIM115

    def added() -> bytes | None:
        """What was added to the file; it ends where it gets shorter."""
        data: bytes = file.read(MOST)
        if not data:
            # Seconds between two looks at a file that may have grown.
            time.sleep(0.02)
        return data if data or os.fstat(file.fileno()).st_size >= file.tell() else None

    if kind == "file":
        return Source(added, file.close)
    piped = partial(_ready, file, lambda: file.read(MOST) or None)
    return Source(piped if os.name != "nt" else lambda: file.read(MOST) or None, file.close)


def _ports() -> str:
    """Serial ports that are there, for a message."""
    with contextlib.suppress(MissingExtraError):
        found = _library("serial.tools.list_ports", "").comports()
        return f"; serial ports here: {', '.join(port.device for port in found) or 'none'}"
    return ""


def _ready(stream: Any, take: Callable[[], bytes | None]) -> bytes | None:
    """What a stream has, after 0.1 s at most."""
    return take() if select.select([stream], [], [], WAIT)[0] else b""


def _socket(address: str, kind: str, sent: bytes) -> Source:
    """A TCP server that is connected to, or UDP datagrams, each a line, at an own port."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if port is None or (kind == "tcp" and not host):
        raise ArgumentError(f"{address}: tcp://HOST:PORT or udp://:PORT is needed")
    try:
        if kind == "tcp":
            # Seconds that a server is waited for.
            link = socket.create_connection((host, port), 5.0)
            link.sendall(sent)
            return Source(partial(_ready, link, lambda: link.recv(MOST) or None), link.close)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        own = socket.socket(family, socket.SOCK_DGRAM)
        own.setblocking(False)
        own.bind((host, port))
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), address) from None

    def datagrams() -> bytes:
        found = b""
        with contextlib.suppress(BlockingIOError):
            while len(found) < MOST:
                found += own.recv(MOST).rstrip(b"\r\n") + b"\n"
        return found

    return Source(partial(_ready, own, datagrams), own.close)


def _library(name: str, what: str) -> Any:
    """A library of the extra for recordings.

    Raises
    ------
    MissingExtraError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(f"{what}: pip install 'trueangle[record]'") from None


def _can_bus(address: str, options: SourceOptions) -> Source:
    """``can:CHANNEL`` or ``can:INTERFACE:CHANNEL``; rows come as lines of CSV.

    A row is complete with one frame of each identifier that is requested, in any order:
    rows come as often as the rarest of them, with the newest of each. Frames without a value of
    each column become a line that is no row: it is rejected and counted as any other.
    """
    can = _library("can", "a CAN bus needs python-can")
    signals = _can_signals(options)
    frames: dict[int, bytes] = dict.fromkeys((number for number, _ in signals.values()), b"")
    waited = {*frames}
    sent = None if options.send is None else _FRAME.fullmatch(options.send.strip())
    if options.send is not None and sent is None:
        raise ArgumentError(f"send: a frame as 123#0102FF is needed, got {options.send!r}")
    interface, _, channel = address.removeprefix("can:").partition(":")
    if not channel or interface not in can.interfaces.VALID_INTERFACES:
        interface, channel = "", address.removeprefix("can:")
    try:
        try:
            bus = can.Bus(channel=channel, interface=interface or None)
        except can.CanInterfaceNotImplementedError:  # none is configured: that of Linux
            bus = can.Bus(channel=channel, interface="socketcan")
    except (can.CanError, OSError, ValueError) as error:
        problem = f"cannot be opened: {error}; name it as can:vcan0 or can:INTERFACE:CHANNEL"
        raise FileError(address, problem) from None

    if sent is not None:
        number, extended = int(sent[1], 16), len(sent[1]) > 3
        data = bytes.fromhex(sent[2])
        bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=extended))

    def rows() -> bytes:
        found, wait = b"", WAIT
        try:
            while len(found) < MOST and (message := bus.recv(wait)):
                wait = 0.0
                if message.arbitration_id in frames and not message.is_error_frame:
                    frames[message.arbitration_id] = bytes(message.data)
                    waited.discard(message.arbitration_id)
                    if not waited:
                        found += row()
        except can.CanError as error:
            raise OSError(str(error)) from None
        return found

    def row() -> bytes:
        """The row of the frames that have come."""
        waited.update(frames)
        values = [value(frames[number]) for number, value in signals.values()]
        if any(map(math.isnan, values)):
            came = (f" {number:x}#{data.hex()}" for number, data in frames.items())
            return f"no value:{''.join(came)}\n".encode()
        return f"{','.join(map(repr, values))}\n".encode()

    return Source(rows, bus.shutdown, names=tuple(signals))


def _can_signals(options: SourceOptions) -> dict[str, tuple[int, Callable[[bytes], float]]]:
    """Identifier and value of each column: of fields, and of a DBC those requested or all.

    A value is NaN in a frame that is too short for it.
    """
    fields = {name: _FIELD.fullmatch(name.encode()) for name in options.fields}
    found = {name: _field(field) for name, field in fields.items() if field}
    if options.dbc is not None:
        database = _library("cantools", "a DBC needs cantools").database
        try:
            described = database.load_file(options.dbc)
        except (database.Error, ValueError) as error:
            raise FileError(options.dbc, f"is no description of a CAN bus: {error}") from None

        def decoded(message: Any, name: str, data: bytes) -> float:
            try:
                return float(message.decode(data, decode_choices=False).get(name, math.nan))
            except database.Error:
                return math.nan

        every = {
            name: (message.frame_id, partial(decoded, message, signal.name))
            for message in described.messages
            for signal in message.signals
            for name in (signal.name, f"{message.name}.{signal.name}")
        }
        # One that is in no message is missed when its role is looked for.
        asked = [name for name in options.fields if name in every]
        found |= {name: every[name] for name in asked or [n for n in every if "." not in n]}
    if not found:
        raise ArgumentError(
            "a CAN bus needs its signals: their description (`dbc=`), or ID:byte:length:scale "
            "as in `signals={'indicated': ('0x101:0:2:0.02197', 'deg')}`"
        )
    return found


def _field(field: re.Match[bytes]) -> tuple[int, Callable[[bytes], float]]:
    """Identifier and value of ``ID:byte:length:scale``."""
    start, stop = int(field[2]), int(field[2]) + int(field[3])
    order: Any = "big" if b"b" in field[4] else "little"

    def value(data: bytes) -> float:
        whole = int.from_bytes(data[start:stop], order, signed=b"s" in field[4])
        return float(field[5]) * whole if len(data) >= stop else math.nan

    return int(field[1], 0), value
