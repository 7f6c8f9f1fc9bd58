"""`trueangle record`: every source, both angles, every way to end."""

import contextlib
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.recording.estimate import CELLS

from .wires import joint_lines

pty = pytest.importorskip("pty")
LINES = [f"{line}\n".encode() for line in joint_lines(6.0)]
#: As a device sends them that does not care who listens, and since when.
PAIRS = [b"reference_deg:%s indicated_deg:%s" % tuple(line.split(b",")) for line in LINES[1:]]


@pytest.fixture(autouse=True)
def _desk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@contextlib.contextmanager
def sending(send, lines=PAIRS, pause=0.0005):
    """A thread that sends lines until it is to end."""
    over = threading.Event()

    def work():
        for line in lines:
            if over.is_set():
                return
            with contextlib.suppress(OSError):
                send(line)
            time.sleep(pause)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.fixture
def port():
    """A pseudo-terminal: its name, and the handle of the device."""
    serial = pytest.importorskip("serial")
    assert serial
    import tty

    device, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(device, False)  # it does not care whether anyone reads
    yield os.ttyname(slave), device
    os.close(slave)
    with contextlib.suppress(OSError):
        os.close(device)


def recorded(path="runs.csv"):
    (run,) = ta.read_runs(path)
    return run


def check_joint(run):
    """At least one whole turn, and its orders."""
    assert np.unique(run.reference // (360.0 / CELLS) % CELLS).size == CELLS
    fit = ta.fit(run, orders=[1, 2])
    np.testing.assert_allclose(fit.model.amplitudes, [0.5, 0.2], atol=0.01)


def test_a_serial_port_until_the_orders_are_known(port, capsys):
    name, device = port
    with sending(lambda line: os.write(device, line)):
        status = main(["record", name, "-o", "runs.csv", "--until", "orders", "--progress", "json"])
    assert status == 0
    check_joint(recorded())
    states = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert states[-1]["ended"] == "asked"
    assert [row["order"] for row in states[-1]["orders"]] == [1, 2]
    keys = "seconds readings rejected rate_hz coverage_deg speeds_deg_s orders missing faults"
    assert set(keys.split()) <= set(states[0])
    assert states[-1]["coverage_deg"]["forwards"] == 360.0
    assert states[-1]["missing"] == "turn it backwards as well"


def test_nothing_is_sent_but_what_is_asked(port, capsys):
    name, device = port
    for sent in ([], ["--send", "start 10"]):
        with sending(lambda line: os.write(device, line)):
            assert main(["record", name, "-o", f"{len(sent)}.csv", "--for", "0.4", *sent]) == 0
        try:
            got = os.read(device, 100)
        except BlockingIOError:
            got = b""
        assert got == (b"start 10\n" if sent else b"")
    assert "times are those of arrival, jitter" in capsys.readouterr().out


def test_a_cable_that_is_pulled_leaves_a_whole_file(port, capsys):
    name, device = port

    def pulled():
        with sending(lambda line: os.write(device, line)):
            time.sleep(0.4)
        os.close(device)

    thread = threading.Thread(target=pulled)
    thread.start()
    assert main(["record", name, "-o", "runs.csv"]) == 3
    thread.join()
    out = capsys.readouterr().out
    assert "ended by a fault" in out
    assert f"runs.csv: {len(recorded())} readings in run 1, " in out


def test_tcp_and_udp(capsys):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"

        def serve():
            link, _ = server.accept()
            with link:
                for line in LINES:
                    link.sendall(line)

        thread = threading.Thread(target=serve)
        thread.start()
        assert main(["record", address, "-o", "tcp.csv"]) == 0
        thread.join()
    assert len(recorded("tcp.csv")) == len(LINES) - 1
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        place = free.getsockname()
    address = f"udp://127.0.0.1:{place[1]}"
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        sending(lambda line: sender.sendto(line.rstrip(), place)),
    ):
        assert main(["record", address, "-o", "udp.csv", "--until", "coverage"]) == 0
    check_joint(recorded("udp.csv"))
    for address in ("tcp://127.0.0.1", "udp://x:y"):
        assert main(["record", address, "-o", "a.csv"]) == 1
    assert main(["record", f"tcp://127.0.0.1:{place[1]}", "-o", "a.csv"]) == 1
    assert "Connection refused" in capsys.readouterr().err


