"""Fits of logs in one pass: the fit of all readings in memory is the oracle."""

import hashlib
import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError, NoModelError
from trueangle.formats.formats import find_format

from .conftest import made_model

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
pytest.importorskip("pyarrow.csv")

NOISE = 0.01


@pytest.fixture(autouse=True)
def few_kept(monkeypatch):
    """Logs of these sizes are summed, and not read into memory."""
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 2000)


def readings(rows, seed, zero, model=None):
    """Degrees of a joint whose error is that of `made_model`, with its own zero."""
    rng = np.random.default_rng(seed)
    reference = np.mod(np.cumsum(rng.uniform(0.0, 0.3, rows)), 360.0)
    error = (model or made_model(ratio=50.0)).error(reference)
    indicated = np.mod(reference + error + zero + rng.normal(0.0, NOISE, rows), 360.0)
    return reference, indicated


@pytest.fixture
def folder(tmp_path):
    """Three logs; the second holds two runs by name, the third two missing readings."""
    logs = tmp_path / "logs"
    logs.mkdir()
    for i in range(3):
        reference, indicated = readings(20_000, i, 100.0 * i)
        table = {"reference_deg": reference, "indicated_deg": indicated}
        if i == 1:
            indicated[8000:] = np.mod(indicated[8000:] + 7.0, 360.0)
            table["run"] = ["warm"] * 8000 + ["cold"] * 12_000
        if i == 2:
            indicated[5], reference[700] = np.nan, np.nan
        pq.write_table(pa.table(table), logs / f"{i}.parquet", row_group_size=3000)
    return logs


def in_memory(folder):
    runs = []
    for i in range(3):
        table = pq.read_table(folder / f"{i}.parquet")
        reference = table["reference_deg"].to_numpy()
        indicated = table["indicated_deg"].to_numpy()
        known = np.isfinite(reference) & np.isfinite(indicated)
        parts = [known]
        if i == 1:
            parts = [known & (np.arange(20_000) < 8000), known & (np.arange(20_000) >= 8000)]
        runs += [ta.CalibrationRun(reference[p], indicated[p], 360.0) for p in parts]
    return runs


ORDERS = {"output": [1, 2, 3], "motor": [1]}


def test_one_pass_equals_the_fit_in_memory(folder):
    found = ta.fit_logs(folder, ORDERS, gear_ratio=50.0)
    expected = ta.fit(in_memory(folder), ORDERS, gear_ratio=50.0, loss="linear")
    assert (found.readings, found.missing, len(found.moments.runs)) == (59_998, 2, 4)
    for mine, theirs in zip(found.model.shafts, expected.model.shafts, strict=True):
        assert (mine.name, mine.orders) == (theirs.name, theirs.orders)
        np.testing.assert_allclose(mine.cosine, theirs.cosine, rtol=0, atol=1e-13)
        np.testing.assert_allclose(mine.sine, theirs.sine, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6, atol=1e-14)
    assert found.residual_variance == pytest.approx(expected.residual_variance, rel=1e-9)
    assert found.model.partial_span is None


