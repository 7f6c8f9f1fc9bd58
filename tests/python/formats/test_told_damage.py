"""What is said of files that no text editor writes, word by word: the file, the place, a remedy."""

import struct

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError, MissingExtraError
from trueangle.formats import csvcells, csvfile, csvrows
from trueangle.formats.format import Format, Selection
from trueangle.formats.formats import find_format

from .test_matlab_elements import X, saved
from .test_wpilog import EXAMPLE

MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])


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
