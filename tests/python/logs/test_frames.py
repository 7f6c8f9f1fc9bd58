"""ta.correct: every kind of data gives its own kind back, with the model's own numbers."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError
from trueangle.logs.columns import find_angle_column, find_joint_signal

from .conftest import made_angles, made_model, unwrapped_truth

ANGLES = made_angles(1000)


def columns():
    return {"t": np.arange(1000), "indicated_deg": ANGLES, "text": [str(i) for i in range(1000)]}


def test_arrays(model):
    np.testing.assert_array_equal(ta.correct(ANGLES, model), model.correct(ANGLES))
    single = ANGLES.astype(np.float32)
    assert ta.correct(single, model).dtype == np.float32


def test_arrays_of_a_model_that_counts_turns():
    model = made_model(ratio=50.5)
    np.testing.assert_allclose(
        ta.correct(ANGLES, model), unwrapped_truth(model, ANGLES), rtol=0, atol=1e-10
    )


def test_pyarrow(model):
    pa = pytest.importorskip("pyarrow")
    table = pa.table(columns())
    for data in (
        table,
        table.to_batches()[0],
        pa.RecordBatchReader.from_batches(table.schema, table.to_batches(max_chunksize=77)),
    ):
        out = ta.correct(data, model)
        assert type(out) is type(data)
        out = out.read_all() if isinstance(out, pa.RecordBatchReader) else out
        np.testing.assert_array_equal(out["corrected_deg"], model.correct(ANGLES))
        assert out["text"].to_pylist() == columns()["text"]


def test_streams_are_lazy(model):
    pa = pytest.importorskip("pyarrow")
    taken = []

    def batches():
        for i in range(3):
            taken.append(i)
            yield pa.record_batch({"indicated_deg": ANGLES})

    schema = pa.schema([("indicated_deg", pa.float64())])
    out = ta.correct(pa.RecordBatchReader.from_batches(schema, batches()), model)
    assert taken == []
    out.read_next_batch()
    assert taken == [0]


def test_polars(model):
    pl = pytest.importorskip("polars")
    frame = pl.DataFrame(columns())
    np.testing.assert_array_equal(
        ta.correct(frame, model)["corrected_deg"].to_numpy(), model.correct(ANGLES)
    )
    lazy = ta.correct(frame.lazy(), model)
    assert isinstance(lazy, pl.LazyFrame)
    assert lazy.collect().equals(ta.correct(frame, model))
    missing = pl.DataFrame({"indicated_deg": [90.0, None, float("nan")]})
    out = ta.correct(missing, model)["corrected_deg"].to_list()
    assert out[:2] == [model.correct(90.0), None]
    assert np.isnan(out[2])


@pytest.mark.parametrize("kind", ["float64", "float32", "Float64", "Int64", "double[pyarrow]"])
def test_pandas(kind, model):
    pd = pytest.importorskip("pandas")
    if "pyarrow" in kind:
        pytest.importorskip("pyarrow")
    frame = pd.DataFrame(columns(), index=np.arange(1000) * 2)
    frame["indicated_deg"] = np.round(frame["indicated_deg"]).astype(kind)
    if kind[0] != "f":
        frame.loc[4, "indicated_deg"] = pd.NA
    out = ta.correct(frame, model)
    assert list(out.columns) == [*frame.columns, "corrected_deg"]
    pd.testing.assert_frame_equal(out[list(frame.columns)], frame)
    expected = model.correct(np.round(ANGLES).astype("float32" if kind == "float32" else float))
    known = out["corrected_deg"].notna().to_numpy()
    assert known.sum() == (1000 if kind[0] == "f" else 999)
    found = out["corrected_deg"].to_numpy(dtype=expected.dtype, na_value=np.nan)
    np.testing.assert_array_equal(found[known], expected[known])
    assert "corrected_deg" not in frame


def test_duckdb_streams_through_the_arrow_capsule(model):
    duckdb = pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    relation = duckdb.sql("select 90.5::double as indicated_deg, 7 as n")
    out = ta.correct(relation, model).read_all()
    assert out["corrected_deg"][0].as_py() == model.correct(90.5)
    assert out["n"][0].as_py() == 7


def test_several_joints_and_named_columns(model):
    pa = pytest.importorskip("pyarrow")
    table = pa.table({"a": ANGLES, "b": ANGLES[::-1]})
    other = made_model(argument="indicated")
    out = ta.correct(table, {"j1": model, "j2": other}, column={"j1": "a", "j2": "b"})
    np.testing.assert_array_equal(out["j1_corrected_deg"], model.correct(ANGLES))
    np.testing.assert_array_equal(out["j2_corrected_deg"], other.correct(ANGLES[::-1]))


def test_dask_arrays_stay_lazy_and_give_the_same_numbers(model):
    da = pytest.importorskip("dask.array")
    lazy = ta.correct(da.from_array(ANGLES, chunks=130), model)
    assert isinstance(lazy, da.Array)
    np.testing.assert_array_equal(lazy.compute(scheduler="threads"), model.correct(ANGLES))


def test_dask_arrays_count_turns_over_blocks():
    da = pytest.importorskip("dask.array")
    model = made_model(ratio=50.5)
    wraps = np.flatnonzero(np.abs(np.diff(ANGLES)) > 180.0) + 1
    chunks = tuple(np.diff([0, *wraps.tolist(), 1000]).tolist())  # borders right at the wrap
    out = ta.correct(da.from_array(ANGLES, chunks=(chunks,)), model).compute(scheduler="threads")
    np.testing.assert_allclose(out, unwrapped_truth(model, ANGLES), rtol=0, atol=1e-10)


def test_dask_frames_stay_lazy_and_give_the_same_numbers(model):
    dd = pytest.importorskip("dask.dataframe")
    pd = pytest.importorskip("pandas")
    frame = dd.from_pandas(pd.DataFrame(columns()), npartitions=4)
    lazy = ta.correct(frame, model)
    assert isinstance(lazy, dd.DataFrame)
    assert lazy["corrected_deg"].dtype == np.float64
    assert len(lazy._meta) == 0
    found = lazy.compute(scheduler="threads")["corrected_deg"]
    np.testing.assert_array_equal(found, model.correct(ANGLES))
    with pytest.raises(ArgumentError, match="rows in order"):
        ta.correct(frame, made_model(ratio=50.5))


@pytest.mark.parametrize("kind", ["float64", "float32", "int64"])
@pytest.mark.parametrize("ratio", [50.0, 50.5])
def test_what_is_lazy_tells_the_type_that_it_gives(ratio, kind):
    """As numpy's: also over blocks that begin, end or consist of missing readings."""
    model = made_model(ratio=ratio)
    angles = np.round(ANGLES).astype(kind)
    if kind != "int64":
        angles[[0, 129, 130, 131, 999]] = np.nan
        angles[390:520] = np.nan
    wanted = ta.correct(angles, model)
    assert wanted.dtype == (np.float32 if kind == "float32" else np.float64)
    da = pytest.importorskip("dask.array")
    lazy = ta.correct(da.from_array(angles, chunks=130), model)
    found = lazy.compute(scheduler="threads")
    assert lazy.dtype == found.dtype == wanted.dtype
    np.testing.assert_array_equal(found, wanted)
    if ratio == 50.0:
        pd, dd = pytest.importorskip("pandas"), pytest.importorskip("dask.dataframe")
        frame = dd.from_pandas(pd.DataFrame({"indicated_deg": angles}), npartitions=4)
        column = ta.correct(frame, model)["corrected_deg"]
        assert column.dtype == column.compute(scheduler="threads").dtype == wanted.dtype
        pl = pytest.importorskip("polars")
        table = ta.correct(pl.LazyFrame({"indicated_deg": angles}), model)
        assert table.collect_schema()["corrected_deg"] == table.collect()["corrected_deg"].dtype
        np.testing.assert_array_equal(table.collect()["corrected_deg"].to_numpy(), wanted)


