"""Memory of readers, measured in processes of their own: a number, whatever the file holds."""

import subprocess
import sys

import numpy as np
import pytest

import trueangle as ta

from .conftest import made_model

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

#: MiB above what the imports take: the figure of docs/large-logs.md.
ALLOWED = 300

MEASURE = """
import sys
import trueangle as ta, trueangle.logs.batch, trueangle.logs.fitting, numpy
import pyarrow, pyarrow.parquet, pyarrow.csv, pyarrow.compute
import trueangle.formats.parquet, trueangle.formats.csvfile
def peak():  # of this process: that of getrusage is handed down by the one that started it
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024
before = peak()
job, log, model, output = sys.argv[1:]
if job == "correct":
    report = ta.correct_logs(log, model, output)
    assert report.is_done, report.logs[0].error
else:
    ta.fit_logs(log, [1])
print(peak() - before)
"""


def added(job, log, tmp_path):
    """Peak of memory above the imports, MiB."""
    model = tmp_path / "model.json"
    made_model().save(model)
    output = tmp_path / f"out{log.suffix}"
    command = [sys.executable, "-c", MEASURE, job, str(log), str(model), str(output)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    print(job, log.name, done.stdout.strip(), "MiB")
    return float(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory by /proc")
@pytest.mark.parametrize("job", ["correct", "fit"])
def test_one_row_group_that_decodes_to_gigabytes(job, tmp_path):
    rows = 3_000_000
    theta = np.mod(np.arange(rows), 360.0)
    labels = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(rows, dtype=np.int32)), pa.array(["x" * 1000])
    )
    columns = {
        "run": labels.cast(pa.dictionary(pa.int32(), pa.large_string())),
        "reference_deg": theta,
        "indicated_deg": theta + 0.25,
    }
    path = tmp_path / "log.parquet"
    table = pa.table(columns)
    writer = pq.ParquetWriter(path, table.schema, compression="zstd", store_schema=False)
    with writer:
        writer.write_table(table, row_group_size=rows)
    assert path.stat().st_size < 10 << 20  # and 3 GB in memory
    if job == "correct":
        path = _fewer(path, tmp_path)
    assert added(job, path, tmp_path) < ALLOWED


def _fewer(path, tmp_path):
    """The first 200 000 rows: decoded, 200 MB of text are written too."""
    table = pq.read_table(path, columns=["run", "indicated_deg"], read_dictionary=["run"])
    shorter = tmp_path / "short.parquet"
    pq.write_table(table.slice(0, 200_000), shorter, store_schema=False, compression="zstd")
    return shorter


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory by /proc")
def test_a_text_file_of_half_a_gigabyte_of_cells(tmp_path):
    rows, width = 40_000, 4_000
    path = tmp_path / "log.csv"
    with path.open("w") as file:
        file.write("indicated_deg,note\n")
        for start in range(0, rows, 1000):
            file.write("".join(f"{i % 360},{'y' * width}\n" for i in range(start, start + 1000)))
    assert added("correct", path, tmp_path) < ALLOWED
    path.unlink()
    (tmp_path / "out.csv").unlink()


def test_a_plain_reader_knows_nothing_of_joints():
    """Formats lie below joints and models: their modules import none of them."""
    import ast
    from pathlib import Path

    folder = Path(ta.__file__).parent / "formats"
    for file in folder.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 2:
                room = (node.module or "").partition(".")[0]
                assert room in {"_core", "errors", "support"}, (file.name, node.module)
