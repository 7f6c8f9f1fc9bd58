"""What is fuzzed: for each loader its seeds, how they are damaged, and what must hold."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import random
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import trueangle as ta
from mutation import NASTY, mutated_bytes, mutated_document, mutated_table
from trueangle.errors import TrueAngleError
from trueangle.logs.manifest import Manifest

#: Readings of the small files that are damaged.
_ROWS = 40


@dataclass(frozen=True)
class Loader:
    """One kind of file.

    ``make`` writes a damaged file below a folder and returns it; ``use`` loads it and
    raises `AssertionError` where an accepted file holds what it must not.
    """

    name: str
    make: Callable[[Path, random.Random], Path]
    use: Callable[[Path], None]


# -- models ---------------------------------------------------------------------------


def _models(folder: Path) -> list[Any]:
    shafts = [
        ta.Shaft("output", 1, [1, 3], [0.1, 0.0], [0.4, -0.05]),
        ta.Shaft("motor", 50.5, [1, 2], [0.002, 0.0], [0.003, 0.001]),
    ]
    terms = [
        ta.Backlash(0.01),
        ta.ThermalDrift(zero_per_K=0.001, pattern_per_K=0.01),
        ta.TorsionalCompliance(0.01),
        ta.Latency(0.001),
    ]
    found = []
    for model in (
        ta.HarmonicModel(shafts[:1], 0.2, 360.0, covariance=np.eye(5) * 1e-6),
        ta.HarmonicModel(shafts, 0.2, 360.0, argument="indicated"),
        ta.HarmonicModel(shafts, 0.2, 360.0, terms=terms),
    ):
        file = folder / "seed.json"
        model.save(file)
        found.append(json.loads(file.read_text()))
    theta = np.arange(0.0, 200.0, 3.0)
    error = 0.5 * np.sin(np.radians(theta))
    run = ta.CalibrationRun(theta, theta + error, period=360.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ta.fit([run, run], orders=[1]).model.save(folder / "seed.json")
    found.append(json.loads((folder / "seed.json").read_text()))
    return found


def _json(document: Any, rng: random.Random) -> bytes:
    text = json.dumps(document)
    action = rng.random()
    if action < 0.1:  # keys that appear twice
        at = text.find("{", rng.randrange(len(text)))
        if at >= 0:
            pair = '"period": 1, '
            text = text[: at + 1] + pair * rng.choice((1, 2, 3000)) + text[at + 1 :]
    elif action < 0.2:
        return mutated_bytes(text.encode(), rng)
    elif action < 0.22:
        text = "[" * rng.choice((10, 100_000)) + text
    return text.encode("utf-8", "surrogatepass")


def _make_model(folder: Path, rng: random.Random) -> Path:
    path = folder / "model.json"
    path.write_bytes(
        _json(mutated_document(rng.choice(_seeds("model", _models, folder)), rng), rng)
    )
    return path


def _use_model(path: Path) -> None:
    model = ta.load_model(path)
    angles = np.linspace(-2.0, 3.0, 41) * model.period
    given: Any = {
        "velocity": 0.01 * model.period,
        "temperature": 25.0,
        "torque": 1.0,
        "direction": 1.0,
    }
    quarter = 0.25 * model.period  # of another joint
    signals = {name: given.get(name, quarter) for name in model.uses_signals}
    error = model.error(angles, **signals)
    assert np.isfinite(error).all(), "an accepted model whose error is not finite"
    try:
        corrected = model.correct(angles, **signals)
    except ta.errors.NotInvertibleError:
        return
    assert np.isfinite(corrected).all(), "an accepted model whose correction is not finite"


# -- simulations ----------------------------------------------------------------------

_SIMULATION: dict[str, Any] = {
    "joint": {
        "gear_ratio": 100.0,
        "fixed_member": "circular_spline",
        "encoder_side": "motor",
        "pole_pairs": 1,
    },
    "harmonic": [
        {"shaft": "output", "order": 1, "amplitude_arcsec": 14.1, "phase_deg": 243.75},
        {"shaft": "wave_generator", "order": 2, "amplitude_arcsec": 33.0, "phase_deg": 10.0},
    ],
    "effect": [
        {"kind": "backlash", "half_width_arcsec": 3.0},
        {"kind": "latency", "delay_s": 0.001},
        {"kind": "thermal_drift", "zero_arcsec_per_K": 1.0},
        {"kind": "local_defect", "place_deg": 30.0, "width_deg": 2.0, "height_arcsec": 20.0},
    ],
    "noise": {"sigma_arcsec": 2.0},
    "run": [
        {"label": "fwd", "direction": 1, "speed_deg_s": 5.0, "samples": 30, "turns": 1.0},
        {"direction": -1, "samples": 20, "reversals": [0.5], "mount_deg": 30.0},
    ],
}


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    return "1979-05-27" if value is None else repr(value)


def _make_simulation(folder: Path, rng: random.Random) -> Path:
    made = mutated_document(_SIMULATION, rng)
    if isinstance(made, dict):
        text = "".join(f"{json.dumps(name)} = {_toml(value)}\n" for name, value in made.items())
    else:
        text = _toml(made)
    data = text.encode("utf-8", "surrogatepass")
    path = folder / "joint.toml"
    path.write_bytes(mutated_bytes(data, rng) if rng.random() < 0.15 else data)
    return path


def _use_simulation(path: Path) -> None:
    sim = ta.load_simulation(path)
    if sim.runs and sum(design.samples for design in sim.runs) <= 100_000:
        for run in ta.simulate(sim, seed=1):
            assert np.isfinite(run.indicated).all(), "simulated readings that are not finite"


# -- manifests ------------------------------------------------------------------------


def _manifest(folder: Path) -> Any:
    (folder / "log.csv").write_text("indicated_deg\n1\n2\n")
    model = ta.HarmonicModel([ta.Shaft("m", 1.5, [1], [0.0], [0.1])], 0.0, 360.0)
    (folder / "b.csv").write_text("indicated_deg\n1\n2\n")
    ta.correct_logs([folder / "log.csv", folder / "b.csv"], model, folder / "out")
    lines = (folder / "out" / "trueangle-manifest.jsonl").read_text().split("\n")
    return [json.loads(line) for line in lines if line]


def _make_manifest(folder: Path, rng: random.Random) -> Path:
    seeds = _seeds("manifest", _manifest, folder)
    lines = [_json(mutated_document(entry, rng), rng) for entry in seeds]
    (folder / "resumed").mkdir(exist_ok=True)
    path = folder / "resumed" / "trueangle-manifest.jsonl"
    path.write_bytes(b"\n".join(lines))
    return path


def _use_manifest(path: Path) -> None:
    with Manifest(path.parent).opened() as manifest:
        for name, entry in manifest._entries.items():
            if len(name) < 200:  # outputs are named by logs, never by the manifest
                log = path.parent.parent / "log.csv"
                manifest.done(log, path.parent / name, entry["settings"])


# -- runs and logs --------------------------------------------------------------------


def _columns() -> dict[str, Any]:
    theta = np.linspace(0.0, 350.0, _ROWS)
    return {
        "run": ["a"] * (_ROWS // 2) + ["b"] * (_ROWS - _ROWS // 2),
        "time_s": (np.arange(_ROWS) * 0.125).tolist(),
        "reference_deg": theta.tolist(),
        "indicated_deg": (theta + 0.25 * np.sin(np.radians(theta))).tolist(),
        "note": [f"n{i % 3}" for i in range(_ROWS)],
    }


def _make_csv(folder: Path, rng: random.Random) -> Path:
    columns = _columns()
    rows = [list(columns), *([str(v) for v in row] for row in zip(*columns.values(), strict=True))]
    path = folder / "runs.csv"
    path.write_bytes(mutated_table(rows, rng))
    return path


def _use_runs(path: Path) -> None:
    for run in ta.read_runs(path):
        assert np.isfinite(run.reference).all()
        assert np.isfinite(run.indicated).all()


_MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.0, 360.0)


def _use_log(path: Path) -> None:
    output = path.with_name(f"corrected{path.suffix}")
    result = ta.correct_logs(path, _MODEL, output)
    error = result.logs[0].error
    if error is not None:
        raise error


def _arrow_table(rng: random.Random) -> Any:
    import pyarrow as pa

    columns = {name: pa.array(values) for name, values in _columns().items()}
    kinds = (
        pa.bool_(),
        pa.string(),
        pa.large_string(),
        pa.binary(),
        pa.float16(),
        pa.float32(),
        pa.int8(),
        pa.uint64(),
        pa.decimal128(38, 3),
        pa.timestamp("ns"),
        pa.date32(),
        pa.null(),
        pa.list_(pa.float64()),
        pa.struct([("x", pa.float64())]),
        pa.dictionary(pa.int32(), pa.string()),
        pa.dictionary(pa.int8(), pa.float64()),
    )
    for _ in range(rng.choice((0, 1, 1, 2))):
        name = rng.choice(list(columns))
        kind = rng.choice(kinds)
        try:
            columns[name] = columns[name].cast(kind)
        except (pa.ArrowException, NotImplementedError):
            values = [
                None if v is None else rng.choice((None, v)) for v in columns[name].to_pylist()
            ]
            columns[name] = pa.nulls(_ROWS, kind) if rng.random() < 0.5 else pa.array(values)
    names = [rng.choice((n, n, n, n, n, n, "", "a/b", "reference_rad")) for n in columns]
    return pa.table(list(columns.values()), names=names)


def _make_parquet(folder: Path, rng: random.Random) -> Path:
    import pyarrow.parquet as pq

    path = folder / "runs.parquet"
    try:
        pq.write_table(
            _arrow_table(rng),
            path,
            row_group_size=rng.choice((1, 7, 100)),
            compression=rng.choice(("none", "snappy", "zstd")),
            use_dictionary=rng.random() < 0.5,
        )
    except Exception:
        pq.write_table(_arrow_table(random.Random(0)), path)
    return _damaged(path, rng)


def _make_arrow(folder: Path, rng: random.Random) -> Path:
    import pyarrow as pa

    path = folder / "log.arrow"
    table = _arrow_table(rng)
    new = rng.choice((pa.ipc.new_file, pa.ipc.new_stream))
    with pa.OSFile(str(path), "wb") as file, new(file, table.schema) as writer:
        writer.write_table(table, max_chunksize=rng.choice((1, 16, 100)))
    return _damaged(path, rng)


def _make_hdf5(folder: Path, rng: random.Random) -> Path:
    import h5py

    path = folder / "log.h5"
    with h5py.File(path, "w") as file:
        for name, values in _columns().items():
            data = np.array(values, dtype="S8" if isinstance(values[0], str) else float)
            if rng.random() < 0.15:
                data = rng.choice((data[:5], data[:, None], data.reshape(2, -1), data[0]))
            if rng.random() < 0.1 and data.dtype.kind == "f":
                data = data.astype(rng.choice((">f4", "<i2", "complex128", "float16")))
            file.create_dataset(rng.choice((name, name, name, f"g/{name}")), data=data)
    return _damaged(path, rng)


def _make_npz(folder: Path, rng: random.Random) -> Path:
    path = folder / "log.npz"
    wanted = rng.choice(list(_columns())), rng.randrange(3), rng.random() < 0.5

    def made(folder: Path) -> bytes:
        name, shape, compressed = wanted
        columns = {name: np.array(values) for name, values in _columns().items()}
        columns[name] = (columns[name], columns[name][:5], columns[name][:, None])[shape]
        (np.savez_compressed if compressed else np.savez)(path, **columns)
        return path.read_bytes()

    path.write_bytes(_seeds(f"npz {wanted}", made, folder))
    return _damaged(path, rng)


def _make_npy(folder: Path, rng: random.Random) -> Path:
    path = folder / "log.npy"
    wanted = rng.choice(("run", "note")), rng.randrange(3)

    def made(folder: Path) -> bytes:
        without, kind = wanted
        columns = {k: np.array(v) for k, v in _columns().items() if k != without}
        table = np.empty(_ROWS, dtype=[(name, values.dtype) for name, values in columns.items()])
        for name, values in columns.items():
            table[name] = values
        np.save(path, (table, columns["indicated_deg"], np.eye(4))[kind])
        return path.read_bytes()

    path.write_bytes(_seeds(f"npy {wanted}", made, folder))
    return _damaged(path, rng)


def _make_matlab(folder: Path, rng: random.Random) -> Path:
    from scipy.io import savemat

    path = folder / "log.mat"
    wanted = rng.random() < 0.5, rng.random() < 0.5

    def made(folder: Path) -> bytes:
        inside, compressed = wanted
        columns = {name: np.array(values) for name, values in _columns().items()}
        nested = {"rig": columns, "indicated_deg": columns["indicated_deg"]}
        savemat(path, nested if inside else columns, do_compression=compressed)
        return path.read_bytes()

    path.write_bytes(_seeds(f"matlab {wanted}", made, folder))
    return _damaged(path, rng)


def _make_mdf(folder: Path, rng: random.Random) -> Path:
    from asammdf import MDF, Signal

    def made(folder: Path) -> bytes:
        columns = _columns()
        times = np.array(columns["time_s"])
        signals = [
            Signal(np.array(columns[name]), times, name=name)
            for name in ("reference_deg", "indicated_deg")
        ]
        with MDF(version="4.10") as mdf:
            mdf.append(signals)
            mdf.save(folder / "seed.mf4", overwrite=True)
        return (folder / "seed.mf4").read_bytes()

    path = folder / "log.mf4"
    path.write_bytes(_seeds("mdf", made, folder))
    return _damaged(path, rng, always=True)


def _make_bag(ending: str) -> Callable[[Path, random.Random], Path]:
    def made(folder: Path) -> bytes:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC if ending == ".bag" else Stores.LATEST)
        kinds = store.types
        state_kind = "sensor_msgs/msg/JointState"
        path = folder / f"seed{ending}"
        if ending == ".bag":
            writer: Any = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if ending == ".mcap" else StoragePlugin.SQLITE3
            writer = Writer(path, version=9, storage_plugin=plugin)
        with writer:
            connection = writer.add_connection("/joint_states", state_kind, typestore=store)
            for i in range(8):
                stamp = kinds["builtin_interfaces/msg/Time"](sec=i, nanosec=0)
                more = {"seq": i} if ending == ".bag" else {}
                header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="", **more)
                position = np.array([0.1 * i, 0.2])
                empty = np.array([])
                state = kinds[state_kind](header, ["indicated_rad", "b"], position, empty, empty)
                write = store.serialize_ros1 if ending == ".bag" else store.serialize_cdr
                writer.write(connection, i * 1000, write(state, state_kind))
        if path.is_dir():
            (path,) = (p for p in path.iterdir() if p.name != "metadata.yaml")
        return path.read_bytes()

    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"log{ending}"
        path.write_bytes(_seeds(f"bag{ending}", made, folder))
        return _damaged(path, rng, always=True)

    return make


# -- formats of which one small file is damaged: a line each --------------------------


def _numbered(form: str, **more: Any) -> bytes:
    """Rows of a text, of the columns by name."""
    columns = _columns() | more
    rows = zip(*columns.values(), strict=True)
    return "\n".join(form.format(**dict(zip(columns, row, strict=True))) for row in rows).encode()


def _guided(folder: Path) -> bytes:
    head = (
        "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-11-20 22:00:00\n\n"
        "Guiding Begins at 2026-11-20 22:10:00\nPixel scale = 1.50 arc-sec/px\n"
        "Mount = EQ, xAngle = 30.0, xRate = 3.750\nRA = 5.00 hr, Dec = 40.0 deg\n"
        "Lock position = 500.000, 400.000\n"
        "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RADuration,RADirection,SNR\n"
    )
    row = '1,{time_s},"Mount",0.1,0.2,{indicated_deg},0.1,120,W,45.6'
    middle = b"\nINFO: DITHER by 1.0, 2.0, new lock pos = 501.000, 402.000\n"
    settled = b"INFO: SETTLING STATE CHANGE, Settling complete\n"
    return head.encode() + _numbered(row) + middle + settled + _numbered(row)


def _matlab4(folder: Path) -> bytes:
    from scipy.io import savemat

    columns = {k: np.array(v) for k, v in _columns().items() if k not in ("run", "note")}
    savemat(folder / "seed4.mat", columns, format="4")
    return (folder / "seed4.mat").read_bytes()


def _robot(folder: Path) -> bytes:
    from trueangle.formats import wpilog

    columns = _columns()
    parts = [b"WPILOG\x00\x01\x00\x00\x00\x00"]
    for number, name in enumerate(("reference_deg", "indicated_deg"), 1):
        parts.append(wpilog._started(number, name, "{}", 0))
        for i, value in enumerate(columns[name]):
            parts.append(wpilog._record(number, 20_000 * i, np.float64(value).tobytes()))
    return b"".join(parts)


_BLANKS = "{time_s:12.6f} {reference_deg:12.6f}\t {indicated_deg:e}"
_SERIAL = "reference_deg:{reference_deg},indicated_deg:{indicated_deg}\nok"
_CAMONITOR = "indicated_deg 2026-11-20 22:10:0{time_s:.3f} {indicated_deg} HIHI"
#: Ending, and the file.
_SMALL: dict[str, tuple[str, Callable[[Path], bytes]]] = {
    "blanks": (".dat", lambda folder: _numbered(_BLANKS)),
    "serial": (".log", lambda folder: _numbered(_SERIAL)),
    "camonitor": (".txt", lambda folder: _numbered(_CAMONITOR)),
    "guidelog": (".txt", _guided),
    "matlab4": (".mat", _matlab4),
    "wpilog": (".wpilog", _robot),
}


def _make_small(name: str) -> Callable[[Path, random.Random], Path]:
    ending, made = _SMALL[name]

    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"log{ending}"
        path.write_bytes(_seeds(name, made, folder))
        return _damaged(path, rng, always=True)

    return make


def _use_small(path: Path) -> None:
    """As runs, and corrected: an error of the one must not keep the other from being tried."""
    with contextlib.suppress(TrueAngleError):
        _use_runs(path)
    _use_log(path)


def _damaged(path: Path, rng: random.Random, always: bool = False) -> Path:
    if always or rng.random() < 0.7:
        path.write_bytes(mutated_bytes(path.read_bytes(), rng))
    return path


_MADE: dict[str, Any] = {}


def _seeds(name: str, make: Callable[[Path], Any], folder: Path) -> Any:
    if name not in _MADE:
        _MADE[name] = make(folder)
    return _MADE[name]


def _has(*modules: str) -> bool:
    return all(importlib.util.find_spec(module) is not None for module in modules)


def loaders() -> dict[str, Loader]:
    """Every loader whose libraries are installed."""
    assert NASTY
    found = [
        Loader("model", _make_model, _use_model),
        Loader("simulation", _make_simulation, _use_simulation),
        Loader("manifest", _make_manifest, _use_manifest),
        Loader("runs-csv", _make_csv, _use_runs),
        Loader("log-csv", _make_csv, _use_log),
    ]
    if _has("pyarrow"):
        found += [
            Loader("runs-parquet", _make_parquet, _use_runs),
            Loader("log-parquet", _make_parquet, _use_log),
            Loader("log-arrow", _make_arrow, _use_log),
        ]
    if _has("h5py"):
        found += [Loader("log-hdf5", _make_hdf5, _use_log)]
    found += [
        Loader("runs-npz", _make_npz, _use_runs),
        Loader("log-npz", _make_npz, _use_log),
        Loader("log-npy", _make_npy, _use_log),
    ]
    found += [
        Loader(f"small-{name}", _make_small(name), _use_small)
        for name in _SMALL
        if name != "matlab4" or _has("scipy")
    ]
    if _has("scipy"):
        found += [Loader("log-matlab", _make_matlab, _use_log)]
    if _has("asammdf"):
        found += [Loader("log-mdf", _make_mdf, _use_log)]
    if _has("rosbags"):
        found += [
            Loader(f"log-{ending[1:]}", _make_bag(ending), _use_log)
            for ending in (".bag", ".db3", ".mcap")
        ]
    return {loader.name: loader for loader in found}