def test_one_pass_gives_any_other_orders(folder):
    found = ta.fit_logs(folder, ORDERS, gear_ratio=50.0)
    less = found.moments.solve([1, 3])
    expected = ta.fit(in_memory(folder), [1, 3], loss="linear")
    np.testing.assert_allclose(less.amplitudes, expected.amplitudes, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kind", ["parquet", "arrow", "one batch", "lz4", "h5", "csv"])
def test_threads_change_no_bit(tmp_path, monkeypatch, kind):
    monkeypatch.setattr("trueangle.formats.parquet._STRETCH", 4000)
    monkeypatch.setattr("trueangle.formats.arrow._STRETCH", 1 << 16)
    monkeypatch.setattr("trueangle.formats.csvfile.BLOCK", 1 << 16)
    ending = "arrow" if kind in ("lz4", "one batch") else kind
    for i in range(3):
        reference, indicated = readings(20_000, i, 100.0 * i)
        indicated[100 * i] = np.nan
        warm = np.arange(20_000) // 100 % 3 == 1
        columns = {
            "other": np.arange(20_000),
            "reference_deg": reference,
            "run": 1.0 * warm if kind == "h5" else np.where(warm, "warm", "cold"),
            "indicated_deg": indicated,
        }
        _write(tmp_path / f"{i}.{ending}", kind, columns, monkeypatch)
    one, two, four = (ta.fit_logs(tmp_path, [1, 2, 3], threads=n) for n in (1, 2, 4))
    assert (one.readings, one.missing) == (59_997, 3)
    names = [0.0, 1.0] if kind == "h5" else ["cold", "warm"]
    assert sorted(label for *_file, label in one.moments.runs) == sorted(3 * names)
    for other in (two, four):
        assert other.model == one.model
        assert other.moments.runs == one.moments.runs
        np.testing.assert_array_equal(other.covariance, one.covariance)
    log = tmp_path / f"0.{ending}"
    if kind != "csv":  # its blocks are read side by side, and summed one after the other
        assert len(find_format(log).stretches(log)) > 3


def _write(path, kind, columns, monkeypatch):
    """A log in many parts."""
    if kind == "h5":
        h5py = pytest.importorskip("h5py")
        monkeypatch.setattr("trueangle.formats.hdf5._BLOCK", 999)
        monkeypatch.setattr("trueangle.formats.hdf5._PART", 4000)
        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                chunks = (700,) if name == "indicated_deg" else (300,)
                file.create_dataset(name, data=values, chunks=chunks, compression="gzip")
        return
    table = pa.table(columns)
    if kind == "parquet":
        pq.write_table(table, path, row_group_size=1500)
    elif kind == "csv":
        pa.csv.write_csv(table, path, pa.csv.WriteOptions(quoting_style="none"))
    else:
        options = pa.ipc.IpcWriteOptions(compression="lz4" if kind == "lz4" else None)
        with pa.ipc.new_file(path, table.schema, options=options) as writer:
            writer.write_table(table, max_chunksize=None if kind == "one batch" else 1500)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_damaged_log_ends_the_fit(folder, monkeypatch, threads):
    monkeypatch.setattr("trueangle.formats.parquet._STRETCH", 4000)
    path = folder / "2.parquet"
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 20_000] = bytes(20_000)
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"2.parquet.*damaged"):
        ta.fit_logs(folder, [1], threads=threads)


@pytest.mark.parametrize("arrow", [True, False])
def test_csv_with_runs_equals_parquet(tmp_path, monkeypatch, arrow):
    if not arrow:
        monkeypatch.setattr("trueangle.formats.csvfile._plain_block", lambda: None)
    monkeypatch.setattr("trueangle.formats.csvfile.SMALL", 0)
    monkeypatch.setattr("trueangle.formats.csvrows.BLOCK", 1 << 16)
    monkeypatch.setattr("trueangle.formats.csvfile.BLOCK", 1 << 16)
    reference, indicated = readings(9000, 1, 0.0)
    indicated[4000:] += 3.0
    labels = np.repeat(["01", "1", "slow, warm"], [4000, 3000, 2000]).tolist()
    table = {"run": labels, "reference_deg": reference, "indicated_deg": indicated}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    for path, last in (("plain.csv", "slow warm"), ("quoted.csv", '"slow, warm"')):
        rows = [
            f"{last if label.startswith('s') else label + ' '},{x!r},{y!r}"
            for label, x, y in zip(labels, reference.tolist(), indicated.tolist(), strict=True)
        ]
        (tmp_path / path).write_text("\n".join(["run,reference_deg,indicated_deg", *rows]))
    expected = ta.fit_logs(tmp_path / "a.parquet", [1, 2, 3])
    for path in ("plain.csv", "quoted.csv"):
        found = ta.fit_logs(tmp_path / path, [1, 2, 3])
        names = [label.replace(",", "") for *_file, label in found.moments.runs]
        assert names == ["01", "1", "slow warm"]
        assert (found.readings, found.missing) == (9000, 0)
        np.testing.assert_allclose(
            found.model.amplitudes, expected.model.amplitudes, rtol=0, atol=1e-13
        )
        np.testing.assert_allclose(found.offsets, expected.offsets, rtol=0, atol=1e-12)


def test_runs_without_a_label_are_one_run(tmp_path):
    reference, indicated = readings(3000, 1, 0.0)
    labels = np.repeat([1.0, np.nan, 2.0], 1000)
    table = {"reference_deg": reference, "indicated_deg": indicated, "run": labels}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    found = ta.fit_logs(tmp_path / "a.parquet", [1])
    assert [label for *_file, label in found.moments.runs] == [1.0, None, 2.0]
    assert found.readings == found.moments.count == 3000


