"""What is shown while it is recorded."""

import io
import json
import os
import struct
import sys
import threading
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError
from trueangle.recording.screen import Screen
from trueangle.recording.sources import SourceOptions, open_source
from trueangle.recording.watched import watched_batches
from trueangle.runs.source import ReadingOptions

from .wires import joint_lines, recorded


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_the_screen_is_drawn_anew_and_holds_everything(tmp_path):
    recording = recorded(tmp_path / "runs.csv", ["Ready", *joint_lines(3.2)])
    stream = Terminal()
    screen = Screen("auto", "deg", stream)
    screen.show(recording, 0.3)
    screen.show(recording, 0.31)
    first = stream.getvalue()
    for part in (
        "1600 readings in run 1, 1 line rejected", "0.3 s  ",
        "given: CSV, columns reference_deg, indicated_deg",
        "forwards  [" + 36 * "#" + "] 360 deg", "backwards [" + 36 * "." + "] 0 deg",
        "order   1  0.50", "order   2  0.20", "  arcsec", "missing: turn it backwards as well",
    ):  # fmt: skip
        assert part in first
    assert "\x1b" not in first
    screen.show(recording, 0.6)
    again = stream.getvalue()[len(first) :]
    assert again.startswith(f"\x1b[{first.count(chr(10))}F\x1b[J")


