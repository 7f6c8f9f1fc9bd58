"""MDF4 files opened: sizes and chains that they state are checked, large blocks read in pieces."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Final

from asammdf import MDF
from asammdf.blocks.mdf_v4 import MDF4
from asammdf.blocks.utils import DataBlockInfo

from ..errors import FileError
from ..support.layout import counted
from .damage import damage_told

#: Bytes to which one byte of a file can unpack: deflate reaches 1032.
_MOST_COMPRESSED = 2000
#: Bytes of a data block read at once: for each part of a block asammdf reads the whole block.
_PIECE = 1 << 22
#: Flag of a channel whose readings may be marked invalid.
HAS_MARKS = 2
#: Flag of a group of records of any length: texts of a channel of another group, no channels. The
#: library writes the texts with that channel, and no such group.
OF_TEXTS = 1
#: First bytes of a file, also of one that was not finished.
_MAGIC = (b"MDF     ", b"UnFinMF ")

#: Where the header block is.
_HEADER: Final = 0x40
#: Bytes before the links of a block: kind, length, number of links.
_HEAD: Final = 24

#: Links of a block that lead to its successor or to what it holds, and what must be there
#: (ASAM MDF 4.2; None: any): a tree, but for conversions that channels share. Those that refer
#: back (master, scope, element) are not among them. Further links of a conversion lead to
#: conversions or texts.
_LEADS: Final[Mapping[bytes, Mapping[int, bytes | None]]] = {
    b"##HD": {0: b"##DG", 1: b"##FH", 2: b"##CH", 3: b"##AT", 4: b"##EV"},
    b"##FH": {0: b"##FH"},
    b"##AT": {0: b"##AT"},
    b"##EV": {0: b"##EV"},
    b"##CH": {0: b"##CH", 1: b"##CH"},
    b"##DG": {0: b"##DG", 1: b"##CG", 2: None},
    b"##CG": {0: b"##CG", 1: b"##CN"},
    b"##CN": {0: b"##CN", 1: None, 4: b"##CC", 5: None},
    b"##CA": {0: None},
    b"##CC": {3: b"##CC"},
    b"##HL": {0: None},
    b"##DL": {0: b"##DL"},
    b"##LD": {0: b"##LD"},
}


@contextmanager
def opened_mdf(path: Path, **options: Any) -> Iterator[MDF]:
    """The file, its errors reported with its name."""
    with path.open("rb") as file:
        if file.read(8) not in _MAGIC:
            raise FileError(path, "is not MDF4")
    check_chains(path)
    with damage_told(path, "MDF4"), _told_once():
        try:
            with MDF(path, **options) as mdf:
                if mdf.version < "4":
                    raise FileError(path, f"is MDF {mdf.version}; convert it to MDF 4")
                _check_sizes(path, mdf)
                _take_in_pieces(mdf)
                yield mdf
        except Exception as cause:
            _close_half_built(cause)
            raise


@contextmanager
def _told_once() -> Iterator[None]:
    """Suppress what the library prints about damage in addition to the error that it raises."""

    def nothing(record: logging.LogRecord) -> bool:
        return False

    logger = logging.getLogger("asammdf")
    logger.addFilter(nothing)
    try:
        yield
    finally:
        logger.removeFilter(nothing)


def _check_sizes(path: Path, mdf: MDF) -> None:
    """Refuse groups that declare more than the file can hold: reading them would not end."""
    size = path.stat().st_size
    for group in mdf.groups:
        record = group.channel_group.samples_byte_nr + group.channel_group.invalidation_bytes_nr
        said = int(group.channel_group.cycles_nr) * max(int(record), 1)
        if group.channel_group.flags & OF_TEXTS and group.channels:
            raise FileError(
                path,
                f"is damaged: a group of texts declares {counted(group.channels, 'channel')}",
            )
        if said > _MOST_COMPRESSED * size:
            raise FileError(path, f"is damaged: {size} bytes, but it declares {said}")
        if record > _MOST_COMPRESSED * size:
            raise FileError(path, f"is damaged: {size} bytes, but it declares records of {record}")
        marks = 8 * int(group.channel_group.invalidation_bytes_nr)
        for channel in group.channels:
            # Types of channels that have no place in a record: virtual master and data.
            if channel.channel_type not in (3, 6):
                bits = 8 * int(channel.byte_offset) + int(channel.bit_offset) + channel.bit_count
                if bits > 8 * int(group.channel_group.samples_byte_nr):
                    raise FileError(
                        path,
                        "is damaged: the channel ends behind its record of "
                        f"{group.channel_group.samples_byte_nr} bytes",
                        column=channel.name,
                    )
            if channel.flags & HAS_MARKS and marks <= int(channel.pos_invalidation_bit):
                raise FileError(
                    path,
                    f"is damaged: its mark is bit {channel.pos_invalidation_bit} of {marks}",
                    column=channel.name,
                )


def _take_in_pieces(mdf: MDF) -> None:
    """Let large data blocks that are not compressed count as many small ones in a row."""
    for group in mdf.groups:
        if group.sorted:
            blocks = group.data_blocks
            group.data_blocks = [piece for block in blocks for piece in _pieces(block)]


def _pieces(block: DataBlockInfo) -> list[DataBlockInfo]:
    size = block.original_size or 0
    # A block that is compressed, has invalidation marks or is cut short stays whole.
    whole = block.block_type or block.invalidation_block or block.block_limit is not None
    if whole or size <= _PIECE:
        return [block]
    return [
        DataBlockInfo(block.address + at, 0, length, length, block.param, location=block.location)
        for at in range(0, size, _PIECE)
        for length in (min(_PIECE, size - at),)
    ]


def _close_half_built(error: Exception) -> None:
    """A constructor of asammdf that fails leaves an object that cannot be closed."""
    place = error.__traceback__
    while place is not None:
        half_built = place.tb_frame.f_locals.get("self")
        if isinstance(half_built, MDF4) and not hasattr(half_built, "_file"):
            half_built._closed = True
            with suppress(AttributeError, OSError):  # not made, or on a full disk
                half_built._tempfile.close()
        place = place.tb_next


def check_chains(path: Path) -> None:
    """Refuse a file whose blocks lead back to one on the way to them, or to no block.

    Costs one look at every block but the data: O(blocks).

    Raises
    ------
    FileError
        Names the block.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        open_, done = {_HEADER}, set()
        way = [(_HEADER, iter(_leads(path, file, _HEADER, size)))]
        while way:
            block, links = way[-1]
            link = next(links, None)
            if link is None:
                way.pop()
                open_.discard(block)
                done.add(block)
            elif link in open_:
                raise FileError(
                    path, f"is damaged: the block at byte {block} leads back to that at {link}"
                )
            elif link not in done:
                open_.add(link)
                way.append((link, iter(_leads(path, file, link, size))))


def _leads(path: Path, file: BinaryIO, block: int, size: int) -> list[int]:
    """Where the blocks are that this one leads to."""
    file.seek(min(block, size))
    kind, length, count = struct.unpack("<4s4xQQ", file.read(_HEAD).ljust(_HEAD, b"\0"))
    leads = _LEADS.get(kind, {})
    # The library reads the links of most kinds where they must be, whatever the declared number.
    room = 8 * (max(leads, default=-1) + 1)
    if kind == b"##CC":
        room = min(8 * count, max(length, _HEAD) - _HEAD, size)
    data = file.read(room)
    links = struct.unpack(f"<{len(data) // 8}Q", data[: len(data) // 8 * 8])
    found = []
    for at, link in enumerate(links):
        wanted = leads.get(at)
        if not link or (at not in leads and not (kind == b"##CC" and at > max(leads))):
            continue
        if wanted is not None:
            file.seek(min(link, size))
            stands = file.read(4)
            if stands != wanted:
                raise FileError(
                    path,
                    f"is damaged: the {kind[2:].decode()} block at byte {block} leads to byte "
                    f"{link}, where there is no {wanted[2:].decode()} block",
                )
        found.append(link)
    return found
