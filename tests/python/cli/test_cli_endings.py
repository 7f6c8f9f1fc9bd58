"""How commands end: statuses, one line, Ctrl-C, a closed pipe, a full disk, hostile text."""

import io
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from trueangle.cli import COMMANDS, build_parser, main, terminal
from trueangle.cli.terminal import printable_text

#: It knows the line of the readings: with nothing to name no further runs are planned, which
#: takes twenty times as long as the rest.
SIMULATION = """\
[joint]
gear_ratio = 50.0
[[harmonic]]
shaft = "output"
order = 1
amplitude_arcsec = 360.0
phase_deg = 0.0
[noise]
sigma_arcsec = 2.0
[[run]]
samples = 120
"""


def runs_text(label="a", seed=1):
    rng = np.random.default_rng(seed)
    theta = np.arange(0.0, 360.0, 3.0)
    error = 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 5e-4, theta.size)
    rows = [
        f'"{label}",{t!r},{t + e!r}' for t, e in zip(theta.tolist(), error.tolist(), strict=True)
    ]
    return "\n".join(["run,reference_deg,indicated_deg", *rows]) + "\n"


@pytest.fixture
def desk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text(runs_text())
    (tmp_path / "b.toml").write_text(SIMULATION)
    assert main(["fit", "r.csv", "-o", "m.json", "--orders", "1"]) == 0
    return tmp_path


def run(arguments, **more):
    more.setdefault("capture_output", True)
    return subprocess.run(
        [sys.executable, "-m", "trueangle", *arguments], text=True, errors="replace", **more
    )


# -- anything unexpected


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (KeyError("orders"), "unexpected KeyError: 'orders'; this is a defect of trueangle"),
        (OSError(5, "Input/output error", "a.csv"), "a.csv: Input/output error"),
    ],
)
def test_whatever_goes_wrong_is_one_line(error, said, desk, capsys, monkeypatch):
    from trueangle.cli import run_lists
    from trueangle.runs import files as runfiles

    def broken(*_args, **_more):
        raise error

    monkeypatch.setattr(run_lists, "read_runs", broken)
    monkeypatch.setattr(runfiles, "read_runs", broken)
    for arguments in (["fit", "r.csv", "-o", "x.json"], ["orders", "r.csv"]):
        capsys.readouterr()
        assert main(arguments) == 1
        told = capsys.readouterr().err
        assert told.startswith(f"trueangle: error: {said}")
        assert told.count("\n") == 1
        assert main([*arguments, "--debug"]) == 1
        told = capsys.readouterr().err
        assert "Traceback" in told
        assert "in broken" in told
        assert f"\ntrueangle: error: {said}" in told


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_debug(command):
    assert "--debug" in build_parser().commands[command]._option_string_actions


def test_debug_shows_where_bad_input_was_found(desk, capsys):
    assert main(["orders", "missing.csv", "--debug"]) == 1
    told = capsys.readouterr().err
    assert told.startswith("Traceback")
    assert told.endswith("trueangle: error: missing.csv: No such file or directory\n")


def test_warnings_are_shown_as_before_after_a_command(desk, monkeypatch):
    import warnings

    def mine(*_args, **_more):
        pass

    monkeypatch.setattr(warnings, "showwarning", mine)
    main(["orders", "missing.csv"])
    assert warnings.showwarning is mine


# -- Ctrl-C


