"""Times, elements and nulls of Arrow columns as numbers, and how Parquet's are kept."""

from __future__ import annotations

import datetime
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
import pyarrow.feather  # noqa: E402
import pyarrow.parquet as pq  # noqa: E402

import trueangle as ta  # noqa: E402
from trueangle.errors import FileError  # noqa: E402
from trueangle.formats import arrow, budget, parquet  # noqa: E402
from trueangle.formats.arrow import BatchRange  # noqa: E402
from trueangle.formats.arrowtables import (  # noqa: E402
    ArrowDigest,
    arrow_numbers,
    arrow_values,
    element_names,
    label_codes,
)

ROWS = 60
NOON = datetime.datetime(2000, 1, 1, 12, 0, 1, 500_000)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_times_are_seconds_since_2000(unit: str) -> None:
    """Whatever unit they are kept in, earlier ones below zero; a null is not a number."""
    given = [NOON.replace(microsecond=0), NOON - datetime.timedelta(days=1), None]
    if unit == "s":
        given[1] = given[1].replace(microsecond=0)
    found = arrow_numbers("f", "t", pa.array(given, pa.timestamp(unit)))
    half = 0.0 if unit == "s" else 0.5
    np.testing.assert_array_equal(found, [43_201.0, 43_201.0 - 86_400.0 + half, np.nan])
    days = pa.array([datetime.date(2000, 1, 3), datetime.date(1999, 12, 31)])
    assert arrow_numbers("f", "t", days).tolist() == [172_800.0, -86_400.0]


@pytest.mark.parametrize(
    ("kind", "unit"),
    [
        *(("time32", unit) for unit in ("s", "ms")),
        *(("time64", unit) for unit in ("us", "ns")),
        *(("duration", unit) for unit in ("s", "ms", "us", "ns")),
    ],
)
def test_durations_and_times_of_the_day_are_seconds(kind: str, unit: str) -> None:
    per_second = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}[unit]
    whole = pa.array([0, 90 * per_second, 1, None], pa.int32() if kind == "time32" else pa.int64())
    found = arrow_numbers("f", "t", whole.cast(getattr(pa, kind)(unit)))
    np.testing.assert_array_equal(found, [0.0, 90.0, 1.0 / per_second, np.nan])