def test_what_cannot_be_corrected_is_refused(model):
    with pytest.raises(ArgumentError, match="got list"):
        ta.correct([1.0], model)
    with pytest.raises(ArgumentError, match="HarmonicModel or its file, got int"):
        ta.correct(ANGLES, 3)
    pa = pytest.importorskip("pyarrow")
    with pytest.raises(FileError, match="data, line 1: no indicated_deg"):
        ta.correct(pa.table({"x": ANGLES}), model)


def test_series_and_labelled_arrays_keep_what_they_are(model):
    pd, pl = pytest.importorskip("pandas"), pytest.importorskip("polars")
    xr = pytest.importorskip("xarray")
    angles = made_angles(100)
    expected = model.correct(angles)
    series = pd.Series(angles, index=np.arange(100) * 2, name="elbow")
    after = ta.correct(series, model)
    assert (after.name, list(after.index)) == ("elbow", list(series.index))
    np.testing.assert_array_equal(after, expected)
    assert ta.correct(pl.Series("wrist", angles), model).to_list() == expected.tolist()
    time = np.arange(100) / 1e3
    array = xr.DataArray(angles, coords={"time": time}, dims="time", attrs={"units": "deg"})
    after = ta.correct(array, model)
    assert after.attrs == {"units": "deg"}
    np.testing.assert_array_equal(after.time, time)
    np.testing.assert_array_equal(after, expected)
    data = xr.Dataset({"indicated_deg": array, "other": ("time", time)})
    after = ta.correct(data, model)
    assert set(after.data_vars) == {"indicated_deg", "other", "corrected_deg"}
    np.testing.assert_array_equal(after.corrected_deg, expected)
    with pytest.raises(ta.errors.ArgumentError, match="one dimension"):
        ta.correct(xr.Dataset({"indicated_deg": (("a", "b"), np.zeros((2, 2)))}), model)


