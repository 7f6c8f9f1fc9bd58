"""Data logs of FRC robots, byte by byte as the specification has them."""

import struct

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.formats import wpilog
from trueangle.formats.format import Selection

ROWS = 200
TRUE = np.linspace(0.0, 2.0 * np.pi, ROWS)
READ = TRUE + 0.01 * np.sin(TRUE)
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])
SIGNALS = {"reference": ("/arm/laser", "rad"), "indicated": ("/arm/angles[1]", "rad")}
#: What the specification shows: an entry `test` is started, is 3, and is finished, at 1 s.
EXAMPLE = bytes.fromhex(
    "5750494c4f47000100000000"
    "20001a40420f0001000000040000007465737405000000696e74363400000000"
    "20010840420f0300000000000000"
    "20000540420f0101000000"
)


def started(number, name, kind):
    texts = [text.encode() for text in (name, kind, "")]
    return (
        bytes([0])
        + struct.pack("<I", number)
        + b"".join(struct.pack("<I", len(text)) + text for text in texts)
    )


def record(number, time, payload):
    """With fields of full length, as the format allows."""
    return struct.pack("<BIIq", 0x7F, number, len(payload), time) + payload


def written(path, apart=0):
    parts = [b"WPILOG\x00\x01" + struct.pack("<I", 5) + b"hello"]
    entries = [("/arm/laser", "double"), ("/arm/angles", "float[]"), ("say", "string")]
    parts += [record(0, 0, started(i + 1, *entry)) for i, entry in enumerate(entries)]
    for i, (true, read) in enumerate(zip(TRUE.tolist(), READ.tolist(), strict=True)):
        time = 1_000_000 + 20_000 * i
        parts.append(record(1, time, struct.pack("<d", true)))
        parts.append(record(3, time, b"tick"))
        parts.append(record(2, time + apart, struct.pack("<2f", 0.0, read)))
    path.write_bytes(b"".join(parts))
    return path


def test_the_example_of_the_specification(tmp_path):
    path = tmp_path / "a.wpilog"
    path.write_bytes(EXAMPLE)
    assert wpilog.columns(path) == ["time_s", "test"]
    (batch,) = wpilog.read(path, Selection(["time_s", "test"]))
    assert (batch["time_s"].tolist(), batch["test"].tolist()) == ([1.0], [3.0])
    assert wpilog._record(1, 1_000_000, struct.pack("<q", 3)) == EXAMPLE[44:58]


def test_entries_of_one_loop_are_runs(tmp_path):
    path = written(tmp_path / "a.wpilog")
    assert wpilog.columns(path) == ["time_s", "/arm/laser", "/arm/angles[0]", "/arm/angles[1]"]
    (run,) = ta.read_runs(path, signals=SIGNALS)
    np.testing.assert_array_equal(run.reference, TRUE)
    np.testing.assert_array_equal(run.indicated, READ.astype(np.float32))
    np.testing.assert_allclose(run.time, 1.0 + 0.02 * np.arange(ROWS))


def test_the_last_record_of_a_time_counts_and_a_signal_holds_from_its_own_time_on(tmp_path):
    """By a loop over the records: the greatest time at or before, of equal ones the last."""
    times = [3, 1, 1, 5, 5, 5, 9]
    parts = [EXAMPLE[:12], record(0, 0, started(1, "x", "double"))]
    parts += [record(1, t, struct.pack("<d", float(i))) for i, t in enumerate(times)]
    path = tmp_path / "a.wpilog"
    path.write_bytes(b"".join(parts))
    (batch,) = wpilog.read(path, Selection(["time_s", "x"]))
    assert (batch["time_s"] * 1e6).round().tolist() == [1, 3, 5, 9]
    assert batch["x"].tolist() == [2.0, 0.0, 5.0, 6.0]
    asked = np.arange(11)
    wanted = [max(((t, i) for i, t in enumerate(times) if t <= k), default=(0, np.nan))[1]
              for k in asked.tolist()]  # fmt: skip
    found = wpilog._at(path, wpilog._opened(path), "x", asked)
    np.testing.assert_array_equal(found, wanted)


def test_entries_with_times_of_their_own_are_joined(tmp_path, capsys):
    path = str(written(tmp_path / "a.wpilog", apart=37))
    command = ["join", path, path, "-o", str(tmp_path / "runs.csv"), "--offset", "0", "--rate", "0"]
    command += ["--signal", "a.indicated=/arm/angles[1]:rad"]
    command += ["--signal", "b.reference=/arm/laser:rad"]
    assert main(command) == 0
    (run,) = ta.read_runs(tmp_path / "runs.csv")
    assert len(run) >= ROWS - 2
    assert np.abs(run.error).max() < 1.01 * np.degrees(0.01)