def beside() -> dict[str, Any]:
    """Columns that are no readings, of each kind of value that Arrow knows."""
    n = np.arange(ROWS)
    return {
        "time32": pa.array(n.astype("i4"), pa.time32("ms")),
        "time64": pa.array(n, pa.time64("us")),
        "duration": pa.array(n, pa.duration("ns")),
        "date": pa.array([datetime.date(2026, 1, 1)] * ROWS),
        "struct": pa.array([{"a": 1.0, "b": "x"}] * ROWS),
        "binary": pa.array([b"\x00\x01"] * ROWS),
        "fixed": pa.array([b"ab"] * ROWS, pa.binary(2)),
        "map": pa.array([[("k", 1)], []] * (ROWS // 2), pa.map_(pa.string(), pa.int64())),
        "words": pa.array([["a"]] * ROWS),
        "rows": pa.array([[{"a": 1}]] * ROWS),
        "null": pa.nulls(ROWS),
        "bool": pa.array([True, None] * (ROWS // 2)),
        "decimal": pa.array([1] * ROWS, pa.decimal256(50, 3)),
        "half": pa.array(n.astype("f2")),
        "codes": pa.array([1, 2] * (ROWS // 2)).dictionary_encode(),
        "bytes' codes": pa.array([b"a"] * ROWS).dictionary_encode(),
        "largest": pa.array(np.full(ROWS, 2**64 - 1, dtype="u8")),
    }


@pytest.mark.parametrize("ending", ["parquet", "arrow"])
@pytest.mark.parametrize("kind", beside())
def test_columns_of_any_kind_do_not_stand_in_the_way_of_readings(kind, ending, tmp_path) -> None:
    """Structures and lists of texts are no columns to read; a copy holds them all the same."""
    reference = np.arange(ROWS) * 5.0
    columns = {"reference_deg": reference, "indicated_deg": reference + 0.5, "x": beside()[kind]}
    path, output = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    if ending == "parquet":
        pq.write_table(pa.table(columns), path)
    else:
        pyarrow.feather.write_feather(pa.table(columns), path, "uncompressed")
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
    report = ta.correct_logs(path, model, output)
    assert report.is_done, report.logs[0].error
    for file in (path, output):
        (run,) = ta.read_runs(file)
        np.testing.assert_array_equal(run.reference, reference)
        unread = ("struct", "map", "words", "rows")
        assert ("x" in run.columns) == (kind not in unread)
    read = pq.read_table if ending == "parquet" else pyarrow.feather.read_table
    assert read(output)["x"].to_pylist() == columns["x"].to_pylist()


def test_a_digest_tells_a_map_whose_key_or_value_is_another() -> None:
    def digest(*maps: list[tuple[str, int]] | None) -> object:
        found = ArrowDigest()
        found.update(pa.table({"x": pa.array(maps, pa.map_(pa.string(), pa.int64()))}))
        return found.contents()

    whole = [[("a", 1), ("b", 2)], [], None, [("c", 3)]]
    assert digest(*whole) == digest(*whole)
    for place, other in ((0, [("a", 1), ("b", 7)]), (0, [("a", 1), ("d", 2)]), (1, None), (2, [])):
        assert digest(*whole[:place], other, *whole[place + 1 :]) != digest(*whole)


@pytest.mark.parametrize("size", [0, 1, 256, 257])
def test_256_elements_of_a_list_are_columns_at_most(size: int) -> None:
    fields = [("a", pa.list_(pa.float64(), size)), ("b", pa.list_(pa.int8())), ("c", pa.int8())]
    fields += [("words", pa.list_(pa.string()))]
    found = element_names(pa.schema(fields), lambda name: {"b": size}[name])
    wanted = [f"{name}[{i}]" for name in "ab" for i in range(min(size, 256))]
    assert found == [*wanted, "c"]


@pytest.mark.parametrize("kind", ["int8", "int16", "float", "double", "string", "bool"])
@pytest.mark.parametrize("nulls", [False, True])
def test_checksums_are_the_same_however_columns_are_cut(kind: str, nulls: bool) -> None:
    """And tell a value and a null that changed."""
    given: list[object] = [str(k % 5) if kind == "string" else k % 2 for k in range(40)]
    if kind == "bool":
        given = [bool(one) for one in given]
    if nulls:
        given[7] = given[23] = None

    def digest(values: list[object], *cuts: int) -> object:
        column = pa.array(values, pa.type_for_alias(kind))
        found = ArrowDigest()
        for start, stop in zip((0, *cuts), (*cuts, len(values)), strict=True):
            found.update(pa.table({"x": column.slice(start, stop - start)}))
        return found.contents()

    whole = digest(given)
    assert digest(given, 3, 7, 24) == digest(given, 20) == whole
    for other in (None, {"string": "7", "bool": True}.get(kind, 1)):
        assert digest([*given[:12], other, *given[13:]]) != whole


@pytest.mark.parametrize("rows", [30, 50, 100])
def test_stretches_are_row_groups_in_a_row_of_as_many_rows_as_are_wanted(
    rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"x": np.arange(600.0)}), path, row_group_size=rows)
    monkeypatch.setattr(parquet, "_STRETCH", 100)
    found = [stretch.groups for stretch in parquet.stretches(path) if stretch is not None]
    assert [group for groups in found for group in groups] == list(range(600 // rows))
    each = -(-100 // rows)  # row groups until there are a hundred rows
    assert {len(groups) for groups in found[:-1]} == {each}
    assert 1 <= len(found[-1]) <= each
    monkeypatch.setattr(parquet, "_STRETCH", 600)
    assert parquet.stretches(path) == [None]
    assert parquet.extent(path, ["x", "y", "z"]) == (600, 3 * 8 * 600)


@pytest.mark.parametrize("kind", ["double", "float", "int64", "int32"])
def test_columns_stay_in_dictionaries_in_which_they_were_whole(kind: str, tmp_path: Path) -> None:
    """Not those whose dictionary grew too large on the way."""
    count = 20_000
    few, many = np.arange(count) % 7, np.arange(count)
    table = pa.table(
        {
            "indicated_deg": np.linspace(0.0, 360.0, count),
            "few": pa.array(few).cast(kind),
            "many": pa.array(many).cast(kind),
        }
    )
    source, target = tmp_path / "a.parquet", tmp_path / "b.parquet"
    pq.write_table(table, source, use_dictionary=["few", "many"], dictionary_pagesize_limit=4096)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.1])], period=360.0)
    assert ta.correct_logs(source, model, target).logs[0].error is None
    chunks = pq.ParquetFile(target).metadata.row_group(0)
    kept = {
        chunks.column(i).path_in_schema: chunks.column(i).has_dictionary_page
        for i in range(chunks.num_columns)
    }
    assert kept == {"indicated_deg": False, "few": True, "many": False, "corrected_deg": False}


@pytest.mark.parametrize("index", [False, True])
def test_an_index_of_pages_is_kept_where_there_is_one(index: bool, tmp_path: Path) -> None:
    table = pa.table({"indicated_deg": np.linspace(0.0, 360.0, 100)})
    source, target = tmp_path / "a.parquet", tmp_path / "b.parquet"
    pq.write_table(table, source, write_page_index=index)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.1])], period=360.0)
    assert ta.correct_logs(source, model, target).logs[0].error is None
    chunks = pq.ParquetFile(target).metadata.row_group(0)
    assert [chunks.column(i).has_offset_index for i in range(2)] == [index, index]


