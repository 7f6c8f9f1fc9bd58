"""A servo with two encoders on a CAN bus: bytes of frames, or a DBC."""

import struct
import threading
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.recording.sources import SourceOptions, open_source

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
