"""No command writes over what it reads, or onto what is no file, however it is named."""

import argparse
import os
import shutil
import socket
import stat
import subprocess
import sys

import numpy as np
import pytest

from trueangle.cli import COMMANDS, build_parser, main
from trueangle.cli.parser import Input, Output, check_paths
from trueangle.errors import FileError
from trueangle.support.files import FileKind

SIMULATION = """\
# belief
[joint]
gear_ratio = 50.0
[[harmonic]]
shaft = "output"
order = 1
amplitude_arcsec = 300.0
phase_deg = 20.0
[noise]
sigma_arcsec = 2.0
[[run]]
label = "a"
samples = 120
[[run]]
label = "b"
direction = -1
samples = 120
"""


@pytest.fixture(scope="module")
def furnished(tmp_path_factory):
    """A folder with a file of each kind, made once."""
    folder = tmp_path_factory.mktemp("furnished")
    (folder / "b.toml").write_text(SIMULATION)
    (folder / "p.cfg").write_text("[angle a]\n")
    (folder / "l.toml").write_text("[limits]\nruns = 3\n")
    (folder / "i.toml").write_text("[item]\n")
    theta, noise = np.arange(0.0, 360.0, 3.0), np.random.default_rng(7)
    for name, zero in (("r.csv", 0.2), ("t.csv", 0.1)):
        error = 0.1 * np.sin(np.radians(theta)) + zero + noise.normal(0.0, 5e-4, theta.size)
        rows = [f"{t!r},{t + e!r}" for t, e in zip(theta.tolist(), error.tolist(), strict=True)]
        (folder / name).write_text("\n".join(["reference_deg,indicated_deg", *rows]) + "\n")
    model = str(folder / "m.json")
    assert main(["fit", str(folder / "r.csv"), "-o", model, "--orders", "1"]) == 0
    assert main(["export", model, "--to", "csv", "-o", str(folder / "e.csv")]) == 0
    (folder / "u.urdf").write_text(
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/></joint></robot>\n'
    )
    return folder


@pytest.fixture
def desk(furnished, tmp_path, monkeypatch):
    """Its copy, which is the working folder."""
    folder = tmp_path / "desk"
    shutil.copytree(furnished, folder)
    monkeypatch.chdir(folder)
    return folder


#: Commands that write, an argument that names an output being OUT, and what they read.
WRITING = {
    "fit": (["fit", "r.csv", "t.csv", "--orders", "1", "-o", "OUT"], ["r.csv", "t.csv"]),
    "fit --one-pass": (["fit", "r.csv", "--orders", "1", "--one-pass", "-o", "OUT"], ["r.csv"]),
    "correct": (["correct", "r.csv", "-m", "m.json", "-o", "OUT"], ["r.csv", "m.json"]),
    "correct, joints": (
        ["correct", "r.csv", "-m", "j=m.json", "--column", "j=indicated_deg", "-o", "OUT"],
        ["r.csv", "m.json"],
    ),
    "plot": (["plot", "r.csv", "--orders", "1", "-o", "OUT"], ["r.csv"]),
    "plot, model": (["plot", "m.json", "-o", "OUT"], ["m.json"]),
    "simulate": (["simulate", "b.toml", "-o", "OUT"], ["b.toml"]),
    "diagnose": (
        ["diagnose", "r.csv", "--simulation", "b.toml", "--extend", "OUT"],
        ["r.csv", "b.toml"],
    ),
    "plan --after": (
        [
            *("plan", "--after", "r.csv", "--simulation", "b.toml", "--limits", "l.toml"),
            *("--between", "backlash", "--seeds", "0", "-o", "OUT"),
        ],
        ["r.csv", "b.toml", "l.toml"],
    ),
    "diagnose --corrected-model": (
        [
            *("diagnose", "r.csv", "--simulation", "b.toml"),
            *("--model", "m.json", "--corrected-model", "OUT"),
        ],
        ["r.csv", "b.toml", "m.json"],
    ),
    "rehearse --plot": (
        [
            *("rehearse", "b.toml", "--causes", "backlash", "--seeds"),
            *("1", "--workers", "1", "--plot", "OUT"),
        ],
        ["b.toml"],
    ),
    "report": (["report", "r.csv", "--simulation", "b.toml", "-o", "OUT"], ["r.csv", "b.toml"]),
    "record": (["record", "r.csv", "--for", "0.1", "-o", "OUT"], ["r.csv"]),
    "join": (["join", "r.csv", "t.csv", "-o", "OUT"], ["r.csv", "t.csv"]),
    "selfcal": (["selfcal", "r.csv", "-o", "OUT"], ["r.csv"]),
    "export": (["export", "m.json", "--to", "csv", "-o", "OUT"], ["m.json"]),
    "fleet": (["fleet", "r.csv", "t.csv", "--orders", "1", "-o", "OUT"], ["r.csv", "t.csv"]),
    "watch --plot": (["watch", "r.csv", "-m", "m.json", "--plot", "OUT"], ["r.csv", "m.json"]),
    "robot": (["robot", "--from-urdf", "u.urdf", "-o", "OUT"], ["u.urdf"]),
    "export --existing": (
        ["export", "m.json", "--to", "klipper", "--existing", "p.cfg", "-o", "OUT"],
        ["m.json", "p.cfg"],
    ),
    "import": (["import", "e.csv", "--from", "csv", "-o", "OUT"], ["e.csv"]),
    "report --certificate": (
        ["report", "r.csv", "--certificate", "i.toml", "-o", "OUT"],
        ["r.csv", "i.toml"],
    ),
    "report --pdf": (["report", "r.csv", "-o", "p.html", "--pdf", "OUT"], ["r.csv"]),
}

