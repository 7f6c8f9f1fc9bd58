"""What a command prints as text are the numbers that it prints as JSON."""

import json
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.reports.robot import JointRank, fitted_rank, ranked, ranking_text

SEED = 55_300
THETA = np.arange(0.0, 360.0, 1.5)
MRAD = np.pi / 648.0
#: Printed to four digits.
FOUR = 6e-4


def model(period=360.0):
    shaft = ta.Shaft(
        "output",
        1,
        [1, 2, 5],
        [-3e-5 * period, 2e-5 * period, 0.0],
        [1e-5 * period, -4e-5 * period, 1e-5 * period],
    )
    return ta.HarmonicModel([shaft], 1e-4 * period, period)


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """Two logs of unlike lengths, one reading of which is missing, and one that is no log."""
    monkeypatch.chdir(tmp_path)
    model().save("m.json")
    for name, angles in (("a", THETA), ("b", THETA[:100])):
        rows = [repr(x) for x in (angles + model().error(angles)).tolist()]
        (tmp_path / f"{name}.csv").write_text(
            "\n".join(["indicated_deg,n", *(f"{x},1" for x in rows), ",1"]) + "\n"
        )
    return tmp_path


def printed(capsys, *arguments, status=0):
    assert main([*arguments]) == status
    return capsys.readouterr().out


def test_correct(desk, capsys):
    command = ("correct", "a.csv", "b.csv", "-m", "m.json")
    told = json.loads(printed(capsys, *command, "-o", "j", "--json"))
    text = printed(capsys, *command, "-o", "t", "--errors-in", "mrad")
    pattern = (
        r"(\w)\.csv: (\d+) readings.*\n +corrected_deg: correction (\S+) mrad rms, "
        r"(\S+) max abs, (\d+) missing kept"
    )
    found = re.findall(pattern, text)
    for (name, rows, rms, largest, missing), entry in zip(found, told["files"], strict=True):
        (joint,) = entry["joints"]
        assert (f"{name}.csv", int(rows)) == (entry["log"], entry["rows"])
        assert int(missing) == joint["missing"] == 1
        wanted = [MRAD * joint["rms_correction_arcsec"], MRAD * joint["max_abs_correction_arcsec"]]
        assert [float(rms), float(largest)] == pytest.approx(wanted, rel=FOUR)
        assert wanted[1] > 1.2 * wanted[0]
    assert f"2 of 2 logs corrected: {told['rows']} readings in" in text
    assert told["rows"] == THETA.size + 102
    # Again with a third: what was done before is counted apart, and its rows are not made anew.
    (desk / "c.csv").write_text((desk / "b.csv").read_text())
    text = printed(capsys, *command[:3], "c.csv", *command[3:], "-o", "t")
    assert "1 of 3 logs corrected, 2 already: 101 readings in" in text


