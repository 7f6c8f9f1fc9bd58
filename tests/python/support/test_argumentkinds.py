"""Every public function and class, asked with the wrong kind for every argument in turn."""

import inspect
import time
import types
import warnings

import numpy as np
import pytest

import trueangle as ta
from trueangle import certificate, planning
from trueangle.errors import TrueAngleError
from trueangle.simulation import Harmonic, Joint, RunDesign
from trueangle.support.argumentkinds import told_kinds

#: Seconds that a call with a wrong argument may take.
MOST_S = 2.0

THETA = np.arange(0.0, 720.0, 12.0)
MODEL = ta.HarmonicModel([ta.Shaft("output", 1.0, [1], [0.0], [0.1])], period=360.0)
RUNS = [
    ta.CalibrationRun(t, t + 0.1 * np.sin(np.radians(t)), period=360.0)
    for t in (THETA, THETA + 3.0)
]
UNITS = [
    ta.CalibrationRun(t, t + a * np.sin(np.radians(t)), period=360.0, unit=f"{a}")
    for t, a in ((THETA, 0.1), (THETA, 0.2), (THETA, 0.15))
]
SIMULATION = ta.Simulation(
    Joint(gear_ratio=1.0, fixed_member="none"),
    runs=(RunDesign("a", 1, 5.0, 60),),
    sigma_arcsec=1.0,
)
LINES = {"orders": [1], "cosine": [0.1], "sine": [0.0]}

#: Arguments with which each can be called; files are those of `files`.
CALLS = {
    ta.Backlash: {"half_width": 0.1},
    ta.Channels: {},
    ta.CalibrationRun: {"reference": THETA, "indicated": THETA, "period": 360.0},
    ta.FilterLag: {"cutoff_hz": 10.0},
    ta.HarmonicModel: {"shafts": MODEL.shafts, "period": 360.0},
    ta.Latency: {"delay_s": 1e-3},
    ta.LoadDependentGearError: LINES,
    ta.LocalDefect: {"place": 1.0, "width": 2.0, "height": 0.01},
    ta.Moments: {"orders": [1]},
    ta.Monitor: {"model": MODEL},
    ta.PreslidingHysteresis: {"amplitude": 0.1, "length": 3.0},
    ta.Shaft: {"name": "a", "cycles_per_turn": 1.0, **LINES},
    ta.Simulation: {},
    ta.StiffeningCompliance: {},
    ta.ThermalDrift: {},
    ta.TorsionalCompliance: {},
    ta.check: {"data": RUNS},
    ta.compare: {"a": MODEL, "b": MODEL},
    ta.correct: {"data": THETA, "model": MODEL},
    ta.correct_logs: {"logs": "r.csv", "model": "m.json", "output": "c.csv"},
    ta.diagnose: {"runs": RUNS, "sim": SIMULATION, "within": 0.2},
    ta.export_model: {"model": MODEL, "target": "mechaduino"},
    ta.fit: {"runs": RUNS, "orders": [1]},
    ta.import_model: {"path": "t.csv", "target": "csv"},
    ta.join: {"a": "r.csv", "b": "r.csv"},
    ta.load_model: {"path": "m.json"},
    ta.fleet: {"runs": UNITS, "orders": [1]},
    ta.load_fleet: {"path": "fleet.json"},
    ta.load_robot: {"path": "robot.json"},
    ta.Robot: {"models": {"a": MODEL}},
    ta.load_simulation: {"path": "s.toml"},
    ta.plan_after: {
        "runs": RUNS,
        "sim": SIMULATION,
        "seeds": 0,
        "within": 1.0,
        "between": ["backlash"],
        "limits": planning.Limits(runs=1, reversals=False),
    },
    ta.plan_arc: {"start": 0.0, "stop": 180.0, "orders": [1], "readings": 6},
    ta.plan_mounts: {"gear_ratio": 10.0, "positions": 5, "orders": [1, 2]},
    ta.read_runs: {"path": "r.csv"},
    ta.rehearse: {"sim": SIMULATION, "causes": ["backlash"], "seeds": 1, "within": 0.1},
    ta.report: {"runs": RUNS, "orders": [1]},
    ta.select_orders: {"runs": RUNS, "candidates": [1, 2]},
    ta.selfcal: {"logs": "r.csv"},
    ta.check_channels: {"logs": "r.csv"},
    ta.diagnose_channels: {"logs": "r.csv"},
    ta.simulate: {"sim": SIMULATION},
    ta.wrap: {"angle": 1.0},
    ta.write_runs: {"runs": RUNS, "path": "w.csv"},
    planning.Limits: {},
    planning.load_limits: {"path": "l.toml"},
    planning.plan_encoder: {"gear_ratio": 10.0, "orders": [1, 2]},
    planning.plan_tilts: {"gear_ratio": 10.0, "positions": 5, "orders": [1, 2]},
    planning.readings_needed: {"noise": 1.0, "standard_error": 1.0, "factor": 1.0},
    planning.wanted_orders: {"gear_ratio": 100.0},
    certificate.load_identity: {"path": "i.toml"},
    Harmonic: {"shaft": "output", "order": 1, "amplitude_arcsec": 1.0, "phase_deg": 0.0},
    Joint: {},
    RunDesign: {},
}
#: Results, which the library makes.
RESULTS = {"Fleet", "Diagnosis", "FitResult", "OrderSelection", "Rehearsal", "SelfCalibration"}
#: The same fit in one pass.
OTHER_DOORS = {"fit_logs"}

