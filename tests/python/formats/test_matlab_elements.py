"""Damaged MATLAB files are refused before a compiled reader trusts their sizes."""

import io
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

import trueangle as ta
from trueangle.errors import FileError
from trueangle.formats.formats import find_format
from trueangle.formats.matlab import check_elements

X = np.linspace(0.0, 360.0, 50)
EVERY_CLASS = {
    "numbers": X,
    "nested": {"b": X, "c": {"d": np.arange(3, dtype="i2")}},
    "cells": np.array(["abc", "de"], dtype=object),
    "text": "höllo",
    "texts": np.array(["ab", "cd"]),
    "complex": X + 1j * X,
    "empty": np.zeros((0, 0)),
    "sparse": csc_matrix(np.eye(4)),
    "logical": np.array([[True, False]]),
    "structures": np.array([(1, 2.0), (3, 4.0)], dtype=[("p", "O"), ("q", "O")]),
    "number": 5,
}


def saved(variables, compressed=False):
    file = io.BytesIO()
    savemat(file, variables, do_compression=compressed)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_whole_files_pass(compressed):
    check_elements(saved(EVERY_CLASS, compressed))


def test_the_sign_of_an_extent_may_be_left_off():
    data = bytearray(saved({"x": X}))
    assert struct.unpack_from("<I", data, 152) == (5,)
    struct.pack_into("<I", data, 152, 6)
    check_elements(bytes(data))


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (132, 1 << 30, "an element of 1073741824 bytes"),  # the array itself
        (160, 1 << 20, "50 values for an array of 52428800"),  # its extent
        (160, 0xFFFFFFFF, "of the extent"),
        (144, 99, "unknown class 99"),
        (144, 1, "an element of type 9, 14 is wanted"),  # numbers called cells
        (128, 9, "type 9 where an array must be"),
    ],
)
def test_a_size_that_is_no_longer_right_is_refused(place, value, said):
    data = bytearray(saved({"x": X}))
    struct.pack_into("<I", data, place, value)
    with pytest.raises(ValueError, match=said):
        check_elements(bytes(data))


def test_a_file_that_is_cut_off_is_refused():
    data = saved({"x": X})
    for length in range(129, len(data)):
        with pytest.raises(ValueError, match="byte"):
            check_elements(data[:length])


def test_arrays_within_arrays_have_an_end():
    """Without it the reader's recursion would end the process."""
    content = b""
    for _ in range(60):
        flags = struct.pack("<IIII", 6, 8, 1, 0)
        extent = struct.pack("<IIii", 5, 8, 1, int(bool(content)))
        name = struct.pack("<II", 1, 0)
        body = flags + extent + name + content
        content = struct.pack("<II", 14, len(body)) + body
    with pytest.raises(ValueError, match="more than 32 deep"):
        check_elements(saved({})[:128] + content)


def test_a_compressed_variable_that_is_cut_off_is_refused():
    inner = saved({"x": X})[128:]
    packed = zlib.compress(inner)[:-8]
    with pytest.raises(ValueError, match="cut off"):
        check_elements(saved({})[:128] + struct.pack("<II", 15, len(packed)) + packed)


def test_no_single_word_ends_the_process():
    """Every word of a file in turn, at four values: refused, or read as it then is."""
    data = saved({"x": X[:4], "s": {"b": X[:3]}})
    refused = 0
    for place in range(128, len(data) - 3, 4):
        for value in (0, 1, 1 << 16, 0x7FFFFFFF):
            changed = bytearray(data)
            struct.pack_into("<I", changed, place, value)
            try:
                check_elements(bytes(changed))
            except ValueError:
                refused += 1
    assert refused > 100


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
def test_numbers_are_as_many_as_their_array_says(kind):
    check_extents(saved({"x": np.ones(50, kind)}), passes=[50], refused=[25, 49, 51, 100])


@pytest.mark.parametrize(("element", "size"), [(16, 1), (17, 2), (18, 4)])
def test_a_letter_is_at_most_four_values(element, size):
    data = bytearray(saved({"x": "a" * (50 * size)}))
    assert struct.unpack_from("<I", data, 176) == (16,)
    struct.pack_into("<I", data, 176, element)
    check_extents(bytes(data), passes=[13, 50], refused=[0, 12])


def check_extents(data, passes, refused):
    """Of the second extent of the only array in a file."""
    for count in (*passes, *refused):
        changed = bytearray(data)
        struct.pack_into("<I", changed, 164, count)
        if count in passes:
            check_elements(bytes(changed))
        else:
            with pytest.raises(ValueError, match=f"values for an array of {count}$"):
                check_elements(bytes(changed))


TRUE = np.linspace(0.0, 357.0, 120)
READ = TRUE + 0.5 * np.sin(np.radians(TRUE))
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.5])], 0.0, 360.0)


def written(path, **more):
    io = pytest.importorskip("scipy.io")
    kept = {"reference_deg": TRUE, "indicated_deg": READ, **more}
    io.savemat(path, kept, format="4", oned_as="column")
    return path


