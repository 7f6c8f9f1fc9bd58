"""Blocks of an MDF4 file: chains in a circle, which reading would follow for ever."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, Final

from ..errors import FileError

#: Where the header block stands.
_HEADER: Final = 0x40
#: Bytes before the links of a block: kind, length, number of links.
_HEAD: Final = 24

#: Links of a block that lead to its successor or to what it holds, and what must stand there
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
    # The library reads the links of most kinds where they must stand, whatever number is said.
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
                    f"{link}, where no {wanted[2:].decode()} block stands",
                )
        found.append(link)
    return found
