"""MDF4 logs: corrected channels in groups of their own, all else kept."""

import logging
import struct
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.formats.format import Selection

from .conftest import made_angles, made_model, unwrapped_truth

asammdf = pytest.importorskip("asammdf")
mdf = pytest.importorskip("trueangle.formats.mdf")
openmdf = pytest.importorskip("trueangle.formats.openmdf")

ROWS = 5000


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr("trueangle.formats.mdf._BLOCK", 777)


def made_file(path, angles, compression=0, invalid=()):
    times = np.arange(angles.size) / 1e3
    bits = np.zeros(angles.size, dtype=bool)
    bits[list(invalid)] = True
    with asammdf.MDF(version="4.11") as mdf:
        signal = asammdf.Signal
        mdf.append(
            [
                signal(angles, times, unit="deg", name="indicated_deg", invalidation_bits=bits),
                signal(np.arange(angles.size, dtype=np.uint16), times, name="counter"),
            ],
            comment="joint",
        )
        mdf.append(
            [
                signal(
                    np.array([b"on", b"off"]), np.array([0.0, 1.0]), name="state", encoding="utf-8"
                )
            ]
        )
        mdf.save(path, overwrite=True, compression=compression)
    return path


def read(path, name):
    with asammdf.MDF(path) as mdf:
        found = mdf.get(name, ignore_invalidation_bits=True)
        return found.samples, found.timestamps, found.invalidation_bits, found.unit


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_channels_are_added_and_all_else_is_kept(compression, tmp_path, model):
    angles = made_angles(ROWS)
    angles[9] = np.nan
    source = made_file(tmp_path / "a.mf4", angles, compression, invalid=[0, 2000, 2001])
    report = ta.correct_logs(source, model, tmp_path / "b.mf4")
    assert report.logs[0].error is None
    assert report.logs[0].result["rows"] == ROWS
    assert report.logs[0].result["joints"][0]["missing"] == 4
    for name in ("indicated_deg", "counter", "state"):
        for before, after in zip(read(source, name), read(tmp_path / "b.mf4", name), strict=True):
            np.testing.assert_array_equal(before, after)
    _, times, invalid, _ = read(source, "indicated_deg")
    found, found_times, found_invalid, unit = read(tmp_path / "b.mf4", "corrected_deg")
    assert unit == "deg"
    np.testing.assert_array_equal(found_times, times)
    np.testing.assert_array_equal(found_invalid, invalid)
    valid = ~invalid
    np.testing.assert_array_equal(found[valid], model.correct(angles)[valid])
    with asammdf.MDF(tmp_path / "b.mf4") as mdf:
        kinds = {b.block_type for g in mdf.groups for b in g.get_data_blocks()}
        assert "model_sha256" in mdf.groups[2].channel_group.comment
        assert mdf.groups[0].channel_group.comment == "joint"
    assert max(kinds) == compression


@pytest.mark.parametrize("compression", [3, 4, 5, 6])
def test_a_copy_is_compressed_as_its_source(compression, tmp_path, model):
    """By the ways of MDF 4.3, where the library writes them."""
    try:
        source = made_file(tmp_path / "a.mf4", made_angles(ROWS), compression)
    except (ImportError, NameError, ValueError, asammdf.blocks.utils.MdfException) as cause:
        pytest.skip(f"asammdf cannot: {cause}")
    kinds = []
    ta.correct_logs(source, model, tmp_path / "b.mf4")
    for path in (source, tmp_path / "b.mf4"):
        with asammdf.MDF(path) as mdf:
            kinds.append(max(b.block_type for g in mdf.groups for b in g.get_data_blocks()))
    assert kinds[0] == kinds[1]


def test_single_precision_and_turns(tmp_path):
    model = made_model(ratio=50.5)
    angles = made_angles(ROWS, turns=5.5)
    made_file(tmp_path / "a.mf4", angles)
    ta.correct_logs(tmp_path / "a.mf4", model, tmp_path / "b.mf4")
    found, *_ = read(tmp_path / "b.mf4", "corrected_deg")
    np.testing.assert_allclose(found, unwrapped_truth(model, angles), rtol=0, atol=1e-10)
    single = angles.astype(np.float32)
    ta.correct_logs(made_file(tmp_path / "c.mf4", single), made_model(), tmp_path / "d.mf4")
    found, *_ = read(tmp_path / "d.mf4", "corrected_deg")
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, made_model().correct(single))


def test_bad_files_are_refused_with_their_name(tmp_path, model):
    (tmp_path / "text.mf4").write_text("no MDF at all, but long enough " * 10)
    source = made_file(tmp_path / "short.mf4", made_angles(ROWS))
    source.write_bytes(source.read_bytes()[:30_000])
    made_file(tmp_path / "named.mf4", made_angles(10))
    for name, column, message in (
        ("text.mf4", None, "not MDF4"),
        ("short.mf4", None, "damaged"),
        ("named.mf4", "state", "numbers are needed"),
        ("named.mf4", "speed", "no such column"),
    ):
        report = ta.correct_logs(tmp_path / name, model, tmp_path / "out.mf4", column=column)
        with pytest.raises(ta.errors.FileError, match=message):
            raise report.logs[0].error
        assert not (tmp_path / "out.mf4").exists()


