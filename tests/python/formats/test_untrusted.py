"""Files that end a process which trusts them: refused by what their headers say."""

import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

NO_WIDTH = ("|V0", "<U0", "|S0", "[]", "[('indicated_deg', '<V0')]")


def npy(path, descr, shape, data=b"", fortran=False):
    """An array whose header says anything."""
    text = f"{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data)


def commands(path, folder):
    model, out = folder / "m.json", folder / f"out{path.suffix}"
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    ta.HarmonicModel([shaft], period=360.0).save(model)
    reads = ["--signal", "indicated=indicated_deg", "--signal", "reference=reference_deg"]
    yield ["check", str(path), *reads]
    yield ["fit", str(path), "--one-pass", "-o", str(folder / "x.json")]
    yield ["correct", str(path), "-m", str(model), "-o", str(out), "--column", "indicated_deg"]


def refused(path, folder):
    """Every command says in one line what is wrong, and lives to say it."""
    code = "import sys; from trueangle.cli import main\n"
    code += "print([main(c.split('|')) for c in sys.argv[1:]])"
    asked = ["|".join(command) for command in commands(path, folder)]
    done = subprocess.run([sys.executable, "-c", code, *asked], capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert done.stdout.strip() == "[1, 1, 1]", (done.stdout, done.stderr)
    assert done.stderr.count("\n") == 3, done.stderr
    assert "defect of trueangle" not in done.stderr
    assert sorted(p.name for p in folder.iterdir()) == sorted([path.name, "m.json"])
    return done.stderr


@pytest.mark.parametrize("kind", NO_WIDTH)
@pytest.mark.parametrize("shape", ["(-1,)", "(4,)", "(2, -1)"])
def test_arrays_of_no_width_are_refused(kind, shape, tmp_path, capsys):
    path = tmp_path / "a.npy"
    npy(path, kind if kind.startswith("[") else repr(kind), shape, bytes(64))
    for command in commands(path, tmp_path):
        assert main(command) == 1
        told = capsys.readouterr().err
        assert "a.npy" in told
        assert told.count("\n") == 1


@pytest.mark.parametrize("shape", ["(-1,)", "(-4, 2)", "(3, -3)"])
def test_arrays_of_less_than_nothing_are_refused(shape, tmp_path, capsys):
    path = tmp_path / "a.npy"
    npy(path, "'<f8'", shape, bytes(64))
    for command in commands(path, tmp_path):
        assert main(command) == 1
        assert "a.npy" in capsys.readouterr().err


def test_the_recipe_itself_does_not_end_the_process(tmp_path):
    npy(tmp_path / "a.npy", "'<U0'", "(-1,)", bytes(64))
    assert "'<U0'" in refused(tmp_path / "a.npy", tmp_path)


@pytest.mark.parametrize("kind", ["'<U0'", "'|V0'", "'<f8'"])
def test_archives_of_such_arrays_are_refused(kind, tmp_path, capsys):
    member = tmp_path / "x.npy"
    npy(member, kind, "(-1,)")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for name in ("reference_deg", "indicated_deg"):
            archive.writestr(f"{name}.npy", member.read_bytes())
    member.unlink()
    for command in commands(tmp_path / "a.npz", tmp_path):
        assert main(command) == 1
        assert "a.npz" in capsys.readouterr().err


def _virtual(path, source, name, rows=100, unlimited=False):
    import h5py

    most = (None,) if unlimited else None
    with h5py.File(path, "w") as file:
        layout = h5py.VirtualLayout((rows,), "f8", maxshape=most)
        given = h5py.VirtualSource(source, name, (rows,), maxshape=most)
        if unlimited:
            layout[0 : h5py.h5s.UNLIMITED] = given[0 : h5py.h5s.UNLIMITED]
        else:
            layout[:] = given
        file.create_virtual_dataset("indicated_deg", layout)
        file["reference_deg"] = np.zeros(rows)


def _ring(path):
    other = path.with_name("other.h5")
    _virtual(path, "other.h5", "indicated_deg")
    _virtual(other, path.name, "indicated_deg")
    yield other


def _linked(path, link):
    import h5py

    with h5py.File(path, "w") as file:
        file["reference_deg"] = np.zeros(100)
        file["indicated_deg"] = link(h5py)
        if link(h5py).path == "/x":
            file["x"] = h5py.SoftLink("/indicated_deg")


def _external(path):
    import h5py

    with h5py.File(path, "w") as file:
        file["reference_deg"] = np.zeros(100)
        raw = [(str(path.with_name("m.json")), 0, 800)]
        file.create_dataset("indicated_deg", (100,), "f8", external=raw)


HDF5 = {
    "virtual of itself": lambda path: _virtual(path, ".", "indicated_deg"),
    "virtual of itself by name": lambda path: _virtual(path, "a.h5", "indicated_deg"),
    "virtual without end": lambda path: _virtual(path, ".", "indicated_deg", unlimited=True),
    "virtual of another": lambda path: _virtual(path, "/etc/hostname", "indicated_deg"),
    "external link": lambda p: _linked(p, lambda h: h.ExternalLink("a.h5", "/indicated_deg")),
    "soft links in a ring": lambda path: _linked(path, lambda h: h.SoftLink("/x")),
    "values in another file": _external,
}


@pytest.mark.parametrize("kind", HDF5)
def test_data_sets_that_lead_elsewhere_are_refused(kind, tmp_path):
    pytest.importorskip("h5py")
    HDF5[kind](tmp_path / "a.h5")
    told = refused(tmp_path / "a.h5", tmp_path)
    assert told.count("a.h5") >= 3
    if "link" not in kind:
        assert "h5repack" in told


def test_a_ring_of_two_files_is_refused(tmp_path):
    pytest.importorskip("h5py")
    (other,) = _ring(tmp_path / "a.h5")
    for command in commands(tmp_path / "a.h5", tmp_path):
        line = [sys.executable, "-m", "trueangle", *command]
        done = subprocess.run(line, capture_output=True, text=True)
        assert done.returncode == 1, done
        assert "h5repack" in done.stderr
    assert other.exists()


def test_a_virtual_data_set_that_is_not_asked_for_does_no_harm(tmp_path):
    h5py = pytest.importorskip("h5py")
    _virtual(tmp_path / "a.h5", ".", "indicated_deg")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.move("indicated_deg", "other")
        file["indicated_deg"] = np.linspace(0.0, 359.0, 100)
        file["reference_deg"][:] = np.linspace(0.0, 359.0, 100)
    (run,) = ta.read_runs(tmp_path / "a.h5")
    assert len(run) == 100
    assert "other" not in run.columns


def test_a_file_of_compounds_or_dangling_links_is_told_to_have_no_column(tmp_path):
    h5py = pytest.importorskip("h5py")
    fields = [("reference_deg", "f8"), ("indicated_deg", "f8")]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["runs"] = np.zeros(50, dtype=fields)
        file["reference_deg"] = h5py.SoftLink("/nowhere")
        file["indicated_deg"] = h5py.ExternalLink("gone.h5", "/indicated_deg")
    with pytest.raises(ta.errors.FileError, match=r"it has no column of numbers or texts, one to"):
        ta.check(tmp_path / "a.h5")


@pytest.mark.parametrize("order", ["C", "F"])
def test_an_array_is_written_and_not_mapped(order, tmp_path):
    given = np.random.default_rng(8).uniform(0.0, 360.0, (3000, 2))
    np.save(tmp_path / "a.npy", np.asarray(given, order=order))
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    model = ta.HarmonicModel([shaft], period=360.0)
    asked = {"column": "column2", "unit": "deg"}
    assert ta.correct_logs(tmp_path / "a.npy", model, tmp_path / "b.npy", **asked).is_done
    made = np.load(tmp_path / "b.npy")
    np.testing.assert_array_equal(made[:, :2], given)
    np.testing.assert_array_equal(made[:, 2], model.correct(given[:, 1]))


@pytest.mark.parametrize("name", ["a.npy", "a.db3"])
def test_a_full_disk_is_told_of_the_output(name, tmp_path):
    """Under mapped memory it would end the process; a database tells of it in words of its own."""
    log, disk = tmp_path / name, tmp_path / "disk"
    more = ["--column", "column2", "--unit", "deg"]
    if name == "a.npy":
        np.save(log, np.random.default_rng(8).uniform(0.0, 360.0, (9000, 2)))
    else:
        pytest.importorskip("rosbags")
        from injection.logfiles import _ros2

        _ros2("SQLITE3")(log, np.random.default_rng(8).uniform(0.0, 360.0, 1500))
        more = ["--column", "elbow"]
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    ta.HarmonicModel([shaft], period=360.0).save(tmp_path / "m.json")
    disk.mkdir()
    mounted = shutil.which("mount") and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)], capture_output=True
    )
    if not mounted or mounted.returncode:
        pytest.skip("mounting a tmpfs is not permitted here")
    try:
        command = ["correct", str(log), "-m", str(tmp_path / "m.json"), "-o", str(disk / name)]
        done = subprocess.run(
            [sys.executable, "-m", "trueangle", *command, *more], capture_output=True, text=True
        )
        assert done.returncode == 1, done
        assert done.stderr == f"trueangle: error: {disk / name}: No space left on device\n"
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True)
