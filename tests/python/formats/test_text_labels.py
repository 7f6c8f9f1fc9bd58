"""Labels are text however a format stores text: every file gives the runs that CSV gives."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import UnreadColumnWarning

h5py = pytest.importorskip("h5py")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

NAMES = ["cold", "warm", "hot Ä"]
ZEROS = np.array([0.0, 7.0, -4.0])


def readings():
    rng = np.random.default_rng(17)
    x = np.sort(rng.uniform(0.0, 360.0, 150))
    run = rng.integers(0, 3, x.size)
    return x, x + ZEROS[run] + 0.08 * np.cos(np.radians(2.0 * x)), [NAMES[k] for k in run]


def hdf5(path, kind, chunked):
    x, y, run = readings()
    more = {"chunks": (32,), "compression": "gzip"} if chunked else {}
    with h5py.File(path, "w") as file:
        file.create_dataset("reference_deg", data=x, **more)
        file.create_dataset("indicated_deg", data=y, **more)
        texts = [name.encode() for name in run] if kind == "S9" else run
        file.create_dataset("run", data=np.array(texts, dtype=kind), **more)


def parquet(path, kind):
    x, y, run = readings()
    if kind == "fixed":
        column = pa.array([name.encode().ljust(9, b"\0") for name in run], pa.binary(9))
    elif kind == "dictionary":
        column = pa.array([name.encode() for name in run]).dictionary_encode()
    else:
        column = pa.array([name.encode() for name in run]).cast(kind)
    pq.write_table(pa.table({"reference_deg": x, "indicated_deg": y, "run": column}), path)


CASES = [
    *(("h5", kind, chunked) for kind in ("S9", "vlen") for chunked in (False, True)),
    *(("parquet", k, None) for k in (pa.string(), pa.binary(), pa.large_binary(), "fixed")),
    ("parquet", "dictionary", None),
]


@pytest.mark.parametrize(("ending", "kind", "chunked"), CASES, ids=str)
def test_texts_are_labels(ending, kind, chunked, tmp_path):
    path = tmp_path / f"runs.{ending}"
    if ending == "h5":
        hdf5(path, h5py.string_dtype() if kind == "vlen" else kind, chunked)
    else:
        parquet(path, kind)
    runs = ta.read_runs(path)
    assert sorted(run.label for run in runs) == sorted(NAMES)
    _, y, run = readings()
    first = next(r for r in runs if r.label == NAMES[2])
    np.testing.assert_array_equal(first.indicated, y[np.array(run) == NAMES[2]])
    fit = ta.fit(path, orders=[1, 2])
    np.testing.assert_allclose(fit.amplitudes, [0.0, 0.08], atol=1e-12)


def test_a_text_is_no_angle_to_correct(tmp_path):
    path = tmp_path / "log.h5"
    hdf5(path, "S9", False)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.1])], 0.0, 360.0)
    report = ta.correct_logs(path, model, tmp_path / "out.h5", column="run", unit="deg")
    assert "no such column; its columns are" in str(report.logs[0].error)
    assert not (tmp_path / "out.h5").exists()


def lists(path, name):
    """A column of this name of a type that is neither number nor text, in every format with one."""
    x, y, run = readings()
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["reference_deg"], file["indicated_deg"] = x, y
            file[name] = np.zeros(x.size, [("a", "f4"), ("b", "i2")])
    elif path.suffix == ".npz":
        more = {name: np.full(x.size, "2026-11-28", "M8[D]")}
        np.savez(path, reference_deg=x, indicated_deg=y, **more)
    else:
        kept = pa.array([[name] for name in run])
        table = pa.table({"reference_deg": x, "indicated_deg": y, name: kept})
        if path.suffix == ".parquet":
            pq.write_table(table, path)
            return
        with pa.ipc.new_file(path, table.schema) as writer:
            writer.write_table(table)


@pytest.mark.parametrize("ending", ["h5", "npz", "parquet", "arrow"])
@pytest.mark.parametrize(
    ("name", "role"), [("run", "run"), ("direction", "direction"), ("torque_Nm", "torque")]
)
def test_a_column_with_the_name_of_a_role_that_is_left_aside_is_reported(
    ending, name, role, tmp_path
):
    path = tmp_path / f"runs.{ending}"
    lists(path, name)
    told = (
        rf"runs\.{ending}: column '{name}' is ignored: it holds neither numbers nor text; write "
        f"it as one of them to use it as the role {role}, or rename it"
    )
    with pytest.warns(UnreadColumnWarning, match=told):
        (run,) = ta.read_runs(path)
    assert run.label is None
    with pytest.warns(UnreadColumnWarning, match=told):
        ta.fit_logs(path, orders=[1, 2])
    lists(path, f"my_{name}")
    ta.read_runs(path)  # of no role: nothing is said


@pytest.mark.parametrize("ending", ["csv", "h5"])
def test_a_text_that_is_no_date_is_left_aside_and_reported(ending, tmp_path):
    path = tmp_path / f"runs.{ending}"
    x, y, _ = readings()
    if ending == "h5":
        with h5py.File(path, "w") as file:
            file["reference_deg"], file["indicated_deg"] = x, y
            file["when"] = [b"spring"] * x.size
    else:
        rows = "".join(f"{a},{b},spring\n" for a, b in zip(x, y, strict=True))
        path.write_text(f"reference_deg,indicated_deg,when\n{rows}")
    told = r"line 2, column 'when': a date and time .* got 'spring'; the column is ignored"
    with pytest.warns(UnreadColumnWarning, match=told):
        (run,) = ta.read_runs(path)
    assert run.when is None