def test_times_are_those_of_the_columns_asked_for(tmp_path):
    """Entries with times of their own: alone each has its own, none asked for those of all."""
    path = written(tmp_path / "a.wpilog", apart=5000)
    laser = 1.0 + 0.02 * np.arange(ROWS)
    for name, times in (
        ("/arm/laser", laser),
        ("/arm/angles[1]", laser + 0.005),
        (None, np.sort([*laser, *(laser + 0.005)])),
    ):
        (batch,) = wpilog.read(path, Selection(["time_s", *([name] if name else [])]))
        np.testing.assert_allclose(batch["time_s"], times, rtol=1e-12)
        assert all(np.isfinite(values).all() for values in batch.values())


def test_a_copy_gets_an_entry_and_keeps_its_bytes(tmp_path):
    path = written(tmp_path / "a.wpilog")
    wanted = {"indicated": SIGNALS["indicated"]}
    report = ta.correct_logs(path, MODEL, tmp_path / "out.wpilog", signals=wanted)
    assert report.is_done, report.logs[0].error
    assert (tmp_path / "out.wpilog").read_bytes().startswith(path.read_bytes())
    found = {**SIGNALS, "indicated": ("/arm/corrected_rad", "rad")}
    (run,) = ta.read_runs(tmp_path / "out.wpilog", signals=found)
    read = READ.astype(np.float32).astype(float)
    np.testing.assert_array_equal(run.indicated, MODEL.correct(read))
    again = ta.correct_logs(tmp_path / "out.wpilog", MODEL, tmp_path / "x.wpilog", signals=wanted)
    assert "corrected before" in str(again.logs[0].error)


def test_a_velocity_is_that_of_the_times_of_the_log_in_seconds(tmp_path):
    """A delay of 2 ms of a joint that turns: as of a table with the same numbers."""
    model = MODEL.replace(terms=[ta.Latency(0.002)])
    path, output = written(tmp_path / "a.wpilog", apart=5000), tmp_path / "out.wpilog"
    report = ta.correct_logs(path, model, output, signals={"indicated": SIGNALS["indicated"]})
    assert report.is_done, report.logs[0].error
    (batch,) = wpilog.read(output, Selection(["time_s", "/arm/corrected_rad"]))
    time = 1.005 + 0.02 * np.arange(ROWS)
    wanted = model.corrector()(READ.astype(np.float32).astype(float), time=time)
    np.testing.assert_allclose(batch["/arm/corrected_rad"], wanted, rtol=0.0, atol=1e-12)
    # 0.031 rad every 20 ms, 2 ms late.
    moved = np.abs(wanted - MODEL.correct(READ))[1:]
    np.testing.assert_allclose(moved, 0.1 * 2.0 * np.pi / (ROWS - 1), rtol=0.03)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (EXAMPLE[:-1], "record at byte 58 goes beyond its end"),
        (EXAMPLE[:6] + b"\x00\x02" + EXAMPLE[8:], "version 2.0; version 1 is read"),
        (EXAMPLE[:44] + b"\x20\x02" + EXAMPLE[46:], "byte 44 is of an entry never started"),
        (EXAMPLE[:10], "is not a data log"),
        (EXAMPLE.replace(b"\x04\x00\x00\x00test", b"\xff\x00\x00\x00test"), "byte 12 is cut short"),
    ],
)
def test_damage_is_told_by_its_byte(data, told, tmp_path):
    path = tmp_path / "a.wpilog"
    path.write_bytes(data)
    with pytest.raises(FileError, match=told):
        ta.read_runs(path)


def log_of(path, *parts):
    path.write_bytes(EXAMPLE[:12] + b"".join(parts))
    return path


