"""Times, elements and nulls of Arrow columns as numbers, and how Parquet's are kept."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
import pyarrow.feather  # noqa: E402
import pyarrow.parquet as pq  # noqa: E402

import trueangle as ta  # noqa: E402
from trueangle.formats import parquet  # noqa: E402
from trueangle.formats.arrowtables import (  # noqa: E402
    ArrowDigest,
    arrow_numbers,
    element_names,
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
