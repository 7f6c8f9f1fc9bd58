"""Documents damaged value by value: models, robots, fleets, simulations, limits, identities."""

from __future__ import annotations

import contextlib
import json
import random
import warnings
from collections.abc import Callable
from dataclasses import MISSING, fields
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import trueangle as ta
from loader import Loader, seeds
from mutation import mutated_bytes, mutated_document, mutated_words
from trueangle.certificate.identity import load_identity
from trueangle.effects import EFFECTS
from trueangle.joint.description import load_description, robot_of_urdf
from trueangle.logs.manifest import Manifest
from trueangle.planning.limits import load_limits


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


@cache
def _effects() -> list[dict[str, Any]]:
    """Every effect with numbers that it takes, as a file has it."""
    found = []
    for kind, effect in EFFECTS.items():
        wanted = [f.name for f in fields(effect) if f.default is MISSING]  # type: ignore[arg-type]
        for values in product((1, 0.5, "output", (1.0,)), repeat=min(len(wanted), 4)):
            with contextlib.suppress(Exception):
                table = effect(**dict(zip(wanted, values, strict=True))).to_table()
                found.append(json.loads(json.dumps({"kind": kind} | table)))
                break
    return found


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


def _toml_text(made: Any, rng: random.Random) -> bytes:
    if isinstance(made, dict):
        text = "".join(f"{json.dumps(name)} = {_toml(value)}\n" for name, value in made.items())
    else:
        text = _toml(made)
    data = text.encode("utf-8", "surrogatepass")
    return mutated_bytes(data, rng) if rng.random() < 0.15 else data


def _make_simulation(folder: Path, rng: random.Random) -> Path:
    effects = [*_SIMULATION["effect"], *rng.sample(_effects(), 2)]
    made = mutated_document(_SIMULATION | {"effect": effects}, rng)
    path = folder / "joint.toml"
    path.write_bytes(_toml_text(made, rng))
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
    entries = seeds("manifest", _manifest, folder)
    lines = [_json(mutated_document(entry, rng), rng) for entry in entries]
    (folder / "resumed").mkdir(exist_ok=True)
    path = folder / "resumed" / "trueangle-manifest.jsonl"
    path.write_bytes(b"\n".join(lines))
    return path


def _use_manifest(path: Path) -> None:
    with Manifest(path.parent).opened() as manifest:
        for name, entry in manifest._entries.items():
            if (
                len(name) < 200 and not Path(name).is_absolute()
            ):  # outputs are named by logs, never by the manifest
                log = path.parent.parent / "log.csv"
                manifest.done(log, path.parent / name, entry["settings"])


#: What the other files of one table or more hold.
_LIMITS: dict[str, Any] = {
    "limits": {
        "arc_deg": [0.0, 270.0],
        "speed_deg_s": [1.0, 30.0],
        "temperature_C": [20.0, 35.0],
        "torque_Nm": [0.0, 5.0],
        "gravity_Nm": 1.0,
        "mount_deg": [0.0, 30.0],
        "samples": 500,
        "runs": 4,
        "reversals": True,
    }
}
_IDENTITY: dict[str, Any] = {
    "certificate": {
        "number": "1",
        "item": "joint",
        "date": "2026-11-26",
        "temperature_C": 20.0,
        "language": "en",
        "address": "a\nb",
    },
    "contribution": [
        {"name": "reference", "distribution": "normal", "standard_arcsec": 0.2},
        {"name": "mount", "distribution": "rectangular", "half_width_arcsec": 0.5},
    ],
    "specification": {"limit_arcsec": 20.0, "decision_rule": "simple"},
}
_ROBOT: dict[str, Any] = {
    "robot": {"name": "arm"},
    "joint": [
        {
            "name": "shoulder",
            "gear_ratio": 100.0,
            "fixed_member": "flexspline",
            "signals": {"indicated": "q1:rad", "reference": "r1:rad"},
            "shafts": {"belt": 2.5},
        },
        {"name": "elbow", "gear_ratio": 50.0},
    ],
}
_URDF = """<robot name="arm">
 <joint name="shoulder" type="revolute"><limit effort="1" velocity="2"/></joint>
 <joint name="elbow" type="continuous"><mimic joint="shoulder"/></joint>
 <transmission name="t"><joint name="shoulder"/>
  <actuator name="a"><mechanicalReduction>100</mechanicalReduction></actuator></transmission>
</robot>
"""


def _tables(name: str, document: Any, load: Callable[[Path], Any]) -> Loader:
    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"{name}.toml"
        path.write_bytes(_toml_text(mutated_document(document, rng), rng))
        return path

    return Loader(name, make, load)


def _make_urdf(folder: Path, rng: random.Random) -> Path:
    path = folder / "arm.urdf"
    path.write_bytes(mutated_words(_URDF, rng))
    return path


def _robots(folder: Path) -> list[Any]:
    models = seeds("model", _models, folder)
    joints = dict(zip(("a", "b"), models[:2], strict=True))
    for n, model in enumerate(joints.values()):
        (folder / f"{n}.json").write_text(json.dumps(model))
    robot = ta.Robot({name: ta.load_model(folder / f"{n}.json") for n, name in enumerate(joints)})
    robot.save(folder / "robot.json")
    return [json.loads((folder / "robot.json").read_text())]


def _use_robot(path: Path) -> None:
    for model in ta.load_robot(path).values():
        assert np.isfinite(model.error(np.linspace(0.0, model.period, 9))).all()


def _fleets(folder: Path) -> list[Any]:
    rng = np.random.default_rng(7)
    table: dict[str, list[Any]] = {
        k: [] for k in ("unit", "when", "reference_deg", "indicated_deg")
    }
    theta = np.arange(0.0, 360.0, 10.0)
    for unit in range(6):
        for when in ("2026-01-10", "2026-07-10"):
            size = rng.normal(0.05, 0.01)
            error = size * np.sin(np.radians(theta)) + rng.normal(0.0, 0.001, theta.size)
            table["unit"] += [f"SN{unit}"] * theta.size
            table["when"] += [when] * theta.size
            table["reference_deg"] += theta.tolist()
            table["indicated_deg"] += (theta + error).tolist()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ta.fleet(table, permitted_arcsec=400.0).save(folder / "fleet.json")
    return [json.loads((folder / "fleet.json").read_text())]


def _use_fleet(path: Path) -> None:
    fleet = ta.load_fleet(path)
    assert isinstance(fleet.summary(), str)


def _saved(name: str, made: Callable[[Path], list[Any]], use: Callable[[Path], None]) -> Loader:
    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"{name}.json"
        document = rng.choice(seeds(name, made, folder))
        path.write_bytes(_json(mutated_document(document, rng), rng))
        return path

    return Loader(name, make, use)


def documents() -> list[Loader]:
    """Loaders of documents."""
    return [
        _saved("model", _models, _use_model),
        _saved("robot-models", _robots, _use_robot),
        _saved("fleet", _fleets, _use_fleet),
        Loader("simulation", _make_simulation, _use_simulation),
        Loader("manifest", _make_manifest, _use_manifest),
        _tables("limits", _LIMITS, load_limits),
        _tables("identity", _IDENTITY, load_identity),
        _tables("robot", _ROBOT, load_description),
        Loader("urdf", _make_urdf, robot_of_urdf),
    ]
