"""Damaged Parquet and Arrow logs are refused in one line: they never end the process."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import trueangle as ta

from .conftest import made_angles

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

ROWS = 200


def in_a_process(script, *arguments):
    """What the script prints; a crash of the library is a failure of this process only."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_offsets_beyond_their_texts_are_refused(tmp_path, model_file):
    """Two offsets of a text column: kernels would read where nothing is."""
    texts = [f"state {i:03d}" for i in range(ROWS)]
    table = pa.table({"indicated_deg": made_angles(ROWS), "state": texts})
    path = tmp_path / "log.arrow"
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table)
    offsets = np.arange(ROWS + 1, dtype="<i4") * 9
    data = path.read_bytes()
    start = data.index(offsets.tobytes())
    offsets[100:102] = 0x7FFFFFF0, 0x7FFFFFF8
    path.write_bytes(data[:start] + offsets.tobytes() + data[start + offsets.nbytes :])
    told = in_a_process(
        """
        import sys, trueangle as ta
        report = ta.correct_logs(sys.argv[1], ta.load_model(sys.argv[2]), sys.argv[3])
        print(type(report.logs[0].error).__name__, report.logs[0].error)
        """,
        path,
        model_file,
        tmp_path / "out.arrow",
    )
    assert told.startswith("FileError")
    assert "log.arrow" in told
    assert not (tmp_path / "out.arrow").exists()


def test_codecs_that_are_none_are_refused(tmp_path, model_file):
    """Every byte of the footer that may be a codec, in turn, as one that Parquet has not."""
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({"indicated_deg": made_angles(ROWS)}), path, compression="snappy")
    told = in_a_process(
        """
        import sys, pathlib, trueangle as ta
        path, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
        model, data = ta.load_model(sys.argv[2]), path.read_bytes()
        footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
        for place in range(footer, len(data) - 8):
            if data[place] == 2:  # snappy, as Thrift writes it
                path.write_bytes(data[:place] + bytes([18]) + data[place + 1 :])
                error = ta.correct_logs(path, model, out).logs[0].error
                print(type(error).__name__, error)
                out.unlink(missing_ok=True)
        """,
        path,
        model_file,
        tmp_path / "out.parquet",
    ).splitlines()
    assert len(told) > 3
    assert all(line.startswith(("FileError", "NoneType")) for line in told)
    assert any("codec" in line for line in told)


def test_whole_logs_are_read(tmp_path, model):
    """The checks refuse nothing that is whole: texts, dictionaries, nulls."""
    texts = pa.array([None if i % 7 == 0 else f"s{i % 5}" for i in range(ROWS)])
    columns = {"indicated_deg": made_angles(ROWS), "a": texts, "b": texts.dictionary_encode()}
    table = pa.table(columns)
    with pa.ipc.new_file(tmp_path / "log.arrow", table.schema) as writer:
        writer.write_table(table)
    report = ta.correct_logs(tmp_path / "log.arrow", model, tmp_path / "out.arrow")
    assert report.logs[0].error is None
    with pa.memory_map(str(tmp_path / "out.arrow")) as source:
        assert pa.ipc.open_file(source).read_all().column("a").equals(table.column("a"))
