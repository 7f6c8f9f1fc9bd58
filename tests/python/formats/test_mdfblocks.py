"""Blocks of an MDF4 file by hand: which of their links lead on, and which are not followed."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from trueangle.errors import FileError
from trueangle.formats.openmdf import check_chains

#: Where the second block stands: behind the header block with its links.
SECOND = 0x40 + 24 + 8 * 6


def block(kind: str, links: list[int], *, count: int | None = None, length: int | None = None):
    """A block of links alone, which may say that it has others."""
    said = len(links) if count is None else count
    size = 24 + 8 * len(links) if length is None else length
    head = struct.pack("<4s4xQQ", f"##{kind}".encode(), size, said)
    return head + struct.pack(f"<{len(links)}Q", *links)


def written(path: Path, *blocks: bytes, first: int = 0) -> Path:
    """A file of a header, of which one link leads to the second block."""
    header = block("HD", [SECOND if i == first else 0 for i in range(6)])
    path.write_bytes(bytes(0x40) + header + b"".join(blocks))
    return path


def conversion(at: int, room: int = 8, **said: int) -> list[bytes]:
    """A group, a set of channels, a channel and its conversion, which leads to itself."""
    group, channels, channel = SECOND, SECOND + 24 + 8 * 3, SECOND + 48 + 8 * 5
    own = channel + 24 + 8 * 6
    return [
        block("DG", [0, channels, 0]),
        block("CG", [0, channel]),
        block("CN", [0, 0, group, group, own, 0]),  # those that refer back are not followed
        block("CC", [own if i == at else 0 for i in range(room)], **said),
    ]


@pytest.mark.parametrize("at", range(8))
def test_conversions_lead_on_by_their_inverse_and_by_what_they_refer_to(at: int, tmp_path: Path):
    """Not by their name, unit and comment, which are texts."""
    path = written(tmp_path / "a.mf4", *conversion(at))
    if at < 3:
        check_chains(path)
        return
    with pytest.raises(FileError, match=r"the block at byte (\d+) leads back to that at \1"):
        check_chains(path)


@pytest.mark.parametrize("at", [3, 4, 5, 16])
@pytest.mark.parametrize("by", ["count", "length"])
@pytest.mark.parametrize("more", [0, 1, 2**60 - 8])
def test_a_conversion_has_as_many_links_as_it_says_and_as_its_length_holds(
    at: int, by: str, more: int, tmp_path: Path
):
    said = {"count": at + more} if by == "count" else {"length": 24 + 8 * (at + more)}
    path = written(tmp_path / "a.mf4", *conversion(at, 24, **said))
    if not more:
        check_chains(path)
        return
    with pytest.raises(FileError, match="leads back"):
        check_chains(path)


@pytest.mark.parametrize("length", [0, 23, 24])
def test_a_conversion_that_says_no_length_has_no_links(length: int, tmp_path: Path):
    check_chains(written(tmp_path / "a.mf4", *conversion(4, length=length)))


@pytest.mark.parametrize("count", [0, 1, 2**62])
@pytest.mark.parametrize("length", [0, 24, 2**62])
def test_links_of_other_blocks_stand_where_they_must_whatever_is_said(
    count: int, length: int, tmp_path: Path
):
    """The library reads them there: the last link of each kind leads back, the first does not."""
    for kind, links in (("DG", [0, SECOND + 24, 0]), ("CH", [0, SECOND]), ("LD", [SECOND])):
        first = {"DG": 0, "CH": 2, "LD": 5}[kind]
        blocks = [block(kind, links, count=count, length=length)]
        if kind == "DG":
            group = SECOND + 24 + 8 * 3
            blocks = [
                block("DG", [0, group, 0], count=count, length=length),
                block("CG", [0, group + 24 + 8 * 2]),
                block("CN", [0, group, 0, 0, 0, 0]),
            ]
        path = written(tmp_path / f"{kind}.mf4", *blocks, first=first)
        if kind == "LD":  # no link of the header leads there
            check_chains(path)
            continue
        with pytest.raises(FileError, match="leads back"):
            check_chains(path)


@pytest.mark.parametrize("beyond", [-24, -8, 0, 8, 2**63])
def test_what_leads_to_the_end_of_the_file_or_beyond_leads_to_nothing(beyond: int, tmp_path: Path):
    """Of links to any block; where one kind must stand the file is damaged."""
    path = written(tmp_path / "a.mf4", block("DG", [0, 0, 0]), bytes(24))
    size = path.stat().st_size
    written(path, block("DG", [0, 0, size + beyond]), bytes(24))
    check_chains(path)
    written(path, block("DG", [0, size + beyond, 0]), bytes(24))
    with pytest.raises(FileError, match=f"leads to byte {size + beyond}, where .* no CG block"):
        check_chains(path)
