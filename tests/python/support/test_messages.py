"""What is told of trouble: short, of the right file and line, or of the machine."""

import errno
import os
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.formats.damage import damage_told
from trueangle.support.files import partition_keys

#: Characters of a line that a person reads; thousands of names would make 30 000.
LONGEST = 2500


def one_line(capsys):
    told = capsys.readouterr().err
    assert told.count("\n") == 1, told
    assert len(told) < LONGEST
    return told


@pytest.fixture
def model(tmp_path):
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    ta.HarmonicModel([shaft], period=360.0).save(tmp_path / "m.json")
    return str(tmp_path / "m.json")


def test_a_table_of_thousands_of_columns_is_refused_at_once(tmp_path, model, capsys):
    count = 20_000
    names = ["indicated_deg", *(f"channel_{i}" for i in range(count))]
    rows = "\n".join([",".join(["1.5"] * (count + 1))] * 3)
    log = tmp_path / "wide.csv"
    log.write_text(",".join(names) + "\n" + rows + "\n")
    start = time.process_time()
    assert main(["fit", str(log), "-o", str(tmp_path / "x.json")]) == 1
    assert "no column reference_deg" in one_line(capsys)
    assert (
        main(["correct", str(log), "-m", model, "-o", str(tmp_path / "o.csv"), "--column", "z"])
        == 1
    )
    assert "no such column" in one_line(capsys)
    # Comparing every name with every other took 5 s and more; this takes 1 s.
    assert time.process_time() - start < 4.0
    log.write_text(",".join([*names, "channel_7"]) + "\n")
    assert main(["check", str(log)]) == 1
    assert "column 'channel_7': the column appears twice" in one_line(capsys)


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (RuntimeError("database or disk is full"), OSError),
        (ValueError("IOError: [errno 28] No space left on device"), OSError),
        (OSError("malloc of size 1048576 failed"), MemoryError),
        (RuntimeError("can't start new thread"), MemoryError),
        (RuntimeError("unexpected end"), ta.errors.FileError),
    ],
)
def test_the_machine_is_not_the_file(error, kind, tmp_path):
    with pytest.raises(kind) as told, damage_told(tmp_path / "a.db3", "a bag"):
        raise error
    if kind is OSError:
        assert told.value.errno == errno.ENOSPC
        assert str(tmp_path) not in str(told.value)


def test_a_library_that_cannot_be_loaded_is_not_a_missing_one(monkeypatch):
    import builtins

    from trueangle.certificate.typesetting import typeset_certificate

    real = builtins.__import__

    def loading(name, *more):
        if name == "typst":
            raise ImportError("failed to map segment from shared object")
        return real(name, *more)

    pytest.importorskip("matplotlib")
    monkeypatch.setattr(builtins, "__import__", loading)
    with pytest.raises(ImportError, match="failed to map") as told:
        typeset_certificate({})
    assert not isinstance(told.value, ta.errors.MissingExtraError)


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(60):
        (folder / f"log_of_the_long_night_shift_{i:03d}.csv").write_text(
            "indicated_deg\n1.5\n2.5\n"
        )
    return folder


def test_a_batch_that_is_interrupted_lists_a_few_logs(logs, tmp_path, model, monkeypatch, capsys):
    from trueangle.logs import batch

    def interrupted(task, watch=None):
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "correct_log", interrupted)
    assert main(["correct", str(logs), "-m", model, "-o", str(tmp_path / "out")]) == 130
    told = one_line(capsys)
    assert len(told) < 1500
    assert "0 of 60 logs" in told
    assert "55 more" in told