def interrupted(arguments, ready, **more):
    """Status and words of a command that gets a real SIGINT once ``ready`` says so."""
    process = subprocess.Popen(
        [sys.executable, "-m", "trueangle", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **more,
    )
    ready(process)
    process.send_signal(signal.SIGINT)
    _out, told = process.communicate(timeout=60)
    return process.returncode, told


WAITING = {
    "fit": ["fit", "pipe", "--orders", "1", "-o", "x.json"],
    "orders": ["orders", "pipe"],
    "diagnose": ["diagnose", "pipe", "--simulation", "b.toml"],
    "diagnose --simulation": ["diagnose", "r.csv", "--simulation", "pipe"],
    "report": ["report", "pipe", "-o", "x.html"],
    "simulate": ["simulate", "pipe", "-o", "x.csv"],
    "correct": ["correct", "r.csv", "-m", "pipe", "-o", "x.csv"],
}


def begun_reading(pipe):
    """Wait until a process has opened the pipe, and keep it waiting for bytes."""

    def ready(process):
        end = time.monotonic() + 60
        while time.monotonic() < end and process.poll() is None:
            try:
                ready.handle = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
            except OSError:
                time.sleep(0.02)
                continue
            return
        raise AssertionError("never opened")

    return ready


@pytest.mark.parametrize("command", WAITING)
def test_waiting_for_a_pipe_ends_with_ctrl_c(command, desk):
    os.mkfifo("pipe")
    ready = begun_reading("pipe")
    status, told = interrupted(WAITING[command], ready)
    os.close(ready.handle)
    assert (status, told) == (130, "trueangle: interrupted\n")
    assert not [p for p in desk.iterdir() if p.name.startswith("x.")]


def test_ctrl_c_in_correct_says_what_is_done(desk):
    """Status 130, whole outputs, and no leftovers."""
    os.mkdir("logs")
    rng = np.random.default_rng(3)
    angles = "\n".join(f"{x:.6f}" for x in rng.uniform(0.0, 360.0, 200_000))
    for k in range(40):
        with open(f"logs/log{k}.csv", "w") as file:
            file.write(f"indicated_deg\n{angles}\n")

    def first_is_done(process):
        process.stdout.readline()

    arguments = ["correct", "logs", "-m", "m.json", "-o", "out"]
    status, told = interrupted(arguments, first_is_done)
    assert status == 130
    assert told.startswith("trueangle: interrupted: ")
    assert "of 40 logs are corrected" in told
    assert told.count("\n") == 1
    left = sorted(p.name for p in (desk / "out").iterdir())
    assert 1 <= len(left) - 1 < 40
    assert not [name for name in left if name.startswith(".")]


# -- a closed pipe


@pytest.mark.parametrize(
    "arguments",
    [
        ["orders", "r.csv", "--json"],
        ["fit", "r.csv", "--orders", "1", "-o", "x.json"],
        ["correct", "r.csv", "-m", "m.json", "-o", "x.csv"],
        ["plan", "--gear-ratio", "100"],
        ["simulate", "b.toml", "-o", "x.csv"],
    ],
    ids=lambda arguments: arguments[0],
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_gone_is_no_error(arguments, unbuffered, desk):
    reading, writing = os.pipe()
    os.close(reading)
    done = run(
        arguments,
        capture_output=False,
        stdout=writing,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )
    os.close(writing)
    assert done.returncode in (0, 141)
    assert done.stderr == ""


def test_head_stops_a_long_list_in_silence(desk):
    script = '"$0" -m trueangle orders r.csv --json | head -n 1; echo ${PIPESTATUS[0]}'
    done = subprocess.run(
        ["bash", "-c", script, sys.executable],
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    assert done.stdout.split()[-1] in ("0", "141")


def test_another_broken_pipe_is_told(desk, capsys, monkeypatch):
    """That of a lost cluster, say, while standard output is read on."""
    from trueangle.cli import run_lists

    def broken(*_args, **_more):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(run_lists, "read_runs", broken)
    assert main(["orders", "r.csv"]) == 1
    assert "Broken pipe" in capsys.readouterr().err


# -- no room, no permission

#: Commands that need a library to draw.
DRAWN = {"report": "jinja2", "plot": "matplotlib"}

#: Commands and the files they write. The limit on the size of files is below each.
WRITES = {
    "fit": (["fit", "r.csv", "--orders", "1", "-o", "x.json"], "x.json"),
    "correct": (["correct", "r.csv", "-m", "m.json", "-o", "x.csv"], "x.csv"),
    "simulate": (["simulate", "b.toml", "-o", "x.csv"], "x.csv"),
    "diagnose": (["diagnose", "r.csv", "--simulation", "b.toml", "--extend", "x.toml"], "x.toml"),
    "report": (["report", "r.csv", "--orders", "1", "-o", "x.html"], "x.html"),
    "plot": (["plot", "r.csv", "--orders", "1", "-o", "x.png"], "x.png"),
    "unit": (["export", "m.json", "--to", "fmu", "-o", "x.fmu"], "x.fmu"),
}


@pytest.mark.parametrize("room", [0, 50])
@pytest.mark.parametrize("there", [False, True], ids=["new", "there before"])
@pytest.mark.parametrize("command", WRITES)
def test_a_full_disk_leaves_what_was_there(command, there, room, desk):
    """Without any room no folder for temporary files is found either."""
    if command in DRAWN:
        pytest.importorskip(DRAWN[command])
    arguments, output = WRITES[command]
    if there:
        (desk / output).write_text("old")
    names = sorted(p.name for p in desk.iterdir())

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    done = run(arguments, preexec_fn=limit)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert f"{output}: File too large" in done.stderr
    assert sorted(p.name for p in desk.iterdir()) == names
    if there:
        assert (desk / output).read_text() == "old"


def without_override():
    """Rights as files state them, for root too: take its power to pass them over."""
    import ctypes

    libc = ctypes.CDLL(None)
    for capability in (1, 2):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
        libc.prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="capabilities of Linux")
@pytest.mark.parametrize("command", WRITES)
def test_a_folder_that_must_not_be_written_is_told(command, desk):
    arguments, output = WRITES[command]
    os.mkdir("closed")
    os.chmod("closed", 0o555)
    done = run([*arguments[:-1], f"closed/{output}"], preexec_fn=without_override)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "closed" in done.stderr
    assert "Permission denied" in done.stderr
    assert ".trueangle-partial" not in done.stderr
    assert os.listdir("closed") == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="capabilities of Linux")
@pytest.mark.parametrize("command", WRITES)
def test_a_file_that_must_not_be_written_stays(command, desk):
    """Renaming over it would be allowed."""
    arguments, output = WRITES[command]
    (desk / output).write_text("old")
    os.chmod(output, 0o444)
    done = run(arguments, preexec_fn=without_override)
    assert done.returncode == 1
    assert "is write-protected" in done.stderr
    assert (desk / output).read_text() == "old"


def test_a_missing_folder_is_told_before_the_work(desk, capsys, monkeypatch):
    from trueangle.cli import run_lists

    monkeypatch.setattr(run_lists, "read_runs", None)
    assert main(["fit", "r.csv", "-o", "nowhere/x.json"]) == 1
    assert capsys.readouterr().err == "trueangle: error: nowhere: No such folder\n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_standard_output_that_is_full_is_told(unbuffered, desk):
    if not os.path.exists("/dev/full"):
        pytest.skip("no /dev/full here")
    with open("/dev/full", "w") as full:
        done = run(
            ["simulate", "b.toml", "-o", "x.csv"],
            capture_output=False,
            stdout=full,
            stderr=subprocess.PIPE,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )
    assert done.returncode == 1
    assert done.stderr == "trueangle: error: standard output: No space left on device\n"


# -- hostile text

#: Colours, a title, a clearing of the screen, a C1 control, text turned round, a return.
HOSTILE = "\x1b[31mred\x1b]0;title\x07\x1b[2J\x9b1m\u202eback\u2066x\rover\x08\x7f"


@pytest.mark.parametrize("character", [c for c in HOSTILE if not c.isprintable()])
def test_control_characters_become_escapes(character):
    shown = printable_text(f"a{character}b")
    assert shown.isprintable()
    assert shown.startswith("a\\")


def test_other_text_stays_as_it_is():
    text = "Gelenk ä, 関節, é, ± 3″\n\tnext"
    assert printable_text(text) == text


def test_names_and_labels_never_steer_the_terminal(desk):
    name = "r" + HOSTILE.replace("/", "") + ".csv"
    with open(name, "w", encoding="utf-8") as file:
        file.write(runs_text(HOSTILE.replace("\r", "")))
    with open("head.csv", "w", encoding="utf-8") as file:
        file.write(f"reference_deg,{HOSTILE}\n1,2\n")
    missing = f"missing{HOSTILE}.csv"
    for arguments in (
        ["fit", name, "--orders", "1", "-o", "x.json"],
        ["fit", missing, "-o", "x.json"],
        ["fit", "r.csv", "-o", f"nowhere{HOSTILE}/x.json"],
        ["fit", "r.csv", "-o", "x.json", "--run", HOSTILE],
        ["fit", "r.csv", "-o", "x.json", "--orders", HOSTILE],
        ["fit", "r.csv", "-o", "x.json", f"--{HOSTILE}"],
        [HOSTILE],
        ["fit", "head.csv", "-o", "x.json"],
        ["orders", name],
        ["orders", name, "--json"],
        ["diagnose", name, "--simulation", "b.toml"],
        ["diagnose", missing, "--simulation", "b.toml", "--debug"],
        ["correct", name, "-m", "m.json", "-o", f"x{HOSTILE}.csv"],
    ):
        done = subprocess.run([sys.executable, "-m", "trueangle", *arguments], capture_output=True)
        told = (done.stdout + done.stderr).decode("utf-8")
        assert told
        for line in told.split("\n"):
            assert line.replace("\t", "").isprintable(), (arguments, line)


def test_a_name_that_is_no_utf8_is_told(desk):
    done = subprocess.run(
        [sys.executable, "-m", "trueangle", "orders", b"caf\xe9.csv"], capture_output=True
    )
    assert done.returncode == 1
    assert done.stderr == rb"trueangle: error: caf\xe9.csv: No such file or directory" + b"\n"


def test_a_terminal_without_the_signs_gets_escapes(desk):
    done = run(["orders", "relé.csv"], env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 1
    assert r"rel\xe9.csv" in done.stderr


def test_progress_may_rewrite_its_own_line():
    from trueangle.logs.report import Progress

    stream = io.StringIO()
    times = iter(range(100))
    shown = Progress(1, 100, "text", terminal.PlainStream(stream), lambda: next(times))
    shown.start_file(100)
    shown.advance(10, 0.1)
    assert stream.getvalue().startswith("\r0/1 files")


def test_a_report_shows_labels_as_text(desk):
    pytest.importorskip("matplotlib")
    label = "<script>alert(1)</script>"
    (desk / "evil.csv").write_text(runs_text(label))
    assert main(["report", "evil.csv", "--orders", "1", "-o", "x.html", "--title", label]) == 0
    page = (desk / "x.html").read_text("utf-8")
    assert label not in page
    assert "alert(1)" in page
