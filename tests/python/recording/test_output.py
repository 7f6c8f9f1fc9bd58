"""The file of a recording: whole at every moment, continued by runs of other labels."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError
from trueangle.recording.output import RunsFile, WholeFile

from .wires import joint_lines, recorded

#: Children that write as fast as they can, killed one after the other at a random moment.
KILLED = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
from trueangle.recording.output import RunsFile
random.seed(52_002)
for i in range(50):
    path = Path(sys.argv[1], f"{i}.csv")
    child = os.fork()
    if not child:
        file = RunsFile(path, None, False)
        os.fsync = lambda handle: None  # as many moments of writing as there are
        file.begin(["a", "b"])
        while True:
            file.add(np.array([[1.2345678, 9.876]] * 500))
            file.rows.flush()
    while not path.exists():
        time.sleep(0.0005)
    time.sleep(random.uniform(0.0, 0.02))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_file_whose_writer_is_killed_holds_whole_rows(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, tmp_path], check=True)
    sizes = []
    for i in range(50):
        data = (tmp_path / f"{i}.csv").read_bytes()
        head, *rows, last = (data or b"run,a,b\n").split(b"\n")
        assert (head, last) == (b"run,a,b", b"")
        assert {row.rstrip(b" ") for row in rows} <= {b"1,1.2345678,9.876"}
        sizes.append(len(rows))
    assert len(set(sizes)) > 10


def test_rows_wait_a_second_at_most_and_are_synced(tmp_path, monkeypatch):
    now, synced = [100.0], []
    monkeypatch.setattr("trueangle.recording.output.time.monotonic", lambda: now[0])
    monkeypatch.setattr("trueangle.recording.output.os.fsync", synced.append)
    file = WholeFile(tmp_path / "a.csv")
    file.add(b"1\n", 1)
    assert not file.path.exists()
    now[0] += 1.0
    file.add(b"2\n", 1)
    assert (file.path.read_bytes(), len(synced)) == (b"1\n2\n", 1)
    file.add(b"3\n", 1)
    file.close()
    assert (file.path.read_bytes(), file.lines) == (b"1\n2\n3\n", 3)


def test_no_call_of_the_system_crosses_a_page(tmp_path, monkeypatch):
    rng, written, write = np.random.default_rng(52_004), [], os.write

    def seen(handle, data):
        written.append(data)
        return write(handle, data)

    monkeypatch.setattr("trueangle.recording.output.os.write", seen)
    file = WholeFile(tmp_path / "a.csv")
    for size in rng.integers(1, 900, 60).tolist():
        file.add(b"".join(b"%d,1\n" % 10**n for n in rng.integers(0, 15, size).tolist()), size)
        file.flush()
    file.close()
    ends = np.cumsum([len(data) for data in written])
    starts = ends - [len(data) for data in written]
    assert (starts // 4096 == (ends - 1) // 4096).all()
    assert all(data.endswith(b"\n") for data in written)
    assert file.path.read_bytes() == b"".join(written)


def test_a_full_disk_leaves_whole_rows_and_is_named(tmp_path, monkeypatch):
    write, left = os.write, [10_000]

    def full(handle, data):
        part = data[: left[0]]
        left[0] -= len(part)
        return write(handle, part)

    monkeypatch.setattr("trueangle.recording.output.os.write", full)
    file = WholeFile(tmp_path / "a.csv")
    file.add(b"0123456789\n" * 2000, 2000)
    with pytest.raises(OSError, match=re.escape("a.csv")):
        file.flush()
    file.close()
    rows = {row.rstrip(b" ") for row in file.path.read_bytes().split(b"\n")}
    assert rows == {b"0123456789", b""}
    assert 4000 < file.path.stat().st_size <= 10_000


def test_an_output_is_refused_or_continued_with_another_label(tmp_path):
    path, lines = tmp_path / "runs.csv", joint_lines(1.0)
    recorded(path, lines)
    with pytest.raises(FileError, match=r"is there already: .* \(`append=True`\)"):
        recorded(path, lines)
    for label in ("1", "a"):
        recorded(path, lines, label="a", append=True) if label == "a" else None
        with pytest.raises(ArgumentError, match=f"has a run '{label}'"):
            RunsFile(path, label, True)
    with open(path, "ab") as file:
        file.write(b"a,12.5,1")  # of a power cut
    recorded(path, lines, append=True)
    assert [run.label for run in ta.read_runs(path)] == ["1", "a", "3"]
    assert [len(run) for run in ta.read_runs(path)] == [500] * 3
    with pytest.raises(FileError, match="has the columns run, time_s, reference_deg"):
        recorded(path, ["x:1 y:2", "x:2 y:3", "x:3 y:3"], append=True)
    path.write_text("reference_deg,indicated_deg\n1,2\n")
    with pytest.raises(FileError, match="has no column run"):
        RunsFile(path, None, True)


def test_a_label_is_quoted_where_it_has_to_be(tmp_path):
    recorded(tmp_path / "runs.csv", joint_lines(1.0), label='warm, "new"')
    assert ta.read_runs(tmp_path / "runs.csv")[0].label == 'warm, "new"'


def test_the_null_device_takes_all():
    assert recorded(Path(os.devnull), ["no row", *joint_lines(0.1)]).rows == 50
    assert not Path(f"{os.devnull}.rejected").exists()
