"""Wild readings: found, reported, harmless; and clean data untouched."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.robust import without_spikes
from trueangle.runs.outliers import outlying

TRUTH = 0.2
SIGMA = 0.01


def contaminated(seed, share, size=10.0, n=400):
    """Readings of order 3 with normal noise, a share of them moved by Student-t jumps."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(0, 360, n)
    indicated = theta + TRUTH * np.sin(np.radians(3 * theta)) + SIGMA * rng.normal(size=n)
    hit = rng.choice(n, int(share * n), replace=False)
    jumps = size * np.sign(rng.normal(size=hit.size)) * (0.2 + np.abs(rng.standard_t(2, hit.size)))
    indicated[hit] += jumps
    return ta.CalibrationRun(theta, indicated, 360.0, label="r"), np.sort(hit)


@pytest.mark.parametrize("loss", ["auto", "huber", "tukey"])
@pytest.mark.parametrize("share", [0.0025, 0.05, 0.15])
def test_wild_readings_do_not_move_the_amplitude(loss, share):
    run, _ = contaminated(11, share)
    result = ta.fit(run, orders=range(1, 6), loss=loss)
    # 5 standard errors of an amplitude; Huber lets a bounded influence through.
    allowed = 5 * SIGMA * np.sqrt(2 / 400) + (0.4 * SIGMA if loss == "huber" else 0.0)
    assert result.amplitudes[2] == pytest.approx(TRUTH, abs=allowed)
    plain = ta.fit(run, orders=range(1, 6), loss="linear")
    assert abs(plain.amplitudes[2] - TRUTH) > allowed


def test_auto_names_the_rows_it_sets_aside():
    run, hit = contaminated(12, 0.02)
    result = ta.fit(run, orders=range(1, 6))
    assert [row for _, row in result.wild] == hit.tolist()
    assert {label for label, _ in result.wild} == {"r"}
    assert "8 outliers rejected" in result.summary()
    assert result.model.fit.wild == 8


def test_one_outlier_is_one():
    theta = np.arange(400) * 0.9
    error = 0.01 * np.random.default_rng(3).normal(size=400)
    error[100] += 5.0
    told = ta.fit(ta.CalibrationRun(theta, theta + error, 360.0), orders=[1]).summary()
    assert "1 outlier rejected" in told


#: Degrees by which one reading is wrong, or what stands in its place.
WRONG = (2.5, -11.0, 47.0, 180.0, -1e3, 1e9, -1e18, 1.5e300)


@pytest.mark.parametrize("column", ["reference", "indicated"])
@pytest.mark.parametrize("at", [0, 33, 58, 59])
def test_one_reading_that_is_wrong_by_anything_moves_nothing(column, at):
    """`fit`, which chooses the orders, sets it aside; `check` names its row and no other fault."""

    def runs(wrong):
        rng = np.random.default_rng(57)
        for label in "abcd":
            theta = np.sort(rng.uniform(0.0, 360.0, 60))
            error = 0.08 * np.sin(np.radians(theta + 70.0)) + 0.03 * np.sin(np.radians(3 * theta))
            angles = {"reference": theta, "indicated": theta + error + 1e-3 * rng.normal(size=60)}
            if label == "b":
                old = angles[column][at]
                angles[column][at] = old + wrong if abs(wrong) < 1e6 else wrong
            yield ta.CalibrationRun(**angles, period=360.0, label=label)

    good = ta.fit(list(runs(0.0)))
    for wrong in WRONG:
        given = list(runs(wrong))
        (fault,) = ta.check(given).data_faults
        assert (fault.fault, fault.rows) == ("outliers", (at + 1,)), wrong
        fit = ta.fit(given)
        assert fit.wild == (("b", at),), wrong
        assert fit.orders == good.orders
        np.testing.assert_allclose(fit.amplitudes, good.amplitudes, rtol=0.02)


