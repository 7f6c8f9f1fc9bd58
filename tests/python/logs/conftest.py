"""Models and readings of logs."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta

#: Of every made log; printed by a failing test through its parameters.
SEED = 20


def made_model(period=360.0, ratio=None, argument="reference"):
    """Errors of tenths of a degree on the output, and on a motor of any ratio."""
    unit = period / 360.0
    shafts = [ta.Shaft("output", 1, [1, 3], [0.1 * unit, 0.0], [0.4 * unit, -0.05 * unit])]
    if ratio is not None:
        shafts.append(ta.Shaft("motor", ratio, [1], [0.02 * unit], [0.03 * unit]))
    return ta.HarmonicModel(shafts, constant=0.2 * unit, period=period, argument=argument)


def made_angles(rows, turns=3.0, seed=SEED):
    """Degrees that run forth over several turns, with jitter, folded into one turn."""
    rng = np.random.default_rng(seed)
    return np.mod(np.linspace(0.0, 360.0 * turns, rows) + rng.normal(0.0, 0.5, rows), 360.0)


@pytest.fixture
def model():
    return made_model()


@pytest.fixture
def model_file(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "joint.json"
    model.save(path)
    return path


def unwrapped_truth(model, angles):
    """Correction of a whole record at once, turns counted by numpy, in the turn given."""
    unwrapped = np.unwrap(angles, period=model.period)
    return model.correct(unwrapped) - (unwrapped - angles)