@pytest.mark.parametrize(
    ("kind", "code", "values"),
    [("double", "<f8", [1.5, -2.25]), ("float", "<f4", [1.5, -2.25]),
     ("int64", "<i8", [-3, 1 << 40]), ("boolean", "?", [0, 1])],
)  # fmt: skip
def test_numbers_of_every_kind_alone_and_in_arrays(kind, code, values, tmp_path):
    """The second array is shorter: of its last element nothing is known then."""
    both = np.array(values, code)
    path = log_of(
        tmp_path / "a.wpilog",
        record(0, 0, started(1, "one", kind)),
        record(0, 0, started(2, "some", f"{kind}[]")),
        record(0, 0, started(3, "none", f"{kind}[]")),
        *(record(1, 10 * k + 5, both[k : k + 1].tobytes()) for k in range(2)),
        record(2, 5, both.tobytes()), record(2, 15, both[:1].tobytes()),
    )  # fmt: skip
    names = ["time_s", "one", "some[0]", "some[1]"]
    assert wpilog.columns(path) == names
    (batch,) = wpilog.read(path, Selection(names))
    np.testing.assert_allclose(batch["time_s"], [5e-6, 15e-6])
    assert batch["one"].tolist() == values
    assert batch["some[0]"].tolist() == [values[0], values[0]]
    np.testing.assert_array_equal(batch["some[1]"], [values[1], np.nan])
    assert wpilog.extent(path, ["one", "some[1]"]) == (4, 64)
    assert wpilog.extent(path) == (4, 0)
    assert wpilog.contents(path).rows == 4


@pytest.mark.parametrize("name", ["a\nb", "[0]", "a[1]", "\n"])
def test_an_array_may_have_any_name(name, tmp_path):
    path = log_of(
        tmp_path / "a.wpilog",
        record(0, 0, started(1, name, "double[]")),
        record(1, 5, np.array([1.5, 2.5]).tobytes()),
    )
    assert wpilog.columns(path) == ["time_s", f"{name}[0]", f"{name}[1]"]
    (batch,) = wpilog.read(path, Selection([f"{name}[1]"]))
    assert batch[f"{name}[1]"].tolist() == [2.5]
    assert wpilog.extent(path, [f"{name}[0]"]) == (1, 8)


def test_an_entry_that_is_finished_may_be_started_anew(tmp_path):
    """Under another number, and its number under another name; a robot does so when it restarts."""
    values = [struct.pack("<d", x) for x in (1.0, 2.0, 3.0, 4.0)]
    parts = [
        record(0, 0, started(1, "a", "double")),
        record(1, 1, values[0]),
        record(0, 2, bytes([1]) + struct.pack("<I", 1)),
        record(0, 2, bytes([2]) + struct.pack("<II", 1, 2) + b"{}"),  # metadata
        record(0, 3, started(7, "a", "double")),
        record(0, 3, started(1, "b", "double")),
        record(7, 4, values[1]),
        record(1, 4, values[2]),
    ]
    path = log_of(tmp_path / "a.wpilog", *parts)
    (batch,) = wpilog.read(path, Selection(["a", "b"]))
    np.testing.assert_array_equal(batch["a"], [1.0, 2.0])
    np.testing.assert_array_equal(batch["b"], [np.nan, 3.0])
    added = len(log_of(tmp_path / "b.wpilog", *parts[:3]).read_bytes())
    for more, told in (
        (values[3], f"byte {added} is of an entry never started"),
        (None, rf"column 'a': is started as double and as float again at byte {added}"),
    ):
        end = record(1, 9, more) if more else record(0, 9, started(2, "a", "float"))
        path = log_of(tmp_path / "b.wpilog", *parts[:3], end)
        with pytest.raises(FileError, match=told):
            wpilog.columns(path)
    short = log_of(tmp_path / "c.wpilog", parts[0], record(1, 1, values[0][:5]))
    begin = len(short.read_bytes()) - 5
    with pytest.raises(FileError, match=f"the record at byte {begin} holds 5 bytes only"):
        list(wpilog.read(short, Selection(["a"])))
    late = log_of(tmp_path / "d.wpilog", parts[0], record(1, -1, values[0]))
    with pytest.raises(FileError, match=rf"is of the time {2**64 - 1} us"):
        wpilog.columns(late)


@pytest.mark.parametrize(
    ("number", "time"), [(1, 0), (255, 255), (256, 1 << 16), (70_000, 1 << 40)]
)
def test_a_record_that_is_written_is_read(number, time, tmp_path):
    """With fields of any length."""
    made = wpilog._started(number, "x", '{"unit": "°"}', time)
    made += wpilog._record(number, time, struct.pack("<d", 0.5))
    (batch,) = wpilog.read(log_of(tmp_path / "a.wpilog", made), Selection(["time_s", "x"]))
    assert (batch["time_s"].tolist(), batch["x"].tolist()) == ([time * 1e-6], [0.5])
