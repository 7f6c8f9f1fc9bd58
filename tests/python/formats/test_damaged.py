"""Damage behind the first checks of a format, as `tests/fuzz` found it: told, in bounded time."""

import re
import sqlite3
import struct
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError, MessageLinesWarning

MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.0, 360.0)
THETA = np.linspace(0.0, 350.0, 40)

#: Seconds of the processor for a line of 60 000 characters: it takes milliseconds where the time
#: grows with its length, and minutes where it grows with the square.
SOON = 5.0


def corrected(path):
    """The error of a correction, or None."""
    report = ta.correct_logs(path, MODEL, path.with_name(f"out{path.suffix}"))
    return report.logs[0].error


@pytest.mark.parametrize("rubbish", ["x" * 60_000, "y:" + "9" * 60_000 + "z", "a b " * 15_000])
def test_a_long_line_of_a_serial_log_costs_its_length(rubbish, tmp_path):
    path = tmp_path / "serial.log"
    rows = [f"reference_deg:{t},indicated_deg:{t + 0.1}" for t in THETA]
    path.write_text("\n".join([*rows[:20], rubbish, *rows[20:]]) + "\n")
    begun = time.process_time()
    with pytest.warns(MessageLinesWarning, match="1 line of words"):
        (run,) = ta.read_runs(path)
    assert time.process_time() - begun < SOON
    np.testing.assert_array_equal(run.reference, THETA)


def test_a_record_of_wpilib_later_than_any_clock(tmp_path):
    from trueangle.formats import wpilog

    start = wpilog._started(1, "indicated_deg", "{}", 0)
    value = struct.pack("<d", 1.0)
    late = bytes([0b0111_0000, 1, len(value)]) + (2**63).to_bytes(8, "little") + value
    path = tmp_path / "log.wpilog"
    path.write_bytes(b"WPILOG\x00\x01\x00\x00\x00\x00" + start + late)
    place = 12 + len(start)
    with pytest.raises(FileError, match=rf"record at byte {place} is of the time {2**63} us"):
        ta.read_runs(path)


def test_arrays_beside_the_corrected_one_may_be_longer(tmp_path):
    np.savez(tmp_path / "log.npz", indicated_deg=THETA[:5], reference_deg=THETA)
    assert corrected(tmp_path / "log.npz") is None
    with np.load(tmp_path / "out.npz") as made:
        np.testing.assert_array_equal(made["corrected_deg"], MODEL.correct(THETA[:5]))


def test_records_side_by_side_and_fields_of_several_numbers(tmp_path):
    kind = [("indicated_deg", "<f8"), ("pair", "<f8", (2,))]
    table = np.zeros((20, 2), kind)
    path = tmp_path / "log.npy"
    np.save(path, table)
    with pytest.raises(FileError, match=r"records one after the other are needed, got \(20, 2\)"):
        ta.read_runs(path)
    table = np.zeros((1, 40), kind)
    table["indicated_deg"] = THETA
    np.save(path, table)
    assert corrected(path) is None
    made = np.load(tmp_path / "out.npy")
    np.testing.assert_array_equal(made["corrected_deg"], MODEL.correct(THETA))
    with pytest.raises(FileError, match=r"its columns are indicated_deg$"):
        ta.read_runs(path)


@pytest.mark.parametrize("kind", ["float16", ">f2", "float32"])
def test_hdf5_of_numbers_of_few_bits_is_corrected(kind, tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["indicated_deg"] = THETA.astype(kind)
    assert corrected(path) is None
    with h5py.File(tmp_path / "out.h5") as file:
        given, made = file["indicated_deg"][:], file["corrected_deg"][:]
    # Corrected as float32 is: to half a unit of its last digit at 360.
    np.testing.assert_allclose(made, MODEL.correct(given.astype(float)), atol=2e-5)


def test_a_filter_that_does_not_fit_its_chunks_is_not_run(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        made = file.create_dataset(
            "indicated_deg", data=THETA.astype("i4"), chunks=(16,), scaleoffset=0
        )
        given = made.id.get_create_plist().get_filter(0)[2]
    whole = path.read_bytes()
    packed = struct.pack(f"<{len(given)}I", *given)
    assert whole.count(packed) == 1
    wrong = struct.pack(f"<{len(given)}I", *given[:2], 1 << 30, *given[3:])
    path.write_bytes(whole.replace(packed, wrong))
    told = r"column 'indicated_deg': .*scale-offset filter do not fit its 16 values of 4 bytes"
    with pytest.raises(FileError, match=told):
        ta.read_runs(path, signals={"reference": ("indicated_deg", "deg")})


def mdf_with(folder, place, form, value):
    """A file of MDF4 with one field of its channel group changed."""
    asammdf = pytest.importorskip("asammdf")
    path = folder / "log.mf4"
    signal = asammdf.Signal(
        THETA, np.arange(40) * 0.1, name="indicated_deg", invalidation_bits=np.arange(40) == 3
    )
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([signal])
        mdf.save(path, overwrite=True)
    whole = bytearray(path.read_bytes())
    at = whole.index(b"##CG") + 24 + 48 + place
    whole[at : at + struct.calcsize(form)] = struct.pack(form, value)
    path.write_bytes(bytes(whole))
    return path


def test_records_that_a_group_of_mdf_has_not(tmp_path):
    path = mdf_with(tmp_path, 8, "<Q", 50)
    error = corrected(path)
    assert isinstance(error, FileError)
    assert "40 of 50 records; copy it again" in str(error)


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [(24, 1 << 30, "declares records of"), (28, 0, "its mark is bit .* of 0")],
)
def test_records_and_marks_wider_than_the_file(place, value, told, tmp_path):
    error = corrected(mdf_with(tmp_path, place, "<I", value))
    assert isinstance(error, FileError)
    assert re.search(told, str(error)) or "declares" in str(error)


def test_a_topic_that_is_no_text(tmp_path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with rosbags.Writer(tmp_path / "bag", version=9) as writer:
        kind = "sensor_msgs/msg/JointState"
        writer.add_connection("/joint_states", kind, typestore=store)
    (path,) = (tmp_path / "bag").glob("*.db3")
    alone = path.rename(tmp_path / "log.db3")
    with sqlite3.connect(alone) as base:
        base.execute("UPDATE topics SET name = x'00ff'")
    base.close()
    error = corrected(alone)
    assert isinstance(error, FileError)
    assert "log.db3: is damaged" in str(error)


def test_a_text_of_matlab_in_the_place_of_the_corrected_angle(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "log.mat", {"indicated_deg": THETA, "corrected_deg": "words"})
    error = corrected(tmp_path / "log.mat")
    assert isinstance(error, FileError)
    assert "column 'corrected_deg': exists already; correct the original" in str(error)
    savemat(tmp_path / "log.mat", {"note": "words"})
    with pytest.raises(FileError, match="no column reference_deg"):
        ta.read_runs(tmp_path / "log.mat")


def test_what_a_file_holds_is_told_in_one_line_that_can_be_printed(tmp_path):
    path = tmp_path / "runs.csv"
    path.write_text("time_s,\x1b[2Jred,\u0378\n1,2,3\n")
    with pytest.raises(FileError, match=r"\\x1b\[2Jred, \\u0378$") as caught:
        ta.read_runs(path)
    assert str(caught.value).isprintable()
