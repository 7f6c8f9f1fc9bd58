"""The one door for files: what is let in, what is let out, and that it appears whole."""

import errno
import os
import socket
import stat
import threading

import pytest

import trueangle as ta
import trueangle.formats.formats  # which endings are of logs, as whatever reads one knows
from trueangle.errors import FileError
from trueangle.support import files
from trueangle.support.files import inputs


@pytest.fixture
def model():
    return ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)


def same_names(tmp_path, name="a.csv"):
    """Ways to name one file again."""
    path = tmp_path / name
    path.write_text("x")
    (tmp_path / "link").symlink_to(path)
    (tmp_path / "chain").symlink_to(tmp_path / "link")
    (tmp_path / "folder").symlink_to(tmp_path)
    os.link(path, tmp_path / "hard")
    return [
        path,
        tmp_path / "." / ".." / tmp_path.name / name,
        tmp_path / "link",
        tmp_path / "chain",
        tmp_path / "folder" / name,
        tmp_path / "hard",
    ]


def test_one_file_under_many_names(tmp_path):
    names = same_names(tmp_path)
    (tmp_path / "b.csv").write_text("x")
    for first in names:
        for second in names:
            assert files.same_file(first, second)
        assert not files.same_file(first, tmp_path / "b.csv")
        assert not files.same_file(first, tmp_path / "missing")
    assert files.same_file(tmp_path / "missing", tmp_path / "folder" / "missing")


def test_an_output_is_never_an_input(tmp_path):
    names = same_names(tmp_path, "a")
    for entry in names:
        for output in names:
            with pytest.raises(FileError, match="also read"):
                files.check_output(output, inputs=[entry])
    assert files.check_output(tmp_path / "b", inputs=names) == tmp_path / "b"


def test_a_folder_that_is_read_stands_for_the_logs_in_it(tmp_path):
    (tmp_path / "logs" / "below").mkdir(parents=True)
    log = tmp_path / "logs" / "below" / "a.csv"
    log.write_text("x")
    os.link(log, tmp_path / "hard")
    model = tmp_path / "logs" / "joint.json"
    model.write_text("{}")
    for output in (log, tmp_path / "hard"):
        with pytest.raises(FileError, match=r"also read \(as .*a\.csv\)|also read:"):
            files.check_output(output, inputs=[tmp_path / "logs"])
    assert files.check_output(model, inputs=[tmp_path / "logs"]) == model


def test_what_was_read_is_known_by_its_content(tmp_path, model):
    """In Python only the hash of what was read is known."""
    path = tmp_path / "runs"
    path.write_text("reference_deg,indicated_deg\n0,0\n90,91\n180,180\n270,269\n")
    before = path.read_bytes()
    runs = ta.read_runs(path)
    for save in (
        ta.fit(runs, orders=[1]).model.save,
        lambda name: ta.report(runs, name, orders=[1]),
    ):
        with pytest.raises(FileError, match="was read"):
            save(path)
        assert path.read_bytes() == before


def special(kind, tmp_path):
    path = tmp_path / "node"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(str(path))
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        try:
            os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 5))  # endless zeros
        except PermissionError:
            return "/dev/zero"
    return path


@pytest.mark.parametrize("kind", ["fifo", "socket", "folder", "device"])
@pytest.mark.parametrize("linked", [False, True])
def test_only_regular_files_are_written(kind, linked, tmp_path, model):
    node = special(kind, tmp_path)
    before = os.stat(node)
    if linked:
        (tmp_path / "link").symlink_to(node)
        node = tmp_path / "link"
    with pytest.raises(FileError, match=f"is a {kind.replace('fifo', 'pipe')}"):
        model.save(node)
    after = os.stat(node)
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)
    assert sorted(p.name for p in tmp_path.iterdir() if p.name not in ("node", "link")) == []


def test_the_null_device_takes_everything_and_stays(tmp_path, model):
    node = tmp_path / "null"
    try:
        os.mknod(node, stat.S_IFCHR | 0o666, os.stat(os.devnull).st_rdev)
    except PermissionError:
        pytest.skip("devices cannot be made here")
    model.save(node)
    assert stat.S_ISCHR(node.stat().st_mode)
    assert [p.name for p in tmp_path.iterdir()] == ["null"]
    with pytest.raises(FileError, match="device"):
        files.check_output(node, regular=True)


def test_a_link_is_followed_and_stays(tmp_path, model):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link.json"
    for target in ("real/there.json", "real/new.json"):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        if "there" in target:
            (tmp_path / target).write_text("old")
        model.save(link)
        assert os.readlink(link) == target
        assert ta.load_model(tmp_path / target) == model
    assert sorted(p.name for p in (tmp_path / "real").iterdir()) == ["new.json", "there.json"]