@pytest.mark.parametrize("size", [-180.0, 63.0, 5.0])
def test_what_is_beside_a_wild_reading_is_not_wild(size):
    """On a slope the wild one moves the median of its neighbours."""
    rng = np.random.default_rng(8)
    angle = np.sort(rng.uniform(0.0, 360.0, 163))
    noise = 4e-4 * rng.normal(size=163)
    for at in range(163):
        error = 0.3 * np.sin(np.radians(3 * angle)) + noise
        error[at] += size
        rows, distance = outlying(ta.CalibrationRun(angle, angle + error, 360.0))
        assert rows.tolist() == [at]
        assert distance == pytest.approx(abs(size), rel=0.05)


@pytest.mark.parametrize("noise", ["normal", "none", "counts"])
def test_clean_data_are_plain_least_squares(noise):
    rng = np.random.default_rng(13)
    theta = rng.uniform(0, 360, 5000)
    indicated = theta + TRUTH * np.sin(np.radians(3 * theta))
    if noise == "normal":
        indicated = indicated + SIGMA * rng.normal(size=5000)
    if noise == "counts":
        indicated = np.round(indicated * 4096 / 360) * 360 / 4096
    run = ta.CalibrationRun(theta, indicated, 360.0)
    auto, linear = (ta.fit(run, orders=range(1, 6), loss=loss) for loss in ("auto", "linear"))
    assert auto.weights is None
    assert auto.model.shafts == linear.model.shafts


def test_an_effect_that_the_model_lacks_is_not_wild():
    theta = np.linspace(0, 360, 400, endpoint=False)
    bump = np.where(np.abs(theta - 90) < 45, 3.0, 0.0)  # a quarter of the turn
    rng = np.random.default_rng(1)
    run = ta.CalibrationRun(theta, theta + bump + 0.001 * rng.normal(size=400), 360.0)
    assert ta.fit(run, orders=[1]).weights is None


def test_given_weights_stay():
    run, hit = contaminated(14, 0.05)
    weights = np.ones(len(run))
    weights[hit] = 0.0
    told = ta.CalibrationRun(run.reference, run.indicated, 360.0, weights=weights)
    result = ta.fit(told, orders=range(1, 6))
    assert result.weights is None  # nothing wild among the readings that count
    found = ta.fit(run, orders=range(1, 6))
    np.testing.assert_allclose(result.amplitudes, found.amplitudes, rtol=1e-12)


@pytest.mark.parametrize("noise", [1.0, 0.5, 0.1])
def test_noise_on_a_slope_is_no_spike(noise):
    """On a slope most readings are the median of their neighbours: one in 17 was set aside."""
    print("seeds 21 to 40")
    theta = np.arange(0.0, 360.0, 3.0)
    turn = np.radians(theta)
    for seed in range(21, 41):
        rng = np.random.default_rng(seed)
        error = 80.0 * np.cos(turn - rng.uniform(0.0, 6.0)) + noise * rng.normal(size=theta.size)
        run = ta.CalibrationRun(theta, theta + error / 3600.0, 360.0)
        assert without_spikes(run) is run
        error[50] += 40.0
        told = without_spikes(ta.CalibrationRun(theta, theta + error / 3600.0, 360.0))
        assert np.flatnonzero(told.weights == 0.0).tolist() == [50]


@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_given_weights_multiply_those_of_a_robust_loss(loss):
    """Readings given four times count as one of weight 4, whatever the loss."""
    run, _ = contaminated(17, 0.05)
    often = np.arange(len(run)) % 3 == 0
    # These have a larger amplitude, so that their weight shows.
    indicated = run.indicated + 0.01 * often * np.sin(np.radians(3 * run.reference))
    rows = np.concatenate([np.arange(len(run)), np.tile(np.flatnonzero(often), 3)])
    weights = np.where(often, 4.0, 1.0)
    a, b, plain = (
        ta.fit(ta.CalibrationRun(x, y, 360.0, weights=w), orders=[3], loss=loss)
        for x, y, w in (
            (run.reference[rows], indicated[rows], None),
            (run.reference, indicated, weights),
            (run.reference, indicated, None),
        )
    )
    # The scale is a median of other readings: alike to a few hundredths of the noise.
    assert a.amplitudes[0] == pytest.approx(b.amplitudes[0], abs=0.05 * SIGMA)
    assert b.amplitudes[0] - plain.amplitudes[0] > 0.2 * SIGMA