def test_damage_is_told_once(tmp_path, model):
    """The library prints lines of its own before it raises."""
    source = made_file(tmp_path / "damaged.mf4", made_angles(10))
    data = bytearray(source.read_bytes())
    of_its_source = data.index(b"##CG") + 24 + 8 * 3
    data[of_its_source : of_its_source + 8] = struct.pack("<Q", 8)
    source.write_bytes(data)
    told = []
    handler = logging.Handler()
    handler.emit = told.append
    logger = logging.getLogger("asammdf")
    logger.addHandler(handler)
    try:
        report = ta.correct_logs(source, model, tmp_path / "out.mf4")
        assert "damaged" in str(report.logs[0].error)
        assert not told
        logger.error("heard again afterwards")
        assert len(told) == 1
    finally:
        logger.removeHandler(handler)


@pytest.mark.parametrize("marked", [[], [0], [3000], [ROWS - 1]])
def test_marks_of_any_part_are_kept(marked, tmp_path, model):
    source = made_file(tmp_path / "a.mf4", made_angles(ROWS), invalid=marked)
    report = ta.correct_logs(source, model, tmp_path / "b.mf4")
    assert report.logs[0].error is None
    samples, _, marks, _ = read(tmp_path / "b.mf4", "corrected_deg")
    assert np.flatnonzero(np.isnan(samples)).tolist() == marked
    assert ([] if marks is None else np.flatnonzero(marks).tolist()) == marked


@pytest.mark.parametrize("compression", [0, 2])
def test_records_are_gone_through_once(compression, tmp_path, monkeypatch):
    """Parts asked for by their place would each go through all records: 22 s for 2e7, not 1."""
    angles = made_angles(ROWS)
    path = made_file(tmp_path / "a.mf4", angles, compression)
    seen = []
    load = asammdf.blocks.mdf_v4.MDF4._load_data
    monkeypatch.setattr(
        "asammdf.blocks.mdf_v4.MDF4._load_data",
        lambda self, *args, **more: seen.append(1) or load(self, *args, **more),
    )
    monkeypatch.setattr(
        "asammdf.blocks.mdf_v4.get_channel_raw_bytes_complete",
        lambda *args: pytest.fail("all records are read for a part of them"),
    )
    parts = list(mdf.read(path, Selection(["indicated_deg", "counter"])))
    assert len(seen) == 1
    assert len(parts) == -(-ROWS // 777)
    assert np.array_equal(np.concatenate([part["indicated_deg"] for part in parts]), angles)
    counted = np.concatenate([part["counter"] for part in parts])
    assert np.array_equal(counted, np.arange(ROWS))


def test_a_large_block_is_taken_in_pieces(monkeypatch, tmp_path):
    monkeypatch.setattr("trueangle.formats.openmdf._PIECE", 1000)
    angles = made_angles(ROWS)
    path = made_file(tmp_path / "a.mf4", angles)
    with openmdf.opened_mdf(path) as opened:
        blocks = list(opened.groups[0].get_data_blocks())
        at = [block.address for block in blocks]
        sizes = [block.original_size for block in blocks]
    assert max(sizes) == 1000
    assert np.array_equal(np.diff(at), sizes[:-1])
    parts = list(mdf.read(path, Selection(["indicated_deg"])))
    assert np.array_equal(np.concatenate([part["indicated_deg"] for part in parts]), angles)


pytest.importorskip("asammdf")

MDF_TEXTS_ROWS = 12
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
    for i in range(MDF_TEXTS_ROWS):
        word = WORDS[i % len(WORDS)]
        records += struct.pack("<BddQ", 1, 0.125 * i, 30.0 * i, stored)
        records += struct.pack("<BI", 2, len(word)) + word
        stored += 4 + len(word)
    blocks = {
        "HD": ("HD", ["DG", "", "", "", "", ""], struct.pack("<Q24x", 1_700_000_000 * 10**9)),
        "DG": ("DG", ["", "CG", "DT", ""], struct.pack("<B7x", 1)),
        "CG": group("texts", "time", 1, MDF_TEXTS_ROWS, 24, flags),
        "texts": group("", "", 2, MDF_TEXTS_ROWS, stored, 1),
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
    assert angles.tolist() == [30.0 * i for i in range(MDF_TEXTS_ROWS)]
    np.testing.assert_allclose(found, MODEL.correct(angles), atol=1e-9)
    assert notes == [WORDS[i % len(WORDS)] for i in range(MDF_TEXTS_ROWS)]


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
