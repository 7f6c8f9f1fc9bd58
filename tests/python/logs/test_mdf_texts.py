"""MDF4 logs of unsorted records with texts of any length in a channel group of their own."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.formats.format import Selection

pytest.importorskip("asammdf")
mdf = pytest.importorskip("trueangle.formats.mdf")

ROWS = 12
Block = tuple[str, list[str], bytes]
WORDS = [b"a note", b"", b"another and longer one"]
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.0, 360.0)


def laid_out(blocks: dict[str, Block]) -> bytes:
    """Kind, links by name and data of each block; an empty name is no link."""
    places, place = {"": 0}, 64
    for name, (_, links, data) in blocks.items():
        places[name] = place
        place += 24 + 8 * len(links) + len(data) + -len(data) % 8
    made = struct.pack("<8s8s8s4xH30xHH", b"MDF     ", b"4.10    ", b"by hand", 410, 0, 0)
    for kind, links, data in blocks.values():
        size = 24 + 8 * len(links) + len(data)
        made += struct.pack("<4s4xQQ", f"##{kind}".encode(), size, len(links))
        made += struct.pack(f"<{len(links)}Q", *(places[link] for link in links))
        made += data + bytes(-len(data) % 8)
    return made


def group(after: str, channel: str, number: int, rows: int, width: int, flags: int = 0) -> Block:
    data = struct.pack("<QQHH4xII", number, rows, flags, 0, width, 0)
    return "CG", [after, channel, "", "", "", ""], data


def channel(after: str, name: str, kind: int, data: int, at: int, texts: str = "") -> Block:
    made = struct.pack("<BBBBIIIIB3x6d", kind, kind == 2, data, 0, at, 64, 0, 0, 0, *[0.0] * 6)
    return "CN", [after, "", name, "", "", texts, "", ""], made


def recorded(path: Path, flags: int = 0, data: int = 4) -> Path:
    """Times, angles of a type of ``data``, notes; ``flags`` are those of the group of readings."""
    records, stored = b"", 0
    for i in range(ROWS):
        word = WORDS[i % len(WORDS)]
        records += struct.pack("<BddQ", 1, 0.125 * i, 30.0 * i, stored)
        records += struct.pack("<BI", 2, len(word)) + word
        stored += 4 + len(word)
    blocks = {
        "HD": ("HD", ["DG", "", "", "", "", ""], struct.pack("<Q24x", 1_700_000_000 * 10**9)),
        "DG": ("DG", ["", "CG", "DT", ""], struct.pack("<B7x", 1)),
        "CG": group("texts", "time", 1, ROWS, 24, flags),
        "texts": group("", "", 2, ROWS, stored, 1),
        "time": channel("angle", "time_s", 2, 4, 0),
        "angle": channel("note", "indicated_deg", 0, data, 8),
        "note": channel("", "notes", 1, 7, 16, "texts"),
        "DT": ("DT", [], records),
    }
    for name in ("time_s", "indicated_deg", "notes"):
        blocks[name] = ("TX", [], name.encode() + b"\0")
    path.write_bytes(laid_out(blocks))
    return path


def test_texts_of_any_length_are_kept_beside_corrected_readings(tmp_path: Path) -> None:
    """The copy is sorted: its texts stand with their channel, and their own group is gone."""
    import asammdf

    source = recorded(tmp_path / "a.mf4")
    (log,) = ta.correct_logs(source, MODEL, tmp_path / "b.mf4").logs
    assert log.error is None
    with asammdf.MDF(tmp_path / "b.mf4") as mdf:
        found = mdf.get("corrected_deg").samples
        notes = [bytes(word).rstrip(b"\0") for word in mdf.get("notes", raw=True).samples]
        angles = mdf.get("indicated_deg").samples
    assert angles.tolist() == [30.0 * i for i in range(ROWS)]
    np.testing.assert_allclose(found, MODEL.correct(angles), atol=1e-9)
    assert notes == [WORDS[i % len(WORDS)] for i in range(ROWS)]


def test_readings_in_a_group_of_texts_are_damage(tmp_path: Path) -> None:
    source = recorded(tmp_path / "a.mf4", flags=1)
    (log,) = ta.correct_logs(source, MODEL, tmp_path / "b.mf4").logs
    assert isinstance(log.error, FileError)
    assert "a.mf4" in str(log.error)
    assert "a group of texts declares 3 channels" in str(log.error)
    assert not (tmp_path / "b.mf4").exists()


def test_bytes_are_no_angles(tmp_path: Path) -> None:
    """Eight to a record: an array of them, and not one number."""
    source = recorded(tmp_path / "a.mf4", data=10)
    said = "column 'indicated_deg': numbers are needed, the channel holds uint8[8]"
    (log,) = ta.correct_logs(source, MODEL, tmp_path / "b.mf4").logs
    assert said in str(log.error)
    with pytest.raises(FileError) as error:
        list(mdf.read(source, Selection(["indicated_deg"])))
    assert said in str(error.value)
