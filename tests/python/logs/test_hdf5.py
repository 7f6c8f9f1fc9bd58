"""HDF5 and MATLAB v7.3 logs: corrected data sets beside their sources, all else untouched."""

import struct
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.formats.format import Selection

from .conftest import made_angles, made_model, unwrapped_truth

h5py = pytest.importorskip("h5py")
from trueangle.formats import hdf5, hdf5sets  # noqa: E402

ROWS = 10_000


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr("trueangle.formats.hdf5._BLOCK", 999)


def made_file(path, angles, **options):
    with h5py.File(path, "w", userblock_size=512) as file:
        file.attrs["robot"] = "r7"
        group = file.create_group("joint3")
        group.create_dataset("indicated_deg", data=angles, **options)
        group["indicated_deg"].attrs["units"] = "deg"
        group["time_s"] = np.arange(angles.size) / 1e3
        file["note"] = "kept"
        file["table"] = np.array([(1, b"a")], dtype=[("x", "i4"), ("name", "S3")])
        file["link"] = h5py.SoftLink("/joint3/time_s")
    return path


def test_names_that_are_no_text_are_left_alone(tmp_path, model):
    """In Latin-1, as some recorders write them: the others are read and corrected."""
    angles = made_angles(ROWS)
    source = made_file(tmp_path / "a.h5", angles)
    with h5py.File(source, "a") as file:
        file["joint3"][b"t\xe9_deg"] = angles
    assert hdf5.columns(source) == ["joint3/indicated_deg", "joint3/time_s"]
    report = ta.correct_logs(source, model, tmp_path / "b.h5")
    assert report.logs[0].error is None
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["joint3"][b"t\xe9_deg"][:].tolist() == angles.tolist()


def test_an_attribute_that_is_no_text_is_no_unit(tmp_path, model):
    """Values of any length, of a damaged file, ended the process where they were read."""
    source = made_file(tmp_path / "a.h5", made_angles(ROWS))
    with h5py.File(source, "a") as file:
        data = file["joint3/indicated_deg"]
        lengths = np.empty(1, object)
        lengths[0] = np.arange(3.0)
        data.attrs.create("units", lengths, dtype=h5py.vlen_dtype(np.dtype("f8")))
        data.attrs["DIMENSION_LABELS"] = ["reading"]
    report = ta.correct_logs(source, model, tmp_path / "b.h5")
    assert report.logs[0].error is None
    with h5py.File(tmp_path / "b.h5") as file:
        made = file["joint3/corrected_deg"].attrs
        assert "units" not in made
        assert "units" in file["joint3/indicated_deg"].attrs
        assert list(made["DIMENSION_LABELS"]) == ["reading"]


def test_readings_that_lie_over_what_describes_them_are_damage(tmp_path, model):
    """Nothing that is written there lies beside them."""
    source = tmp_path / "a.h5"
    with h5py.File(source, "w") as file:
        file["indicated_deg"] = np.arange(40.0)
        place = file["indicated_deg"].id.get_offset()
    whole, where = source.read_bytes(), struct.pack("<QQ", place, 320)
    assert whole.count(where) == 1
    source.write_bytes(whole.replace(where, struct.pack("<QQ", 2, 320)))
    report = ta.correct_logs(source, model, tmp_path / "b.h5")
    told = str(report.logs[0].error)
    because = "is damaged: writing corrected readings changes the others"
    assert told.startswith(f"{source}, column 'indicated_deg': {because}")
    assert not (tmp_path / "b.h5").exists()


def test_data_sets_are_added_and_all_else_is_kept(tmp_path, model):
    angles = made_angles(ROWS)
    angles[[5, 2000]] = np.nan
    options = {"chunks": (700,), "compression": "gzip", "compression_opts": 3, "shuffle": True}
    source = made_file(tmp_path / "a.h5", angles, fletcher32=True, **options)
    before = source.read_bytes()
    report = ta.correct_logs(source, model, tmp_path / "b.h5")
    assert source.read_bytes() == before
    assert report.logs[0].result["rows"] == ROWS
    assert report.logs[0].result["joints"][0]["missing"] == 2
    with h5py.File(tmp_path / "b.h5") as out, h5py.File(source) as given:
        made = out["joint3/corrected_deg"]
        np.testing.assert_array_equal(made[()], model.correct(angles))
        assert {name: getattr(made, name) for name in options} == options
        assert made.fletcher32
        assert made.attrs["units"] == "deg"
        assert "model_sha256" in made.attrs["trueangle"]
        assert out.attrs["robot"] == "r7"
        assert out["note"][()] == b"kept"
        assert out["table"][0].item() == given["table"][0].item()
        np.testing.assert_array_equal(out["link"][()], given["joint3/time_s"][()])
        np.testing.assert_array_equal(out["joint3/indicated_deg"][()], angles)
        assert out.userblock_size == 512


@pytest.mark.parametrize("shape", [(1, ROWS), (ROWS, 1)])
def test_matlab_files_store_vectors_as_matrices(shape, tmp_path, model):
    angles = made_angles(ROWS).astype(np.float32)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["indicated_deg"] = angles.reshape(shape)
        file["indicated_deg"].attrs["MATLAB_class"] = np.bytes_("single")
    ta.correct_logs(tmp_path / "a.mat", model, tmp_path / "b.mat")
    with h5py.File(tmp_path / "b.mat") as out:
        made = out["corrected_deg"]
        assert (made.shape, made.dtype) == (shape, np.float32)
        assert made.attrs["MATLAB_class"] == b"single"
        np.testing.assert_array_equal(made[()].ravel(), model.correct(angles))


