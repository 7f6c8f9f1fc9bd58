"""The pages about recording: their commands, against devices that do what their firmware does."""

import itertools
import os
import re
import shlex
import struct
import threading
import time

import numpy as np
import pytest

import trueangle as ta
from conftest import ROOT
from trueangle.cli import main

PAGES = ROOT / "docs" / "howto"


def commands(page):
    """Commands of a page, as words behind the program's name."""
    text = (PAGES / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```text\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    return text, [shlex.split(x)[1:] for x in lines if x.startswith("trueangle ")]


def printed(text, names):
    """What the sketch prints in a line, by its calls: texts, and names of values."""
    loop = text.split("void loop()")[1].split("```")[0]
    parts = re.findall(r"Serial\.print(?:ln)?\((.*?)\);", loop)
    found = []
    for part in parts:
        quoted = re.fullmatch(r"""(["'])(.*)\1""", part)
        found.append(quoted[2] if quoted else f"{{{names[part]}}}")
    return "".join(found) + "\r\n"


def device(lines, pause):
    """A pseudo-terminal that prints lines until it is closed: its name, and what closes it."""
    pytest.importorskip("serial")
    pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")
    handle, slave = pty.openpty()
    tty.setraw(slave)
    over = threading.Event()

    def work():
        for line in itertools.takewhile(lambda _: not over.is_set(), lines):
            os.write(handle, line.encode())
            time.sleep(pause)

    thread = threading.Thread(target=work)
    thread.start()

    def close():
        over.set()
        thread.join()
        os.close(handle)
        os.close(slave)

    return os.ttyname(slave), close


def test_an_as5600_against_a_stepper(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, (record, fit, export) = commands("record-as5600.md")
    line = printed(text, {"back ? 64000L - at : at": "step", "raw": "raw"})
    assert line == "step:{step} raw:{raw}\r\n"

    def lines():
        for step in range(0, 64_000, 10):
            angle = step / 3200 * 360.0
            shown = angle + 0.8 * np.sin(np.radians(angle))
            yield line.format(step=step, raw=round(shown / 360.0 * 4096) % 4096)

    name, close = device(lines(), 0.0005)
    assert main([*record[:1], name, *record[2:]]) == 0
    close()
    (run,) = ta.read_runs("runs.csv")
    assert len(run) > 600
    assert main(fit) == 0
    assert main(export) == 0
    assert ta.load_model("sensor.json").amplitudes[0] == pytest.approx(0.8, abs=0.01)
    assert "table" in (tmp_path / "correction.h").read_text()


@pytest.mark.parametrize("place", [0, 2])
def test_a_servo_on_can(place, tmp_path, monkeypatch):
    can = pytest.importorskip("can")
    monkeypatch.chdir(tmp_path)
    page = commands("record-can.md")[1]
    record, fit = page[place], page[1]
    (tmp_path / "servo.dbc").write_text(
        'VERSION ""\nBU_: servo\n'
        'BO_ 257 Output: 2 servo\n SG_ angle : 0|16@1+ (0.0054931640625,0) [0|0] "" servo\n'
        'BO_ 258 Motor: 2 servo\n SG_ angle : 7|16@0+ (0.0054931640625,0) [0|0] "" servo\n'
    )
    over = threading.Event()

    def work():
        with can.Bus(interface="virtual", channel="can0") as bus:
            for angle in itertools.takewhile(lambda _: not over.is_set(), np.arange(0.0, 1e6, 2.0)):
                shown = angle + 0.5 * np.cos(np.radians(angle))
                for number, order, x in ((0x101, "<H", shown), (0x102, ">H", angle)):
                    data = struct.pack(order, round(x / 360.0 * 65536) % 65536)
                    bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))
                time.sleep(0.001)

    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert main(record) == 0
    finally:
        over.set()
        thread.join()
    assert main(fit) == 0
    model = ta.load_model("joint.json")
    assert model.amplitudes[0] == pytest.approx(0.5, abs=0.02)


def test_a_spindle_that_coasts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, (record, selfcal) = commands("record-spindle.md")
    line = printed(text, {"micros()": "time", "readEncoder()": "count"})
    assert line == "{time},{count}\r\n"

    def lines():
        """From 10 to 2 turns a second in 20 s, ten lines at a time."""
        decay = np.log(5.0) / 20.0
        turn = 10.0 / decay * (1.0 - np.exp(-decay * np.arange(20_000) / 1000.0))
        error = 300.0 * np.sin(2.0 * np.pi * turn + 0.3) + 150.0 * np.sin(4.0 * np.pi * turn)
        count = np.rint((turn + error / 1_296_000.0) * 16384).astype(int) % 16384
        every = [line.format(time=1000 * i, count=x) for i, x in enumerate(count.tolist())]
        return ("".join(every[i : i + 10]) for i in range(0, len(every), 10))

    name, close = device(lines(), 0.001)
    # The coast is played faster, so that nobody waits for 20 s.
    assert main(["record", name, *(word.replace("20s", "6s") for word in record[2:])]) == 0
    close()
    header, first, *rows = (tmp_path / "coast.csv").read_text().splitlines()
    assert header == "run,time_s,indicated_deg"
    times = [float(row.split(",")[1]) for row in (first, *rows)]
    np.testing.assert_allclose(np.diff(times), 1e-3, atol=1e-9)
    assert len(rows) > 19_000
    assert main(selfcal) == 0
    model = ta.load_model("spindle.json")
    found = dict(zip(model.shafts[0].orders, model.amplitudes, strict=True))
    assert 3600.0 * found[1] == pytest.approx(300.0, abs=10.0)
    assert 3600.0 * found[2] == pytest.approx(150.0, abs=5.0)