#: Ways to name a file again without the ending that would give it away.
ALIASES = {
    "as it is": lambda path: path.name,
    "other spelling": lambda path: f"../{path.parent.name}/./{path.name}",
    "absolute": lambda path: str(path),
    "symbolic link": lambda path: linked(path, os.symlink),
    "link to a link": lambda path: linked(linked(path, os.symlink), os.symlink),
    "folder link": lambda path: f"{linked(path.parent, os.symlink)}/{path.name}",
    "hard link": lambda path: linked(path, os.link),
}


def linked(path, make):
    name = f"link{len(os.listdir())}"
    make(path, name)
    return name


def named(arguments, output):
    return [output if a == "OUT" else a for a in arguments]


def contents(folder):
    return {
        path.relative_to(folder): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    }


def one_line(capsys):
    told = capsys.readouterr().err
    assert told.count("\n") == 1, told
    assert told.startswith("trueangle: error: ")
    assert "Traceback" not in told
    return told


@pytest.mark.parametrize("way", ALIASES)
@pytest.mark.parametrize("command", WRITING)
def test_an_output_is_never_an_input(command, way, desk, capsys):
    arguments, inputs = WRITING[command]
    for entry in inputs:
        output = ALIASES[way](desk / entry)
        before = contents(desk)
        capsys.readouterr()
        assert main(named(arguments, output)) == 1
        told = one_line(capsys)
        assert "overwrit" in told or "ending" in told, told
        assert contents(desk) == before


@pytest.mark.parametrize("command", WRITING)
def test_an_input_named_by_a_link_is_not_overwritten_by_its_own_name(command, desk, capsys):
    """The input is the alias this time; without an ending, so that only the file tells."""
    arguments, inputs = WRITING[command]
    for entry in inputs:
        if command.startswith("correct") and entry.endswith("csv"):
            continue  # a log's format goes by its ending
        os.link(entry, f"plain-{entry[0]}")
        alias = f"alias-{entry[0]}"
        os.symlink(entry, alias)
        before = contents(desk)
        read = [a.replace(entry, alias) for a in arguments]
        capsys.readouterr()
        assert main(named(read, f"plain-{entry[0]}")) == 1
        assert "overwritten" in one_line(capsys)
        assert contents(desk) == before


def test_every_command_that_writes_is_tried():
    """Also by those that are added: `demo --report` alone reads nothing."""
    writing = {
        command
        for command in COMMANDS
        for action in build_parser().commands[command]._actions
        if action.type is not None
        and callable(action.type)
        and getattr(action.type, "__qualname__", "").startswith("Output")
    }
    tried = {name.split()[0].rstrip(",") for name in WRITING} | {"demo"}
    assert writing <= tried


