"""Parquet as LeRobot data sets have it: joints as elements of a column, an episode a run."""

import datetime

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.formats.formats import find_format

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

ROWS, JOINTS = 120, 6
STATE = np.random.default_rng(5).uniform(-1.0, 1.0, (ROWS, JOINTS)).astype(np.float32)
TRUE = np.tile(np.linspace(0.0, 2.0 * np.pi, ROWS // 2), 2)
STATE[:, 3] = TRUE + 0.01 * np.sin(TRUE)
SIGNALS = {
    "indicated": ("observation.state[3]", "rad"),
    "reference": ("observation.laser", "rad"),
    "time": ("timestamp", "s"),
    "run": "episode_index",
}
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])


def table(kind):
    states = pa.array(STATE.tolist(), kind)
    episode = np.arange(ROWS) // (ROWS // 2)
    return pa.table(
        {
            "observation.state": states,
            "action": states,
            "observation.laser": TRUE,
            "timestamp": np.tile(np.arange(ROWS // 2) / 30.0, 2).astype(np.float32),
            "episode_index": episode,
            "next.done": np.arange(ROWS) == ROWS - 1,
            "task": ["pick"] * ROWS,
        }
    )


def written(path, kind, **options):
    if path.suffix == ".arrow":
        with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, table(kind).schema) as to:
            to.write_table(table(kind), max_chunksize=50)
    else:
        pq.write_table(table(kind), path, row_group_size=50, **options)
    return path


LISTS = {"fixed": pa.list_(pa.float32(), JOINTS), "any": pa.list_(pa.float32())}


@pytest.mark.parametrize(
    ("name", "lists"), [("a.parquet", "fixed"), ("a.parquet", "any"), ("a.arrow", "fixed")]
)
def test_an_element_is_read_and_corrected(name, lists, tmp_path):
    path = written(tmp_path / name, LISTS[lists])
    first, second = ta.read_runs(path, signals=SIGNALS)
    assert (first.label, second.label) == ("0", "1")
    np.testing.assert_array_equal(np.r_[first.indicated, second.indicated], STATE[:, 3])
    np.testing.assert_array_equal(first.columns["action[5]"], STATE[: ROWS // 2, 5])
    summed = ta.fit_logs(path, [1], signals=SIGNALS)
    held = ta.fit([first, second], [1])
    np.testing.assert_allclose(summed.model.amplitudes, held.model.amplitudes, rtol=1e-9)
    wanted = {"indicated": SIGNALS["indicated"]}
    report = ta.correct_logs(path, MODEL, tmp_path / f"out{path.suffix}", signals=wanted)
    assert report.is_done, report.logs[0].error
    if path.suffix == ".parquet":
        after = pq.read_table(tmp_path / "out.parquet")
        assert after.column_names == [*table(LISTS[lists]).column_names, "corrected_rad"]
        assert after.drop_columns("corrected_rad").equals(table(LISTS[lists]))
        assert after.schema.field("corrected_rad").type == pa.float32()
        found = after["corrected_rad"].to_numpy()
        np.testing.assert_array_equal(found, MODEL.correct(STATE[:, 3]))


def test_lists_that_differ_in_length(tmp_path):
    states = [[1.0, 2.0], [1.0], None, [3.0, 4.0]]
    plain = {"reference_deg": np.arange(4.0), "state": states}
    pq.write_table(pa.table(plain), tmp_path / "a.parquet")
    with pytest.raises(FileError, match=r"a.parquet.*out of bounds"):
        ta.read_runs(tmp_path / "a.parquet", signals={"indicated": ("state[1]", "deg")})
    with pytest.raises(FileError, match=r"column 'state\[2\]': several columns may be"):
        ta.read_runs(tmp_path / "a.parquet", signals={"indicated": ("state[2]", "deg")})


def test_lists_of_any_length_are_no_columns_of_arrow_files(tmp_path):
    """No length is told before the rows are read; of fixed ones it is that of the type."""
    for kind, count in (("fixed", JOINTS), ("any", 0)):
        names = find_format(written(tmp_path / "a.arrow", LISTS[kind])).module.columns(
            tmp_path / "a.arrow"
        )
        for name in ("observation.state", "action"):
            assert [n for n in names if n.startswith(name)] == [
                f"{name}[{i}]" for i in range(count)
            ]


def test_times_and_truth_values_beside_the_angles(tmp_path):
    start = datetime.datetime(2026, 11, 21, 23, 59, tzinfo=datetime.UTC)
    stamps = [start + datetime.timedelta(seconds=5 * i) for i in range(24)]
    angle = np.arange(24) * 15.0
    columns = {"stamp": stamps, "is_cold": angle < 90.0, "reference_deg": angle}
    pq.write_table(pa.table({**columns, "indicated_deg": angle}), tmp_path / "a.parquet")
    (run,) = ta.read_runs(tmp_path / "a.parquet", signals={"time": "stamp"})
    np.testing.assert_array_equal(np.diff(run.time), 5.0)
    assert run.columns["is_cold"].sum() == 6
    runs = ta.read_runs(tmp_path / "a.parquet", signals={"when": "stamp"})
    assert [(len(run), run.when[:10]) for run in runs] == [(12, "2026-11-21"), (12, "2026-11-22")]
