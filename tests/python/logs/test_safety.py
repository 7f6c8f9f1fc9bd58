"""Nothing half-written passes for complete: kills, full disks, damaged logs, resuming."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import weakref

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import TrueAngleError
from trueangle.logs import batch
from trueangle.logs.manifest import MANIFEST
from trueangle.support.files import publish, workplace
from trueangle.support.files.workplace import PARTIAL, hidden_name

from .conftest import made_angles

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

FILES = 6
ROWS = 60_000


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    (folder / "cell1").mkdir(parents=True)
    for i in range(FILES):
        angles = made_angles(ROWS, seed=i)
        table = pa.table({"time_s": np.arange(ROWS) / 1e3, "indicated_deg": angles})
        path = folder / ("cell1" if i % 2 else "") / f"log{i}.parquet"
        pq.write_table(table, path, row_group_size=10_000)
    return folder


def tree(folder):
    """Every file but the manifest, hidden ones too, with its bytes."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in files if p.name != MANIFEST}


def command(logs, model_file, *more):
    return ["correct", str(logs), "-m", str(model_file), *map(str, more)]


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    """A log whose correction takes seconds, nearly all of them in h5py."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path_factory.mktemp("packed") / "a.h5"
    with h5py.File(path, "w") as file:
        angles = np.linspace(0.0, 36000.0, 3_000_000) % 360.0
        file.create_dataset("indicated_deg", data=angles, chunks=(4096,), compression="gzip")
    return path


@pytest.mark.parametrize(("name", "status"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_ends_whatever_a_library_does(name, status, packed, model_file, tmp_path):
    """As h5py, whose callbacks take most of them: nothing is left, and nothing told but that."""
    arguments = command(packed, model_file, "-o", tmp_path / "b.h5")
    line = [sys.executable, "-m", "trueangle", *arguments]
    process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    while not list(tmp_path.iterdir()):
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(0.12)
    process.send_signal(getattr(signal, name))
    sent = time.monotonic()
    told = process.communicate()[1]
    assert (process.returncode, told.count("\n")) == (status, 1), told
    assert told.startswith("trueangle: interrupted")
    assert ": 0 of 1 logs are corrected" in told
    assert time.monotonic() - sent < 10.0  # a second, where nobody else works
    assert list(tmp_path.iterdir()) == []


#: A signal in every call that HDF5 makes, one after another, until none is left.
IN_EVERY_CALL = """
import os, signal, sys
from trueangle.cli import main
from trueangle.formats.hdf5 import _WrittenFile as Output

def counted(own):
    def call(self, *arguments):
        calls[0] -= 1
        if not calls[0]:
            signal.raise_signal(signal.SIGTERM)
        return own(self, *arguments)
    return call

for name in ("write", "seek", "truncate", "flush", "readinto"):
    setattr(Output, name, counted(getattr(Output, name)))
number, left = 0, -1
while left <= 0:
    number += 1
    calls = [number]
    status, left, files = main(sys.argv[1:]), calls[0], os.listdir(sys.argv[-1])
    assert left > 0 or (status, files) == (143, []), number
assert (status, "a.h5" in files) == (0, True)
assert number > 20
"""


def test_a_signal_within_hdf5_waits_for_its_end(model_file, tmp_path):
    """One that was raised there, where it closed its file, ended the process with a fault."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        angles = np.linspace(0.0, 36000.0, 50_000) % 360.0
        file.create_dataset("indicated_deg", data=angles, chunks=(8192,), compression="gzip")
    (tmp_path / "out").mkdir()
    line = [sys.executable, "-c", IN_EVERY_CALL]
    line += command(tmp_path / "a.h5", model_file, "-o", tmp_path / "out")
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


