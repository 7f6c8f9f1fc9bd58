"""Arrays of numpy, MATLAB files and tables of firmware."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError

MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
THETA = np.linspace(0.0, 700.0, 3001)
SAID = THETA + 0.5 + 0.25 * np.sin(np.radians(THETA))


def test_columns_side_by_side(tmp_path):
    np.save(tmp_path / "rig.npy", np.column_stack([THETA, SAID]))
    signals = {"reference": ("column1", "deg"), "indicated": ("column2", "deg")}
    (run,) = ta.read_runs(tmp_path / "rig.npy", signals=signals)
    np.testing.assert_array_equal(run.indicated, SAID)
    report = ta.correct_logs(
        tmp_path / "rig.npy", MODEL, tmp_path / "out.npy", signals={"indicated": ("column2", "deg")}
    )
    assert report.is_done, report.logs[0].error
    made = np.load(tmp_path / "out.npy")
    np.testing.assert_array_equal(made[:, 1], SAID)
    np.testing.assert_allclose(made[:, 2], THETA, atol=1e-9)


def test_records_with_names(tmp_path):
    records = np.empty(THETA.size, dtype=[("run", "U2"), ("indicated_deg", "<f4"), ("n", "i4")])
    records["indicated_deg"], records["n"], records["run"] = SAID, np.arange(THETA.size), "a"
    np.save(tmp_path / "log.npy", records)
    assert ta.correct_logs(tmp_path / "log.npy", MODEL, tmp_path / "out.npy").is_done
    made = np.load(tmp_path / "out.npy")
    np.testing.assert_array_equal(made["n"], records["n"])
    np.testing.assert_allclose(made["corrected_deg"], THETA, atol=1e-3)


@pytest.mark.parametrize("ending", ["csv", "npy", "txt"])
def test_a_table_of_entries_is_a_turn(ending, tmp_path):
    counts = 16_384
    place = np.arange(counts) * (360.0 / counts)
    entries = np.round((place + 0.5 * np.sin(np.radians(place))) * (counts / 360.0)).astype(int)
    path = tmp_path / f"table.{ending}"
    if ending == "npy":
        np.save(path, entries)
    else:
        path.write_text("\n".join(map(str, entries.tolist())))
    (run,) = ta.read_runs(path, counts_per_turn=counts)
    assert len(run) == counts
    np.testing.assert_allclose(run.reference, place)
    model = ta.fit(run, orders=[1, 2]).model
    assert model.amplitudes[0] == pytest.approx(0.5, abs=1e-3)
    with pytest.raises(FileError, match=r"Its unit is unknown.*`counts_per_turn=`"):
        ta.read_runs(path)


@pytest.mark.parametrize("compressed", [True, False])
def test_matlab_of_today_and_before(compressed, tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    path = tmp_path / "rig.mat"
    content = {
        "rig": {"ref": THETA, "enc": np.radians(SAID), "name": "rig 7"},
        "picture": np.eye(3),
    }
    scipy_io.savemat(path, content, do_compression=compressed)
    signals = {"reference": ("rig/ref", "deg"), "indicated": ("rig/enc", "rad")}
    (run,) = ta.read_runs(path, signals=signals)
    np.testing.assert_allclose(run.indicated, SAID, rtol=1e-14)
    report = ta.correct_logs(
        path, MODEL, tmp_path / "out.mat", signals={"indicated": ("rig/enc", "rad")}
    )
    assert report.is_done, report.logs[0].error
    made = scipy_io.loadmat(tmp_path / "out.mat")
    np.testing.assert_array_equal(made["picture"], np.eye(3))
    (name,) = [name for name in made if "corrected" in name and not name.startswith("__")]
    np.testing.assert_allclose(np.degrees(made[name][:, 0]), THETA, atol=1e-9)
    assert (tmp_path / "out.mat").read_bytes().startswith(path.read_bytes())


@pytest.mark.parametrize("name", ["a.npy", "a.mat", "a.npz"])
def test_what_is_damaged_is_told_with_its_name(name, tmp_path):
    heads = {
        "a.npy": b"\x93NUMPY\x01\x00\xff\xff",
        "a.mat": b"MATLAB 5.0 MAT",
        "a.npz": b"PK\x03\x04",
    }
    path = tmp_path / name
    path.write_bytes(heads[name] + b"\x01" * 200)
    with pytest.raises(FileError, match=rf"{name}: is damaged or not"):
        ta.read_runs(path)


@pytest.mark.parametrize("ending", [".mat", ".h5"])
def test_a_file_of_unnamed_arrays_says_what_is_in_it(ending, tmp_path):
    path = tmp_path / f"rig{ending}"
    angle = np.arange(40.0)
    if ending == ".mat":
        scipy_io = pytest.importorskip("scipy.io")
        scipy_io.savemat(path, {"rig": {"ref": angle, "enc": angle + 0.1}, "other": np.arange(3.0)})
    else:
        with pytest.importorskip("h5py").File(path, "w") as file:
            file["rig/ref"], file["rig/enc"] = angle, angle + 0.1
    with pytest.raises(FileError, match=r"no column reference_deg .*rig/enc"):
        ta.check(path)
    with pytest.raises(FileError, match=r"no column reference_deg .*rig/enc"):
        ta.read_runs(path)


SHAPES = {
    "a column": (np.arange(6.0), ["column1"]),
    "a row": (np.arange(6.0)[None, :], ["column1"]),
    "in the order of Fortran": (np.asfortranarray(np.arange(12.0).reshape(6, 2)), 2),
    "of other bytes": (np.arange(12.0).reshape(6, 2).astype(">f8"), 2),
    "single, of other bytes": (np.arange(12.0).reshape(6, 2).astype(">f4"), 2),
    "small whole numbers": (np.arange(12, dtype=">i2").reshape(6, 2), 2),
    "records in a column": (np.zeros((6, 1), [("a", ">f8"), ("b", "i2")]), ["a", "b"]),
    "records of arrays": (np.zeros(6, [("a", "f8"), ("two", "f8", 2), ("t", "S3")]), ["a", "t"]),
}


@pytest.mark.parametrize("case", SHAPES)
def test_an_array_of_any_shape_is_columns_and_gets_one_more(case, tmp_path):
    from trueangle.formats import npy
    from trueangle.formats.format import Selection

    array, names = SHAPES[case]
    names = [f"column{k + 1}" for k in range(names)] if isinstance(names, int) else names
    array = array.copy(order="K")
    if array.dtype.names:
        array[array.dtype.names[0]] = np.arange(6.0).reshape(array.shape)
    path, column = tmp_path / "a.npy", names[0]
    np.save(path, array)
    assert npy.columns(path) == names
    assert npy.extent(path, [column, column]) == (6, 96)
    (batch,) = npy.read(path, Selection([column]))
    first = array.reshape(6, -1)[:, 0] if array.dtype.names is None else np.arange(6.0)
    np.testing.assert_array_equal(batch[column], first)
    assert batch[column].dtype.isnative
    signals = {"indicated": (column, "deg")}
    report = ta.correct_logs(path, MODEL, tmp_path / "out.npy", signals=signals)
    assert report.is_done, report.logs[0].error
    made = np.load(tmp_path / "out.npy")
    wanted = MODEL.correct(first.astype(np.float64))
    if array.dtype.names is None:
        assert made.dtype == (np.float32 if "single" in case else np.float64)
        width = array.size // 6
        np.testing.assert_array_equal(made[:, :width], array.reshape(6, width))
        np.testing.assert_allclose(made[:, width], wanted, rtol=1e-6)
        assert made.shape == (6, width + 1)
    else:
        assert made.dtype.names == (*array.dtype.names, "corrected_deg")
        np.testing.assert_array_equal(made["corrected_deg"], wanted)
        for name in array.dtype.names:
            assert made.dtype[name] == array.dtype[name]
            np.testing.assert_array_equal(made[name], array.reshape(-1)[name])


@pytest.mark.parametrize(
    ("array", "told"),
    [
        (np.zeros((2, 3, 4)), "one column, or several side by side, are needed"),
        (np.zeros(0), "one column, or several side by side, are needed"),
        (np.array(["a", "b"]), "numbers are needed, the array holds <U1"),
        (np.zeros((2, 2), [("a", "f8")]), r"records one after the other are needed, got \(2, 2\)"),
    ],
)
def test_an_array_that_is_no_table_is_refused(array, told, tmp_path):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FileError, match=rf"a\.npy: {told}"):
        ta.read_runs(tmp_path / "a.npy")
