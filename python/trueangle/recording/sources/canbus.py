"""Rows from a CAN bus, by python-can: signals of a DBC, or bytes of a frame with a scale."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from ...errors import ArgumentError, FileError, MissingExtraError
from .source import MOST, SourceOptions

#: ``ID:byte:length:scale``; behind the length ``s`` is signed, ``b`` is big-endian.
_FIELD: Final = re.compile(r"(0x[0-9a-fA-F]+|\d+):(\d+):([1-8])([sb]{0,2}):([-+.\deE]+)")
#: ``ID#DATA`` as `cansend` takes it.
_FRAME: Final = re.compile(rb"([0-9a-fA-F]{1,8})#((?:[0-9a-fA-F]{2}){0,8})\s*")


class _Field(NamedTuple):
    """A column: the frame that holds it, and its value there."""

    name: str
    frame: int
    value: Callable[[bytes], float]


class CanBus:
    """``can:CHANNEL`` or ``can:INTERFACE:CHANNEL``; rows come as lines of CSV.

    A row is complete with one frame of each identifier that is asked for, whatever their order:
    rows come as often as the rarest of them, with the newest of each. A frame that is too short
    becomes a line that is no row: it is rejected and counted as any other.
    """

    midway = False

    def __init__(self, address: str, options: SourceOptions) -> None:
        try:
            import can
        except ImportError:
            raise MissingExtraError(
                "a CAN bus needs python-can: pip install 'trueangle[record]'"
            ) from None
        self._fields = _fields(options)
        self._frames = {field.frame for field in self._fields}
        self._values: dict[int, bytes] = {}
        self.names = tuple(field.name for field in self._fields)
        place = address.removeprefix("can:")
        interface, colon, channel = place.partition(":")
        known = bool(colon) and interface in can.interfaces.VALID_INTERFACES
        try:
            if known:
                self._bus: Any = can.Bus(interface=interface, channel=channel)
            else:
                self._bus = _usual_bus(can, place)
        except (can.CanError, OSError, ValueError) as error:
            raise FileError(
                address, f"cannot be opened: {error}; name it as can:vcan0 or can:INTERFACE:CHANNEL"
            ) from None
        self._error = can.CanError

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        lines: list[str] = []
        size = 0
        try:
            while size < MOST and (message := self._bus.recv(timeout)):
                if message.arbitration_id in self._frames and not message.is_error_frame:
                    lines += self._taken(message.arbitration_id, bytes(message.data))
                timeout, size = 0.0, size + 8
        except self._error as error:
            raise OSError(str(error)) from None
        return "".join(f"{line}\n" for line in lines).encode()

    def _taken(self, frame: int, data: bytes) -> list[str]:
        """Lines that a frame completes."""
        self._values[frame] = data
        if len(self._values) < len(self._frames):
            return []
        values, self._values = self._values, {}
        try:
            row = [field.value(values[field.frame]) for field in self._fields]
        except ValueError:
            return [f"too short: {k:x}#{d.hex()}" for k, d in values.items()]
        return [",".join(map(repr, row))]

    def send(self, data: bytes) -> None:
        """Send one frame, written as ``ID#DATA``.

        Raises
        ------
        ArgumentError
            Something else.
        """
        import can

        found = _FRAME.fullmatch(data)
        if found is None:
            raise ArgumentError(f"send: a frame as 123#0102FF is needed, got {data.decode()!r}")
        number = int(found[1], 16)
        self._bus.send(
            can.Message(
                arbitration_id=number,
                data=bytes.fromhex(found[2].decode()),
                is_extended_id=len(found[1]) > 3,
            )
        )

    def close(self) -> None:
        """See `Source.close`."""
        self._bus.shutdown()


def _usual_bus(can: Any, channel: str) -> Any:
    """A bus of the interface that python-can is configured for, else of Linux."""
    try:
        return can.Bus(channel=channel)
    except can.CanInterfaceNotImplementedError:
        return can.Bus(interface="socketcan", channel=channel)


def _fields(options: SourceOptions) -> list[_Field]:
    found = [_field(name) for name in options.fields if _FIELD.fullmatch(name)]
    if options.dbc is not None:
        found += _described(options.dbc, [n for n in options.fields if not _FIELD.fullmatch(n)])
    if not found:
        raise ArgumentError(
            "a CAN bus needs its signals: their description (`dbc=`), or ID:byte:length:scale "
            "as in `signals={'indicated': ('0x101:0:2:0.02197', 'deg')}`"
        )
    return found


def _field(name: str) -> _Field:
    """A column of ``ID:byte:length:scale``."""
    frame, first, length, marks, scale = _FIELD.fullmatch(name).groups()  # type: ignore[union-attr]
    start, end, factor = int(first), int(first) + int(length), float(scale)
    order: Any = "big" if "b" in marks else "little"

    def value(data: bytes) -> float:
        if len(data) < end:
            raise ValueError
        return factor * int.from_bytes(data[start:end], order, signed="s" in marks)

    return _Field(name, int(frame, 0), value)


def _described(dbc: str, wanted: Sequence[str]) -> list[_Field]:
    """Columns of signals that a DBC describes: those asked for, or all of their messages."""
    try:
        import cantools
    except ImportError:
        raise MissingExtraError("a DBC needs cantools: pip install 'trueangle[record]'") from None
    try:
        database: Any = cantools.database.load_file(dbc)
    except (cantools.database.Error, ValueError) as error:
        raise FileError(dbc, f"is no description of a CAN bus: {error}") from None
    every = {
        name: (message, signal.name)
        for message in database.messages
        for signal in message.signals
        for name in (signal.name, f"{message.name}.{signal.name}")
    }
    # One that is in no message is missed when its role is looked for.
    names = [name for name in wanted if name in every] or [n for n in every if "." not in n]

    def value(message: Any, signal: str) -> Callable[[bytes], float]:
        def decoded(data: bytes) -> float:
            try:
                return float(message.decode(data, decode_choices=False).get(signal, math.nan))
            except cantools.database.Error as error:
                raise ValueError(str(error)) from None

        return decoded

    return [_Field(n, every[n][0].frame_id, value(*every[n])) for n in names]