def test_running_again_does_nothing_twice(logs, model_file, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(command(logs, model_file, "-o", out, "--json")) == 0
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
    capsys.readouterr()
    assert main(command(logs, model_file, "-o", out, "--json")) == 0
    again = json.loads(capsys.readouterr().out)
    assert {log["status"] for log in again["files"]} == {"done before"}
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")} == times
    # A changed log, a lost output and another model are done anew.
    source = logs / "log0.parquet"
    pq.write_table(pq.read_table(source).slice(10), source)
    (out / "log2.parquet").unlink()
    capsys.readouterr()
    assert main(command(logs, model_file, "-o", out, "--json")) == 0
    statuses = {f["log"]: f["status"] for f in json.loads(capsys.readouterr().out)["files"]}
    anew = {name for name, status in statuses.items() if status == "done"}
    assert anew == {str(source), str(logs / "log2.parquet")}


def test_half_a_line_of_the_manifest_is_skipped(logs, model_file, tmp_path, capsys):
    out = tmp_path / "out"
    main(command(logs, model_file, "-o", out))
    manifest = out / MANIFEST
    manifest.write_bytes(manifest.read_bytes()[:-40])
    capsys.readouterr()
    for expected in (1, 0):
        main(command(logs, model_file, "-o", out, "--json"))
        files = json.loads(capsys.readouterr().out)["files"]
        assert sum(f["status"] == "done" for f in files) == expected


def test_damaged_logs_are_listed_and_the_others_done(logs, model_file, tmp_path, capsys):
    group, short = logs / "log0.parquet", logs / "log2.parquet"
    data = bytearray(group.read_bytes())
    middle = pq.ParquetFile(group).metadata.row_group(3).column(1).data_page_offset
    data[middle : middle + 2000] = bytes(2000)
    group.write_bytes(data)
    short.write_bytes(short.read_bytes()[:-500])
    out = tmp_path / "out"
    assert main(command(logs, model_file, "-o", out)) == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"{FILES - 2} of {FILES} logs are corrected" in told
    assert "log0.parquet" in told
    assert "log2.parquet" in told
    assert "run the same command again" in told
    assert len(tree(out)) == FILES - 2


def test_a_failed_log_keeps_nothing_that_was_read_of_it(logs, model, tmp_path, monkeypatch):
    read = []

    def taken():
        values = np.zeros(7)
        read.append(weakref.ref(values))
        raise OSError("lost")

    def failing(*_):
        values = np.zeros(3)
        read.append(weakref.ref(values))
        try:
            taken()
        except OSError as cause:
            raise TrueAngleError("damaged") from cause

    monkeypatch.setattr(batch, "correct_log", failing)
    (log,) = ta.correct_logs(logs / "log0.parquet", model, tmp_path / "o.parquet").logs
    assert [values() for values in read] == [None, None]
    assert (str(log.error), str(log.error.__cause__)) == ("damaged", "lost")
    assert log.error.__traceback__ is not None  # which --debug shows


def test_a_full_disk_ends_the_run_and_it_resumes(logs, model_file, tmp_path, capsys):
    """On a small tmpfs; `test_a_file_size_limit...` needs no mount."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = shutil.which("mount") and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2600k", "tmpfs", str(disk)], capture_output=True
    )
    if not mounted or mounted.returncode:
        pytest.skip("mounting a tmpfs is not permitted here")
    try:
        assert main(command(logs, model_file, "-o", disk, "--json")) == 1
        captured = capsys.readouterr()
        statuses = [f["status"] for f in json.loads(captured.out)["files"]]
        assert statuses[0] == "done"
        assert statuses.count("failed") == 1
        assert statuses[-1] == "not started"
        assert "No space left" in captured.err
        assert "not started" in captured.err
        assert len(tree(disk)) == statuses.count("done")
        subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
        assert main(command(logs, model_file, "-o", disk)) == 0
        assert main(command(logs, model_file, "-o", tmp_path / "whole")) == 0
        assert tree(disk) == tree(tmp_path / "whole")
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_file_size_limit_leaves_nothing(logs, model_file, tmp_path):
    out = tmp_path / "out"

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))

    done = subprocess.run(
        [sys.executable, "-m", "trueangle", *command(logs, model_file, "-o", out)],
        capture_output=True,
        text=True,
        preexec_fn=limit,
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert "0 of 6" in done.stderr
    assert tree(out) == {}


def test_an_output_that_reads_back_differently_is_not_kept(logs, model, tmp_path, monkeypatch):
    from trueangle.formats import parquet as parquetlog

    real = parquetlog.contents

    def flipped(path, topic=None):
        table = pq.read_table(path)
        values = table["corrected_deg"].to_numpy().copy()
        values[1234] = np.nextafter(values[1234], 0)
        pq.write_table(table.set_column(2, table.schema.field(2), pa.array(values)), path)
        return real(path)

    monkeypatch.setattr(parquetlog, "contents", flipped)
    report = ta.correct_logs(logs / "log0.parquet", model, tmp_path / "b.parquet")
    assert "corrected_deg" in str(report.logs[0].error)
    assert "did not read back" in str(report.logs[0].error)
    assert not (tmp_path / "b.parquet").exists()


def test_two_runs_into_one_folder_do_not_mix(logs, model, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / MANIFEST).touch()
    with (
        workplace.lock_path(out / MANIFEST),
        pytest.raises(ta.errors.ArgumentError, match="another run"),
    ):
        ta.correct_logs(logs, model, out)


def test_leftovers_of_the_living_are_spared(tmp_path):
    target = tmp_path / "a.csv"
    with workplace.workplace(target) as aside:
        aside.write_text("x")
        workplace.remove_leftovers([target])
        assert aside.exists()
        dead = tmp_path / (aside.parent.name.replace(".a.csv.", ".a.csv.dead"))
        dead.mkdir()
        workplace.remove_leftovers([target])
        assert not dead.exists()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_replaced_whole_and_put_back_when_killed_between(tmp_path):
    target = tmp_path / "bag"
    target.mkdir()
    (target / "x").write_text("old")
    with workplace.workplace(target) as aside:
        aside.mkdir()
        (aside / "x").write_text("new")
        publish(aside, target)
    assert (target / "x").read_text() == "new"
    # Killed after the old folder was moved aside, before the new one had its name.
    dead = tmp_path / f".bag.dead{PARTIAL}"
    dead.mkdir()
    os.replace(target, dead / "bag.replaced")
    workplace.remove_leftovers([target])
    assert (target / "x").read_text() == "new"
    assert not dead.exists()


@pytest.mark.parametrize("ends", [KeyboardInterrupt, OSError])
def test_a_folder_goes_back_when_its_replacement_ends_between(ends, tmp_path, monkeypatch):
    """Ctrl-C or an error after the old folder was moved aside, before the new one has its name."""
    monkeypatch.setattr(workplace, "exchange_names", lambda first, second: False)
    target = tmp_path / "bag"
    target.mkdir()
    (target / "x").write_text("old")
    replace = os.replace

    def moved(old, new):
        if str(new).endswith(".replaced"):
            replace(old, new)
            raise ends
        replace(old, new)

    def corrected():
        with workplace.workplace(target) as aside:
            aside.mkdir()
            (aside / "x").write_text("new")
            monkeypatch.setattr(os, "replace", moved)
            publish(aside, target)

    with pytest.raises(ends):
        corrected()
    assert (target / "x").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]


def test_leftovers_of_many_outputs_are_found_in_one_listing(tmp_path, monkeypatch):
    """Names that begin alike share what is left of them; other outputs' is spared."""
    long = "x" * 60
    targets = [tmp_path / f"{long}{k}.csv" for k in range(3)] + [tmp_path / "[a].csv"]
    left = [
        tmp_path / f"{hidden_name(target)}.dead{k}{PARTIAL}" for k, target in enumerate(targets)
    ]
    spared = tmp_path / f".b.csv.dead{PARTIAL}"
    for folder in (*left, spared):
        folder.mkdir()
    (left[0] / f"{long}2.csv.replaced").mkdir()
    listed = []
    listdir = os.listdir
    monkeypatch.setattr(os, "listdir", lambda path: listed.append(path) or listdir(path))
    workplace.remove_leftovers(targets)
    assert listed.count(tmp_path) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([spared.name, f"{long}2.csv"])


def test_permissions_are_kept_in_place(logs, model):
    path = logs / "log0.parquet"
    path.chmod(0o640)
    assert ta.correct_logs(path, model, in_place=True).is_done
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["-o", "OUT", "--in-place"], "either --output or --in-place"),
        ([], "either --output or --in-place"),
        (["-o", "LOGS"], "overwrite"),
        (["-o", "OUT", "--column", "j1=x"], "j1"),
    ],
)
def test_impossible_requests_are_refused_before_anything_is_done(
    more, message, logs, model_file, tmp_path, capsys
):
    before = tree(tmp_path)
    named = {"OUT": tmp_path / "out", "LOGS": logs}
    assert main(command(logs, model_file, *(named.get(a, a) for a in more))) == 1
    assert message in capsys.readouterr().err
    assert tree(tmp_path) == before


def test_a_signal_without_a_column_is_a_usage_error(logs, model_file, tmp_path, capsys):
    before = tree(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(command(logs, model_file, "-o", tmp_path / "out", "--signal", "x"))
    assert left.value.code == 2
    assert "ROLE=NAME" in capsys.readouterr().err
    assert tree(tmp_path) == before


def test_a_log_that_grows_meanwhile_is_not_taken(logs, model, tmp_path, monkeypatch):
    from trueangle.formats import parquet as parquetlog

    real, path = parquetlog.contents, logs / "log0.parquet"

    def growing(aside, topic=None):
        with path.open("ab") as file:
            file.write(b"more")
        return real(aside, topic)

    monkeypatch.setattr(parquetlog, "contents", growing)
    report = ta.correct_logs(path, model, tmp_path / "b.parquet")
    assert "changed while it was read" in str(report.logs[0].error)
    assert not (tmp_path / "b.parquet").exists()