KINDS = ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"]
KINDS += ["float", "double"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("nulls", [False, True])
@pytest.mark.parametrize(("start", "stop"), [(0, 11), (3, 9), (5, 5), (0, 0)])
def test_values_are_those_of_pyarrow(kind: str, nulls: bool, start: int, stop: int):
    rng = np.random.default_rng(7)
    given = rng.integers(0, 100, 11).tolist()
    if nulls:
        given[4] = given[7] = None
    column = pa.array(given, pa.type_for_alias(kind)).slice(start, stop - start)
    expected = column.to_numpy(zero_copy_only=False)
    found = arrow_values(column)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("rows", [0, 2, 7, 10])
@pytest.mark.parametrize("parts", [1, 3, 4])
def test_parts_of_a_batch_hold_each_row_once(rows: int, parts: int):
    batch = pa.record_batch({"x": np.arange(rows)})
    found = [BatchRange(range(1), part, parts).of(batch)["x"].to_numpy() for part in range(parts)]
    np.testing.assert_array_equal(np.concatenate(found), np.arange(rows))


def test_nothing_but_nulls():
    column = pa.nulls(3, pa.float64())
    assert np.isnan(arrow_values(column)).all()
    assert np.isnan(arrow_numbers("f", "a", column)).all()


def test_labels_with_and_without_nulls():
    found = label_codes(pa.array(["b", None, "a", "b"]))
    assert [found.names[code] for code in found.codes] == ["b", None, "a", "b"]
    assert found.codes.dtype == np.intp
    found = label_codes(pa.array(["b", "a"]))
    assert [found.names[code] for code in found.codes] == ["b", "a"]


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_reading_does_without_pandas(tmp_path: Path, ending: str):
    angle = np.linspace(0.0, 720.0, 30_000)  # a small file of text is read without pyarrow
    table = pa.table({"reference_deg": angle, "indicated_deg": angle + 0.1})
    path = tmp_path / f"log.{ending}"
    if ending == "parquet":
        pq.write_table(table, path)
    else:
        rows = "".join(f"{a},{a + 0.1}\n" for a in angle.tolist())
        path.write_text("reference_deg,indicated_deg\n" + rows)
    script = (
        "import sys, trueangle as ta\n"
        f"assert len(ta.read_runs({str(path)!r})[0]) == 30000\n"
        f"assert ta.fit_logs({str(path)!r}, [1], progress='none').readings == 30000\n"
        "assert 'pyarrow' in sys.modules\n"
        "sys.exit('pandas' in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, env=dict(os.environ))


#: Rows of the batches, none first.
ARROWHEADERS_ROWS = (0, 300, 7)
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
    batches = [table(rows) for rows in ARROWHEADERS_ROWS]
    path = written(tmp_path / f"a.{ending}", codec, batches)
    is_file = ending == "arrow"
    found = list(arrow._packed(path, is_file))
    assert {one.codec for one in found} == {codec}
    dictionaries = [one for one in found if one.rows < 0]
    assert len(dictionaries) == 1
    assert dictionaries[0].size >= sum(map(len, LABELS))
    records = [one for one in found if one.rows >= 0]
    assert tuple(one.rows for one in records) == ARROWHEADERS_ROWS
    for one, rows in zip(records, ARROWHEADERS_ROWS, strict=True):
        # Eight bytes a number and four a code; what is not packed stands at whole 64 bytes.
        assert 12 * rows <= one.size <= 12 * rows + (0 if codec else 2 * 64)
    assert arrow._compression(path, is_file) == codec
    assert arrow.extent(path, ["x", "x"]) == (sum(ARROWHEADERS_ROWS), 16 * sum(ARROWHEADERS_ROWS))
    assert arrow.extent(path) == (sum(ARROWHEADERS_ROWS), 0)


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
