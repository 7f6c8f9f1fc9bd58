"""What a source of lines is, and what its users choose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

#: Bytes of one read, at most.
MOST = 1 << 16


class Source(Protocol):
    """Bytes that arrive.

    Attributes
    ----------
    midway : bool
        Whether the first line may have begun before the source was opened.
    names : tuple of str
        Of the columns, where the source knows them; its lines are CSV then.
    """

    midway: bool
    names: tuple[str, ...]

    def read(self, timeout: float) -> bytes | None:
        """What has arrived, after ``timeout`` seconds at most; None where the source has ended.

        Raises
        ------
        OSError
            The device is gone.
        """

    def send(self, data: bytes) -> None:
        """Send to the device."""

    def close(self) -> None:
        """Close the source."""


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
    """

    baud: int = 115200
    dbc: str | None = None
    fields: tuple[str, ...] = ()
