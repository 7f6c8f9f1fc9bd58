"""The sources of lines: ports, sockets, pipes, growing files, and rows from a CAN bus."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import re
import select
import socket
import stat
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

from ..errors import ArgumentError, FileError, MissingExtraError

#: Bytes of one read, at most; seconds that one waits, and a server is waited for.
MOST: Final = 1 << 16
WAIT: Final = 0.1
_PATIENCE: Final = 5.0
#: Seconds between two looks at a file that may have grown.
_LOOK: Final = 0.02

#: ``ID:byte:length:scale``; behind the length ``s`` is signed, ``b`` is big-endian.
_FIELD: Final = re.compile(r"(0x[0-9a-fA-F]+|\d+):(\d+):([1-8])([sb]{0,2}):([-+.\deE]+)")
#: ``ID#DATA`` as `cansend` takes it.
_FRAME: Final = re.compile(rb"([0-9a-fA-F]{1,8})#((?:[0-9a-fA-F]{2}){0,8})\s*")
_STANDARD: Final = 0x7FF


@dataclass(frozen=True)
class SourceOptions:
    """What a source is opened with.

    Attributes
    ----------
    baud : int
        Of serial ports.
    dbc : str, optional
        Description of the messages of a CAN bus.
    fields : tuple of str
        Columns that are asked for: a CAN bus takes its signals from them.
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


class Source:
    """Bytes that arrive.

    Parameters
    ----------
    stream : object
        It is closed with the source, and waited for where ``waits``.
    take : callable
        Bytes that are there; None where the source has ended.
    put : callable, optional
        Sends bytes.

    Attributes
    ----------
    midway : bool
        Whether the first line may have begun before the source was opened.
    names : tuple of str
        Of the columns, where the source knows them; its lines are CSV then.
    """

    midway = False
    names: tuple[str, ...] = ()

    def __init__(
        self,
        stream: Any,
        take: Callable[[], bytes | None],
        put: Callable[[bytes], object] | None = None,
        waits: bool = True,
    ) -> None:
        self._stream, self._take, self._put, self._waits = stream, take, put, waits

    def read(self) -> bytes | None:
        """What has arrived, after 0.1 s at most; None where the source has ended.

        Raises
        ------
        OSError
            The device is gone.
        """
        if self._waits and not select.select([self._stream], [], [], WAIT)[0]:
            return b""
        return self._take()

    def send(self, data: bytes) -> None:
        """Send to the device.

        Raises
        ------
        ArgumentError
            Lines are only read here, or this is nothing that the device takes.
        """
        if self._put is None:
            raise ArgumentError("send: lines are only read here")
        self._put(data)

    def close(self) -> None:
        """Close the source."""
        if self._stream is not sys.stdin:
            self._stream.close()


def kind_of(address: str) -> str:
    """What an address names: can, tcp, udp, pipe, file, port, or nothing.

    Examples
    --------
    >>> [kind_of(address) for address in ("udp://:5005", "-", "COM3", "nosuch.csv")]
    ['udp', 'pipe', 'port', '']
    """
    scheme = re.match("(can|tcp|udp):", address)
    mode = 0
    with contextlib.suppress(OSError, ValueError):
        mode = os.stat(address).st_mode
    kinds = {
        "pipe": address == "-" or stat.S_ISFIFO(mode),
        "file": stat.S_ISREG(mode),
        "port": "://" in address or stat.S_ISCHR(mode) or address.upper().startswith("COM"),
    }
    return scheme[1] if scheme else next((kind for kind, it_is in kinds.items() if it_is), "")


def open_source(address: str, options: SourceOptions) -> Source:
    """Open a source by its address; a port exclusively, and nothing is sent.

    Raises
    ------
    FileError, ArgumentError
        No source has this address.
    MissingExtraError
        The library that reads it is not installed.
    OSError
        It cannot be opened.

    Examples
    --------
    >>> source = open_source("udp://127.0.0.1:0", SourceOptions())
    >>> source.read()
    b''
    >>> source.close()
    """
    kind = kind_of(address)
    if kind == "can":
        return CanBus(address, options)
    if kind in ("tcp", "udp"):
        try:
            return _of_network(address)
        except OSError as error:
            raise OSError(error.errno, error.strerror or str(error), address) from None
    if kind == "port":
        serial = library("serial", "serial ports need pyserial")
        port = serial.serial_for_url(address, options.baud, timeout=WAIT, exclusive=True)
        source = Source(
            port, lambda: port.read(max(1, min(port.in_waiting, MOST))), port.write, waits=False
        )
        source.midway = True
        return source
    if not kind:
        raise FileError(
            address,
            "no such source; it is a serial port (/dev/ttyUSB0, COM3), - (standard input), "
            "tcp://HOST:PORT, udp://:PORT, can:vcan0 or a file",
        )
    file: Any = sys.stdin if address == "-" else open(address, "rb", buffering=0)  # noqa: SIM115
    handle = file.fileno()
    if kind == "pipe":
        return Source(file, lambda: os.read(handle, MOST) or None, waits=os.name != "nt")

    def added() -> bytes | None:
        """What was added to the file; it ends where it gets shorter."""
        data = os.read(handle, MOST)
        if not data:
            time.sleep(_LOOK)
        is_shorter = os.fstat(handle).st_size < os.lseek(handle, 0, os.SEEK_CUR)
        return None if is_shorter and not data else data

    return Source(file, added, waits=False)