def swapped(path):
    """The same file as a machine of the other order of bytes writes it."""
    data, parts, place = path.read_bytes(), [], 0
    while place < len(data):
        code, rows, width, imaginary, length = struct.unpack_from("<5i", data, place)
        size = rows * width * (1 + imaginary)
        parts.append(struct.pack(">5i", code + 1000, rows, width, imaginary, length))
        begin = place + 20 + length
        parts.append(data[place + 20 : begin])
        kind = np.dtype("<" + ("f8", "f4", "i4", "i2", "u2", "u1")[code // 10 % 10])
        parts.append(np.frombuffer(data, kind, size, begin).astype(kind.newbyteorder()).tobytes())
        place = begin + size * kind.itemsize
    path.write_bytes(b"".join(parts))


@pytest.mark.parametrize("other_order", [False, True])
def test_vectors_are_read_and_corrected(other_order, tmp_path):
    io = pytest.importorskip("scipy.io")
    more = {
        "x": np.arange(120, dtype=np.int16),
        "note": "cold",
        "square": np.eye(3),
        "z": READ * 1j,
        "f": READ.astype(np.float32),
    }
    path = written(tmp_path / "rig.mat", **more)
    if other_order:
        swapped(path)
    assert find_format(path).module_name == "matlab"
    (run,) = ta.read_runs(path)
    np.testing.assert_array_equal(run.indicated, READ)
    np.testing.assert_array_equal(run.columns["x"], np.arange(120))
    assert not {"note", "square", "z"} & run.columns.keys()
    report = ta.correct_logs(path, MODEL, tmp_path / "out.mat")
    if other_order:  # readers take files of one order only
        assert "its bytes the other way round" in str(report.logs[0].error)
        return
    assert report.is_done, report.logs[0].error
    after = (tmp_path / "out.mat").read_bytes()
    assert after.startswith(path.read_bytes())
    found = io.loadmat(tmp_path / "out.mat")
    np.testing.assert_array_equal(found["corrected_deg"].ravel(), MODEL.correct(READ))
    assert '"column": "corrected_deg"' in found["trueangle_note"][0]
    report = ta.correct_logs(tmp_path / "out.mat", MODEL, tmp_path / "again.mat")
    assert "corrected before" in str(report.logs[0].error)


def test_what_is_damaged_or_not_read_is_told(tmp_path):
    io = pytest.importorskip("scipy.io")
    path = written(tmp_path / "rig.mat")
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(FileError, match=r"is damaged or not a MATLAB file: .*'indicated_deg'"):
        ta.read_runs(path)
    path.write_bytes(whole + whole[:7])
    with pytest.raises(FileError, match="is damaged or not a MATLAB file"):
        ta.read_runs(path)
    written(path)
    io.savemat(path, {"reference_deg": TRUE, "indicated_deg": READ[:-1]}, format="4")
    with pytest.raises(FileError, match="differ in length: reference_deg 120, indicated_deg 119"):
        ta.read_runs(path)


@pytest.mark.parametrize("version", ["4", "5"])
def test_joints_are_corrected_one_after_the_other(version, tmp_path):
    """In version 5 the second was said not to read back as written; readers keep both notes."""
    io = pytest.importorskip("scipy.io")
    kept = {"elbow_indicated_deg": READ, "wrist_indicated_deg": READ + 1.0, "corrected_by": TRUE}
    io.savemat(tmp_path / "0.mat", kept, format=version, oned_as="column")
    for k, joint in enumerate(("elbow", "wrist")):
        source, target = tmp_path / f"{k}.mat", tmp_path / f"{k + 1}.mat"
        report = ta.correct_logs(source, {joint: MODEL}, target)
        assert report.is_done, report.logs[0].error
    found = io.loadmat(tmp_path / "2.mat")
    for joint, note in (("elbow", "trueangle_note"), ("wrist", "trueangle_note_2")):
        corrected = MODEL.correct(kept[f"{joint}_indicated_deg"])
        np.testing.assert_array_equal(found[f"{joint}_corrected_deg"].ravel(), corrected)
        assert f'"column": "{joint}_corrected_deg"' in found[note][0]


def test_a_name_that_begins_with_no_letter_is_given_one(tmp_path):
    """Such variables are left out unsaid where they are written."""
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "rig.mat"
    io.savemat(path, {"qpos": {"deg": READ}})
    path.write_bytes(path.read_bytes().replace(b"qpos", b"_pos"))
    columns = {"indicated": ("_pos/deg", "deg")}
    report = ta.correct_logs(path, MODEL, tmp_path / "out.mat", signals=columns)
    assert report.is_done, report.logs[0].error
    (name,) = (n for n in io.loadmat(tmp_path / "out.mat") if "corrected" in n)
    assert name.startswith("x_pos")


def test_two_corrected_variables_of_one_name_are_refused(tmp_path):
    io = pytest.importorskip("scipy.io")
    columns = {"elbow": {"indicated_deg": READ}, "elbow_indicated_deg": READ + 1.0}
    io.savemat(tmp_path / "rig.mat", columns)
    joints = {"elbow": MODEL, "other": MODEL}
    signals = {
        "elbow": {"indicated": ("elbow/indicated_deg", "deg")},
        "other": {"indicated": ("elbow_indicated_deg", "deg")},
    }
    report = ta.correct_logs(tmp_path / "rig.mat", joints, tmp_path / "out.mat", signals=signals)
    assert not report.is_done
    assert "column 'elbow_corrected_deg': exists already" in str(report.logs[0].error)
    assert not (tmp_path / "out.mat").exists()
