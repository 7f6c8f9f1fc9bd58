"""What the headers of Arrow's messages say, against what was written: rows, codec, bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")

from trueangle.errors import FileError  # noqa: E402
from trueangle.formats import arrow, budget  # noqa: E402

#: Rows of the batches, none first.
ROWS = (0, 300, 7)
LABELS = [f"label {k}" for k in range(50)]


def table(rows: int) -> Any:
    """Numbers, and labels by a dictionary, which is a message of its own."""
    codes = pa.array((np.arange(rows) % 50).astype("int32"))
    labels = pa.DictionaryArray.from_arrays(codes, pa.array(LABELS))
    return pa.record_batch({"x": np.zeros(rows), "label": labels})


def written(path: Path, codec: str | None, batches: list[Any]) -> Path:
    options = pa.ipc.IpcWriteOptions(compression=codec)
    new = pa.ipc.new_stream if path.suffix == ".arrows" else pa.ipc.new_file
    schema = batches[0].schema
    with pa.OSFile(str(path), "wb") as file, new(file, schema, options=options) as writer:
        for batch in batches:
            writer.write_batch(batch)
    return path


@pytest.mark.parametrize("ending", ["arrow", "arrows"])
@pytest.mark.parametrize("codec", [None, "lz4", "zstd"])
def test_headers_say_rows_codec_and_bytes_of_batches_and_of_dictionaries(
    codec: str | None, ending: str, tmp_path: Path
):
    batches = [table(rows) for rows in ROWS]
    path = written(tmp_path / f"a.{ending}", codec, batches)
    is_file = ending == "arrow"
    found = list(arrow._packed(path, is_file))
    assert {one.codec for one in found} == {codec}
    dictionaries = [one for one in found if one.rows < 0]
    assert len(dictionaries) == 1
    assert dictionaries[0].size >= sum(map(len, LABELS))
    records = [one for one in found if one.rows >= 0]
    assert tuple(one.rows for one in records) == ROWS
    for one, rows in zip(records, ROWS, strict=True):
        # Eight bytes a number and four a code; what is not packed stands at whole 64 bytes.
        assert 12 * rows <= one.size <= 12 * rows + (0 if codec else 2 * 64)
    assert arrow._compression(path, is_file) == codec
    assert arrow.extent(path, ["x", "x"]) == (sum(ROWS), 16 * sum(ROWS))
    assert arrow.extent(path) == (sum(ROWS), 0)


@pytest.mark.parametrize("ending", ["arrow", "arrows"])
@pytest.mark.parametrize("large", ["batch", "dictionary"])
def test_a_packed_batch_beside_a_dictionary_is_held_to_the_budget_as_that_is(
    large: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The larger of the two, from both sides; what is not packed is only mapped."""
    batch = table(20_000)
    if large == "dictionary":
        labels = pa.DictionaryArray.from_arrays(pa.array([0], pa.int32()), pa.array(["a" * 10**5]))
        batch = pa.record_batch({"x": np.zeros(1), "label": labels})
    for codec in ("zstd", None):
        path = written(tmp_path / f"a.{ending}", codec, [batch])
        size = max(one.size for one in arrow._packed(path, ending == "arrow"))
        monkeypatch.setattr(budget, "DECODED_BYTES", size)
        assert arrow.columns(path) == ["x", "label"]
        monkeypatch.setattr(budget, "DECODED_BYTES", size - 1)
        if codec is None:
            assert arrow.columns(path) == ["x", "label"]
            continue
        with pytest.raises(FileError, match="record batch unpacks to"):
            arrow.columns(path)
