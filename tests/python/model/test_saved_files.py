"""Files written by earlier versions load unchanged: what they say is what was said then.

The files in ``saved`` carry the version and the commit that wrote them, and beside them
stands what that version computed from them.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import EFFECTS
from trueangle.errors import LargeModelWarning
from trueangle.model import writing

SAVED = Path(__file__).parent / "saved"
MODELS = [path for path in sorted(SAVED.glob("model-*.json")) if "corrected" not in path.stem]

# Both versions solve to 1e-12 of a turn of 360 degrees.
SOLVED = 2 * 360e-12
# A delay of 0.4 ms moves every line since then, those of effects too: at 40 deg/s by 0.8 deg of the
# motor, which its bump of 12 arcsec and the lines beside it turn into so many arcsec.
MOVED = 2.5


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_models_of_before_correct_as_they_did(path, tmp_path):
    model = ta.load_model(path)
    then = json.loads((SAVED / f"{path.stem}-corrected.json").read_text())
    expected = np.array(then.pop("corrected"))
    indicated = np.array(then.pop("indicated"))
    signals = {name: np.array(values) for name, values in then.items()}
    np.testing.assert_allclose(model.correct(indicated, **signals), expected, rtol=0, atol=SOLVED)
    step = model.compensator()
    rows = zip(*signals.values(), strict=True)
    stepped = [
        step(x, **dict(zip(signals, row, strict=True)))
        for x, row in zip(indicated, rows, strict=True)
    ]
    np.testing.assert_allclose(stepped, expected, rtol=0, atol=SOLVED)
    # Written again it says the same, key for key.
    model.save(tmp_path / "again.json")
    then, again = json.loads(path.read_text()), json.loads((tmp_path / "again.json").read_text())
    assert again["terms"] == then["terms"]
    assert again["shafts"] == then["shafts"]


def test_robots_and_fleets_of_before_are_what_they_were():
    robot = ta.load_robot(SAVED / "robot-0.2.0-91f1b46c.json")
    then = [9.979510880413214, 200.0150818229647]
    np.testing.assert_allclose(robot.correct([10.0, 200.0]), then, rtol=0, atol=SOLVED)
    fleet = ta.load_fleet(SAVED / "fleet-0.2.0-91f1b46c.json")
    assert [unit.verdict for unit in fleet.units] == ["fine"] * 4
    first, fourth = fleet.common
    assert (first.order, first.std, fourth.order) == (1.0, 0.0009081828834635185, 4.0)
    assert fleet.prior.units == 4


@pytest.mark.parametrize("path", sorted(SAVED.glob("simulation-*.toml")), ids=lambda p: p.stem)
def test_simulations_of_before_predict_as_they_did(path):
    sim = ta.load_simulation(path)
    then = json.loads((SAVED / f"{path.stem}-predicted.json").read_text())
    runs = ta.simulate(sim, 3)
    np.testing.assert_allclose(sim.predict(runs), then["expected_arcsec"], rtol=0, atol=MOVED)
    error = np.concatenate([run.error for run in runs])
    np.testing.assert_allclose(error, then["error_deg"], rtol=0, atol=MOVED / 3600.0)
    # Every cause of that version is in it.
    assert len({effect.kind for effect in sim.effects} & set(EFFECTS)) == 20


def test_a_covariance_too_large_to_be_read_back_is_left_out_and_reported(tmp_path, monkeypatch):
    x = np.linspace(0.0, 360.0, 50, endpoint=False)
    run = ta.CalibrationRun(x, x + 0.1 * np.sin(np.radians(x)), 360.0)
    model = ta.fit(run, orders=[1, 2]).model
    assert model.covariance.shape == (5, 5)
    path = tmp_path / "m.json"
    monkeypatch.setattr(writing, "MODEL_BYTES", 25 * writing.FLOAT_BYTES)
    model.save(path)
    np.testing.assert_array_equal(ta.load_model(path).covariance, model.covariance)
    monkeypatch.setattr(writing, "MODEL_BYTES", 25 * writing.FLOAT_BYTES - 1)
    with pytest.warns(LargeModelWarning, match="without the covariance of 5 numbers"):
        model.save(path)
    loaded = ta.load_model(path)
    assert loaded.covariance is None
    assert loaded.shafts == model.shafts
