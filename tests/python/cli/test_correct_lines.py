"""What is printed of logs one by one and together, against counts written out."""

import argparse
import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli.correct import _print, _status, _total
from trueangle.cli.watch import _line
from trueangle.errors import FileError, TrueAngleError
from trueangle.logs.report import BatchReport, LogReport
from trueangle.model.monitor import WatchedOrder, WatchedWindow

SEED = 81_300
STATUS = ("done", "done before", "failed", "not started")


def joint(rms, largest, missing=0, outside=None):
    return {
        "joint": None, "column": "q", "corrected": "corrected_deg",
        "rms_correction_arcsec": rms, "max_abs_correction_arcsec": largest,
        "missing": missing, "outside_span": outside, "unit_note": None,
    }  # fmt: skip


def log(number, status, rows):
    path, made = Path(f"log{number}.csv"), Path(f"out/log{number}.csv")
    result = {"rows": rows, "rows_per_second": 1e6, "joints": [joint(1.0, 2.0)], "after": {}}
    error = FileError(path, f"is damaged at byte {number}") if status == "failed" else None
    return LogReport(path, made, 100, status, result if status.startswith("done") else {}, error)


def batches():
    """Batches of unlike numbers of logs of each kind."""
    rng = np.random.default_rng(SEED)
    for counts in itertools.product((0, 1, 2, 7), (0, 1, 3), (0, 1, 2, 6, 9), (0, 2)):
        if sum(counts) < 2:
            continue
        kinds = [s for s, n in zip(STATUS, counts, strict=True) for _ in range(n)]
        rng.shuffle(kinds)
        rows = rng.integers(1, 1000, len(kinds)).tolist()
        yield (
            counts,
            BatchReport(
                [log(k, s, n) for k, (s, n) in enumerate(zip(kinds, rows, strict=True))], 2.0
            ),
        )


def test_logs_together_are_those_of_this_time(capsys):
    """What was done before is told apart, and its readings are not counted again."""
    for (done, before, failed, waiting), batch in batches():
        rows = sum(one.result["rows"] for one in batch.logs if one.status == "done")
        assert batch.to_dict()["rows"] == rows
        assert batch.to_dict()["complete"] == (failed + waiting == 0)
        _total(batch)
        total = done + before + failed + waiting
        more = f", {before} already" if before else ""
        wanted = f"{done} of {total} logs corrected{more}: {rows} readings in 2.0 s\n"
        assert capsys.readouterr().out == wanted


def test_what_is_not_done_is_counted_and_named():
    for (done, before, failed, waiting), batch in batches():
        if failed + waiting == 0:
            assert _status(batch) == 0
            continue
        with pytest.raises(TrueAngleError) as found:
            _status(batch)
        text = str(found.value)
        total = done + before + failed + waiting
        assert text.startswith(f"{done + before} of {total} logs are corrected and complete")
        named = text.count("is damaged at byte")
        more = [part for part in text.split("; ") if part.endswith(" more failed")]
        assert named + sum(int(part.split()[0]) for part in more) == failed
        assert (named == failed) == (not more)
        assert ("not started: " in text) == (waiting > 0)
        assert text.endswith("; run the same command again to go on")


@pytest.mark.parametrize(("largest", "unit"), [(3590.0, "arcsec"), (3610.0, "deg")])
@pytest.mark.parametrize("share", [0.1, 0.7])
def test_a_correction_is_in_the_unit_that_its_largest_has(share, largest, unit, capsys):
    one = log(0, "done", 500)
    one.result["joints"][:] = [joint(share * largest, largest, 3, 7), joint(1.0, 2.0)]
    _print(one, "auto")
    first, second, third = capsys.readouterr().out.splitlines()
    assert first == "log0.csv: 500 readings corrected at 1,000,000 rows/s -> out/log0.csv"
    scale = 1.0 if unit == "arcsec" else 1.0 / 3600.0
    words = second.split()
    assert float(words[2]) == pytest.approx(share * largest * scale, rel=1e-3)
    assert words[3] == unit
    assert float(words[5]) == pytest.approx(largest * scale, rel=1e-3)
    assert second.endswith("max abs, 3 missing kept, 7 outside the calibrated span")
    assert third.endswith("max abs")
    before = log(1, "done before", 5)
    _print(before, "auto")
    assert capsys.readouterr().out == "log1.csv: done before -> out/log1.csv\n"
    _print(log(2, "failed", 0), "auto")
    assert capsys.readouterr().out == ""


TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "count": 8192.0}
ARCSEC = 1_296_000.0
SIZE = 2372.0

#: What a size of 2372 arcsec is in each unit, of 8192 counts to a turn or of 4096 asked for.
SHOWN = {
    ("auto", None): (SIZE, "arcsec"),
    ("arcsec", None): (SIZE, "arcsec"),
    ("deg", None): (SIZE / 3600.0, "deg"),
    ("mrad", None): (SIZE / ARCSEC * 2000.0 * np.pi, "mrad"),
    ("count", 4096.0): (SIZE / ARCSEC * 4096.0, "count"),
    ("count", None): (SIZE / ARCSEC * 8192.0, "count"),
}


def window(turn, alarm=False, scale=1.0):
    """Order 3 is the largest, and neither the first nor that with the largest sum."""
    orders = tuple(
        WatchedOrder(order, part * scale * SIZE * turn / ARCSEC, 10.0, statistic)
        for order, part, statistic in ((1.0, 0.2, 4.0), (3.0, 1.0, 2.0), (2.0, 0.9, 9.0))
    )
    because = "order 2 by 2134.8 arcsec since window 3" if alarm else ""
    return WatchedWindow(7, 0.0, None, 90, orders, 9.0, 8.5, alarm, because)


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize("asked", list(SHOWN), ids=str)
def test_a_size_is_in_the_unit_asked_for(asked, readings):
    turn, (name, counts) = TURNS[readings], asked
    if name == "count" and counts is None and readings != "count":
        return
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in=name, counts_per_turn=counts)
    value, unit = SHOWN[asked]
    for alarm in (False, True):
        line = _line(window(turn, alarm), model, args)
        found = re.match(r"window +7  order 3 is (\S+) (\w+) off  chart  9.00 of 8.50", line)
        assert float(found[1]) == pytest.approx(value, rel=1e-3)
        assert found[2] == unit
        assert ("ALARM" in line) == alarm
        if alarm:
            told = re.search(r"ALARM order 2 by (\S+) (\w+) since window 3", line)
            assert float(told[1]) == pytest.approx(0.9 * value, rel=2e-3)
            assert told[2] == unit


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize(("scale", "unit"), [(3590.0 / SIZE, "arcsec"), (3610.0 / SIZE, "deg")])
def test_by_itself_it_is_in_degrees_from_one_on(scale, unit, readings):
    turn = TURNS[readings]
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in="auto", counts_per_turn=None)
    assert f" {unit} off" in _line(window(turn, scale=scale), model, args)
    args.json = True
    plain = json.loads(_line(window(turn, scale=scale), model, args))
    sizes = [row["amplitude_arcsec"] for row in plain["orders"]]
    np.testing.assert_allclose(sizes, np.array([0.2, 1.0, 0.9]) * scale * SIZE)