def _of_network(address: str) -> Source:
    """A TCP server that is connected to, or UDP datagrams, each a line, at an own port."""
    try:
        parts = urlsplit(address)
        scheme, host, port = parts.scheme, parts.hostname or "", parts.port
    except ValueError:
        port = None
    if port is None or (scheme == "tcp" and not host):
        raise ArgumentError(f"{address}: tcp://HOST:PORT or udp://:PORT is needed")
    if scheme == "tcp":
        link = socket.create_connection((host, port), _PATIENCE)
        return Source(link, lambda: link.recv(MOST) or None, link.sendall)
    own = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
    own.setblocking(False)
    try:
        own.bind((host, port))
    except OSError:
        own.close()
        raise

    def datagrams() -> bytes:
        found = b""
        with contextlib.suppress(BlockingIOError):
            while len(found) < MOST:
                found += own.recv(MOST).rstrip(b"\r\n") + b"\n"
        return found

    return Source(own, datagrams)


def library(name: str, what: str) -> Any:
    """A library of the extra for recordings.

    Raises
    ------
    MissingExtraError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(f"{what}: pip install 'trueangle[record]'") from None


class CanBus(Source):
    """``can:CHANNEL`` or ``can:INTERFACE:CHANNEL``; rows come as lines of CSV.

    A row is complete with one frame of each identifier that is asked for, whatever their order:
    rows come as often as the rarest of them, with the newest of each. A frame that is too short
    becomes a line that is no row: it is rejected and counted as any other.
    """

    def __init__(self, address: str, options: SourceOptions) -> None:
        self._can = can = library("can", "a CAN bus needs python-can")
        database = library("cantools", "a CAN bus needs cantools").database
        self._signals, self._damage = _signals(options, database), database.Error
        self.names = tuple(self._signals)
        self._frames = {message.frame_id for message, _ in self._signals.values()}
        self._values: dict[int, bytes] = {}
        interface, _, channel = address.removeprefix("can:").partition(":")
        if not channel or interface not in can.interfaces.VALID_INTERFACES:
            interface, channel = "", address.removeprefix("can:")
        try:
            try:
                self._bus = can.Bus(channel=channel, interface=interface or None)
            except can.CanInterfaceNotImplementedError:  # none is configured: that of Linux
                self._bus = can.Bus(channel=channel, interface="socketcan")
        except (can.CanError, OSError, ValueError) as error:
            raise FileError(
                address, f"cannot be opened: {error}; name it as can:vcan0 or can:INTERFACE:CHANNEL"
            ) from None

    def read(self) -> bytes:
        """See `Source.read`."""
        lines: list[str] = []
        wait = WAIT
        try:
            while len(lines) < MOST and (message := self._bus.recv(wait)):
                wait = 0.0
                if message.arbitration_id in self._frames and not message.is_error_frame:
                    self._values[message.arbitration_id] = bytes(message.data)
                if self._frames <= self._values.keys():
                    lines += self._row()
        except self._can.CanError as error:
            raise OSError(str(error)) from None
        return "".join(f"{line}\n" for line in lines).encode()

    def _row(self) -> list[str]:
        """The row of the frames that have come."""
        values, self._values = self._values, {}
        try:
            found = [
                message.decode(values[message.frame_id], decode_choices=False).get(name, math.nan)
                for message, name in self._signals.values()
            ]
        except self._damage:
            return [f"too short: {frame:x}#{data.hex()}" for frame, data in values.items()]
        return [",".join(repr(float(value)) for value in found)]

    def send(self, data: bytes) -> None:
        """Send one frame, written as ``ID#DATA``; see `Source.send`."""
        found = _FRAME.fullmatch(data)
        if found is None:
            raise ArgumentError(f"send: a frame as 123#0102FF is needed, got {data.decode()!r}")
        number, content = int(found[1], 16), bytes.fromhex(found[2].decode())
        self._bus.send(
            self._can.Message(arbitration_id=number, data=content, is_extended_id=len(found[1]) > 3)
        )

    def close(self) -> None:
        """See `Source.close`."""
        self._bus.shutdown()


def _signals(options: SourceOptions, database: Any) -> dict[str, tuple[Any, str]]:
    """Message and signal of each column: fields, and those of a DBC asked for or all of them."""
    found = {n: (_message(database, n), n) for n in options.fields if _FIELD.fullmatch(n)}
    if options.dbc is not None:
        try:
            described = database.load_file(options.dbc)
        except (database.Error, ValueError) as error:
            raise FileError(options.dbc, f"is no description of a CAN bus: {error}") from None
        every = {
            name: (message, signal.name)
            for message in described.messages
            for signal in message.signals
            for name in (signal.name, f"{message.name}.{signal.name}")
        }
        # One that is in no message is missed when its role is looked for.
        asked = [name for name in options.fields if name in every]
        found |= {n: every[n] for n in asked or [n for n in every if "." not in n]}
    if not found:
        raise ArgumentError(
            "a CAN bus needs its signals: their description (`dbc=`), or ID:byte:length:scale "
            "as in `signals={'indicated': ('0x101:0:2:0.02197', 'deg')}`"
        )
    return found


def _message(database: Any, field: str) -> Any:
    """The message that ``ID:byte:length:scale`` describes, of one signal."""
    frame, first, length, marks, scale = _FIELD.fullmatch(field).groups()  # type: ignore[union-attr]
    is_big, number = "b" in marks, int(frame, 0)
    signal = database.can.Signal(
        field,
        8 * int(first) + 7 * is_big,
        8 * int(length),
        "big_endian" if is_big else "little_endian",
        is_signed="s" in marks,
        conversion=database.conversion.BaseConversion.factory(float(scale), 0.0),
    )
    size, extended = int(first) + int(length), number > _STANDARD
    return database.can.Message(
        number, field, size, [signal], is_extended_frame=extended, strict=False
    )
