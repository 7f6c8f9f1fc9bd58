"""No form beside the one that a search came to explains more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import EFFECTS, FilterLag, MissedCounts
from trueangle.effects.drawing import Drawing
from trueangle.effects.missed_counts import STEP_MARGIN
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs

from .test_stated_errors import HIDDEN, NOISE, SIM, signal_of

Array = np.ndarray

#: Numbers of a shape that a search finds, by the cause as `HIDDEN` has it; in degrees or radians
#: those that are places on a circle.
SEARCHED = {
    "presliding_hysteresis": ("length_deg",),
    "presliding_hysteresis, long": ("length_deg",),
    "filter_lag, first order": ("cutoff_hz",),
    "filter_lag, second order": ("cutoff_hz", "damping"),
    "stiffening_compliance, knee": ("knee_Nm",),
    "torque_hysteresis": ("span_Nm",),
    "channel_skew": ("phase",),
    "local_defect, output": ("place_deg", "width_deg"),
}
CIRCLES = {"phase": 1.0, "place_deg": 10.0}

#: Squares of the noise that a search may leave: a third of a standard error away.
LEFT = 0.1


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


@pytest.mark.parametrize("case", SEARCHED)
def test_no_form_beside_it_explains_more(case: str, signals: Signals) -> None:
    """By least squares of the readings as they are, beside what is fitted in any case."""
    effect = EFFECTS[case.partition(",")[0]]
    hidden = effect(**HIDDEN[case][0])  # type: ignore[arg-type]
    for seed in (71_000 + len(case), 71_100 + len(case)):
        print(f"seed {seed}")
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(signals))
        error = noise + signal_of(hidden, signals)
        start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
        found = effect.propose(start)
        assert found is not None
        assert set(SEARCHED[case]) <= found.shape.keys()

        def left(shape: dict[str, object], error: Array = error, base: Array = start.base) -> float:
            columns = effect.columns(signals, SIM.surroundings, shape)
            if effect is FilterLag:  # of its own size, whatever coefficient would suit it
                error, columns = error - columns[:, 0], columns[:, :0]
            design = np.hstack([base, columns])
            rest = error - design @ np.linalg.lstsq(design, error, rcond=None)[0]
            return float(rest @ rest) / NOISE**2

        best = left(found.shape)
        for name in SEARCHED[case]:
            value = found.shape[name]
            for step in (0.003, -0.003, 0.01, -0.01, 0.03, -0.03, 0.1, -0.1, 0.3, -0.3):
                moved = value + step * CIRCLES.get(name, value)
                less = best - left({**found.shape, name: moved})
                assert less < LEFT, f"{name} {moved:.5g} for {value:.5g}: {less:.3g} less"


@pytest.mark.parametrize("row", [STEP_MARGIN, 200, 480 - STEP_MARGIN])
@pytest.mark.parametrize("size", [9.0, -9.0])
def test_no_other_row_explains_a_step_better(size: float, row: int, signals: Signals) -> None:
    """Slow: a step at every row of every run, of those with so many readings on either side."""
    print(f"seed {71_200 + row}")
    noise = NOISE * np.random.default_rng(71_200 + row).standard_normal(len(signals))
    error = noise + signal_of(MissedCounts(size, 5, row), signals)
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    found = MissedCounts.propose(start)
    assert found is not None
    assert found.shape == {"run": 5, "row": row}
    # Its size and its row, one of any run.
    assert (found.parameters, found.log_grid) == (2, pytest.approx(np.log(signals.runs)))
    steps = np.column_stack(
        [
            MissedCounts.columns(signals, SIM.surroundings, {"run": run, "row": k})[:, 0]
            for run in (4, 5)
            for k in range(STEP_MARGIN, 480 - STEP_MARGIN + 1)
        ]
    )
    assert int(np.argmax(start.gains(steps))) % 471 == row - STEP_MARGIN


@pytest.mark.parametrize("away", [-STEP_MARGIN, 1 - STEP_MARGIN, STEP_MARGIN - 1, STEP_MARGIN])
def test_the_next_step_keeps_its_distance_from_one_that_was_found(
    away: int, signals: Signals
) -> None:
    """A few readings that are off and come back are outliers, no two steps."""
    print(f"seed {71_300 + away}")
    error = 0.01 * np.random.default_rng(71_300 + away).standard_normal(len(signals))
    low, high = sorted((200, 200 + away))
    error[(signals.run == 5) & (signals.row >= low) & (signals.row < high)] += 30.0
    bare = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    shape = {"run": 5, "row": 200}
    columns = MissedCounts.columns(signals, SIM.surroundings, shape)
    found = MissedCounts.propose(bare.with_terms([bare.propose(MissedCounts.kind, shape, columns)]))
    assert found is not None
    if away > 0:
        assert found.shape == {"run": 5, "row": 200 + STEP_MARGIN}
    assert found.shape["run"] != 5 or abs(found.shape["row"] - 200) >= STEP_MARGIN


@pytest.mark.parametrize(("counts", "told"), [(0.85, False), (0.95, True)])
def test_less_than_a_count_is_no_lost_count(counts: float, told: bool, signals: Signals) -> None:
    print("seed 71400")
    counted = replace(signals, count=20.0)
    error = 0.01 * np.random.default_rng(71_400).standard_normal(len(signals))
    error += signal_of(MissedCounts(-20.0 * counts, 2, 150), signals)
    start = Regression.of(counted, error, SIM.surroundings, rho=0.0)
    assert (MissedCounts.propose(start) is not None) == told


@pytest.mark.parametrize(("less", "found"), [(0, True), (1, False)])
def test_a_run_has_room_for_a_step(less: int, found: bool) -> None:
    """So many readings on either side of the one row that may be its first."""
    size = 2 * STEP_MARGIN + 1 - less
    runs = [ta.CalibrationRun(np.arange(size) * 7.0 + k, np.zeros(size), 360.0) for k in range(2)]
    short = join_runs(runs)
    error = 1e-3 * np.random.default_rng(71_500).standard_normal(2 * size)
    error += signal_of(MissedCounts(9.0, 1, STEP_MARGIN), short)
    start = Regression.of(short, error, replace(SIM, harmonics=()).surroundings, rho=0.0)
    extension = MissedCounts.propose(start)
    assert (extension is not None) == found
    assert extension is None or extension.shape == {"run": 1, "row": STEP_MARGIN}


def test_steps_are_drawn_well_within_any_run(signals: Signals) -> None:
    rng = np.random.default_rng(71_600)
    drawn = [MissedCounts.drawn(-4.0, Drawing(signals, SIM.surroundings, rng)) for _ in range(100)]
    assert {step.run for step in drawn if step} == set(range(8))
    assert all(step and 96 <= step.row < 384 and step.step_arcsec == -4.0 for step in drawn)