def test_two_outputs_are_not_one_file(desk, capsys):
    os.symlink("x.pdf", "y.pdf")
    assert main(["report", "r.csv", "-o", "x.pdf", "--pdf", "y.pdf"]) == 1
    assert "two outputs" in one_line(capsys)


def test_a_log_in_a_folder_that_is_read_is_not_written_over(desk, capsys):
    (desk / "logs").mkdir()
    os.rename("t.csv", "logs/t.csv")
    os.link("logs/t.csv", "same")
    before = contents(desk)
    assert main(["fit", "logs", "--orders", "1", "-o", "same"]) == 1
    assert "overwritten" in one_line(capsys)
    assert main(["correct", "logs", "-m", "m.json", "-o", "logs"]) == 1
    assert "overwrite" in one_line(capsys)
    assert contents(desk) == before


@pytest.fixture
def node(request, desk):
    kind = request.param
    if kind == "pipe":
        os.mkfifo("node")
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind("node")
    elif kind == "folder":
        os.mkdir("node")
    else:
        number = {"endless": (1, 5), "full": (1, 7)}[kind]
        try:
            os.mknod("node", stat.S_IFCHR | 0o666, os.makedev(*number))
        except PermissionError:
            pytest.skip("devices cannot be made here")
    return os.stat("node")


@pytest.mark.parametrize("link", [False, True], ids=["itself", "by link"])
@pytest.mark.parametrize("node", ["pipe", "socket", "endless", "full"], indirect=True)
@pytest.mark.parametrize("command", WRITING)
def test_only_files_are_written(command, node, link, desk, capsys):
    if link:
        os.symlink("node", "to-node")
    before = contents(desk)
    capsys.readouterr()
    assert main(named(WRITING[command][0], "to-node" if link else "node")) == 1
    assert "name a file" in one_line(capsys)
    assert (os.stat("node").st_ino, os.stat("node").st_mode) == (node.st_ino, node.st_mode)
    assert contents(desk) == before


# Those need a browser, typst or data of their own; their own tests try them.
ELSEWHERE = ("report --pdf", "report --certificate", "selfcal", "join", "export --existing")


@pytest.mark.parametrize(
    "command", [c for c in WRITING if "correct" not in c and c not in ELSEWHERE]
)
def test_the_null_device_takes_the_output_and_stays(command, desk):
    try:
        os.mknod("node", stat.S_IFCHR | 0o666, os.stat(os.devnull).st_rdev)
    except PermissionError:
        pytest.skip("devices cannot be made here")
    if command.startswith("report"):
        pytest.importorskip("matplotlib")
    assert main(named(WRITING[command][0], "node")) == 0
    assert stat.S_ISCHR(os.stat("node").st_mode)


@pytest.mark.parametrize("output", ["-", "stdout", "stderr", "/dev/fd/1"])
@pytest.mark.parametrize(
    ("command", "into"),
    [*((c, "file") for c in WRITING), *((c, "pipe") for c in ("fit", "correct", "simulate"))],
)
def test_standard_output_is_no_place_for_a_file(command, output, into, desk):
    """Into a file, renaming would take it from under what is printed."""
    if not os.path.exists("/dev/fd/1"):
        pytest.skip("no /dev/fd here")
    # As /dev has them; a fault that replaced those would harm the machine.
    os.symlink("/dev/fd/1", "stdout")
    os.symlink("/dev/fd/2", "stderr")
    if into == "file":
        with open("printed", "wb") as out, open("told", "wb") as err:
            done = run(named(WRITING[command][0], output), stdout=out, stderr=err)
        told = (desk / "told").read_text()
    else:
        done = run(named(WRITING[command][0], output), capture_output=True)
        told = done.stderr.decode()
    assert done.returncode == 1
    assert told.count("\n") == 1
    assert "name a" in told
    assert not os.path.exists("-")