def test_orders_are_selected_by_evidence(folder):
    found = ta.fit_logs(folder, gear_ratio=50.0)
    assert {shaft.name: shaft.orders for shaft in found.model.shafts} == {"output": (1, 3, 50)}
    assert found.selection.row(1).holdout_gain > 0.5
    assert found.selection.row(2).verdict == "noise"
    assert found.notes[0] == "2 rows with an empty cell omitted."
    assert "in one pass" in found.notes[1]


def test_the_note_of_one_pass_tells_how_many_readings_were_kept(folder, monkeypatch):
    """By the blocks of 256 of each run, in memory as many as the pass may keep."""
    from trueangle.logs import fitting

    kept = []

    def fitted(runs, *given, _fit=fitting.fitted_to, **options):
        kept.append(sum(len(run) for run in runs))
        return _fit(runs, *given, **options)

    monkeypatch.setattr(fitting, "fitted_to", fitted)
    notes = ta.fit_logs(folder, gear_ratio=50.0).notes
    assert any(
        f"are of all 59998 readings, in one pass. Positions, repeats, correlation "
        f"and the ridge are estimated from {kept[-1]} of them" in note
        for note in notes
    )
    # Four runs of a block each at least; halves go where they are more than 2000.
    assert 1000 < kept[-1] <= 2000


def test_no_order_is_selected_from_noise(tmp_path):
    flat = ta.HarmonicModel([], period=360.0)
    for i in range(4):
        reference, indicated = readings(5000, i, 3.0, flat)
        table = pa.table({"reference_deg": reference, "indicated_deg": indicated})
        pq.write_table(table, tmp_path / f"{i}.parquet")
    with pytest.raises(NoModelError, match="no model: "):
        ta.fit_logs(tmp_path)


def test_partial_travel_is_noted_and_kept_in_the_model(tmp_path):
    reference = np.linspace(30.0, 240.0, 50_000)
    indicated = reference + 0.3 * np.sin(np.radians(reference))
    table = pa.table({"reference_deg": reference, "indicated_deg": indicated})
    pq.write_table(table, tmp_path / "a.parquet")
    found = ta.fit_logs(tmp_path, [1])
    start, stop = found.model.partial_span
    assert (start, stop) == (pytest.approx(30.0, abs=1e-9), pytest.approx(240.0, abs=1e-9))
    assert "outside it is extrapolated" in found.summary()


def test_units_counts_and_csv(tmp_path):
    reference, indicated = readings(3000, 1, 0.0)
    counts = indicated * 65536 / 360
    rows = [f"{np.radians(x)!r},{c!r}" for x, c in zip(reference.tolist(), counts, strict=True)]
    rows = [row.replace("np.float64(", "").replace(")", "") for row in rows]
    (tmp_path / "a.csv").write_text("\n".join(["reference_rad,indicated_count", *rows]))
    found = ta.fit_logs(tmp_path / "a.csv", ORDERS, gear_ratio=50.0, counts_per_turn=65536)
    run = ta.CalibrationRun(np.radians(reference), np.radians(indicated))
    expected = ta.fit(run, ORDERS, gear_ratio=50.0, loss="linear")
    np.testing.assert_allclose(found.model.amplitudes, expected.amplitudes, rtol=0, atol=1e-12)


def test_wrong_signs_and_missing_columns_are_refused(tmp_path):
    reference, indicated = readings(3000, 1, 0.0)
    pq.write_table(
        pa.table({"reference_deg": reference, "indicated_deg": -indicated}), tmp_path / "a.parquet"
    )
    with pytest.raises(FileError, match=r"a.parquet.*runs backwards"):
        ta.fit_logs(tmp_path, [1])
    pq.write_table(pa.table({"indicated_deg": indicated}), tmp_path / "a.parquet")
    with pytest.raises(FileError, match=r"no column reference_deg"):
        ta.fit_logs(tmp_path, [1])