def test_correct_tells_readings_outside_the_span_beside_those_missing(desk, capsys):
    arc = np.linspace(30.0, 200.0, 300)
    run = ta.CalibrationRun(arc, arc + 0.3 * np.sin(np.radians(arc)), period=360.0)
    ta.fit(run, orders=[1]).model.save("arc.json")
    (desk / "d.csv").write_text("indicated_deg,x\n0,1\n29,2\n,3\n100,4\n210,5\n")
    text = printed(capsys, "correct", "d.csv", "-m", "arc.json", "-o", "d_out.csv")
    assert "d.csv: 5 readings corrected" in text
    assert ", 1 missing kept, 3 outside the calibrated span, where no reading verifies it\n" in text


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi, 1.0])
def test_import(period, desk, capsys):
    one = model(period)
    one.save("p.json")
    assert main(["export", "p.json", "--to", "csv", "--entries", "256", "-o", "t.csv"]) == 0
    capsys.readouterr()
    command = ("import", "t.csv", "--from", "csv", "-o", "i.json")
    told = json.loads(printed(capsys, *command, "--json"))
    back = ta.load_model("i.json")
    unit = 1_296_000.0 / back.period
    wanted = zip(back.orders, back.amplitudes * unit, np.degrees(back.phases) % 360.0, strict=True)
    for row, values in zip(told["orders"], wanted, strict=True):
        assert [row["order"], row["amplitude_arcsec"], row["phase_deg"]] == pytest.approx(values)
        assert 0.0 <= row["phase_deg"] < 360.0
    assert told["zero_deg"] == pytest.approx(360.0 * back.constant / back.period)
    sizes = {row["order"]: row["amplitude_arcsec"] for row in told["orders"]}
    true = dict(zip(one.orders, one.amplitudes * 1_296_000.0 / period, strict=True))
    for order, size in true.items():
        assert sizes[order] == pytest.approx(size, rel=1e-3)
    text = printed(capsys, *command, "--errors-in", "mrad")
    assert f"{len(told['orders'])} orders, zero" in text
    assert float(re.search(r"zero (\S+) deg", text)[1]) == pytest.approx(told["zero_deg"], abs=3e-6)
    rows = re.findall(r"order (\S+): (\S+) mrad at (\S+) deg", text)
    by_size = sorted(told["orders"], key=lambda row: -row["amplitude_arcsec"])
    for (order, size, phase), row in zip(rows, by_size, strict=False):
        assert float(order) == row["order"]
        assert float(size) == pytest.approx(MRAD * row["amplitude_arcsec"], rel=FOUR)
        assert float(phase) == pytest.approx(row["phase_deg"], abs=0.051)


@pytest.mark.parametrize("period", [360.0, 1.0])
def test_watch(period, desk, capsys):
    """Its line names the order that is off the most, whichever chart is the highest."""
    model(period).save("w.json")
    rng = np.random.default_rng(SEED)
    angle = np.arange(0.0, 40.0 * 360.0, 4.0)
    error = model().error(angle) + rng.normal(0.0, 0.002, angle.size)
    error += 0.01 * np.cos(np.radians(angle)) * (angle > 30.0 * 360.0)
    rows = [f"{x!r},{y!r}" for x, y in zip(angle.tolist(), (angle + error).tolist(), strict=True)]
    (desk / "w.csv").write_text("\n".join(["reference_deg,indicated_deg", *rows]) + "\n")
    command = ("watch", "w.csv", "-m", "w.json")
    told = [json.loads(line) for line in printed(capsys, *command, "--json", status=3).splitlines()]
    lines = printed(capsys, *command, "--errors-in", "mrad", status=3).splitlines()
    pattern = r"window +(\d+)  order (\S+) is off by (\S+) mrad; "
    pattern += r"(?:baseline \d of 8|change (\S+), alarm from (\S+?)(  ALARM .*)?)"
    apart = 0
    for line, one in zip(lines, told, strict=True):
        window, order, size, chart, limit, alarm = re.fullmatch(pattern, line).groups()
        largest = max(one["orders"], key=lambda row: row["amplitude_arcsec"])
        assert (int(window), float(order)) == (one["window"], largest["order"])
        assert float(size) == pytest.approx(MRAD * largest["amplitude_arcsec"], rel=FOUR)
        assert (chart is None) == (one["window"] <= 8)
        if chart is not None:
            assert float(chart) == pytest.approx(one["statistic"], abs=0.0051)
            assert float(limit) == pytest.approx(one["limit"], abs=0.0051)
        assert bool(alarm) == one["alarm"]
        apart += largest is not max(one["orders"], key=lambda row: row["statistic"])
    assert apart > 5
    # 0.01 deg, known to 0.002 sqrt(2 / 90) in a window.
    off = [row["amplitude_arcsec"] for one in told[32:] for row in one["orders"][:1]]
    assert np.mean(off) == pytest.approx(36.0, rel=0.05)
    moved = re.search(r"order 1 moved by (\S+) mrad", "".join(lines))
    assert float(moved[1]) == pytest.approx(0.01 * 3600.0 * MRAD, rel=0.1)