def run(arguments, **more):
    return subprocess.run([sys.executable, "-m", "trueangle", *arguments], **more)


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["fit", "DEV", "-o", "x.json"],
        ["fit", "DEV", "--one-pass", "-o", "x.json"],
        ["orders", "DEV"],
        ["correct", "DEV", "-m", "m.json", "-o", "x.csv"],
        ["correct", "r.csv", "-m", "DEV", "-o", "x.csv"],
        ["simulate", "DEV", "-o", "x.csv"],
        ["diagnose", "DEV", "--simulation", "b.toml"],
        ["diagnose", "r.csv", "--simulation", "DEV"],
        [
            *("diagnose", "r.csv", "--simulation", "b.toml"),
            *("--model", "DEV", "--corrected-model", "x.json"),
        ],
        ["report", "DEV", "-o", "x.html"],
        ["report", "r.csv", "--simulation", "DEV", "-o", "x.html"],
    ],
    ids=" ".join,
)
def test_endless_devices_are_refused_as_inputs(arguments, device, desk, capsys):
    os.symlink(device, "endless")
    for name in (device, "endless"):
        capsys.readouterr()
        assert main([name if a == "DEV" else a for a in arguments]) == 1
        assert "is a device" in one_line(capsys)


@pytest.mark.parametrize("command", ["fit", "orders", "diagnose", "report"])
def test_runs_may_come_through_a_pipe(command, desk):
    """As ``trueangle orders <(zcat a.csv.gz)`` does, and ``... | trueangle fit /dev/stdin``."""
    if command == "report":
        pytest.importorskip("matplotlib")
    arguments = {
        "fit": ["fit", "/dev/stdin", "--orders", "1", "-o", "x.json"],
        "orders": ["orders", "/dev/stdin"],
        "diagnose": ["diagnose", "/dev/stdin", "--simulation", "b.toml"],
        "report": ["report", "/dev/stdin", "--orders", "1", "-o", "x.html"],
    }[command]
    done = run(arguments, input=(desk / "r.csv").read_bytes(), capture_output=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == b""


def test_a_log_to_correct_is_no_pipe(desk, capsys):
    os.mkfifo("log.csv")
    os.mkdir("logs")
    os.mkfifo("logs/log.csv")
    for log in ("log.csv", "logs"):
        assert main(["correct", log, "-m", "m.json", "-o", "out.csv"]) == 1
        assert "is a pipe, which can be read only once" in one_line(capsys)


def test_in_place_corrects_the_log_that_a_link_leads_to(desk):
    os.mkdir("real")
    os.rename("r.csv", "real/r.csv")
    os.symlink("real/r.csv", "link.csv")
    assert main(["correct", "link.csv", "-m", "m.json", "--in-place"]) == 0
    assert os.readlink("link.csv") == "real/r.csv"
    assert (
        (desk / "real" / "r.csv")
        .read_text()
        .startswith("reference_deg,indicated_deg,corrected_deg\n")
    )
    assert [p.name for p in (desk / "real").iterdir()] == ["r.csv"]


def test_in_place_of_several_links_resumes(desk, capsys):
    os.mkdir("real")
    os.mkdir("links")
    for name in ("r.csv", "t.csv"):
        os.rename(name, f"real/{name}")
        os.symlink(f"../real/{name}", f"links/{name}")
    for status in ("rows/s", "done before"):
        capsys.readouterr()
        assert main(["correct", "links", "-m", "m.json", "--in-place"]) == 0
        assert capsys.readouterr().out.count(status) == 2
    assert (desk / "real" / "t.csv").read_text().startswith("reference_deg,indicated_deg,corr")


def test_an_output_follows_its_link(desk):
    os.mkdir("real")
    for name in ("x.csv", "x.json"):
        os.symlink(f"real/{name}", name)
    assert main(["correct", "r.csv", "-m", "m.json", "-o", "x.csv"]) == 0
    assert main(["fit", "r.csv", "--orders", "1", "-o", "x.json"]) == 0
    assert sorted(p.name for p in (desk / "real").iterdir()) == ["x.csv", "x.json"]
    assert os.path.islink("x.csv")
    assert os.path.islink("x.json")


def test_a_folder_of_logs_that_links_to_itself_ends(desk, capsys):
    os.mkdir("logs")
    os.rename("r.csv", "logs/r.csv")
    os.symlink(".", "logs/loop")
    os.symlink("../logs", "logs/loop2")
    assert main(["correct", "logs", "-m", "m.json", "-o", "out"]) == 0
    assert sorted(str(p) for p in (desk / "out").rglob("*.csv")) == [str(desk / "out" / "r.csv")]
    os.symlink("round.csv", "round.csv")
    capsys.readouterr()
    assert main(["correct", "round.csv", "-m", "m.json", "-o", "x.csv"]) == 1
    assert "round.csv" in one_line(capsys)


@pytest.mark.parametrize(
    ("arguments", "advice"),
    [
        (["fit", "r.csv", "-o", "x.csv"], "x.json"),
        (["fit", "r.csv", "-o", "x.pdf"], "x.json"),
        (["fit", "r.csv", "--one-pass", "-o", "x.toml"], "x.json"),
        (["correct", "r.csv", "-m", "m.json", "-o", "x.parquet"], "x.csv"),
        (["correct", "r.csv", "-m", "m.json", "-o", "x.zip"], "x.csv"),
        (["correct", "r.csv", "-m", "m.json", "-o", "x.tsv"], "x.csv"),
        (["correct", "r.csv", "t.csv", "-m", "m.json", "-o", "x.csv"], "a folder"),
        (["simulate", "b.toml", "-o", "x.parquet"], "x.csv"),
        (["simulate", "b.toml", "-o", "x.toml"], "x.csv"),
        (["diagnose", "r.csv", "--simulation", "b.toml", "--extend", "x.json"], "x.toml"),
        (["report", "r.csv", "-o", "x.docx"], "x.html"),
        (["report", "r.csv", "-o", "x.json"], "x.html"),
        (["report", "r.csv", "-o", "x.html", "--pdf", "y.html"], "y.pdf"),
        (["demo", "--report", "x.csv"], "x.html"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_an_ending_of_another_format_is_refused(arguments, advice, desk, capsys):
    before = contents(desk)
    capsys.readouterr()
    assert main(arguments) == 1
    assert advice in one_line(capsys)
    assert contents(desk) == before


def test_a_report_named_pdf_is_one(desk, monkeypatch):
    pytest.importorskip("matplotlib")
    from trueangle.reports import composition

    def printed(html, path, browser=None):
        assert "<html" in html
        with open(path, "wb") as file:
            file.write(b"%PDF-")

    monkeypatch.setattr(composition, "print_pdf", printed)
    assert main(["report", "r.csv", "--orders", "1", "-o", "x.pdf"]) == 0
    assert (desk / "x.pdf").read_bytes() == b"%PDF-"


def test_a_report_named_pdf_without_a_browser_is_refused(desk, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("PATH", "/nowhere")
    assert main(["report", "r.csv", "--orders", "1", "-o", "x.pdf"]) == 1
    assert "needs an installed browser" in one_line(capsys)
    assert not os.path.exists("x.pdf")


#: Words by which the help of a command calls a file; others name no files.
FILES = {
    "FILE",
    "RUNS",
    "MODEL",
    "LOG",
    "LOGS",
    "FILES",
    "A",
    "B",
    "SIMULATION",
    "IDENTITY",
    "EXISTING",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_argument_that_names_a_file_says_whether_it_is_read_or_written(command):
    """Else the check before a command begins would not see it."""
    for action in build_parser().commands[command]._actions:
        metavar = action.metavar if isinstance(action.metavar, str) else ""
        if isinstance(action, argparse._HelpAction) or metavar.rpartition("=")[2] not in FILES:
            continue
        assert callable(action.type), (command, action.dest)
        assert isinstance(action.type("x"), Input | Output), (command, action.dest)


def test_an_output_is_none_of_the_files_that_a_pattern_stands_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a-1.csv", "a-2.csv", "b.csv"):
        (tmp_path / name).write_text("reference_deg,indicated_deg\n")
    written = Output.of(FileKind("calibration runs", (".csv",)))
    for name in ("a-*.csv", "a-2.csv"):
        read = argparse.Namespace(runs=[Input(name)], output=written("a-2.csv"))
        with pytest.raises(FileError, match=r"^a-2\.csv: is also read"):
            check_paths(read)
        check_paths(argparse.Namespace(runs=[Input(name)], output=written("b.csv")))