def test_the_command_fits_folders_in_one_pass(folder, tmp_path, capsys):
    model = tmp_path / "m.json"
    assert (
        main(["fit", str(folder), "-o", str(model), "--gear-ratio", "50", "--json", "--one-pass"])
        == 0
    )
    printed = json.loads(capsys.readouterr().out)
    assert (printed["readings"], printed["runs"], printed["missing"]) == (59_998, 4, 2)
    assert [(o["shaft"], o["order"]) for o in printed["orders"]] == [
        ("output", 1),
        ("output", 3),
        ("output", 50),
    ]
    assert any(not row["retained"] for row in printed["evidence"])
    assert main(["fit", str(folder), "-o", str(model), "--loss", "huber", "--one-pass"]) == 1
    assert "in one pass" in capsys.readouterr().err


def test_checksums_are_kept_where_asked_for(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("trueangle.formats.parquet._STRETCH", 4000)
    wanted = [hashlib.sha256((folder / f"{i}.parquet").read_bytes()).hexdigest() for i in range(3)]
    path = tmp_path / "m.json"
    assert (
        main(["fit", str(folder), "-o", str(path), "--orders", "1", "--checksums", "--one-pass"])
        == 0
    )
    sources = ta.load_model(path).provenance.inputs
    assert [source.sha256 for source in sources] == wanted
    assert [source.file for source in sources] == ["0.parquet", "1.parquet", "2.parquet"]
    without = ta.fit_logs(folder, [1]).model.provenance.inputs
    assert [source.sha256 for source in without] == ["", "", ""]


def test_a_fit_of_logs_corrects_logs(tmp_path):
    for i in range(2):  # of one zero: a model has one
        reference, indicated = readings(20_000, i, 5.0)
        table = pa.table({"reference_deg": reference, "indicated_deg": indicated})
        pq.write_table(table, tmp_path / f"{i}.parquet")
    model = ta.fit_logs(tmp_path / "0.parquet", ORDERS, gear_ratio=50.0).model
    ta.correct_logs(tmp_path / "1.parquet", model, tmp_path / "out.parquet")
    out = pq.read_table(tmp_path / "out.parquet")
    left = ta.wrap(out["corrected_deg"].to_numpy() - out["reference_deg"].to_numpy(), 360.0)
    assert left.std() < 1.02 * NOISE


def test_the_orders_command_prints_the_evidence_of_logs(folder, capsys, monkeypatch):
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 30_000)  # enough to tell the noise
    assert main(["orders", str(folder), "--gear-ratio", "50", "--json", "--one-pass"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [o["order"] for o in printed["orders"] if o["retained"]] == [1, 3, 50]
    assert printed["noise_arcsec"] == pytest.approx(NOISE * 3600, rel=0.05)
    assert main(["orders", str(folder), "--gear-ratio", "50", "--one-pass"]) == 0
    assert "noise" in capsys.readouterr().out
    assert main(["orders", str(folder), "--method", "paper", "--one-pass"]) == 1


def logs_of(folder, patterns, memory=0.0, seed=1):
    """A log for each pattern ``(order, amplitude, phase)``, with noise that remembers."""
    rng = np.random.default_rng(seed)
    for i, lines in enumerate(patterns):
        reference = np.linspace(0.0, 720.0, 2000)
        noise = rng.normal(size=reference.size)
        for j in range(1, noise.size):
            noise[j] = memory * noise[j - 1] + np.sqrt(1.0 - memory**2) * noise[j]
        error = sum(a * np.sin(np.radians(k * reference + p)) for k, a, p in lines)
        table = {"reference_deg": reference, "indicated_deg": reference + error + NOISE * noise}
        pq.write_table(pa.table(table), folder / f"unit{i}.parquet")
    return folder


SAME, OTHER = [(1, 0.2, 10.0), (2, 0.1, 70.0)], [(1, 0.2, 130.0), (2, 0.05, 200.0)]


def test_a_folder_of_unlike_units_raises_a_warning_that_names_them(tmp_path):
    logs_of(tmp_path, [SAME, SAME, OTHER, SAME])
    with pytest.warns(ta.errors.UnlikeRunsWarning, match=r"unit2\.parquet \(of 4\)"):
        found = ta.fit_logs(tmp_path, [1, 2])
    assert any("unit2.parquet" in note for note in found.notes)


def test_one_pass_takes_the_scatter_between_runs_under_correlated_noise(tmp_path):
    logs_of(tmp_path, [SAME] * 8, memory=0.95)
    assert ta.fit_logs(tmp_path, [1, 2]).uncertainty.kind == "cluster"
    found = ta.fit_logs(tmp_path, [1, 2], covariance="cluster")
    runs = ta.read_runs([tmp_path / f"unit{i}.parquet" for i in range(8)])
    expected = ta.fit(runs, [1, 2], covariance="cluster")
    # Elements that vanish by symmetry are the rounding of two different orders of summation.
    nothing = 1e-12 * np.abs(expected.covariance).max()
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6, atol=nothing)
    np.testing.assert_allclose(found.interval(), expected.interval(), rtol=0, atol=1e-9)
    assert ta.fit_logs(tmp_path, [1, 2], covariance="white").uncertainty.kind == "white"
    found = ta.fit_logs(tmp_path, [1, 2], covariance="correlated")
    assert any("eighbours in time correlate by 0.9" in note for note in found.notes)


def test_one_pass_and_memory_print_the_same_json(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 6000)  # enough to cover the turn
    logs_of(tmp_path, [SAME] * 4)
    files = [str(tmp_path / f"unit{i}.parquet") for i in range(4)]
    printed = []
    for more in ([], ["--one-pass"]):
        model = tmp_path / "m.json"
        assert main(["fit", *files, "-o", str(model), "--loss", "linear", "--json", *more]) == 0
        printed.append(json.loads(capsys.readouterr().out))
    memory, once = printed
    assert memory.keys() == once.keys()
    for mine, theirs in zip(once["orders"], memory["orders"], strict=True):
        assert mine.keys() == theirs.keys()
        assert mine["amplitude_arcsec"] == pytest.approx(
            theirs["amplitude_arcsec"], abs=0.2 * theirs["std_arcsec"]
        )
        assert mine["std_arcsec"] == pytest.approx(theirs["std_arcsec"], rel=0.4)
    assert once["evidence"][0].keys() == memory["evidence"][0].keys()


def test_a_gear_of_a_fraction_is_fitted_over_its_turns(tmp_path):
    ratio, model = 50.5, made_model(ratio=50.5)
    rng = np.random.default_rng(4)
    for i in range(2):
        reference = np.linspace(30.0, 1100.0, 9000)
        error = model.error(reference) + rng.normal(0.0, NOISE, reference.size)
        table = pa.table({"reference_deg": reference, "indicated_deg": reference + error})
        pq.write_table(table, tmp_path / f"{i}.parquet")
    found = ta.fit_logs(tmp_path, ORDERS, gear_ratio=ratio)
    runs = ta.read_runs([tmp_path / f"{i}.parquet" for i in range(2)])
    expected = ta.fit(runs, ORDERS, gear_ratio=ratio)
    assert found.moments is not None
    assert found.model.fit.span == expected.model.fit.span == (30.0, 1100.0)
    np.testing.assert_allclose(
        found.model.amplitudes, expected.model.amplitudes, rtol=0, atol=1e-12
    )
    for i in range(2):
        table = pq.read_table(tmp_path / f"{i}.parquet")
        within = pa.table(
            {name: np.mod(table[name].to_numpy(), 360.0) for name in table.column_names}
        )
        pq.write_table(within, tmp_path / f"{i}.parquet")
    with pytest.raises(ta.errors.ArgumentError, match="one pass does not count turns"):
        ta.fit_logs(tmp_path, ORDERS, gear_ratio=ratio)


def test_outliers_of_logs_without_labels_are_named_as_in_memory(tmp_path):
    for i in range(2):
        reference, indicated = readings(6000, 40 + i, 10.0 * i)
        indicated[[700 * (i + 1), 4000]] += 20.0
        table = pa.table({"reference_deg": reference, "indicated_deg": indicated})
        pq.write_table(table, tmp_path / f"{i}.parquet")
    found = ta.fit_logs(tmp_path, {"output": [1, 2], "motor": [2]}, gear_ratio=50)
    runs = ta.read_runs([tmp_path / f"{i}.parquet" for i in range(2)])
    fitted = ta.fit(runs, {"output": [1, 2], "motor": [2]}, gear_ratio=50)
    assert {row for _, row in found.wild} >= {700, 1400, 4000}
    assert found.moments is not None
    assert found.wild == fitted.wild