def test_join_and_check(desk, capsys):
    t = np.arange(0.0, 40.0, 0.02)

    def motion(time):
        return 100.0 * np.sin(0.4 * time) + 30.0 * np.sin(1.1 * time)

    rng = np.random.default_rng(SEED)
    for name, role, clock, angle in (
        ("i", "indicated", t, motion(t) + rng.normal(0.0, 0.01, t.size)),
        ("r", "reference", t + 3.0, motion(t)),
    ):
        rows = [f"{x!r},{y!r}" for x, y in zip(clock.tolist(), angle.tolist(), strict=True)]
        del rows[700:760]
        (desk / f"{name}.csv").write_text("\n".join([f"time_s,{role}_deg", *rows]) + "\n")
    command = ("join", "i.csv", "r.csv")
    told = json.loads(printed(capsys, *command, "-o", "j.csv", "--json"))
    text = printed(capsys, *command, "-o", "k.csv", "--errors-in", "mrad")
    head = re.search(r"(\d+) of (\d+) readings joined in 1 run", text)
    assert [int(head[1]), int(head[2]) - int(head[1])] == [told["readings"], told["left_out"]]
    offset, std = map(float, re.search(r"offset +(\S+) \+- (\S+) s", text).groups())
    assert [offset, std] == pytest.approx(
        [told["offset_s"], told["offset_std_s"]], abs=0.06 * told["offset_std_s"]
    )
    assert float(re.search(r"adds (\S+) mrad", text)[1]) == pytest.approx(
        MRAD * told["std_arcsec"], rel=FOUR
    )
    assert f"gaps      {len(told['gaps'])}" in text
    told = json.loads(printed(capsys, "check", "j.csv", "--json"))
    text = " ".join(printed(capsys, "check", "j.csv").split())
    found = re.search(
        r"(\d+) readings in (\d+) run, (\S+) deg covered, longest run (\S+) turns\.", text
    )
    wanted = [told["readings"], told["runs"], told["span_deg"], told["turns"]]
    assert [float(x) for x in found.groups()] == pytest.approx(wanted, rel=FOUR)
    assert float(re.search(r"Indicated per reference: (\S+)", text)[1]) == pytest.approx(
        told["ratio"], rel=1e-5
    )
    assert f"speeds: {', '.join(f'{v:g}' for v in told['speeds'])} deg/s" in text


@pytest.mark.parametrize("period", [360.0, 1.0])
def test_the_joints_of_a_robot_stand_the_worst_first(period):
    """What has no model before all, then by the error as measured; left is the fit's own."""
    rng, rows = np.random.default_rng(SEED), []
    for joint, size in (("small", 0.01), ("large", 0.05), ("none", 0.02)):
        error = size * np.sin(np.radians(THETA)) + rng.normal(0.0, 1e-3, THETA.size)
        unit = period / 360.0
        runs = [ta.CalibrationRun(THETA * unit, (THETA + error) * unit, period)]
        found = ValueError("no order") if joint == "none" else ta.fit(runs, [1], loss="linear")
        rows.append(fitted_rank(joint, runs, found))
        assert rows[-1].peak_to_peak_before_arcsec == pytest.approx(7200.0 * size, rel=0.2)
    assert [row.rms_left_arcsec for row in rows] == [
        pytest.approx(3.6, rel=0.2), pytest.approx(3.6, rel=0.2), None,
    ]  # fmt: skip
    assert [row.joint for row in ranked(rows)] == ["none", "large", "small"]
    text = ranking_text("Joints", ranked(rows), "mrad")
    for row in rows:
        cells = re.search(rf"^{row.joint} +(\S+) +(\S+)", text, re.M).groups()
        wanted = [row.peak_to_peak_before_arcsec, row.rms_left_arcsec]
        for cell, value in zip(cells, wanted, strict=True):
            assert (
                cell == "-"
                if value is None
                else float(cell) == pytest.approx(MRAD * value, rel=FOUR)
            )
    sizes = (("usable", None), ("not usable", 1.0))
    two = [JointRank(verdict, size, None, verdict, None) for verdict, size in sizes]
    assert ranked(two)[0].joint == "not usable"
