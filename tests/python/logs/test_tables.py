"""Parquet and Arrow logs: values, and everything else kept as it was."""

import datetime
import decimal
import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError

from .conftest import made_angles, made_model, unwrapped_truth

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
feather = pytest.importorskip("pyarrow.feather")

ROWS = 5000


def rich_table(rows=ROWS):
    """Columns of every kind that logs hold, with nulls and NaN among the angles."""
    rng = np.random.default_rng(4)
    angles = made_angles(rows)
    angles[10] = np.nan
    missing = np.zeros(rows, bool)
    missing[[0, 77, rows - 1]] = True
    texts = [None if i % 7 == 0 else f"räd {i % 13}" for i in range(rows)]
    start = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    columns = {
        "stamp": pa.array(
            [start + datetime.timedelta(milliseconds=i) for i in range(rows)],
            pa.timestamp("us", "UTC"),
        ),
        "indicated_deg": pa.array(angles, mask=missing),
        "flag": pa.array(rng.random(rows) < 0.5, mask=missing),
        "text": pa.array(texts),
        "state": pa.array(texts).dictionary_encode(),
        "blob": pa.array([None if t is None else t.encode() for t in texts]),
        "small": pa.array(rng.integers(-100, 100, rows), pa.int8()),
        "single": pa.array(rng.normal(size=rows), pa.float32()),
        "money": pa.array([decimal.Decimal(i) / 100 for i in range(rows)], pa.decimal128(12, 2)),
        "list": pa.array([None if i % 5 == 0 else [i, i + 1][: i % 3] for i in range(rows)]),
        "place": pa.array([{"x": i, "name": t} for i, t in enumerate(texts)]),
        "none": pa.nulls(rows),
    }
    schema = pa.schema([pa.field(n, c.type, metadata={"u": n}) for n, c in columns.items()])
    return pa.table(list(columns.values()), schema=schema.with_metadata({"robot": "r7"}))


def write(table, path, **options):
    if path.suffix == ".parquet":
        pq.write_table(table, path, **{"row_group_size": 1024} | options)
    elif path.suffix == ".arrows":
        with pa.ipc.new_stream(path, table.schema) as writer:
            writer.write_table(table, max_chunksize=1024)
    else:
        feather.write_feather(table, path, **{"chunksize": 1024} | options)
    return path


def read(path):
    if path.suffix == ".parquet":
        return pq.ParquetFile(path).read()
    if path.suffix == ".arrows":
        with pa.ipc.open_stream(path) as reader:
            return reader.read_all()
    return feather.read_table(path)


@pytest.mark.parametrize("name", ["a.parquet", "a.feather", "a.arrows"])
def test_angles_are_corrected_and_all_else_is_kept(name, tmp_path, model, model_file):
    table = rich_table()
    source = write(table, tmp_path / name)
    report = ta.correct_logs(source, model_file, tmp_path / f"out_{name}")
    assert report.is_done
    out = read(tmp_path / f"out_{name}")
    kept = out.drop_columns(["corrected_deg"])
    assert kept.schema.equals(table.schema, check_metadata=False)
    assert kept.schema.metadata[b"robot"] == b"r7"
    for given, found in zip(table.schema, kept.schema, strict=True):
        assert found.metadata[b"u"] == given.metadata[b"u"]
    for column in table.column_names:
        if column != "indicated_deg":  # holds a NaN, which never equals itself
            assert kept[column].combine_chunks().equals(table[column].combine_chunks()), column
    indicated = table["indicated_deg"].to_numpy()
    corrected = out["corrected_deg"]
    np.testing.assert_array_equal(corrected.to_numpy(), model.correct(indicated))
    np.testing.assert_array_equal(corrected.is_null(), table["indicated_deg"].is_null())
    assert np.isnan(corrected[10].as_py())  # NaN stays NaN, null stays null
    made = json.loads(out.schema.metadata[b"trueangle"])
    import hashlib

    (entry,) = made["corrected"]
    assert entry["model_sha256"] == hashlib.sha256(model_file.read_bytes()).hexdigest()
    assert (entry["column"], entry["from"]) == ("corrected_deg", "indicated_deg")


