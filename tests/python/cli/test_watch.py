"""`trueangle watch`: a log or lines that arrive, a line per window, the status of an alarm."""

import json
import re
import sys

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError

SEED = 53_101


@pytest.fixture
def desk(tmp_path, monkeypatch):
    print("seed", SEED)
    monkeypatch.chdir(tmp_path)
    shaft = ta.Shaft("output", 1, [1, 2], [0.01, 0.0], [0.0, 0.02])
    model = ta.HarmonicModel([shaft], period=360.0)
    model.save("m.json")
    rng = np.random.default_rng(SEED)
    angle = np.arange(60 * 90) * 4.0
    error = model.error(angle) + rng.normal(0.0, 0.001, angle.size)
    for name, more in (("fine", 0.0), ("moved", 0.002)):
        shown = error + more * np.cos(np.radians(angle)) * (angle > 30 * 360.0)
        rows = [
            f"{0.1 * i:.1f},{x % 360.0},{(x + e) % 360.0}"
            for i, (x, e) in enumerate(zip(angle.tolist(), shown.tolist(), strict=True))
        ]
        lines = ["time_s,reference_deg,indicated_deg", *rows]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return tmp_path


def test_a_line_a_window_and_the_status(desk, capsys):
    assert main(["watch", "fine.csv", "-m", "m.json"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 59
    assert main(["watch", "moved.csv", "-m", "m.json"]) == 3
    assert re.search(r"ALARM order 1 moved by 7\.\d+ arcsec \(\+- ", capsys.readouterr().out)


def test_lines_that_arrive_say_the_same(desk, capsys, monkeypatch):
    assert main(["watch", "moved.csv", "-m", "m.json", "--json"]) == 3
    whole = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    with (desk / "moved.csv").open() as lines:
        monkeypatch.setattr(sys, "stdin", lines)
        assert main(["watch", "-", "-m", "m.json", "--json"]) == 3
    arrived = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert arrived == whole
    keys = {"window", "angle", "time_s", "orders", "statistic", "limit", "alarm", "because"}
    assert set(whole[0]) == keys
    assert whole[0]["time_s"] == pytest.approx(9.0, abs=0.3)
    assert [row["order"] for row in whole[0]["orders"]] == [1.0, 2.0]


def test_the_charts_are_drawn(desk, capsys):
    pytest.importorskip("matplotlib")
    assert main(["watch", "moved.csv", "-m", "m.json", "--plot", "w.svg"]) == 3
    assert (desk / "w.svg").read_text().count("<path") > 20
    model = ta.load_model("m.json")
    angle = np.arange(40 * 90) * 4.0
    error = model.error(angle) + np.random.default_rng(SEED).normal(0.0, 0.001, angle.size)
    error += 0.002 * np.cos(np.radians(angle)) * (angle > 30 * 360.0)
    windows = ta.Monitor(model).windows_of(angle, error)
    alt = ta.plots.text_alternative(ta.plots.watched_windows(windows, model.period))
    assert f"{len(windows)} windows" in alt
    assert "order 1 moved by" in alt
    with pytest.raises(ArgumentError, match="windows is empty"):
        ta.plots.watched_windows([], 360.0)


def test_the_page_holds_alarms_and_charts(desk, capsys):
    pytest.importorskip("jinja2")
    assert main(["watch", "moved.csv", "-m", "m.json", "--json", "--report", "w.html"]) == 3
    windows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    page = (desk / "w.html").read_text("utf-8")
    alarms = [window for window in windows if window["alarm"]]
    rows = re.findall(r'<th scope="row" class="r">(\d+)</th>', page)
    assert rows == [str(window["window"]) for window in alarms]
    assert f"{len(windows)} windows of travel, {len(alarms)} alarm" in page
    assert page.count("order 1 moved by") == len(alarms)
    # One chart of all, and of each of two orders its sums and its size.
    assert page.count("<figure") == 5
    assert "<script" not in page
    assert main(["watch", "fine.csv", "-m", "m.json", "--report", "w.html"]) == 0
    assert "no alarm." in (desk / "w.html").read_text("utf-8")
    assert main(["watch", "fine.csv", "-m", "m.json", "--report", "w.csv"]) == 1


def test_longer_windows(desk, capsys):
    assert main(["watch", "fine.csv", "-m", "m.json", "--every", "5turns"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 11
    with pytest.raises(SystemExit) as ended:
        main(["watch", "fine.csv", "-m", "m.json", "--every", "often"])
    assert ended.value.code == 2


def test_what_cannot_be_read_is_told_with_its_line(desk, capsys, monkeypatch):
    for text, told in (
        ("", "0 lines, none of numbers"),
        ("reference_deg,indicated_deg\nx,1\nx,3\n", "3 lines, none of numbers; check"),
        ("a,b\n1,2\n", "reference"),
    ):
        (desk / "typed.csv").write_text(text)
        with (desk / "typed.csv").open() as lines:
            monkeypatch.setattr(sys, "stdin", lines)
            assert main(["watch", "-", "-m", "m.json"]) == 1
        assert told in capsys.readouterr().err