def test_a_batch_that_fails_lists_a_few_logs(logs, tmp_path, model, capsys):
    for path in logs.iterdir():
        path.write_text("indicated_deg\nx\n")
    assert main(["correct", str(logs), "-m", model, "-o", str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert len(captured.err) < LONGEST
    assert "55 more failed" in captured.err
    assert "0 of 60 logs corrected: 0 readings" in captured.out


def test_a_batch_ends_with_a_total(logs, tmp_path, model, capsys):
    command = ["correct", str(logs), "-m", model, "-o", str(tmp_path / "out")]
    assert main(command) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("60 of 60 logs corrected: 120 readings in ")
    (tmp_path / "out" / "log_of_the_long_night_shift_007.csv").unlink()
    assert main(command) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("1 of 60 logs corrected, 59 already: 2 readings in ")


@pytest.mark.filterwarnings("default::UserWarning")
def test_a_broken_link_does_not_stop_a_folder(logs, tmp_path, model, capsys):
    os.symlink(logs / "nowhere.csv", logs / "broken.csv")
    assert main(["correct", str(logs), "-m", model, "-o", str(tmp_path / "out")]) == 0
    captured = capsys.readouterr()
    assert "60 of 60" in captured.out
    assert "broken.csv: is a link to nothing and is omitted" in captured.err
    assert captured.err.count("\n") == 1


PREAMBLES = {
    "nothing": [],
    "words": ["Recorded by rig 7", ""],
    "notes": ["# rig 7", "", "# second"],
    "words and notes": ["Rig 7", "# a", "", "# b", ""],
}


@pytest.mark.parametrize("preamble", PREAMBLES)
def test_the_line_named_is_that_of_the_file(preamble, tmp_path, model, capsys):
    lines = [*PREAMBLES[preamble], "time_s,reference_deg,indicated_deg"]
    header = len(lines)
    lines += ["0,0,0.1", "# between", "", "1,10,10.1", "2,20,oops", "3,30,30.1"]
    bad = lines.index("2,20,oops") + 1
    log, out = tmp_path / "a.csv", str(tmp_path / "x.json")
    log.write_text("\n".join(lines) + "\n")
    reading = [["fit", "-o", out], ["fit", "--one-pass", "-o", out], ["check"]]
    reading.append(["correct", "-m", model, "-o", str(tmp_path / "o.csv")])
    for command in reading:
        assert main([command[0], str(log), *command[1:]]) == 1
        assert f"a.csv, line {bad}, column 'indicated_deg'" in one_line(capsys), command
    log.write_text("\n".join(lines).replace("reference_deg", "angle_deg").replace("oops", "20.1"))
    for command in reading[:3]:
        assert main([command[0], str(log), *command[1:]]) == 1
        assert f"a.csv, line {header}: " in one_line(capsys), command
    asked = ["correct", str(log), "-m", model, "-o", out.replace("json", "csv"), "--column", "z"]
    assert main(asked) == 1
    assert f"a.csv, line {header}, column 'z'" in one_line(capsys)


def test_folders_that_say_what_a_file_is_are_read(tmp_path, capsys, monkeypatch):
    """Keys give what the file does not say: labels, and columns of one value."""
    rng = np.random.default_rng(4)
    paths = []
    for unit in ("a", "b c"):
        for run in ("3", "007"):
            place = tmp_path / "cells" / f"unit={unit.replace(' ', '%20')}" / f"run={run}"
            place = place / "temperature_C=21.5"
            place.mkdir(parents=True)
            theta = np.arange(0.0, 360.0, 3.0)
            said = theta + 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 1e-3, theta.size)
            rows = [f"{t!r},{s!r}" for t, s in zip(theta.tolist(), said.tolist(), strict=True)]
            paths.append(place / "data.csv")
            paths[-1].write_text("\n".join(["reference_deg,indicated_deg", *rows]) + "\n")
    runs = ta.read_runs(paths)
    assert [(run.unit, run.label) for run in runs] == [
        *(("a", "3"), ("a", "007"), ("b c", "3"), ("b c", "007"))
    ]
    for run in runs:
        np.testing.assert_array_equal(run.temperature, 21.5)
    model = str(tmp_path / "x.json")
    assert main(["fit", *map(str, paths), "--orders", "1", "-o", model]) == 0
    names = [entry.file for entry in ta.load_model(model).provenance.inputs]
    assert len(set(names)) == 4
    assert names[0] == "unit=a/run=3/temperature_C=21.5/data.csv"
    found = ta.fit_logs(paths, orders=[1])
    assert [(run.unit, run.label) for run in found.runs] == [(r.unit, r.label) for r in runs]
    assert len({entry.file for entry in found.model.provenance.inputs}) == 4
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 400)  # so that these are summed in one pass
    summed = ta.fit_logs(paths, orders=[1])
    assert [run[1:] for run in summed.moments.runs] == [(r.unit, r.label) for r in runs]
    # What the file says comes first.
    paths[0].write_text("run,reference_deg,indicated_deg\n9,0,0.1\n9,90,90.1\n")
    assert ta.read_runs(paths[0])[0].label == "9"
    assert partition_keys("x/unit=__HIVE_DEFAULT_PARTITION__/a.csv") == {}
