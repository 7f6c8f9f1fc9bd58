"""What an MDF4 file may say of its sizes: each limit from both sides; large blocks in pieces."""

from types import SimpleNamespace

import pytest

pytest.importorskip("asammdf")

from asammdf.blocks.utils import DataBlockInfo

from trueangle.errors import FileError
from trueangle.formats import openmdf

SIZE = 100
PIECE = openmdf._PIECE


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "log.mf4"
    found.write_bytes(bytes(SIZE))
    return found


def group(cycles=10, record=8, marks=0, **channel):
    """A group of one channel of a record; its bits are those of the whole record."""
    values = {
        "name": "enc", "channel_type": 0, "byte_offset": 0, "bit_offset": 0,
        "bit_count": 8 * record, "flags": 0, "pos_invalidation_bit": 0,
    } | channel  # fmt: skip
    about = SimpleNamespace(
        cycles_nr=cycles, samples_byte_nr=record, invalidation_bytes_nr=marks, flags=0
    )
    return SimpleNamespace(channel_group=about, channels=[SimpleNamespace(**values)])


MOST = 2000 * SIZE
TAKEN = [
    group(MOST // 8),
    group(MOST // 10, marks=2),
    group(MOST, 0),
    group(1, MOST),
    group(byte_offset=4, bit_offset=7, bit_count=25),
    group(byte_offset=40, channel_type=3),  # no place in a record
    group(marks=1, flags=2, pos_invalidation_bit=7),
    group(pos_invalidation_bit=99),  # without marks the bit means nothing
]
REFUSED = [
    (group(MOST // 8 + 1), "100 bytes, but it declares 200008"),
    (group(MOST // 10 + 1, marks=2), "100 bytes, but it declares 200010"),
    (group(MOST + 1, 0), "declares 200001"),
    (group(0, MOST + 1), "declares records of 200001"),
    (group(byte_offset=4, bit_offset=7, bit_count=26), "behind its record of 8 bytes"),
    (group(byte_offset=8, bit_count=1), "behind its record of 8 bytes"),
    (group(marks=1, flags=2, pos_invalidation_bit=8), "its mark is bit 8 of 8"),
    (group(flags=3), "its mark is bit 0 of 0"),
]


@pytest.mark.parametrize("one", TAKEN)
def test_what_a_file_can_hold_is_taken(one, path):
    openmdf._check_sizes(path, SimpleNamespace(groups=[group(), one]))


@pytest.mark.parametrize(("one", "told"), REFUSED)
def test_what_no_file_of_its_size_can_hold_is_refused(one, told, path):
    with pytest.raises(FileError, match=f"is damaged: .*{told}"):
        openmdf._check_sizes(path, SimpleNamespace(groups=[group(), one]))


def block(size, **more):
    values = {
        "address": 640, "block_type": 0, "original_size": size, "compressed_size": size, "param": 0,
    } | more  # fmt: skip
    return DataBlockInfo(**values)


@pytest.mark.parametrize("over", [-1, 0, 1, PIECE - 1, PIECE, 3 * PIECE + 5])
def test_pieces_of_a_large_block_are_the_block(over):
    """One after the other, none larger than a piece and none empty."""
    size = PIECE + over
    pieces = openmdf._pieces(block(size))
    assert len(pieces) == -(-size // PIECE)
    place = 640
    for piece in pieces:
        assert piece.address == place
        assert 0 < piece.original_size == piece.compressed_size <= PIECE
        place += piece.original_size
    assert place == 640 + size


def test_what_is_compressed_or_cut_short_stays_whole():
    size = 3 * PIECE
    for whole in (block(size, block_type=1), block(size, block_limit=100), block(size // 3)):
        assert openmdf._pieces(whole) == [whole]