def test_given_weights_stay_where_readings_are_set_aside():
    run, hit = contaminated(18, 0.03)
    weights = np.random.default_rng(1).uniform(0.2, 5.0, len(run))
    told = ta.CalibrationRun(run.reference, run.indicated, 360.0, weights=weights)
    found = ta.fit(told, orders=range(1, 6))
    assert [row for _, row in found.wild] == hit.tolist()
    expected = weights.copy()
    expected[hit] = 0.0
    np.testing.assert_array_equal(found.weights[0], expected)
    np.testing.assert_array_equal(
        without_spikes(told).weights, np.where(without_spikes(run).weights == 0.0, 0.0, weights)
    )


def test_readings_that_do_not_count_are_never_called_wild():
    run, hit = contaminated(19, 0.03)
    weights = np.ones(len(run))
    weights[hit[::2]] = 0.0
    told = ta.CalibrationRun(run.reference, run.indicated, 360.0, weights=weights)
    found = ta.fit(told, orders=range(1, 6))
    assert [row for _, row in found.wild] == hit[1::2].tolist()
    assert found.model.fit.wild == hit[1::2].size


@pytest.mark.parametrize("loss", ["auto", "linear", "huber", "tukey"])
@pytest.mark.parametrize("runs", [1, 2])
@pytest.mark.parametrize("left_out", [0.1, 0.45])
def test_readings_of_weight_zero_are_as_good_as_absent(left_out, runs, loss):
    """Many far-off ones, whose scale nobody is to be judged by; a few others that are not told."""
    rng = np.random.default_rng(21)
    with_them, without = [], []
    for number in range(runs):
        run, _ = contaminated(22 + number, 0.03)
        weights = np.ones(len(run))
        weights[rng.choice(len(run), int(left_out * len(run)), replace=False)] = 0.0
        indicated = run.indicated + (weights == 0.0) * rng.normal(0.0, 8.0, len(run))
        label = str(number)
        with_them.append(
            ta.CalibrationRun(run.reference, indicated, 360.0, weights=weights, label=label)
        )
        kept = weights > 0.0
        without.append(ta.CalibrationRun(run.reference[kept], indicated[kept], 360.0, label=label))
    found, wanted = (ta.fit(x, orders=range(1, 6), loss=loss) for x in (with_them, without))
    np.testing.assert_allclose(found.amplitudes, wanted.amplitudes, rtol=1e-6, atol=1e-9)
    # Beside the rows of what was rejected, of which there are more with them.
    notes = (fit.model.fit.note.partition(": reading")[0] for fit in (found, wanted))
    assert len(set(notes)) == 1
    assert found.model.fit.wild == wanted.model.fit.wild
    for one, other in zip(with_them, without, strict=True):
        left, right = without_spikes(one).weights, without_spikes(other).weights
        right = np.ones(len(other)) if right is None else right
        np.testing.assert_array_equal(left[one.weights > 0.0], right)
        assert not left[one.weights == 0.0].any()


def test_the_robust_scale_is_the_standard_deviation_of_normal_readings():
    from trueangle.fitting.robust import HUBER, robust_scale

    rng = np.random.default_rng(20)
    # Of 4096 readings the median of the absolute values is known to 1.8 %.
    assert robust_scale(3.0 * rng.normal(size=4096)) == pytest.approx(3.0, rel=0.06)
    # 95 % of the efficiency of least squares, by the definition of the constant.
    x = np.linspace(-8.0, 8.0, 160_001)
    density = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi) * (x[1] - x[0])
    psi = np.clip(x, -HUBER, HUBER)
    inside = density[np.abs(x) < HUBER].sum()
    assert inside**2 / (density @ psi**2) == pytest.approx(0.95, abs=1e-3)
