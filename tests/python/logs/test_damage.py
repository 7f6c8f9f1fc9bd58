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


def test_no_byte_of_a_footer_ends_the_process(tmp_path, model_file):
    """Each larger by one: sizes, codecs, lengths of statistics of numbers and texts."""
    path = tmp_path / "log.parquet"
    texts = [None if i % 7 == 0 else f"s{i % 5}" for i in range(ROWS)]
    pq.write_table(pa.table({"indicated_deg": made_angles(ROWS), "state": texts}), path)
    told = in_a_process(
        """
        import sys, pathlib, trueangle as ta
        path, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
        model, data = ta.load_model(sys.argv[2]), path.read_bytes()
        footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
        for place in range(footer, len(data) - 8):
            path.write_bytes(data[:place] + bytes([(data[place] + 1) % 256]) + data[place + 1 :])
            error = ta.correct_logs(path, model, out).logs[0].error
            print(type(error).__name__)
            out.unlink(missing_ok=True)
        """,
        path,
        model_file,
        tmp_path / "out.parquet",
    ).splitlines()
    assert set(told) == {"FileError", "NoneType"}


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


def _mdf(path):
    asammdf = pytest.importorskip("asammdf")
    times = np.arange(ROWS) / 1e3
    with asammdf.MDF(version="4.11") as mdf:
        mdf.append([asammdf.Signal(made_angles(ROWS), times, name="indicated_deg")])
        mdf.save(path, overwrite=True)
    return path.read_bytes()


def _leading_to(data, block, link, target):
    """The file with one link of a block changed."""
    place = block + 24 + 8 * link
    return data[:place] + int(target).to_bytes(8, "little") + data[place + 8 :]


CORRECTED = """
    import pathlib, resource, sys, trueangle as ta
    resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
    model, out = ta.load_model(sys.argv[1]), pathlib.Path(sys.argv[2])
    for path in sys.argv[3:]:
        error = ta.correct_logs(path, model, out).logs[0].error
        print(type(error).__name__, error, out.exists())
"""

#: A block, one of its links, the kind of block it is made to lead to, and what is said of it.
CIRCLES = (
    (b"##DG", 0, b"##DG", "leads back to that at"),
    (b"##CG", 0, b"##CG", "leads back to that at"),
    (b"##CN", 0, b"##CN", "leads back to that at"),
    (b"##FH", 0, b"##FH", "leads back to that at"),
    (b"##HD", 0, b"##HD", "where there is no DG block"),
    (b"##DG", 1, b"##DG", "where there is no CG block"),
)


def test_blocks_of_mdf_that_lead_in_a_circle_are_refused(tmp_path, model_file):
    """The library would follow them for ever."""
    data = _mdf(tmp_path / "whole.mf4")
    paths = []
    for number, (kind, link, to, _) in enumerate(CIRCLES):
        block = data.index(kind)
        circle = _leading_to(data, block, link, data.index(to))
        if number == 0:  # the library does not look at how many links a block says to have
            circle = circle[: block + 16] + bytes(8) + circle[block + 24 :]
        paths.append(tmp_path / f"log{number}.mf4")
        paths[-1].write_bytes(circle)
    told = in_a_process(CORRECTED, model_file, tmp_path / "out.mf4", *paths).splitlines()
    assert len(told) == len(CIRCLES)
    for line, path, (_, _, _, says) in zip(told, paths, CIRCLES, strict=True):
        assert line.startswith("FileError")
        assert path.name in line
        assert says in line
        assert line.endswith("False")


def test_a_channel_of_mdf_behind_its_record_is_refused(tmp_path, model_file):
    """The library would read memory that is not the file's, or end the process."""
    path = tmp_path / "log.mf4"
    data = _mdf(path)
    for block in range(len(data)):
        if data[block : block + 4] == b"##CN":
            place = block + 24 + 8 * int.from_bytes(data[block + 16 : block + 24], "little") + 4
            offset = int.from_bytes(data[place : place + 4], "little")
            if offset == 8:  # behind the time: the channel of the angle
                data = data[:place] + (4_653_072).to_bytes(4, "little") + data[place + 4 :]
    path.write_bytes(data)
    told = in_a_process(CORRECTED, model_file, tmp_path / "out.mf4", path)
    assert told.startswith("FileError")
    assert "column 'indicated_deg'" in told
    assert "ends behind its record of 16 bytes" in told