def test_no_line_of_the_screen_is_broken_by_the_terminal(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for name, lines in (("long" * 9, ["a:1 b:2"] * 4), ("b", joint_lines(1.2)), ("c", ["1"] * 9)):
        recording = recorded(tmp_path / name, lines)
        stream = Terminal()
        Screen("auto", "deg", stream).show(recording, 3.0)
        drawn = stream.getvalue().splitlines()
        assert [line for line in drawn if len(line) > 80 and str(tmp_path) not in line] == []


def test_what_is_missing_ends_with_nothing(tmp_path):
    lines = joint_lines(0.4)
    assert "of 360 deg are read" in recorded(tmp_path / "a.csv", lines).missing
    assert "no column reference_deg" in recorded(tmp_path / "b.csv", ["a:1", "a:2", "a:3"]).missing
    still = [lines[0], *(200 * [lines[5]])]
    assert recorded(tmp_path / "c.csv", still).missing == "motion: turn it slowly"
    both = joint_lines(8.0, back=True)
    timed = [f"{t:.4f},{line}" for t, line in zip(np.arange(8000) * 0.01, both[1:], strict=True)]
    known = recorded(tmp_path / "d.csv", [f"time_s,{both[0]}", *timed])
    assert known.missing in ("", "turn it at another speed as well")
    assert known.estimate.is_settled


@pytest.mark.parametrize(
    ("fault", "change"),
    [
        ("wrong_sign", lambda a, b: (a, -b)),
        ("stuck", lambda a, b: (a, np.where(a < 600.0, b, 600.0))),
        ("stuck", lambda a, b: (np.full(a.size, 7.0), b)),
        ("wrong_gear_ratio", lambda a, b: (a, 10.0 * b)),
    ],
)
def test_faults_are_shown_at_once(tmp_path, fault, change):
    angle = np.arange(0.0, 700.0, 0.7)
    reference, indicated = change(angle, angle + 0.3 * np.sin(np.radians(angle)))
    rows = zip(reference % 360.0, indicated % 360.0, strict=True)
    lines = ["reference_deg,indicated_deg", *(f"{a:.4f},{b:.4f}" for a, b in rows)]
    recording = recorded(tmp_path / "a.csv", lines)
    stream = io.StringIO()
    Screen("none", "auto", stream).show(recording, 2.5)
    assert f"warning: {fault}: " in stream.getvalue()
    stream = io.StringIO()
    Screen("json", "auto", stream).show(recording, 5.0)
    state = json.loads(stream.getvalue())
    assert fault in [row["fault"] for row in state["faults"]]


def test_lost_bytes_and_silence_are_faults(tmp_path):
    lines = joint_lines(1.0)
    lines[50:60] = ["1.2.3"] * 10
    recording = recorded(tmp_path / "a.csv", lines)
    found = recording.new_faults(10.0)
    assert "10 of 500 lines are no rows" in found["rejected_lines"]
    assert "does the device send?" in found["silent"]
    assert recording.new_faults(20.0) == {}


def test_a_shaft_without_a_reference_is_recorded_for_selfcal(tmp_path):
    lines = [f"{i % 4096}" for i in range(0, 20_000, 37)]
    signals = {"indicated": ("column1", "count")}
    recording = recorded(tmp_path / "a.csv", lines, signals, (4096.0, None))
    assert recording.estimate.share == 1.0
    assert (tmp_path / "a.csv").read_text().startswith("run,time_s,indicated_deg\n")
    assert "reference_deg" in recording.missing
    assert recording.estimate.orders == []


SHAFT = ta.Shaft("output", 1, [1], [0.5], [0.0])
MODEL = ta.HarmonicModel([SHAFT], period=360.0)


def lines(moved=0.0, turns=30):
    rng = np.random.default_rng(4)
    angle = np.arange(turns * 90) * 4.0
    error = MODEL.error(angle) + rng.normal(0.0, 0.001, angle.size)
    error += moved * np.cos(np.radians(angle)) * (angle > 15 * 360.0)
    return [
        f"ref:{a % 360.0:.4f} enc:{(a + e) % 360.0:.4f}\n"
        for a, e in zip(angle, error, strict=True)
    ]


@pytest.mark.filterwarnings("ignore::trueangle.errors.MessageLinesWarning")  # a first line cut
def test_lines_of_a_port_are_watched(tmp_path, monkeypatch, capsys):
    pytest.importorskip("serial")
    pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")
    monkeypatch.chdir(tmp_path)
    MODEL.save("m.json")
    device, slave = pty.openpty()
    tty.setraw(slave)

    def work():
        time.sleep(0.3)
        for line in lines(0.02):
            os.write(device, line.encode())
        time.sleep(1.0)
        os.close(device)

    thread = threading.Thread(target=work)
    thread.start()
    signals = ["--signal", "reference=ref:deg", "--signal", "indicated=enc:deg"]
    status = main(["watch", os.ttyname(slave), "-m", "m.json", "--json", *signals])
    thread.join()
    os.close(slave)
    told = capsys.readouterr()
    windows = [json.loads(line) for line in told.out.splitlines()]
    assert "ended by a fault" in told.err
    assert status == 1
    assert any(window["alarm"] for window in windows)
    assert len(windows) > 15
    assert windows[-1]["time_s"] > windows[0]["time_s"] > 0.0


def typed(monkeypatch, text):
    """Standard input with a text, open."""
    read, write = os.pipe()
    os.write(write, text.encode())
    os.close(write)
    monkeypatch.setattr(sys, "stdin", os.fdopen(read))
    return sys.stdin


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("unit", [360.0, 2.0 * np.pi])
def test_batches_have_the_unit_of_the_model(monkeypatch, argument, unit):
    text = "time_ms,reference_deg,indicated_deg\n0,10,10.5\n500,20,19.5\n1000,30,30.25\n"
    shaft = ta.Shaft("output", 1, [1], [1e-4 * unit], [0.0])
    model = ta.HarmonicModel([shaft], period=unit, argument=argument)
    with typed(monkeypatch, text):
        (batch,) = watched_batches("-", model, ReadingOptions(), SourceOptions())
    reference, error = np.array([10.0, 20.0, 30.0]), np.array([0.5, -0.5, 0.25])
    angle = reference if argument == "reference" else reference + error
    wanted = (angle * unit / 360.0, error * unit / 360.0, [0.0, 0.5, 1.0])
    for found, values in zip(batch, wanted, strict=True):
        np.testing.assert_allclose(found, values, rtol=1e-12)


def test_no_row_and_no_column_are_errors(monkeypatch):
    for text, says in (("", "none of numbers"), ("a,b\n1,2\n", "no column reference_deg")):
        with typed(monkeypatch, text), pytest.raises(FileError, match=says):
            list(watched_batches("-", MODEL, ReadingOptions(), SourceOptions()))


can = pytest.importorskip("can")

DBC = """VERSION ""
BU_: servo
BO_ 257 Output: 4 servo
 SG_ angle : 0|16@1+ (0.0054931640625,0) [0|360] "deg" Vector__XXX
 SG_ torque : 16|16@1- (0.01,0) [-300|300] "Nm" Vector__XXX
BO_ 258 Motor: 2 servo
 SG_ reference : 7|16@0+ (0.0054931640625,0) [0|360] "deg" Vector__XXX
"""
SCALE = 360.0 / 65536
FIELDS = [f"0x101:0:2:{SCALE}", f"0x102:0:2b:{SCALE}", "0x101:2:2s:0.01"]


@pytest.fixture
def servo():
    """Sends both angles, the torque and frames of others on the virtual bus."""
    over = threading.Event()

    def work():
        with can.Bus(interface="virtual", channel="servo") as bus:
            for i in range(100_000):
                if over.is_set():
                    return
                angle = 1.5 * i
                shown = angle + 0.5 * np.cos(np.radians(angle))
                raw, true = (round(x / SCALE) % 65536 for x in (shown, angle))
                frames = (
                    (0x101, struct.pack("<Hh", raw, -1234)),
                    (0x300, b"other"),
                    (0x102, struct.pack(">H", true)),
                )
                for number, data in frames[:: 1 - 2 * (i % 2)]:
                    message = can.Message(arbitration_id=number, data=data, is_extended_id=False)
                    bus.send(message)
                if i % 100 == 50:
                    bus.send(can.Message(arbitration_id=0x101, data=b"x", is_extended_id=False))
                time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    yield
    over.set()
    thread.join()


@pytest.mark.parametrize("described", [False, True])
def test_rows_have_one_frame_of_each(servo, described, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ["angle", "Motor.reference", "torque"] if described else FIELDS
    (tmp_path / "servo.dbc").write_text(DBC)
    signals = [f"indicated={names[0]}:deg", f"reference={names[1]}:deg", f"torque={names[2]}:Nm"]
    options = [word for signal in signals for word in ("--signal", signal)]
    options += ["--dbc", "servo.dbc"] if described else []
    assert main(["record", "can:virtual:servo", "-o", "r.csv", *options, "--until", "orders"]) == 0
    (run,) = ta.read_runs("r.csv")
    assert set(run.torque) == {-12.34}
    fit = ta.fit(run, orders=[1])
    assert fit.model.amplitudes[0] == pytest.approx(0.5, abs=0.02)


def test_frames_that_are_too_short_are_rejected():
    with can.Bus(interface="virtual", channel="short") as bus:
        options = SourceOptions(fields=("1:0:2:0.5", "1:2:1s:1"), send="1A3#01ff")
        source = open_source("can:virtual:short", options)
        assert source.names == ("1:0:2:0.5", "1:2:1s:1")
        sent = bus.recv(1.0)
        assert (sent.arbitration_id, sent.data) == (0x1A3, b"\x01\xff")
        for data in (b"\x04\x00\xff", b"\x04\x00", b"\x06\x01\x02"):
            bus.send(can.Message(arbitration_id=1, data=data, is_extended_id=False))
        assert source.read() == b"2.0,-1.0\nno value: 1#0400\n131.0,2.0\n"
        source.close()
        with pytest.raises(ArgumentError, match="a frame as 123#0102FF is needed, got 'start'"):
            open_source("can:virtual:short", options._replace(send="start"))


def test_what_is_no_bus_and_no_signal_is_named(capsys, tmp_path):
    (tmp_path / "a.dbc").write_text("no dbc")
    output = ["-o", str(tmp_path / "r.csv"), "--for", "0.2"]
    field = ["--signal", "indicated=1:0:2:0.1:deg"]
    assert main(["record", "can:virtual:x", *output]) == 1
    assert main(["record", "can:nosuch:x", *output, *field]) == 1
    assert main(["record", "can:virtual:x", *output, "--dbc", str(tmp_path / "a.dbc")]) == 1
    told = capsys.readouterr().err
    for part in (
        "needs its signals: their description (--dbc)",
        "--signal indicated=0x101:0:2:0.02197:deg",
        "cannot be opened",
        "is no description of a CAN bus",
    ):
        assert part in told
