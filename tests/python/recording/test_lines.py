"""Lines: their layout is found, and whatever befalls them only whole rows pass."""

import math
import os
from pathlib import Path

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.recording.arrivals import layout_of, layout_of_pattern

from .wires import arrived, recorded

SEED = 52_001
#: Damaged lines: a hundred thousand by night.
DAMAGED = 105_000 if os.environ.get("TRUEANGLE_NIGHTLY") == "1" else 3_500


def printed(kind, step, raw):
    return {
        "csv": f"{step},{raw:.3f}",
        "semicolons": f"{step}; {raw:.3f};",
        "tabs": f"{step}\t{raw:.3f}",
        "blanks": f"{step} {raw:.3f}",
        "pairs": f"step:{step} raw:{raw:.3f}",
        "equals": f"step = {step}, raw = {raw:.3f}",
        "json": f'{{"step": {step}, "imu": {{"raw": {raw:.3f}}}, "ok": true, "text": "a"}}',
    }[kind]


KINDS = {
    "csv": ("CSV", ("column1", "column2")),
    "semicolons": ("CSV", ("column1", "column2")),
    "tabs": ("CSV", ("column1", "column2")),
    "blanks": ("numbers", ("column1", "column2")),
    "pairs": ("name:value pairs", ("step", "raw")),
    "equals": ("name:value pairs", ("step", "raw")),
    "json": ("JSON", ("step", "imu.raw")),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_layout_is_found_behind_what_a_firmware_says_first(kind, end):
    rng = np.random.default_rng(SEED)
    values = [(i, 0.5 * i - 3.0) for i in range(40)]
    lines = ["\x00\xf0garbage", "Ready: 115200 baud.", *(printed(kind, *v) for v in values), ""]
    data = end.join(lines).encode("latin-1")
    arrivals, found, times = arrived(data, sizes=rng.integers(1, 30, 64).tolist())
    assert (arrivals.layout.kind, arrivals.layout.names) == KINDS[kind]
    np.testing.assert_allclose(found, values)
    assert arrivals.rejected == [line.encode("latin-1") for line in lines[:2]]
    assert (np.diff(times) > 0.0).all()


def test_a_header_names_columns_and_is_no_row_when_it_comes_again():
    lines = ["boot", "time_ms;ref [deg];enc", "0;1;2", "1;2;3", "2;3;4"]
    lines += ["time_ms;ref [deg];enc", "3;4;5", ""]
    arrivals, values, *_ = arrived("\n".join(lines).encode())
    assert arrivals.layout.names == ("time_ms", "ref [deg]", "enc")
    assert (len(values), arrivals.rejected) == (4, [b"boot"])


def test_a_line_that_is_cut_by_the_end_is_no_row():
    arrivals, values, *_ = arrived(b"1,2\n2,3\n3,4\n4,55")
    assert (len(values), arrivals.rejected) == (3, [b"4,55"])


def test_numbers_that_are_none_are_rejected():
    arrivals, values, *_ = arrived(b"1,2\n2,3\n3,4\n1e999,2\nnan,3\n5,inf\n,6\n7,\n8,9\n")
    assert len(values) == 4
    assert arrivals.rejected == [b"1e999,2", b"nan,3", b"5,inf", b",6", b"7,"]


def damaged(line, rng):
    """A line with bytes lost, doubled, changed, cut off, or in another encoding."""
    data = bytearray(line)
    at = int(rng.integers(len(data)))
    match int(rng.integers(6)):
        case 0:
            del data[at : at + int(rng.integers(1, 5))]
        case 1:
            data[at:at] = data[at : at + int(rng.integers(1, 5))]
        case 2:
            data[at] ^= 1 << int(rng.integers(8))
        case 3:
            del data[at:]
        case 4:
            return line.decode("latin-1").encode(["utf-16-le", "utf-16", "utf-7"][at % 3])
        case 5:
            data[at:at] = bytes(rng.integers(0, 256, 3).tolist())
    return bytes(data)


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_befalls_lines_only_whole_rows_pass_and_the_others_are_kept(kind, tmp_path):
    rng = np.random.default_rng([SEED, *kind.encode()])
    print("seed", SEED)
    good = [printed(kind, i, 0.25 * i + 7.0).encode() + b"\n" for i in range(10)]
    for part in range(DAMAGED // len(KINDS) // 500):
        sent = [printed(kind, i, 0.25 * i).encode() + b"\n" for i in rng.integers(0, 9999, 500)]
        data = b"".join([*good, *(damaged(line, rng) for line in sent), b"\n", *good])
        path = tmp_path / f"{part}.csv"
        recording = recorded(path, data, sizes=[*rng.integers(1, 900, 97).tolist(), 65536])
        header, *rows = path.read_text().splitlines()
        assert header == ",".join(["run", "time_s", *KINDS[kind][1]])
        values = np.array([row.split(",") for row in rows], dtype=float)
        assert values.shape == (recording.rows, 4)
        assert np.isfinite(values).all()
        assert (np.diff(values[:, 1]) > 0.0).all()
        np.testing.assert_array_equal(values[:10, 2:], values[-10:, 2:])
        lines = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        kept = Path(f"{path}.rejected").read_bytes().split(b"\n")[:-1]
        assert len(kept) == recording.file.rejected.lines
        assert len(rows) + len(kept) == sum(bool(line.strip()) for line in lines)
        assert {*kept} <= {*lines}


def test_a_line_without_end_costs_its_length_and_no_more():
    data = b"1 2\n2 3\n3 4\n" + b" " * 300_000 + b"\n4 5\n" + b"9" * 300_000 + b"\n5 6\n"
    arrivals, values, *_ = arrived(data, sizes=(1000,))
    assert values[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert b"".join(arrivals.rejected).count(b"9") == 300_000


def test_a_pattern_names_the_columns():
    pattern = r"S(?P<step>\d+) .*R(?P<raw>[\d.]+)"
    arrivals, values, *_ = arrived(b"x S1 of 9 R2.5 mV\nS2 R\nS3 of 9 R4\n", pattern)
    assert arrivals.layout.names == ("step", "raw")
    assert values.tolist() == [[1.0, 2.5], [3.0, 4.0]]
    assert arrivals.rejected == [b"S2 R"]
    for pattern, says in (("(", "no regular expression"), (r"\d+", "names no group")):
        with pytest.raises(ArgumentError, match=says):
            layout_of_pattern(pattern)


def test_what_is_no_layout_is_not_guessed():
    assert layout_of([b"Ready.", b"", b"", b"", b"1,2", b"3,4"]) is None
    assert layout_of([b"Ready."], hurry=True) is None
    assert layout_of([b"1,2"], hurry=True).names == ("column1", "column2")
    arrivals, values, *_ = arrived(b"".join(b"no number here\n" for _ in range(900)))
    assert (arrivals.layout, len(values), len(arrivals.rejected)) == (None, 0, 900)
    assert math.isnan(arrivals.jitter)
