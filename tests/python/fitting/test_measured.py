"""Measured data of other people's encoders (see the data's own README); skipped without."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.estimation import reference
from trueangle.support.angles import wrap


def left(model, runs):
    """What correcting unseen runs leaves, all readings together."""
    return np.concatenate([wrap(model.correct(r.indicated) - r.reference, 360.0) for r in runs])


def test_rm44_held_out_runs_are_as_good_as_with_24_orders_by_numpy(data_dir):
    runs = ta.read_runs(data_dir / "rm44_repeat.csv")
    kept, held = runs[:8], runs[8:]
    orders = range(1, 25)
    expected = reference.fit(kept, [(1.0, list(orders))])
    design = reference.design_matrix
    plain = np.concatenate(
        [
            r.centred_error
            - expected.offsets.mean()
            - design(r.reference, [(1.0, orders)], 360.0, constant=False) @ expected.coefficients
            for r in held
        ]
    )
    before = np.concatenate([r.centred_error for r in held])
    assert before.std() == pytest.approx(0.40, abs=0.01)
    for wanted in (orders, None):
        result = ta.fit(kept, orders=wanted)
        assert left(result.model, held).std() <= 1.03 * plain.std()
    assert result.model.constant == pytest.approx(-109.4, abs=1.0)


# One held-out reading lies a little outside the arc of the run that was fitted.
@pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")
def test_arm_joint_on_188_degrees_with_a_wild_reading(data_dir):
    runs = {r.label: r for r in ta.read_runs(data_dir / "arm_joint_protractor.csv")}
    held = runs["joint2_2021-05-28"]
    assert held.centred_error.std() == pytest.approx(0.48, abs=0.01)
    # One run may have drifted by some of what orders 1 and 2 make of it: they are held smaller.
    for orders, most in ((None, 0.27), (range(1, 5), 0.21)):
        result = ta.fit(runs["joint2_2021-06-06"], orders=orders)
        assert len(result.wild) == 1
        difference = wrap(result.model.correct(held.indicated) - held.reference, 360.0)
        assert difference.std() <= most
        assert result.model.amplitudes.max() < 5.0


@pytest.mark.parametrize("label", ["joint1_2021-06-05", "joint2_2021-06-06"])
def test_arm_joint_amplitudes_stay_small_at_any_number_of_orders(data_dir, label):
    runs = {r.label: r for r in ta.read_runs(data_dir / "arm_joint_protractor.csv")}
    for highest in (4, 6, 8, 12):
        result = ta.fit(runs[label], orders=range(1, highest + 1))
        assert result.model.amplitudes.max() < 20.0


def test_resolver_prefers_the_true_angle(data_dir):
    (run,) = ta.read_runs(data_dir / "resolver_stepper.csv")
    assert run.centred_error.std() == pytest.approx(5.26, abs=0.01)
    true_angle = ta.fit(run, orders=range(1, 51))
    assert np.sqrt(np.mean(true_angle.residuals**2)) < 0.08
    indicated = ta.fit(run, orders=range(1, 51), argument="indicated")
    assert indicated.residual_std > 5 * true_angle.residual_std
