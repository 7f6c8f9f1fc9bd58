"""A real Dask cluster of processes: the numbers of one process, also after a lost worker."""

import os
import signal
import threading
import time
from contextlib import nullcontext

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError

from .conftest import made_angles, made_model

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.filterwarnings("default")  # the cluster's own warnings are not ours

FILES = 8
ROWS = 200_000


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for i in range(FILES):
        angles = made_angles(ROWS, turns=5.3, seed=i)
        table = pa.table({"indicated_deg": angles, "reference_deg": angles - 0.1})
        pq.write_table(table, folder / f"{i}.parquet", row_group_size=20_000)
    return folder


@pytest.fixture(scope="module")
def alone(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("alone")
    assert ta.correct_logs(logs, made_model(ratio=50.5), out).is_done
    return tree(out)


def tree(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def cluster(workers):
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        dashboard_address=":0",
        silence_logs=50,
    )


@pytest.fixture(scope="module")
def two():
    """A cluster that no test takes a worker from."""
    with cluster(2) as found:
        yield found


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_any_number_of_workers_gives_the_bytes_of_one_process(workers, two, logs, alone, tmp_path):
    # A model that counts turns: every log must know where the one before stopped.
    model = made_model(ratio=50.5)
    with nullcontext(two) if workers == 2 else cluster(workers) as found:
        address = found.scheduler_address
        report = ta.correct_logs(logs, model, tmp_path / "out", scheduler=address)
        fit = ta.fit_logs(logs, [1, 2, 3], scheduler=address)
    assert report.is_done
    assert tree(tmp_path / "out") == alone
    expected = ta.fit_logs(logs, [1, 2, 3])
    assert fit.model.shafts == expected.model.shafts
    assert fit.model.constant == expected.model.constant
    np.testing.assert_array_equal(fit.covariance, expected.covariance)


def test_a_lost_worker_changes_nothing(logs, alone, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    killed = []
    with cluster(2) as found:
        victim = next(iter(found.workers.values())).pid

        def kill():
            # In the middle: when one log is done and others are being written.
            while not any(out.glob("*.parquet")):
                time.sleep(0.005)
            os.kill(victim, signal.SIGKILL)
            killed.append(len(tree(out)))

        killer = threading.Thread(target=kill, daemon=True)
        killer.start()
        report = ta.correct_logs(
            logs, made_model(ratio=50.5), out, scheduler=found.scheduler_address
        )
        killer.join(timeout=10)
    assert killed
    assert killed[0] < FILES
    assert report.is_done, [log.error for log in report.logs]
    assert tree(out) == alone


def test_a_damaged_log_fails_alone_and_the_rest_resumes(two, logs, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(3):
        data = (logs / f"{i}.parquet").read_bytes()
        (folder / f"{i}.parquet").write_bytes(data[:-100] if i == 1 else data)
    address = two.scheduler_address
    report = ta.correct_logs(folder, made_model(), tmp_path / "out", scheduler=address)
    assert [log.status for log in report.logs] == ["done", "failed", "done"]
    assert "1.parquet" in str(report.logs[1].error)
    (folder / "1.parquet").write_bytes((logs / "1.parquet").read_bytes())
    report = ta.correct_logs(folder, made_model(), tmp_path / "out", scheduler=address)
    assert [log.status for log in report.logs] == ["done before", "done", "done before"]


def test_no_scheduler_is_one_clear_error(logs, tmp_path, monkeypatch):
    monkeypatch.setattr("trueangle.logs.cluster._TIMEOUT", 1)
    with pytest.raises(ArgumentError, match="no Dask scheduler answers"):
        ta.correct_logs(logs, made_model(), tmp_path / "out", scheduler="tcp://127.0.0.1:9")
