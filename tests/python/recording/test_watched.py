"""`trueangle watch` takes the same sources as `record`."""

import json
import os
import sys
import threading
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.recording.sources import SourceOptions
from trueangle.recording.watched import watched_batches
from trueangle.runs.source import ReadingOptions

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
    for text, says in (("", "no line is a row"), ("a,b\n1,2\n", "no column reference_deg")):
        with typed(monkeypatch, text), pytest.raises(FileError, match=says):
            list(watched_batches("-", MODEL, ReadingOptions(), SourceOptions()))
