"""Lines from a serial port, by pyserial."""

from __future__ import annotations

from typing import Any

from ...errors import MissingExtraError
from .source import MOST, SourceOptions


class SerialPort:
    """A port opened exclusively; nothing is sent at the opening."""

    midway = True
    names: tuple[str, ...] = ()

    def __init__(self, address: str, options: SourceOptions) -> None:
        try:
            import serial
        except ImportError:
            raise MissingExtraError(
                "serial ports need pyserial: pip install 'trueangle[record]'"
            ) from None
        taken: dict[str, Any] = {} if "://" in address else {"exclusive": True}
        self._port: Any = serial.serial_for_url(address, options.baud, timeout=0.0, **taken)

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        self._port.timeout = timeout
        first: bytes = self._port.read(1)
        waiting = min(self._port.in_waiting, MOST) if first else 0
        return first + self._port.read(waiting) if waiting else first

    def send(self, data: bytes) -> None:
        """See `Source.send`."""
        self._port.write(data)

    def close(self) -> None:
        """See `Source.close`."""
        self._port.close()