def test_the_summary_counts_and_measures(tmp_path, model):
    table = rich_table()
    report = ta.correct_logs(write(table, tmp_path / "a.parquet"), model, tmp_path / "b.parquet")
    (log,) = report.logs
    (joint,) = log.result["joints"]
    indicated = table["indicated_deg"].to_numpy()
    change = model.correct(indicated) - indicated
    assert log.result["rows"] == ROWS
    assert joint["missing"] == 4
    assert joint["rms_correction_arcsec"] == pytest.approx(np.sqrt(np.nanmean(change**2)) * 3600)
    assert joint["max_abs_correction_arcsec"] == pytest.approx(np.nanmax(np.abs(change)) * 3600)
    assert joint["outside_span"] is None  # fitted on the whole turn, or not known


@pytest.mark.parametrize("unit", ["deg", "rad", "turn", "count"])
def test_rows_outside_the_calibrated_span_are_counted_whatever_the_columns_unit(unit, tmp_path):
    theta = np.linspace(30.0, 200.0, 300)
    run = ta.CalibrationRun(theta, theta + 0.3 * np.sin(np.radians(theta)), period=360.0)
    model = ta.fit(run, orders=[1]).model
    angles = np.array([0.0, 29.0, 31.0, 100.0, 199.0, 210.0, 391.0, np.nan])
    turn = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "count": 4096.0}[unit]
    table = pa.table({f"indicated_{unit}": angles * (turn / 360.0)})
    counts = {"counts_per_turn": turn} if unit == "count" else {}
    source = write(table, tmp_path / "a.parquet")
    report = ta.correct_logs(source, model, tmp_path / "b.parquet", **counts)
    (joint,) = report.logs[0].result["joints"]
    assert joint["outside_span"] == 3
    change = (model.correct(angles) - angles)[:-1]
    assert joint["rms_correction_arcsec"] == pytest.approx(3600.0 * np.sqrt(np.mean(change**2)))
    assert joint["max_abs_correction_arcsec"] == pytest.approx(3600.0 * np.abs(change).max())


@pytest.mark.parametrize("codec", ["snappy", "zstd", "gzip", "lz4", "brotli", "none"])
def test_compression_of_parquet_is_kept(codec, tmp_path, model):
    source = write(rich_table(), tmp_path / "a.parquet", compression=codec)
    ta.correct_logs(source, model, tmp_path / "b.parquet")
    before, after = (pq.ParquetFile(tmp_path / n).metadata for n in ("a.parquet", "b.parquet"))
    assert after.num_row_groups == before.num_row_groups
    codecs = [after.row_group(0).column(i).compression for i in range(after.num_columns)]
    assert set(codecs) == {before.row_group(0).column(0).compression}


def test_mixed_compression_and_encodings_are_kept_by_column(tmp_path, model):
    table = rich_table().select(["indicated_deg", "text", "small"])
    options = {
        "compression": {"indicated_deg": "zstd", "text": "gzip", "small": "none"},
        "use_dictionary": ["text"],
        "use_byte_stream_split": ["indicated_deg"],
    }
    ta.correct_logs(write(table, tmp_path / "a.parquet", **options), model, tmp_path / "b.parquet")
    group = pq.ParquetFile(tmp_path / "b.parquet").metadata.row_group(0)
    chunks = {group.column(i).path_in_schema: group.column(i) for i in range(4)}
    assert [chunks[n].compression for n in ("indicated_deg", "text", "small", "corrected_deg")] == [
        "ZSTD",
        "GZIP",
        "UNCOMPRESSED",
        "ZSTD",
    ]
    assert chunks["text"].has_dictionary_page
    assert not chunks["small"].has_dictionary_page
    assert "BYTE_STREAM_SPLIT" in chunks["corrected_deg"].encodings


@pytest.mark.parametrize("codec", ["lz4", "zstd", "uncompressed"])
def test_compression_of_arrow_files_is_kept(codec, tmp_path, model):
    from trueangle.formats.arrow import _compression

    source = write(rich_table(), tmp_path / "a.arrow", compression=codec)
    ta.correct_logs(source, model, tmp_path / "b.arrow")
    expected = None if codec == "uncompressed" else codec
    assert _compression(tmp_path / "b.arrow", True) == expected


def test_a_large_row_group_is_taken_in_parts(tmp_path, model, monkeypatch):
    from trueangle.formats import parquet as parquetlog

    monkeypatch.setattr(parquetlog, "_BYTES", 1 << 15)
    angles = made_angles(20_000)
    source = write(pa.table({"indicated_deg": angles}), tmp_path / "a.parquet", row_group_size=ROWS)
    ta.correct_logs(source, model, tmp_path / "b.parquet")
    out = pq.ParquetFile(tmp_path / "b.parquet")
    assert out.metadata.num_row_groups > 4
    np.testing.assert_array_equal(out.read()["corrected_deg"], model.correct(angles))


