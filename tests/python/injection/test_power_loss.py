"""The power fails at every moment: what has its name is whole, and the work is taken up again."""

import os
import shutil
import sys

import pytest

from trueangle.cli import main

from .conftest import COMMANDS, commands, tree
from .disk import Disk, laid_out
from .logfiles import FORMATS, made_log

pytestmark = pytest.mark.skipif(
    not os.path.isdir("/proc/self/fd") or sys.platform == "win32",
    reason="which file is synced is asked in /proc",
)

MANIFEST = "trueangle-manifest.jsonl"


def recorded(arguments, desk, monkeypatch):
    """What the disk may hold at every moment of a command, and the tree at its end."""
    monkeypatch.chdir(desk)
    disk = Disk(desk)
    with disk.recorded(monkeypatch):
        assert main(arguments) == 0
    assert len(disk.eager) > 4
    return disk, tree(desk)


@pytest.mark.parametrize("there", [False, True], ids=["new", "there before"])
@pytest.mark.parametrize("command", [c for c in commands() if c != "correct"])
def test_an_output_is_whole_or_as_it_was(command, there, desk, monkeypatch):
    arguments, output = COMMANDS[command]
    if there:
        (desk / output).write_text("old")
    before = tree(desk).get(output)
    disk, end = recorded(arguments, desk, monkeypatch)
    for state in (*disk.eager, *disk.lazy):
        found = state.files.get(output)
        content = None if found is None else found.content
        assert content in (before, end[output]), state.moment
    # When the command has ended, its output is there for good.
    for states in (disk.eager, disk.lazy):
        assert states[-1].files[output].content == end[output]


@pytest.mark.parametrize("way", ["folder", "in place"])
def test_correcting_is_taken_up_again_from_every_moment(way, desk, tmp_path, monkeypatch):
    arguments = COMMANDS["correct"][0]
    folder = "out"
    if way == "in place":
        arguments, folder = [*arguments[:-2], "--in-place"], "logs"
    inputs = tree(desk)
    disk, end = recorded(arguments, desk, monkeypatch)
    outputs = {name: end[f"{folder}/{name}"] for name in ("a.csv", "b.csv")}
    again = tmp_path / "again"
    for state in (*disk.eager, *disk.lazy):
        laid_out(state, again)
        for name, whole in outputs.items():
            found = state.files.get(f"{folder}/{name}")
            content = None if found is None else found.content
            assert content in (inputs.get(f"{folder}/{name}"), whole), (state.moment, name)
            if content == whole:  # what is done is known to be done
                told = state.files.get(f"{folder}/{MANIFEST}")
                assert told is not None, state.moment
                assert f'"output": "{name}"'.encode() in told.content, state.moment
        monkeypatch.chdir(again)
        assert main(arguments) == 0, state.moment
        assert {name: (again / folder / name).read_bytes() for name in outputs} == outputs
    for states in (disk.eager, disk.lazy):
        kept = states[-1].files
        assert {name: kept[f"{folder}/{name}"].content for name in outputs} == outputs


def test_a_folder_of_which_no_sync_is_known_is_no_error(desk, monkeypatch):
    """Some network file systems cannot sync folders: the rename itself is done."""
    import errno

    real = os.fsync

    def without_folders(handle):
        if os.path.isdir(f"/proc/self/fd/{handle}"):
            raise OSError(errno.EINVAL, "Invalid argument")
        real(handle)

    monkeypatch.setattr(os, "fsync", without_folders)
    monkeypatch.chdir(desk)
    assert main(COMMANDS["fit"][0]) == 0
    assert main(COMMANDS["correct"][0]) == 0


@pytest.mark.parametrize("command", commands())
def test_a_sync_that_fails_is_told(command, desk, monkeypatch, capsys):
    """What the disk did not take is not named, or its name is not sure to last."""
    import errno

    def failing(handle):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", failing)
    monkeypatch.chdir(desk)
    furnished = tree(desk)
    assert main(COMMANDS[command][0]) == 1
    told = capsys.readouterr().err
    assert "Input/output error" in told
    assert COMMANDS[command][1] in told
    assert not [name for name in tree(desk).keys() - furnished.keys() if MANIFEST not in name]


@pytest.fixture(params=FORMATS)
def correcting(request, desk, monkeypatch):
    """The command that corrects a log of a format, its output, and what it had made of it."""
    for module in FORMATS[request.param].modules:
        pytest.importorskip(module)
    monkeypatch.chdir(desk)
    log = FORMATS[request.param].file
    output = f"x{log.removeprefix('a')}"
    arguments = ["correct", log, "-m", "m.json", *made_log(request.param, desk)]
    before = tree(desk)
    assert main([*arguments, "-o", output]) == 0
    made = {name: data for name, data in tree(desk).items() if name not in before}
    shutil.rmtree(output) if os.path.isdir(output) else os.unlink(output)
    return arguments, log, output, made


@pytest.mark.parametrize("room", [0, 2000, 5000])
def test_no_room_for_a_log_is_told_of_the_output(room, correcting, desk, capsys):
    """Whatever the library says of it: of the file that it reads, of its own, or nothing."""
    import resource

    arguments, _, output, made = correcting
    before, limit = tree(desk), resource.getrlimit(resource.RLIMIT_FSIZE)
    capsys.readouterr()
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, limit[1]))
    try:
        status = main([*arguments, "-o", output])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    if status:
        assert capsys.readouterr().err == f"trueangle: error: {output}: File too large\n"
        assert tree(desk) == before
        assert main([*arguments, "-o", output]) == 0
    else:
        assert max(map(len, made.values())) <= room
    assert tree(desk).keys() == before.keys() | made.keys()


@pytest.mark.parametrize("there", [False, True], ids=["new", "in place"])
def test_a_name_that_the_disk_does_not_take_is_taken_back(
    there, correcting, desk, monkeypatch, capsys
):
    """The last sync, of the folder, fails: the command can be given again."""
    import errno

    arguments, log, output, _ = correcting
    name, way = (log, ["--in-place"]) if there else (output, ["-o", output])
    before, real = tree(desk), os.fsync

    def failing(handle):
        if os.readlink(f"/proc/self/fd/{handle}") == str(desk):
            raise OSError(errno.EIO, "Input/output error")
        real(handle)

    capsys.readouterr()
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", failing)
        assert main([*arguments, *way]) == 1
    assert capsys.readouterr().err == f"trueangle: error: {name}: Input/output error\n"
    assert tree(desk) == before
    assert main([*arguments, *way]) == 0
    assert tree(desk) != before
