"""Lines from the network: a TCP server that is connected to, UDP datagrams at an own port."""

from __future__ import annotations

import select
import socket
from urllib.parse import urlsplit

from ...errors import ArgumentError
from .source import MOST, SourceOptions

#: Seconds until a server has answered.
_PATIENCE = 5.0


def _place(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(address)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if port is None or (not host and parts.scheme == "tcp"):
        raise ArgumentError(f"{address}: tcp://HOST:PORT or udp://:PORT is needed")
    return host, port


class TcpStream:
    """A connection to a server that sends lines."""

    midway = False
    names: tuple[str, ...] = ()

    def __init__(self, address: str, options: SourceOptions) -> None:
        try:
            self._socket = socket.create_connection(_place(address), _PATIENCE)
        except OSError as error:
            raise OSError(error.errno, error.strerror or str(error), address) from None

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        if not select.select([self._socket], [], [], timeout)[0]:
            return b""
        return self._socket.recv(MOST) or None

    def send(self, data: bytes) -> None:
        """See `Source.send`."""
        self._socket.sendall(data)

    def close(self) -> None:
        """See `Source.close`."""
        self._socket.close()


class UdpPort:
    """Datagrams that arrive at a port; each ends a line."""

    midway = False
    names: tuple[str, ...] = ()

    def __init__(self, address: str, options: SourceOptions) -> None:
        host, port = _place(address)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise OSError(error.errno, error.strerror or str(error), address) from None

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        found = b""
        while len(found) < MOST and select.select([self._socket], [], [], timeout)[0]:
            found += self._socket.recv(MOST).rstrip(b"\r\n") + b"\n"
            timeout = 0.0
        return found

    def send(self, data: bytes) -> None:
        """Refuse: it has no one to send to.

        Raises
        ------
        ArgumentError
        """
        raise ArgumentError("send: a UDP port only listens")

    def close(self) -> None:
        """See `Source.close`."""
        self._socket.close()