def test_a_file_that_grows_and_standard_input(tmp_path, capsys):
    log = tmp_path / "log.txt"
    with open(log, "wb", buffering=0) as file, sending(file.write, LINES, 0.0002):
        assert main(["record", "log.txt", "-o", "runs.csv", "--until", "coverage"]) == 0
    check_joint(recorded())
    program = [sys.executable, "-m", "trueangle", "record", "-", "-o"]
    for name, more, status in (("a.csv", [], 0), ("b.csv", ["--for", "60s"], 3)):
        done = subprocess.run([*program, name, *more], input=b"".join(LINES), capture_output=True)
        assert done.returncode == status, done
        assert len(recorded(name)) == len(LINES) - 1
    assert main(["record", "nosuch", "-o", "c.csv"]) == 1
    assert "no such source; it is a serial port" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_a_whole_file(number):
    program = [sys.executable, "-m", "trueangle", "record", "-", "-o", "runs.csv"]
    process = subprocess.Popen(
        [*program, "--progress", "json"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    process.stdin.write(b"".join(LINES[:1500]))
    process.stdin.flush()
    while not json.loads(process.stderr.readline())["readings"]:
        pass
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert len(recorded()) == 1499
    assert b"1499 readings in run 1, 0 lines rejected" in out
    assert b"interrupted" in err


#: Kills at random moments.
KILLS = int(os.environ.get("TRUEANGLE_KILLS", "6"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whenever_it_is_ended_the_file_holds_whole_rows_from_the_first_on(number):
    rng = np.random.default_rng([52_005, number])
    program = [sys.executable, "-m", "trueangle", "record", "-", "-o"]
    sizes = []
    for i in range(-(-KILLS // 3)):
        with subprocess.Popen(
            [*program, f"{i}.csv"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:  # fmt: skip
            path = Path(f"{i}.csv")
            out = told(process, number, path if i % 4 else Path(), rng.uniform(0.0, 2.5))
        assert abs(process.returncode) in (number, 128 + number)
        data = path.read_bytes() if path.exists() else b""
        header, *rows, last = (data or b"\n").split(b"\n")
        assert last == b""
        values = [[float(cell) for cell in row.split(b",")] for row in rows]
        assert [row[2:] for row in values] == [[k, 2 * k] for k in range(len(rows))]
        assert header in (b"run,time_s,n,m", b"")
        if number != signal.SIGKILL and out:
            assert f"{i}.csv: {len(rows)} reading" in out
        sizes.append(len(rows))
    print(sizes)


def told(process, number, path, seconds):
    """What it printed, fed with lines and ended so long after a file was there."""
    feed, sent, end = process.stdin.fileno(), 0, math.inf
    os.set_blocking(feed, False)
    while time.monotonic() < end:
        if end == math.inf and path.exists():
            end = time.monotonic() + seconds
        lines = b"".join(b"n:%d m:%d\n" % (k, 2 * k) for k in range(sent, sent + 100))
        with contextlib.suppress(BlockingIOError):
            if os.write(feed, lines) < len(lines):
                break  # within a line: nobody reads any more
            sent += 100
        time.sleep(0.005)
    process.send_signal(number)
    return process.communicate()[0].decode()


def test_ten_thousand_lines_a_second_are_all_there(port):
    name, device = port
    program = [sys.executable, "-m", "trueangle", "record", name, "-o", "runs.csv"]
    os.set_blocking(device, True)
    with subprocess.Popen([*program, "--progress", "json"], stderr=subprocess.PIPE) as process:
        process.stderr.readline()  # the port is open
        start, sent = time.monotonic(), 0
        while sent < 30_000:
            due = min(int(1e4 * (time.monotonic() - start)), 30_000)
            os.write(device, b"".join(b"%d %d\n" % (i, 7 * i) for i in range(sent, due)))
            sent = due
            time.sleep(0.002)
        time.sleep(0.5)
        process.terminate()
        process.communicate()
    assert process.returncode == 128 + signal.SIGTERM
    rejected = Path("runs.csv.rejected")
    cut = rejected.read_bytes().count(b"\n") if rejected.exists() else 0
    assert cut <= 1  # the first may have begun before
    values = np.loadtxt("runs.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(values[:, 2], np.arange(cut, 30_000))
    np.testing.assert_array_equal(values[:, 3], 7 * np.arange(cut, 30_000))
    assert (np.diff(values[:, 1]) > 0.0).all()


COUNTS = ["--signal", "reference=step:count", "--counts-per-turn-reference", "3200"]
COUNTS += ["--signal", "indicated=-raw:count", "--counts-per-turn", "4096"]


def test_counts_become_angles_that_every_command_finds(tmp_path, capsys):
    angle = np.arange(0.0, 1080.0, 0.45)
    error = 0.5 * np.sin(np.radians(angle))
    steps, raw = np.rint(angle / 360.0 * 3200), np.rint(-(angle + error) / 360.0 * 4096)
    text = "".join(
        f"t_ms:{i} step:{int(s)} raw:{int(r) % 4096}\n"
        for i, (s, r) in enumerate(zip(steps, raw, strict=True))
    )
    (tmp_path / "log.txt").write_text(f"AS5600 found\n{text}")
    time_signal = ["--signal", "time=t_ms:ms"]
    options = [*COUNTS, *time_signal, "--until", "coverage", "--errors-in", "deg"]
    assert main(["record", "log.txt", "-o", "runs.csv", *options]) == 0
    assert "order   1  0.49" in capsys.readouterr().out
    header = (tmp_path / "runs.csv").read_text().splitlines()[0]
    assert header == "run,time_s,reference_deg,-indicated_deg"
    assert (tmp_path / "runs.csv.rejected").read_bytes() == b"AS5600 found\n"
    fit = ["fit", "runs.csv", "-o", "m.json", "--orders", "1-4"]
    for command in (fit, ["export", "m.json", "--to", "simplefoc"]):
        assert main([*command, *(["-o", "t.h"] if command[0] == "export" else [])]) == 0
    model = ta.load_model("m.json")
    assert model.indicated_sign == -1
    assert model.amplitudes[0] == pytest.approx(0.5, abs=0.01)
    assert recorded().time[1] == pytest.approx(1e-3)


def test_rates_labels_and_what_stands_in_the_way(tmp_path, capsys):
    (tmp_path / "log.txt").write_bytes(b"".join(LINES))
    short = ["--for", "0.1"]
    assert main(["record", "log.txt", "-o", "runs.csv", *short, "--label", "cold"]) == 0
    assert main(["record", "log.txt", "-o", "runs.csv", *short]) == 1
    assert main(["record", "log.txt", "-o", "runs.csv", *short, "--append"]) == 0
    assert [run.label for run in ta.read_runs("runs.csv")] == ["cold", "2"]
    assert main(["record", "log.txt", "-o", "log.txt", *short]) == 1
    assert main(["record", "log.txt", "-o", "a.csv", "--signal", "torque=tau"]) == 1
    assert main(["record", "log.txt", "-o", "b.csv", *short, "--pattern", r"(?P<a>\d)x"]) == 1
    assert main(["record", "log.txt", "-o", "c.csv", "--rate", "0"]) == 1
    plain = ["--pattern", r"(?P<a>\d+)\.\d*,(?P<b>\d+)"]
    assert main(["record", "log.txt", "-o", "d.csv", *plain, "--until", "orders"]) == 1
    told = capsys.readouterr().err
    assert not (tmp_path / "b.csv").exists()
    for part in (
        "--append",
        "is also read",
        "no such column",
        "--rate must be positive, got",
        "reference_deg",
        "no line that is a row has come, 3001 lines rejected (b.csv.rejected)",
    ):
        assert part in told
    assert not (tmp_path / "a.csv").exists()


def test_lines_at_a_rate_are_thinned(tmp_path):
    read, write = os.pipe()
    with os.fdopen(read) as stream, sending(lambda line: os.write(write, line), pause=0.001):
        before, sys.stdin = sys.stdin, stream
        try:
            assert main(["record", "-", "-o", "r.csv", "--rate", "50", "--for", "1s"]) == 0
        finally:
            sys.stdin = before
    os.close(write)
    run = recorded("r.csv")
    assert 25 <= len(run) <= 50.0 * np.ptp(run.time) + 2.0
    assert np.unique(np.floor(run.time * 50.0)).size == len(run)


def test_two_sources_are_joined(port, capsys):
    name, device = port
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        place = free.getsockname()
    start = time.monotonic()

    def angle():
        return 120.0 * (time.monotonic() - start)

    def sensor(_):
        x = angle()
        os.write(device, f"raw:{(x + 0.5 * np.cos(np.radians(x))) % 360.0:.4f}\n".encode())

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:

        def reference(_):
            sender.sendto(f"{angle() % 360.0:.5f}".encode(), place)

        many = range(10_000)
        with sending(sensor, many, 0.002), sending(reference, many, 0.005):
            signals = ["--signal", "a.indicated=raw:deg", "--signal", "b.reference=column1:deg"]
            sources = [name, f"udp://127.0.0.1:{place[1]}"]
            ends = ["--for", "7s", "--errors-in", "deg"]
            assert main(["record", *sources, "-o", "runs.csv", *signals, *ends]) == 0
    run = recorded()
    assert len(run) > 1000
    fit = ta.fit(run, orders=[1])
    # What the program waits between two lines is seen at 120 deg/s.
    assert fit.model.amplitudes[0] == pytest.approx(0.5, abs=0.05)
    assert main(["record", *sources, sources[0], "-o", "x.csv"]) == 1
    assert "one source is recorded, or two are joined" in capsys.readouterr().err


ALONE = ["--signal", "indicated=enc:count"]
DBC = 'VERSION ""\nBU_: a\nBO_ 257 Output: 2 a\n SG_ angle : 0|16@1+ (0.005,0) [0|0] "" a\n'
#: What a new user types, and the one line that names what helps.
WRONG = {
    "/dev/ttyNONE": "no such source; it is a serial port (/dev/ttyUSB0, COM3), ",
    "COM99": "cannot be opened: ",
    "nosuch://port": "protocol 'nosuch' not known; is it plugged in and free of other programs?",
    "PORT --baud fast": "--baud: invalid int value: 'fast'",
    "PORT --baud 0": "--baud must be positive, got 0",
    "PORT --pattern (\\d+)": "names no group; name columns as in ",
    "PORT --signal indicated=roh:count": "column 'roh': no such column; its columns are ref, enc",
    "PORT --signal indicated=enc": "its unit is not known; give it: --signal indicated=enc:count",
    "PORT --signal indicated=enc:count --until coverage": "give --counts-per-turn",
    "PORT --until order": "did you mean orders?",
    "PORT -o there.csv": "there.csv: is there already: name another file, or add a run to it (--",
    "PORT -o there.csv --append": "there.csv, line 1: has the columns run, time_s, a, and run, ",
    "PORT PORT": "one source is recorded, or two are joined; got 2",
    "can:virtual:w --dbc a.dbc --signal indicated=angel:deg": "did you mean 'angle'?",
    "can:virtual:w --dbc a.dbc --signal indicated=angle:deg": "nothing has come; does it send? ",
    "can:virtual:w": "a CAN bus needs its signals: their description (--dbc), or ID:byte:length:",
    "can:virtual:w --signal indicated=1:0:2:1:deg --send go": "a frame as 123#0102FF is needed, ",
    "silent.fifo": "silent.fifo: nothing has come; does it send? --send",
    "tcp://127.0.0.1": "tcp://HOST:PORT or udp://:PORT is needed",
    "words.txt": "words.txt: no line that is a row has come, 5 lines rejected (o.csv.rejected); is",
    "words.txt --baud 9600": "--baud is for a serial port; SOURCE is words.txt",
    "PORT --dbc a.dbc": "--dbc is for a CAN bus; SOURCE is /dev/",
    "words.txt --send go": "send: nothing can be sent to words.txt",
    "PORT words.txt --signal a.indicated=enc:deg": "words.txt: no line that is a row has come",
}


@pytest.mark.parametrize("typed", WRONG)
def test_what_is_wrong_is_named_in_one_line_with_what_helps(typed, port, capsys):
    if typed.startswith("can:"):
        pytest.importorskip("cantools")
    name, device = port
    Path("there.csv").write_text("run,time_s,a\n1,0,1\n")
    Path("words.txt").write_text("Ready.\n" * 5)
    Path("a.dbc").write_text(DBC)
    os.mkfifo("silent.fifo")
    words = typed.replace("PORT", name).split()
    command = ["record", *words, *(() if "-o" in words else ("-o", "o.csv")), "--for", "0.4s"]
    handle = os.open("silent.fifo", os.O_RDWR)  # who may write, and does not

    def send(line):
        os.write(device, line.replace(b"reference_deg", b"ref").replace(b"indicated_deg", b"enc"))

    with sending(send), contextlib.suppress(SystemExit):
        assert main(command) == 1
    os.close(handle)
    *before, last = capsys.readouterr().err.splitlines()
    assert WRONG[typed] in last, last
    assert all(line.startswith(("usage: ", "trueangle: warning: ")) for line in before)
    assert not Path("o.csv").exists()


def test_sources_without_a_common_time_are_named(port, capsys):
    name, device = port
    Path("ref.txt").write_text("".join(f"{x / 100:.2f}\n" for x in range(500)))
    options = ["--signal", "a.indicated=indicated_deg:deg", "--signal", "b.reference=column1:deg"]
    pairs = (line.partition(b" ")[2] for line in PAIRS)

    def late(line):
        time.sleep(0.2)
        os.write(device, line)

    with sending(late, pairs):
        assert main(["record", name, "ref.txt", "-o", "o.csv", *options, "--for", "1s"]) == 1
    told = capsys.readouterr().err
    assert "readings without a reference at their time; do both send at the same time?" in told