WRONG = [
    None,
    True,
    1,
    float("nan"),
    "x",
    b"",
    object(),
    [],
    [1.0],
    [None],
    {},
    {1: 2},
    np.zeros((2, 2, 2)),
    np.array(["a"]),
    np.array(1 + 2j),
    int,
]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kinds")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        MODEL.save("m.json")
        ta.Robot({"a": MODEL}).save("robot.json")
        ta.fleet(UNITS, orders=[1]).save("fleet.json")
        SIMULATION.save("s.toml")
        ta.write_runs(RUNS, "r.csv")
        ta.export_model(MODEL, "csv", "t.csv", entries=8)
        yield


def test_every_public_name_is_asked():
    asked = {name for name in ta.__all__ if any(getattr(ta, name) is made for made in CALLS)}
    known = asked | RESULTS | OTHER_DOORS | {"TrueAngleError"}
    assert {name for name in ta.__all__ if callable(getattr(ta, name))} <= known


def fault(function, given, name, value):
    """What is wrong with the answer to one wrong argument; empty where nothing is."""
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(**{**given, name: value})
    except TrueAngleError as error:
        if isinstance(error, TypeError) and name not in str(error) and "angles" not in str(error):
            return f"does not name it: {error}"
    except OSError as error:
        if not (isinstance(value, str | list) or type(value).__module__ == "numpy"):
            return f"{type(error).__name__}: {error}"  # a name of no file is one of a right kind
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    taken = time.process_time() - begun
    return f"took {taken:.1f} s" if taken > MOST_S else ""


@pytest.mark.parametrize("function", CALLS, ids=lambda made: made.__name__)
def test_a_wrong_kind_is_named_or_taken(function, files):
    faults = []
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is parameter.VAR_KEYWORD or name == "report":  # called, not looked at
            continue
        for value in WRONG:
            wrong = fault(function, CALLS[function], name, value)
            faults += [f"{name}={value!r:.30}: {wrong}"] if wrong else []
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: ta.simulate(1), "sim must be a trueangle.Simulation"),
        (lambda: ta.HarmonicModel([1.0]), r"shafts\[0\] must be a trueangle.Shaft"),
        (lambda: ta.correct_logs([], MODEL, "c.csv"), "logs is empty"),
        (lambda: ta.load_simulation(1), "path must be the name of a file, got 1"),
        (lambda: ta.load_model(True), "path must be .*, got True"),
        (lambda: MODEL.save(None), "path must be the name of a file, got None"),
        (lambda: SIMULATION.save(2), "path must be the name of a file, got 2"),
        (lambda: ta.Moments([1]).merge(3), "other must be Moments"),
        (lambda: ta.simulate(SIMULATION, seed=-1), "seed must be a whole number from 0"),
    ],
)
def test_wrong_kinds_that_got_through(call, says):
    with pytest.raises(TrueAngleError, match=says):
        call()


def test_an_error_of_another_kind_stays_itself():
    @told_kinds
    def broken(angle: float, names: list[str] | None = None) -> float:
        raise LookupError("a defect")

    with pytest.raises(LookupError, match="a defect"):
        broken(1.0, names=["a"])
    with pytest.raises(ta.errors.KindError, match=r"names must be list\[str\] \| None, got \[1\]"):
        broken(1.0, names=[1])
    assert isinstance(broken, types.FunctionType)


def test_warnings_name_the_line_that_asked(tmp_path):
    (tmp_path / "r.csv").write_text(
        "reference_deg,indicated_deg\n" + "".join(f"{x},{x}\n" for x in THETA.tolist()) + "5,\n"
    )
    with pytest.warns(ta.errors.EmptyCellsWarning) as seen:
        ta.read_runs(tmp_path / "r.csv")
    with pytest.warns(ta.errors.UnitWarning) as units:
        ta.fit(ta.CalibrationRun(THETA, THETA + 0.1 * np.sin(np.radians(THETA))), orders=[1])
    assert {warning.filename for warning in [*seen, *units]} == {__file__}
