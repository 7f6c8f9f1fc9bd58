"""Columns of Arrow data as numpy arrays, without the imports of pyarrow's own conversion."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
import pyarrow.parquet as pq  # noqa: E402

from trueangle.formats.arrow import BatchRange  # noqa: E402
from trueangle.formats.arrowtables import arrow_numbers, arrow_values, label_codes  # noqa: E402

KINDS = ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"]
KINDS += ["float", "double"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("nulls", [False, True])
@pytest.mark.parametrize(("start", "stop"), [(0, 11), (3, 9), (5, 5), (0, 0)])
def test_values_are_those_of_pyarrow(kind: str, nulls: bool, start: int, stop: int):
    rng = np.random.default_rng(7)
    given = rng.integers(0, 100, 11).tolist()
    if nulls:
        given[4] = given[7] = None
    column = pa.array(given, pa.type_for_alias(kind)).slice(start, stop - start)
    expected = column.to_numpy(zero_copy_only=False)
    found = arrow_values(column)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("rows", [0, 2, 7, 10])
@pytest.mark.parametrize("parts", [1, 3, 4])
def test_parts_of_a_batch_hold_each_row_once(rows: int, parts: int):
    batch = pa.record_batch({"x": np.arange(rows)})
    found = [BatchRange(range(1), part, parts).of(batch)["x"].to_numpy() for part in range(parts)]
    np.testing.assert_array_equal(np.concatenate(found), np.arange(rows))


def test_nothing_but_nulls():
    column = pa.nulls(3, pa.float64())
    assert np.isnan(arrow_values(column)).all()
    assert np.isnan(arrow_numbers("f", "a", column)).all()


def test_labels_with_and_without_nulls():
    found = label_codes(pa.array(["b", None, "a", "b"]))
    assert [found.names[code] for code in found.codes] == ["b", None, "a", "b"]
    assert found.codes.dtype == np.intp
    found = label_codes(pa.array(["b", "a"]))
    assert [found.names[code] for code in found.codes] == ["b", "a"]


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_reading_does_without_pandas(tmp_path: Path, ending: str):
    angle = np.linspace(0.0, 720.0, 30_000)  # a small file of text is read without pyarrow
    table = pa.table({"reference_deg": angle, "indicated_deg": angle + 0.1})
    path = tmp_path / f"log.{ending}"
    if ending == "parquet":
        pq.write_table(table, path)
    else:
        rows = "".join(f"{a},{a + 0.1}\n" for a in angle.tolist())
        path.write_text("reference_deg,indicated_deg\n" + rows)
    script = (
        "import sys, trueangle as ta\n"
        f"assert len(ta.read_runs({str(path)!r})[0]) == 30000\n"
        f"assert ta.fit_logs({str(path)!r}, [1], progress='none').readings == 30000\n"
        "assert 'pyarrow' in sys.modules\n"
        "sys.exit('pandas' in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, env=dict(os.environ))
