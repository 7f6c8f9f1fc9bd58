"""Damaged MATLAB files are refused before a compiled reader trusts their sizes."""

import io
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

from trueangle.formats.matlabelements import check_elements

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