FOUND = [
    # joint, columns -> column, unit, corrected
    (None, ["t", "indicated_deg"], "indicated_deg", "deg", "corrected_deg"),
    (None, ["a/indicated_rad", "a/t"], "a/indicated_rad", "rad", "a/corrected_rad"),
    ("j3", ["j2_indicated_deg", "j3_indicated_deg"], "j3_indicated_deg", "deg", "j3_corrected_deg"),
    ("j3", ["indicated_turn_j3", "j3_deg"], "indicated_turn_j3", "turn", "corrected_turn_j3"),
    ("j3", ["j3/indicated_deg", "j4/indicated_deg"], "j3/indicated_deg", "deg", "j3/corrected_deg"),
    ("j3", ["j3_rad", "j3"], "j3_rad", "rad", "j3_corrected_rad"),
    ("j3", ["j2", "j3"], "j3", "deg", "j3_corrected_deg"),
]


@pytest.mark.parametrize(("joint", "columns", "name", "unit", "corrected"), FOUND)
def test_found_by_name(joint, columns, name, unit, corrected):
    angle = find_angle_column("log", 360.0, columns, joint=joint)
    assert (angle.name, angle.unit, angle.corrected) == (name, unit, corrected)


REFUSED = [
    ({}, ["a", "b"], "no indicated_deg.*`column=`.*a, b"),
    ({}, ["indicated_deg", "indicated_rad"], "several.*`column=`"),
    ({"joint": "j1"}, ["indicated_deg"], "joint j1.*`column=.*j1.*NAME"),
    ({"joint": "j1"}, ["j1_indicated_deg", "indicated_deg_j1"], "several columns of joint j1"),
    ({"column": "x"}, ["y"], "'x': no such column"),
    ({"column": "x", "unit": "count"}, ["x"], "`counts_per_turn=`"),
    ({}, ["indicated_deg", "corrected_deg"], "corrected before"),
    *(
        ({"column": name, "unit": "turn"}, [name], "holds corrected angles: name the indicated")
        for name in ("corrected_deg", "corrected_rad_j3", "j3_corrected_count", "a/corrected_turn")
    ),
]


@pytest.mark.parametrize(("asked", "columns", "message"), REFUSED)
def test_refused_with_what_to_do(asked, columns, message):
    with pytest.raises(FileError, match=message):
        find_angle_column("log", 360.0, columns, **asked)


def test_signals_of_the_joint_come_before_common_ones():
    columns = ["temperature_C", "j1_temperature_C", "velocity_rad_s"]

    def found(signal, joint):
        return find_joint_signal("log", columns, signal, joint, None)

    assert found("temperature", "j1").name == "j1_temperature_C"
    assert found("temperature", "j2").name == "temperature_C"
    assert found("velocity", "j2").name == "velocity_rad_s"
    assert found("torque", None) is None
    with pytest.raises(FileError, match="'T': no such column"):
        find_joint_signal("log", columns, "temperature", None, ("T", None))
