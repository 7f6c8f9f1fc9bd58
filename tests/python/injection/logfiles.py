"""A small log of every format that can be corrected, of one joint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROWS = 40


class LogFormat(NamedTuple):
    """Name of its file or folder, the modules it needs, and what writes it.

    ``write`` takes the path and angles in degrees; ``more`` are arguments of ``correct``.
    """

    file: str
    modules: tuple[str, ...]
    write: Callable[[Path, Any], None]
    more: tuple[str, ...] = ()

    @property
    def is_folder(self) -> bool:
        """A bag that is a folder."""
        return "." not in self.file


def made_log(name: str, folder: Path) -> tuple[str, ...]:
    """Write the log of a format into ``folder``; further arguments of ``correct``."""
    entry = FORMATS[name]
    angles = np.random.default_rng(11).uniform(0.0, 360.0, ROWS)
    entry.write(folder / entry.file, angles)
    return entry.more


def _csv(path: Path, angles: Any) -> None:
    path.write_text("indicated_deg\n" + "".join(f"{x:.9f}\n" for x in angles))


def _bare_csv(path: Path, angles: Any) -> None:
    path.write_text("".join(f"{i},{x:.9f}\n" for i, x in enumerate(angles)))


def _parquet(path: Path, angles: Any) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"indicated_deg": angles}), path)


def _arrow(path: Path, angles: Any) -> None:
    import pyarrow as pa

    table = pa.table({"indicated_deg": angles})
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, table.schema) as writer:
        writer.write_table(table)


def _hdf5(path: Path, angles: Any) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["indicated_deg"] = angles


def _matlab(path: Path, angles: Any) -> None:
    from scipy.io import savemat

    savemat(path, {"indicated_deg": angles[:, None]})


def _npy(path: Path, angles: Any) -> None:
    np.save(path, np.column_stack([np.arange(ROWS, dtype=np.float64), angles]))


def _records(path: Path, angles: Any) -> None:
    made = np.zeros(ROWS, dtype=[("indicated_deg", "<f8")])
    made["indicated_deg"] = angles
    np.save(path, made)


def _npz(path: Path, angles: Any) -> None:
    np.savez(path, indicated_deg=angles)


def _mdf(path: Path, angles: Any) -> None:
    from asammdf import MDF, Signal

    with MDF() as mdf:
        times = np.arange(ROWS) / 100.0
        mdf.append([Signal(angles, times, name="indicated_deg")])
        mdf.save(path, overwrite=True)


def _messages(writer: Any, angles: Any, is_ros1: bool) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)
    kind = "sensor_msgs/msg/JointState"
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    connection = writer.add_connection("/joint_states", kind, typestore=store)
    for i, angle in enumerate(np.radians(angles)):
        extra = {"seq": i} if is_ros1 else {}
        state = store.types[kind](
            header=header(stamp=time(sec=i, nanosec=0), frame_id="base", **extra),
            name=["elbow"],
            position=np.array([angle]),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )
        data = (store.serialize_ros1 if is_ros1 else store.serialize_cdr)(state, kind)
        writer.write(connection, 10 * i, data)


def _ros1(path: Path, angles: Any) -> None:
    from rosbags import rosbag1

    with rosbag1.Writer(path) as writer:
        _messages(writer, angles, True)


def _ros2(storage: str) -> Callable[[Path, Any], None]:
    def write(path: Path, angles: Any) -> None:
        from rosbags import rosbag2

        folder = path.with_name("made") if path.suffix else path
        plugin = rosbag2.StoragePlugin[storage]
        with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
            _messages(writer, angles, False)
        if path.suffix:
            import shutil

            (made,) = folder.glob(f"*{path.suffix}")
            made.rename(path)
            shutil.rmtree(folder)

    return write


_REPLACED = ("--column", "elbow", "--output-topic", "/joint_states")

FORMATS = {
    "CSV": LogFormat("a.csv", (), _csv),
    "CSV without names": LogFormat("a.csv", (), _bare_csv, ("--column", "column2")),
    "Parquet": LogFormat("a.parquet", ("pyarrow",), _parquet),
    "Arrow": LogFormat("a.arrow", ("pyarrow",), _arrow),
    "HDF5": LogFormat("a.h5", ("h5py",), _hdf5),
    "MATLAB": LogFormat("a.mat", ("scipy",), _matlab),
    "numpy array": LogFormat("a.npy", (), _npy, ("--column", "column2", "--unit", "deg")),
    "numpy records": LogFormat("a.npy", (), _records),
    "numpy archive": LogFormat("a.npz", (), _npz),
    "MDF4": LogFormat("a.mf4", ("asammdf",), _mdf),
    "ROS 1": LogFormat("a.bag", ("rosbags",), _ros1, _REPLACED),
    "sqlite3": LogFormat("a.db3", ("rosbags",), _ros2("SQLITE3"), _REPLACED),
    "MCAP": LogFormat("a.mcap", ("rosbags",), _ros2("MCAP"), _REPLACED),
    "bag folder, sqlite3": LogFormat("bag", ("rosbags",), _ros2("SQLITE3"), _REPLACED),
    "bag folder, MCAP": LogFormat("bag", ("rosbags",), _ros2("MCAP"), _REPLACED[:2]),
}
