"""Stretches of Arrow files: each row once, of the size that is asked for, whatever the batches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from trueangle.errors import FileError
from trueangle.formats.format import Selection

pa = pytest.importorskip("pyarrow")
from trueangle.formats import arrow  # noqa: E402

NAMES = ["a", "b"]


def written(path: Path, rows: list[int], packed: str | None = None, stream: bool = False) -> int:
    """Record batches of so many rows; returns the bytes of the file."""
    schema = pa.schema([(name, pa.float64()) for name in NAMES])
    options = pa.ipc.IpcWriteOptions(compression=packed)
    start = 0
    with (pa.ipc.new_stream if stream else pa.ipc.new_file)(path, schema, options=options) as file:
        for count in rows:
            a = np.arange(start, start + count, dtype=float)
            file.write_batch(pa.record_batch([a, -a], names=NAMES))
            start += count
    return path.stat().st_size


def read(path: Path, stretch: object) -> np.ndarray:
    parts = [
        np.column_stack([np.asarray(batch[name]) for name in NAMES])
        for batch in arrow.read(path, Selection(NAMES, stretch=stretch))
    ]
    return np.concatenate(parts) if parts else np.zeros((0, 2))


@pytest.mark.parametrize("packed", [None, "zstd", "lz4"])
@pytest.mark.parametrize("size", [1_000, 20_000, 10_000_000])
@pytest.mark.parametrize("rows", [[5], [4_000], [700] * 9, [900, 0, 1, 3_000, 20], [0, 0]])
def test_each_row_is_in_one_stretch(
    rows: list[int], size: int, packed: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrow, "_STRETCH", size)
    path = tmp_path / "log.arrow"
    whole = written(path, rows, packed)
    stretches = arrow.stretches(path)
    assert None not in stretches
    assert {len(s.batches) for s in stretches} <= {*range(1, len(rows) + 1)}
    found = np.concatenate([read(path, stretch) for stretch in stretches])
    a = np.arange(sum(rows), dtype=float)
    np.testing.assert_array_equal(found, np.column_stack([a, -a]))
    np.testing.assert_array_equal(read(path, None), found)
    # Of batches that are alike each stretch has no more than it may, and no less than half of it.
    if len(set(rows)) == 1 and packed is None:
        sizes = [whole / len(rows) * len(s.batches) / s.parts for s in stretches]
        assert max(sizes) <= max(size, whole / arrow._MOST_PARTS)
        assert len(stretches) <= max(1, 2.0 * whole / size + 1)
    if packed:  # a part of a packed batch needs all of it unpacked
        assert {s.parts for s in stretches} == {1}
    assert arrow.extent(path, NAMES) == (sum(rows), 8 * sum(rows) * 2)
    assert arrow.extent(path, NAMES[:1]) == (sum(rows), 8 * sum(rows))


@pytest.mark.parametrize(("rows", "parts"), [(60_000, 64), (3_000, 49)])
def test_a_large_batch_has_so_many_parts_at_most(
    rows: int, parts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrow, "_STRETCH", 1_000)
    path = tmp_path / "log.arrow"
    whole = written(path, [rows])
    stretches = arrow.stretches(path)
    assert [s.part for s in stretches] == list(range(parts))
    assert {s.parts for s in stretches} == {parts} == {min(-(-whole // 1_000), 64)}
    assert all(s.batches == range(1) for s in stretches)


def test_what_has_no_index_is_read_in_one(tmp_path: Path) -> None:
    """The stream format, and a file without a batch; batches of it are what they are."""
    stream, empty = tmp_path / "log.arrows", tmp_path / "log.arrow"
    written(stream, [700] * 3, stream=True)
    written(empty, [])
    assert arrow.stretches(stream) == arrow.stretches(empty) == [None]
    np.testing.assert_array_equal(read(stream, None)[:, 0], np.arange(2_100.0))
    assert arrow.extent(stream, NAMES) == (2_100, 16 * 2_100)
    assert arrow.extent(empty, NAMES) == (0, 0)
    assert arrow.columns(stream) == arrow.columns(empty) == NAMES


@pytest.mark.parametrize("packed", ["zstd", "lz4"])
@pytest.mark.parametrize("stream", [False, True])
def test_what_unpacks_beyond_the_budget_is_refused_before(
    packed: str, stream: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two columns of 1000 numbers unpack to 16 000 bytes, whatever they are packed to."""
    path = tmp_path / "log.arrow"
    written(path, [10, 1_000], packed, stream)
    (small, large) = (batch.size for batch in arrow._packed(path, not stream))
    assert 160 <= small < 400
    assert 16_000 <= large < 16_200
    asked: list[int] = []

    def refuse(path: Path, size: int, what: str) -> None:
        asked.append(size)
        if size > 15_000:
            raise FileError(path, f"a {what} of {size} bytes")

    monkeypatch.setattr(arrow, "check_part", refuse)
    with pytest.raises(FileError, match="a record batch of 16"):
        read(path, None)
    assert asked == [small, large]
    if not stream:
        with pytest.raises(FileError, match="a record batch of 16"):
            arrow.stretches(path)


def test_a_buffer_that_is_not_packed_counts_as_it_is_stored(tmp_path: Path) -> None:
    """Such a one begins with -1 in place of the bytes that it unpacks to."""
    path = tmp_path / "log.arrows"
    written(path, [1_000], "lz4", stream=True)
    with pa.memory_map(str(path), "r") as source:
        (message,) = (m for m in pa.ipc.MessageReader.open_stream(source) if "batch" in m.type)
        header, body = message.metadata.to_pybytes(), np.array(message.body).view(np.int64)
    assert arrow._header(header, pa.py_buffer(body)).size == 16_000
    places = np.flatnonzero(body == 8_000)
    sizes = []
    for plain in (places[:1], places[1:], places):
        changed = body.copy()
        changed[plain] = -1
        sizes.append(arrow._header(header, pa.py_buffer(changed)).size)
    # All that is stored, but for the padding of each buffer.
    assert body.nbytes - 2 * 64 < sizes[2] <= body.nbytes
    assert sizes[0] + sizes[1] == 16_000 + sizes[2]