def test_several_joints_one_after_the_other_or_together(tmp_path):
    first, second = made_model(), made_model(argument="indicated")
    a, b = made_angles(ROWS, seed=1), made_angles(300, seed=2)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["j1/indicated_deg"] = a
        file["j2/indicated_deg"] = b
    ta.correct_logs(tmp_path / "a.h5", {"j1": first, "j2": second}, tmp_path / "both.h5")
    ta.correct_logs(tmp_path / "a.h5", {"j1": first}, tmp_path / "one.h5")
    ta.correct_logs(tmp_path / "one.h5", {"j2": second}, tmp_path / "two.h5")
    for name in ("both.h5", "two.h5"):
        with h5py.File(tmp_path / name) as out:
            np.testing.assert_array_equal(out["j1/corrected_deg"][()], first.correct(a))
            np.testing.assert_array_equal(out["j2/corrected_deg"][()], second.correct(b))


def test_turns_are_counted_over_blocks(tmp_path):
    model = made_model(ratio=50.5)
    angles = made_angles(ROWS, turns=5.5)
    ta.correct_logs(made_file(tmp_path / "a.h5", angles), model, tmp_path / "b.h5")
    with h5py.File(tmp_path / "b.h5") as out:
        np.testing.assert_allclose(
            out["joint3/corrected_deg"][()], unwrapped_truth(model, angles), rtol=0, atol=1e-10
        )


def test_bad_files_are_refused_with_their_name(tmp_path, model):
    (tmp_path / "text.h5").write_text("no HDF5")
    (tmp_path / "old.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(500))
    source = made_file(tmp_path / "short.h5", made_angles(ROWS))
    source.write_bytes(source.read_bytes()[:-3000])
    with h5py.File(tmp_path / "grid.h5", "w") as file:
        file["indicated_deg"] = np.zeros((3, 4))
    messages = {
        "text.h5": "not HDF5",
        "old.mat": "-v7.3",
        "short.h5": "damaged",
        "grid.h5": r"shape is \(3, 4\)",
    }
    for name, message in messages.items():
        report = ta.correct_logs(tmp_path / name, model, tmp_path / f"out{Path(name).suffix}")
        with pytest.raises(ta.errors.FileError, match=rf"{name}.*{message}"):
            raise report.logs[0].error
        assert not list(tmp_path.glob("out.*"))


def test_damage_within_is_found(tmp_path, model):
    options = {"chunks": (700,), "compression": "gzip"}
    source = made_file(tmp_path / "a.h5", made_angles(ROWS), **options)
    with h5py.File(source) as file:
        place = file["joint3/indicated_deg"].id.get_chunk_info(7).byte_offset + 512
    data = bytearray(source.read_bytes())
    data[place + 20 : place + 600] = bytes(580)
    source.write_bytes(data)
    report = ta.correct_logs(source, model, tmp_path / "b.h5")
    assert "damaged" in str(report.logs[0].error)


@pytest.mark.parametrize("packed", [True, False])
def test_a_chunk_is_unpacked_once_whatever_takes_parts_of_it(tmp_path, packed):
    options = {"compression": "gzip"} if packed else {}
    source = made_file(tmp_path / "a.h5", made_angles(ROWS), chunks=(ROWS,), **options)
    with h5py.File(source) as file:
        data = hdf5sets.cached(file, "joint3/indicated_deg")
        kept = data.id.get_access_plist().get_chunk_cache()[1]
    # HDF5 keeps a chunk that is not larger than that; one that is as it is is read in place.
    assert kept == (8 * ROWS if packed else 0)


@pytest.mark.parametrize("chunk", [None, 700, ROWS])
@pytest.mark.parametrize("parts", [1, 3, 20])
def test_parts_hold_every_row_once_and_whole_chunks(tmp_path, monkeypatch, chunk, parts):
    monkeypatch.setattr(hdf5, "_PART", ROWS // parts)
    angles = made_angles(ROWS)
    source = made_file(tmp_path / "a.h5", angles, chunks=chunk and (chunk,))
    name = "joint3/indicated_deg"
    stretches = hdf5.stretches(source)
    assert len(stretches) == parts
    read = [
        np.concatenate(
            [batch[name] for batch in hdf5.read(source, Selection([name], stretch=stretch))] or [[]]
        )
        for stretch in stretches
    ]
    np.testing.assert_array_equal(np.concatenate(read), angles)
    edges = np.cumsum([values.size for values in read])
    assert not (edges[edges < ROWS] % (chunk or 1)).any()


def test_hdf5_closes_after_its_file_was_closed(tmp_path, recwarn):
    """As an interrupt while h5py opens it leaves them: no error, and nothing told at the end."""
    path = made_file(tmp_path / "a.h5", made_angles(ROWS), chunks=(500,), compression="gzip")
    with hdf5._WrittenFile(path, "r+b") as output:
        file = h5py.File(output, "r+")
        file["joint3/indicated_deg"][::2] = 1.0
        file["more"] = np.arange(ROWS)
    file.close()
    output.check()
    assert not recwarn
