"""Options of commands that read lines as they arrive."""

from __future__ import annotations

import argparse
import os
from functools import partial
from typing import TYPE_CHECKING

from .parser import declare
from .paths import Input

if TYPE_CHECKING:
    from ..recording.sources import SourceOptions

#: What a source may be, as every help names it.
SOURCES = (
    "a serial port (/dev/ttyUSB0, COM3), can:vcan0, - (standard input), tcp://HOST:PORT, "
    "udp://:PORT"
)


def source_argument(text: str) -> str:
    """A source as it is typed: an input where it is a file that is there."""
    from ..recording.sources import kind_of

    is_live = kind_of(text) not in ("file", "")
    return Input(text) if os.path.exists(text) and not is_live else text


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Declare what sources are opened with, and how their lines are read."""
    add = partial(declare, parser)
    add("--baud N", int, "of a serial port (default: 115200)")
    add(
        "--dbc FILE",
        Input,
        "description of a CAN bus; without one signals are ID:byte:length:scale, as "
        "--signal indicated=0x101:0:2:0.02197:deg (length 2s is signed, 2b big-endian)",
    )
    add(
        "--pattern REGEX",
        str,
        "a row's columns as named groups, as 'S(?P<step>\\d+) R(?P<raw>\\d+)' "
        "(default: CSV, name:value pairs, numbers or JSON, found by the first lines)",
    )
    add(
        "--send TEXT",
        str,
        "line to send to the device at the start (a frame ID#DATA on CAN); without it "
        "nothing is sent",
    )


def source_options(args: argparse.Namespace) -> SourceOptions:
    """What sources are opened with."""
    from ..recording.sources import SourceOptions

    fields = tuple(name.lstrip("-") for _joint, _role, name, _unit in args.signal or ())
    return SourceOptions(args.baud or 115200, args.dbc, fields, args.pattern, args.send)
