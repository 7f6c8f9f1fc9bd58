"""A correction is given only where a further run would gain by it."""

import warnings

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import NoModelError
from trueangle.support.angles import circular_mean

SEED = 41
NOISE = 0.01


def joint(phase, amplitude=0.1, label=None, seed=0, n=400):
    rng = np.random.default_rng([SEED, seed])
    x = np.sort(rng.uniform(0.0, 360.0, n))
    error = amplitude * np.sin(np.radians(2.0 * x) + phase) + rng.normal(0.0, NOISE, n)
    return ta.CalibrationRun(x, x + error, 360.0, label=label)


def test_runs_of_one_joint_pass_however_weak():
    for amplitude in (0.1, 0.005):
        runs = [joint(0.3, amplitude, str(i), seed=i) for i in range(8)]
        assert ta.fit(runs).orders == (2,)


def test_runs_of_unlike_joints_are_refused():
    phases = (0.0, 0.3, 1.4, 2.9, 0.2, 4.0)
    runs = [joint(p, 0.1, f"unit {i}", seed=i) for i, p in enumerate(phases)]
    with pytest.raises(NoModelError, match="no model: "):
        ta.fit(runs)
    # Declared orders are the user's.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert ta.fit(runs, [2]).orders == (2,)


# Units of one kind are joints of their own.
@pytest.mark.filterwarnings("ignore::trueangle.errors.UnlikeRunsWarning")
@pytest.mark.parametrize(
    ("name", "left"), [("stepper_encoder_units", 1.0005), ("rm44_repeat", 0.25)]
)
def test_splits_by_run_of_measured_sets(data_dir, name, left):
    """Held-out runs of every set are never worse than uncorrected."""
    runs = ta.read_runs(data_dir / f"{name}.csv")
    rng = np.random.default_rng(SEED)
    for _ in range(4):
        kept = set(rng.choice(len(runs), len(runs) // 2 + 1, replace=False).tolist())
        try:
            model = ta.fit([runs[i] for i in kept]).model
        except NoModelError:
            model = None
        squares = np.zeros(2)
        for run in (run for i, run in enumerate(runs) if i not in kept):
            corrected = run.indicated if model is None else model.correct(run.indicated)
            for k, angle in enumerate((run.indicated, corrected)):
                off = ta.wrap(angle - run.reference, 360.0)
                squares[k] += np.sum(ta.wrap(off - circular_mean(off, 360.0), 360.0) ** 2)
        assert np.sqrt(squares[1] / squares[0]) <= left
