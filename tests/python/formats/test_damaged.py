"""Damage behind the first checks of a format, as `tests/fuzz` found it: told, in bounded time."""

import re
import sqlite3
import struct
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError, MessageLinesWarning, MissingExtraError
from trueangle.formats import csvcells, csvfile, csvrows
from trueangle.formats.format import Format, Selection
from trueangle.formats.formats import find_format

from .test_matlab_elements import X, saved
from .test_wpilog import EXAMPLE

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


TOLD_DAMAGE_MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])


def changed(data, place, form, value):
    made = bytearray(data)
    struct.pack_into(form, made, place, value)
    return bytes(made)


def mdf(path, *groups):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for names in groups:
            times = np.arange(5.0)
            file.append([asammdf.Signal(times, times, name=name) for name in names])
        file.save(path, overwrite=True)


def mdf_block(kind, link):
    """A file with a link of its first block of a kind set to that block's own place, or another."""

    def write(path):
        mdf(path, ["reference_deg", "indicated_deg"])
        data = path.read_bytes()
        place = data.index(kind)
        path.write_bytes(changed(data, place + 24 + 8 * link, "<Q", place if link == 0 else 8))

    return write


def virtual(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        layout = h5py.VirtualLayout((5,), "f8")
        layout[:] = h5py.VirtualSource("b.h5", "x", (5,))
        file.create_virtual_dataset("reference_deg", layout)
        file["indicated_deg"] = np.arange(5.0)


def lengths(path):
    with pytest.importorskip("h5py").File(path, "w") as file:
        file["reference_deg"], file["indicated_deg"] = np.arange(5.0), np.arange(4.0)


def square(path):
    with pytest.importorskip("h5py").File(path, "w") as file:
        file["reference_deg"] = file["indicated_deg"] = np.eye(3)


def of_bytes(data):
    return lambda path: path.write_bytes(data)


#: Name, how it is written, and what reading it as runs says behind the name.
TOLD = {
    "version": ("a.wpilog", of_bytes(EXAMPLE[:6] + b"\2\0" + EXAMPLE[8:]),
                "is a data log of version 0.2; version 1 is read"),
    "elements": ("a.mat", of_bytes(saved({"x": X}) + b"\0\0\0"),
                 "is damaged or not a MATLAB file: byte 584: 3 bytes are no element; save it "
                 "again, with -v7 or -v7.3"),
    "flags": ("a.mat", of_bytes(changed(saved({"x": X}), 140, "<I", 4)),
              "is damaged or not a MATLAB file: byte 136: an array without its flags; save it "
              "again, with -v7 or -v7.3"),
    "small": ("a.mat", of_bytes(saved({"x": X}) + struct.pack("<II", (6 << 16) | 1, 0)),
              "is damaged or not a MATLAB file: byte 584: a small element of 6 bytes; save it "
              "again, with -v7 or -v7.3"),
    "one of two groups": ("a.mf4", lambda p: mdf(p, ["reference_deg"], ["indicated_deg"]),
                          "channels that belong together are in several groups: reference_deg in "
                          "0, indicated_deg in 1"),
    "a circle": ("a.mf4", mdf_block(b"##CG", 0),
                 "is damaged: the block at byte HERE leads back to that at HERE"),
    "another block": ("a.mf4", mdf_block(b"##CG", 1),
                      "is damaged: the CG block at byte HERE leads to byte 8, where there is no "
                      "CN block"),
    "no mdf": ("a.mf4", of_bytes(b"x" * 100), "is not MDF4"),
    "virtual": ("a.h5", virtual,
                "column 'reference_deg': its values are in other data sets or files (a virtual "
                "or external data set), which are not read. Write them into "
                "this file (h5repack or h5py)"),
    "lengths": ("a.h5", lengths, "data sets differ in length: reference_deg 5, indicated_deg 4; "
                "export the file again"),
    "square": ("a.h5", square, "column 'reference_deg': one angle after the other is needed, its "
               "shape is (3, 3)"),
}  # fmt: skip


@pytest.mark.parametrize("case", TOLD)
def test_the_file_the_place_and_what_to_do(case, tmp_path):
    name, write, told = TOLD[case]
    path = tmp_path / name
    write(path)
    with pytest.raises(FileError) as caught:
        ta.read_runs(path)
    said = str(caught.value).removeprefix(f"{path}, ").removeprefix(f"{path}: ")
    if "HERE" in told:
        told = told.replace("HERE", str(path.read_bytes().index(b"##CG")))
    assert said == told


def test_a_line_that_is_too_long(monkeypatch, tmp_path):
    for module in (csvcells, csvfile, csvrows):
        monkeypatch.setattr(module, "LONGEST_LINE", 2 << 20, raising=False)
    path = tmp_path / "a.csv"
    path.write_text("reference_deg,indicated_deg\n0,0\n1," + "1" * (5 << 20))
    with pytest.raises(FileError, match=r"a\.csv, line 3: is longer than 2 MiB; is this a table\?"):
        ta.read_runs(path)


def test_a_folder_that_is_no_log(tmp_path):
    with pytest.raises(FileError) as caught:
        find_format(tmp_path)
    told = str(caught.value)
    assert told.startswith(f"{tmp_path}: no log format has a folder; known are .parquet, .pq, .arr")
    assert told.endswith(".txt, .txt.gz, .txt.zst, .xlsx, .xlsm")
    (tmp_path / "a.html").write_text("text")
    with pytest.raises(FileError, match=r"a\.html: no log format has the ending \.html; known are"):
        find_format(tmp_path / "a.html")


@pytest.mark.parametrize("lacks", ["h5py", "trueangle.formats.hdf5", None])
def test_a_library_that_is_not_there(lacks, monkeypatch):
    """The extra is named, unless what is missing is of this package itself."""

    def nothing(name, package):
        raise ModuleNotFoundError("missing", name=lacks)

    monkeypatch.setattr("importlib.import_module", nothing)
    made = Format("hdf5", {"a file of HDF5": (".h5",), "": (".txt",)}, "hdf5")
    assert made.endings == (".h5", ".txt")
    if lacks == "h5py":
        told = r"file of HDF5 files need h5py: pip install 'trueangle\[hdf5\]'"
        with pytest.raises(MissingExtraError, match=told):
            _ = made.module
    elif lacks is not None:
        with pytest.raises(ModuleNotFoundError):
            _ = made.module
    with pytest.raises(ModuleNotFoundError):
        _ = Format("hdf5", {}).module


@pytest.mark.parametrize(
    ("topics", "asked", "told"),
    [
        (("/a", "/b"), None, "several JointState topics: name one with `topic=`; there are /a, /b"),
        (("/a", "/b"), "/c", "no JointState topic /c: name one with `topic=`; there are /a, /b"),
        ((), None, "no JointState topic: name one with `topic=`; there are none"),
    ],
)
def test_topics_of_a_bag(topics, asked, told, tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    from trueangle.formats import rosbag

    store = get_typestore(Stores.LATEST)
    with rosbag2.Writer(tmp_path / "bag", version=9) as writer:
        for topic in topics:
            writer.add_connection(topic, "sensor_msgs/msg/JointState", typestore=store)
        writer.add_connection("/log", "std_msgs/msg/String", typestore=store)
    with pytest.raises(FileError) as caught:
        list(rosbag.read(tmp_path / "bag", Selection(["x"], asked)))
    assert str(caught.value) == f"{tmp_path / 'bag'}: {told}"