@pytest.mark.parametrize("kind", [pa.float32(), pa.int16(), pa.uint32(), pa.float16()])
def test_types_of_angles(kind, tmp_path):
    model = made_model(period=4096.0)
    counts = np.random.default_rng(5).integers(0, 4096, 1000)
    table = pa.table({"indicated_count": pa.array(counts.astype(kind.to_pandas_dtype()), kind)})
    ta.correct_logs(write(table, tmp_path / "a.parquet"), model, tmp_path / "b.parquet")
    out = read(tmp_path / "b.parquet")["corrected_count"]
    single = pa.types.is_floating(kind)
    assert out.type == (pa.float32() if single else pa.float64())
    given = table["indicated_count"].to_numpy()
    expected = model.correct(given.astype(np.float32) if single else given)
    np.testing.assert_array_equal(out.to_numpy(), expected)


def test_text_where_an_angle_belongs_is_refused(tmp_path, model):
    source = write(pa.table({"indicated_deg": ["a"]}), tmp_path / "a.parquet")
    report = ta.correct_logs(source, model, tmp_path / "b.parquet")
    assert "numbers are needed" in str(report.logs[0].error)
    assert not (tmp_path / "b.parquet").exists()


@pytest.mark.parametrize("rows", [0, 1])
def test_tiny_logs(rows, tmp_path, model):
    for name in ("a.parquet", "a.arrow", "a.arrows"):
        source = write(pa.table({"indicated_deg": np.zeros(rows)}), tmp_path / name)
        assert ta.correct_logs(source, model, tmp_path / f"b{name}").is_done
        assert read(tmp_path / f"b{name}").num_rows == rows


def test_several_joints_each_with_its_model(tmp_path):
    models = {"j1": made_model(), "j2": made_model(period=2 * np.pi)}
    a, b = made_angles(1000, seed=1), made_angles(1000, seed=2)
    table = pa.table({"j1_indicated_deg": a, "j2_rad": np.radians(b), "indicated_deg": a})
    ta.correct_logs(write(table, tmp_path / "a.parquet"), models, tmp_path / "b.parquet")
    out = read(tmp_path / "b.parquet")
    assert out.column_names[3:] == ["j1_corrected_deg", "j2_corrected_rad"]
    np.testing.assert_array_equal(out["j1_corrected_deg"], models["j1"].correct(a))
    np.testing.assert_array_equal(out["j2_corrected_rad"], models["j2"].correct(np.radians(b)))


def test_turns_are_counted_over_batches_and_files_for_models_that_need_it(tmp_path):
    model = made_model(ratio=50.5)  # its error repeats after two turns only
    assert not model.is_periodic
    angles = made_angles(6000, turns=5.5)
    # Borders of files and of row groups right at the wrap.
    wraps = np.flatnonzero(np.abs(np.diff(angles)) > 180.0) + 1
    folder = tmp_path / "logs"
    folder.mkdir()
    for i, part in enumerate(np.split(angles, wraps[[2, 7]])):
        first = int(np.flatnonzero(np.abs(np.diff(part)) > 180.0)[0]) + 1
        write(pa.table({"indicated_deg": part}), folder / f"{i}.parquet", row_group_size=first)
    ta.correct_logs(folder, model, tmp_path / "out")
    out = np.concatenate([read(tmp_path / f"out/{i}.parquet")["corrected_deg"] for i in range(3)])
    np.testing.assert_allclose(out, unwrapped_truth(model, angles), rtol=0, atol=1e-10)
    # Without counting turns the motor's part is wrong by twice its amplitude.
    assert np.abs(model.correct(angles) - unwrapped_truth(model, angles)).max() > 0.05


def test_a_changed_source_is_not_taken(tmp_path, model, monkeypatch):
    from trueangle.formats import parquet as parquetlog

    source = write(rich_table(), tmp_path / "a.parquet")
    contents = parquetlog.contents

    def written_on(path, topic=None):
        with source.open("ab") as file:
            file.write(b"more")
        return contents(path, topic)

    monkeypatch.setattr(parquetlog, "contents", written_on)
    report = ta.correct_logs(source, model, tmp_path / "b.parquet")
    assert isinstance(report.logs[0].error, FileError)
    assert "still being written" in str(report.logs[0].error)
