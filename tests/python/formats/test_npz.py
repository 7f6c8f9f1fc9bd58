"""Archives of numpy as runs and as logs."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError

MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.5, 360.0)
THETA = np.linspace(0.0, 720.0, 5001)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr("trueangle.formats.npz.BLOCK", 777)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_is_read_as_runs(save, tmp_path):
    labels = np.where(THETA < 360.0, "up", "more")
    save(
        tmp_path / "rig.npz",
        run=labels,
        reference_deg=THETA,
        enc=np.radians(THETA).astype(np.float32)[:, None],
        picture=np.zeros((3, 3)),
        short=np.zeros(7),
    )
    runs = ta.read_runs(tmp_path / "rig.npz", signals={"indicated": ("enc", "rad")})
    assert [run.label for run in runs] == ["up", "more"]
    np.testing.assert_allclose(runs[1].indicated, THETA[THETA >= 360.0], rtol=1e-6)


@pytest.mark.parametrize("kind", ["float64", "float32", ">f8", "int16"])
def test_a_copy_has_the_corrected_array_and_all_others(kind, tmp_path):
    given = {"indicated_deg": THETA.astype(kind), "picture": np.eye(4), "note": np.array("x")}
    np.savez_compressed(tmp_path / "log.npz", **given)
    report = ta.correct_logs(tmp_path / "log.npz", MODEL, tmp_path / "out.npz")
    assert report.is_done, report.logs[0].error
    with np.load(tmp_path / "out.npz") as made:
        for name, values in given.items():
            np.testing.assert_array_equal(made[name], values)
        corrected = made["corrected_deg"]
        assert corrected.dtype == (np.float32 if kind == "float32" else np.float64)
        expected = MODEL.correct(given["indicated_deg"].astype(corrected.dtype))
        np.testing.assert_array_equal(corrected, expected)
        assert b"corrected_deg" in made["trueangle.json"]


def test_missing_readings_stay_missing(tmp_path):
    angles = THETA.copy()
    angles[5] = np.nan
    np.savez(tmp_path / "log.npz", indicated_deg=angles)
    assert ta.correct_logs(tmp_path / "log.npz", MODEL, tmp_path / "out.npz").is_done
    with np.load(tmp_path / "out.npz") as made:
        assert np.flatnonzero(np.isnan(made["corrected_deg"])).tolist() == [5]


def test_what_is_none_or_would_run_code_is_refused(tmp_path):
    path = tmp_path / "bad.npz"
    np.savez(path, reference_deg=np.array([0.0, {}], dtype=object), indicated_deg=THETA)
    with pytest.raises(FileError, match=r"bad\.npz.*no column reference_deg"):
        ta.read_runs(path)  # objects are never unpickled
    np.savez(path, reference_deg=THETA[:5], indicated_deg=THETA)
    with pytest.raises(FileError, match="differ in length"):
        ta.read_runs(path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(FileError, match="damaged"):
        ta.read_runs(path)


def test_an_archive_without_columns_is_refused(tmp_path):
    np.savez(tmp_path / "empty.npz", picture=np.eye(3))
    with pytest.raises(FileError, match="no column reference_deg"):
        ta.read_runs(tmp_path / "empty.npz")
    np.savez(tmp_path / "nothing.npz")
    with pytest.raises(FileError):
        ta.read_runs(tmp_path / "nothing.npz")