def test_links_that_lead_nowhere_are_refused(tmp_path, model):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    (tmp_path / "c").symlink_to("missing/x.json")
    with pytest.raises(OSError, match="a") as loop:
        model.save(tmp_path / "a")
    assert loop.value.errno == errno.ELOOP
    with pytest.raises(FileNotFoundError, match="missing"):
        model.save(tmp_path / "c")


@pytest.mark.parametrize("name", ["-", "", "a\0b", "new/"])
def test_names_that_name_no_file(name, tmp_path, model, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError):
        model.save(name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "ending",
    [".csv", ".parquet", ".PDF", ".html", ".toml", ".json.gz", ".xlsx", ".png", ".v2", ".dat"],
)
def test_an_ending_of_another_format_is_refused(ending, tmp_path, model):
    with pytest.raises(FileError, match=r"ending .*name it .*\.json"):
        model.save(tmp_path / f"joint{ending}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["joint.json", "joint.JSON", "joint", ".model"])
def test_endings_of_the_format_and_none_are_taken(name, tmp_path, model):
    model.save(tmp_path / name)
    assert ta.load_model(tmp_path / name) == model


def test_permissions_of_what_is_replaced_are_kept(tmp_path, model):
    path = tmp_path / "joint.json"
    before = os.umask(0o027)
    try:
        model.save(path)
        assert path.stat().st_mode & 0o777 == 0o640
        path.chmod(0o600)
        model.save(path)
        assert path.stat().st_mode & 0o777 == 0o600
    finally:
        os.umask(before)


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")

    def fail(error):
        with files.written_atomically(path) as file:
            file.write("half")
            file.flush()
            raise error

    with pytest.raises(ZeroDivisionError):
        fail(ZeroDivisionError())
    with pytest.raises(OSError, match="No space left") as full:
        fail(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert full.value.filename == str(path)  # not the hidden name
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_it_is_synced_before_it_is_named(tmp_path, monkeypatch):
    """Otherwise a power cut leaves an empty file of the right name."""
    path = tmp_path / "a"
    seen = []
    fsync, replace = os.fsync, os.replace

    def synced(handle):
        what = "folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file"
        seen.append((what, path.exists()))
        fsync(handle)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", lambda *names: (seen.append("named"), replace(*names)))
    with files.written_atomically(path) as file:
        file.write("whole")
    assert seen == [("file", False), "named", ("folder", True)]


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom", "/dev/full"])
def test_endless_devices_are_not_read(device):
    if not os.path.exists(device):
        pytest.skip(f"no {device} here")
    for read in (ta.read_runs, ta.load_model, ta.load_simulation, files.check_input):
        with pytest.raises(FileError, match="is a device"):
            read(device)


def test_a_pipe_is_read_to_its_end(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = "reference_deg,indicated_deg\n" + "".join(f"{k},{k}\n" for k in range(36000))
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    (run,) = ta.read_runs(pipe)
    writer.join()
    assert len(run) == 36000


def test_a_pipe_that_goes_on_is_left(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def pour():
        with pipe.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(b"0" * 65536)
            except BrokenPipeError:
                pass

    writer = threading.Thread(target=pour)
    writer.start()
    with pytest.raises(FileError, match="is longer than 3 MiB, the most that is read of a model"):
        files.read_whole(pipe, 3 << 20, "a model")
    writer.join()


def test_files_have_a_size_limit_that_the_message_names(tmp_path, monkeypatch):
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(inputs.RUNS_BYTES + 1)  # takes no room on the disk
    for read, size in (
        (ta.load_model, "256 MiB"),
        (ta.load_simulation, "16 MiB"),
        (ta.read_runs, "1 GiB"),
    ):
        with pytest.raises(FileError, match=f"bytes, but .* up to {size}"):
            read(path)


def test_a_folder_that_takes_no_files_ends_the_attempt(model, tmp_path, monkeypatch):
    """As /proc: a folder, in which nothing can be made."""
    opened = os.open
    tried = []

    def refuse(path, flags, *rest, **more):
        if flags & os.O_CREAT and "partial" in os.fsdecode(path):
            tried.append(path)
            if len(tried) > 10_000:
                pytest.fail("tries without an end")
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), os.fsdecode(path))
        return opened(path, flags, *rest, **more)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(FileNotFoundError, match="no file can be made in this folder"):
        model.save(tmp_path / "m.json")
    assert tried
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("count", "said"),
    [(3 << 20, "3 MiB"), (1023 << 20, "1023 MiB"), (1 << 30, "1 GiB"), (5 << 30, "5 GiB")],
)
def test_limits_are_told_in_the_larger_unit_from_one_of_it(count, said):
    assert inputs._size(count) == said
