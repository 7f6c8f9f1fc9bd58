"""Correct an MCAP bag and a Parquet log of the same two joints: CPU seconds for each byte.

    python benches/bags.py [--messages 200000]

Both in turns in one process, medians; the first round of each is left out (imports).
"""

from __future__ import annotations

import argparse
import resource
import shutil
import statistics
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import trueangle as ta

JOINTS = ("elbow", "wrist")
KIND = "sensor_msgs/msg/JointState"


def made(folder: Path, messages: int) -> dict[str, Path]:
    rng = np.random.default_rng(0)
    angles = np.mod(np.cumsum(rng.uniform(0.0, 0.002, (messages, 2)), 0), 2.0 * np.pi)
    columns = {f"{joint}_indicated_rad": angles[:, j] for j, joint in enumerate(JOINTS)}
    pq.write_table(pa.table(columns), folder / "joints.parquet")
    store = get_typestore(Stores.LATEST)
    kinds = store.types
    time, header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/joint_states", KIND, typestore=store)
        for i, position in enumerate(angles):
            state = kinds[KIND](
                header=header(stamp=time(sec=i // 1000, nanosec=i % 1000 * 10**6), frame_id="base"),
                name=list(JOINTS),
                position=position,
                velocity=np.zeros(2),
                effort=np.zeros(2),
            )
            writer.write(topic, i * 10**6, store.serialize_cdr(state, KIND))
    return {"Parquet": folder / "joints.parquet", "MCAP": folder / "bag"}


def cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=200_000)
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1, 2], [1e-3, 0.0], [0.0, 2e-3])])
    models = dict.fromkeys(JOINTS, model)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = made(folder, args.messages)
        seconds: dict[str, list[float]] = {kind: [] for kind in logs}
        for _ in range(args.repeat + 1):
            for kind, path in logs.items():
                out = folder / f"corrected{path.suffix}"
                start = cpu()
                columns = {joint: joint for joint in JOINTS} if kind == "MCAP" else None
                ta.correct_logs(path, models, out, column=columns)
                seconds[kind].append(cpu() - start)
                shutil.rmtree(out) if out.is_dir() else out.unlink()
        per_byte = {}
        for kind, path in logs.items():
            files = path.rglob("*") if path.is_dir() else [path]
            size = sum(file.stat().st_size for file in files)
            per_byte[kind] = statistics.median(seconds[kind][1:]) / size
            print(f"{kind:8s} {size:12d} bytes {1e9 * per_byte[kind]:8.1f} ns a byte")
        print(f"MCAP over Parquet, a byte: {per_byte['MCAP'] / per_byte['Parquet']:.1f}")


if __name__ == "__main__":
    main()
