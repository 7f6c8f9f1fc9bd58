"""Controls and levels of a gain against their definitions, run by run."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from trueangle.diagnosis.gain import Gain, _control, _parts, _shuffled, measure_delay_gain
from trueangle.diagnosis.holdout import HoldOutModel, error_numbers, residual_at_held_out
from trueangle.diagnosis.levels import LevelGain, _reach, gains_by_level, levels_of_runs
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation, simulate

#: A factor, and the signals that carry its labels.
CARRIED = {
    "direction": ("direction", "segment_direction"),
    "velocity": ("velocity",),
    "temperature": ("temperature",),
    "torque": ("torque",),
    "mount": ("mount",),
    "coupled": ("coupled",),
    "time": ("theta",),
}
RUNS = 6


def signals_of(levels: np.ndarray, samples: int = 80) -> Signals:
    """Runs there and back, whose every label is at one of ``levels``."""
    runs = tuple(RunDesign(samples=samples, reversals=(0.5,), speed_deg_s=9.0) for _ in levels)
    found = join_runs(simulate(Simulation(runs=runs), 4))
    level = levels[found.run]
    wave = np.cos(found.theta)
    return replace(
        found,
        velocity=found.direction * (10.0 + level),
        temperature=20.0 + level + 0.01 * wave,
        torque=(3.0 + level) * wave,
        mount=np.radians(level),
        coupled={"elbow": found.degrees + level},
    )


@pytest.mark.parametrize("factor", CARRIED)
def test_a_control_has_the_labels_of_other_runs_and_nothing_else(factor: str) -> None:
    """The same labels, each in one run; what does not carry them is untouched."""
    given = signals_of(np.arange(RUNS) * 2.0)
    unit, drawn = given.run, []
    for seed in range(8):
        found = _shuffled(given, factor, unit, np.random.default_rng([31, seed]))
        for name in (f.name for f in fields(Signals)):
            if name not in CARRIED[factor]:
                assert getattr(found, name) is getattr(given, name), name
        at = [slice(a, b) for a, b in given.run_bounds()]
        if factor in ("direction", "velocity"):
            signs = [found.direction[w] * given.direction[w] if factor == "direction"
                     else found.velocity[w] / given.velocity[w] for w in at]  # fmt: skip
            assert all(np.ptp(sign) < 1e-12 for sign in signs)
            drawn.append([sign[0] for sign in signs])
            # Half of the runs, so that the mean is no label.
            assert sorted(np.round(drawn[-1])) == [-1.0] * 3 + [1.0] * 3
            np.testing.assert_array_equal(
                found.direction if factor == "direction" else given.direction,
                found.segment_direction[found.segment],
            )
        elif factor in ("temperature", "mount"):
            before, after = getattr(given, factor), getattr(found, factor)
            means = [[float(v[w].mean()) for w in at] for v in (before, after)]
            assert sorted(means[1]) == pytest.approx(sorted(means[0]))
            drawn.append(np.round(means[1], 9).tolist())
            for w in at:
                # What changes within a run stays.
                np.testing.assert_allclose(
                    after[w] - after[w].mean(), before[w] - before[w].mean(), atol=1e-9
                )
        elif factor == "torque":
            ratio = [float(np.median(found.torque[w] / given.torque[w])) for w in at]
            sizes = [float(np.abs(found.torque[w]).mean()) for w in at]
            own = [float(np.abs(given.torque[w]).mean()) for w in at]
            assert sorted(sizes) == pytest.approx(sorted(own))
            assert min(ratio) > 0.0
            drawn.append(np.round(sizes, 9).tolist())
        elif factor == "coupled":
            for w in at:
                before, after = given.coupled["elbow"][w], found.coupled["elbow"][w]
                assert np.sort(np.abs(after)) == pytest.approx(np.sort(np.abs(before)))
                assert not np.allclose(np.abs(after), np.abs(before))
            drawn.append([float(np.sign(found.coupled["elbow"][w]).sum()) for w in at])
        else:
            turned = [found.theta[w] - given.theta[w] for w in at]
            assert all(np.ptp(each) < 1e-9 for each in turned)
            drawn.append([float(each[0]) for each in turned])
            assert np.unique(np.round(drawn[-1], 6)).size == RUNS
    assert len({tuple(np.round(row, 6)) for row in drawn}) > 1


def test_loads_alike_in_every_run_are_turned_round() -> None:
    """Exchanged, they would be the same loads again: as measured ones are, to some percent."""
    given = signals_of(np.linspace(0.0, 0.3, RUNS))
    found = _shuffled(given, "torque", given.run, np.random.default_rng(3))
    ratio = found.torque / given.torque
    assert sorted(np.unique(np.round(ratio, 9))) == [-1.0, 1.0]
    assert [np.ptp(ratio[a:b]) < 1e-9 for a, b in given.run_bounds()] == [True] * RUNS


@pytest.mark.parametrize("size", [4.0, 0.1])
def test_the_share_of_a_control_is_that_of_columns_with_other_labels(size: float) -> None:
    """A cause that no label makes gains as much under others; one that a label makes does not."""
    given = signals_of(np.arange(RUNS) * 2.0, 200)
    around = Simulation().surroundings
    effect = EFFECTS["backlash"]
    noise = np.random.default_rng(7).standard_normal(len(given))
    fitted = Regression.of(given, noise + size * given.direction, around, rho=0.0)
    fitted = fitted.with_terms([effect.propose(fitted)])
    found = _control(fitted, [0], given.run, np.random.default_rng(9))
    # Slow: the size from odd runs under exchanged directions, in the even ones, three times.
    rest = fitted.with_terms([])
    y, left = (
        np.where(fitted.outlying, 0.0, at.left - at.whiten.run_part(at.left))
        for at in (rest, fitted)
    )
    test, rng, shares = given.run % 2 == 0, np.random.default_rng(9), []
    for _ in range(3):
        other = _shuffled(given, "direction", given.run, rng).direction
        told = other[~test] @ y[~test] / (other[~test] @ other[~test])
        p0, p1 = np.mean(y[test] ** 2), np.mean((y[test] - told * other[test]) ** 2)
        shares.append(max((p0 - p1) / (p0 - np.mean(left[test] ** 2)), -1.0))
    assert found == pytest.approx(np.mean(shares), abs=1e-9)
    assert found < 0.5


def test_one_run_is_held_out_in_ten_stretches_of_its_record() -> None:
    one = signals_of(np.zeros(1), 205)
    fitted = Regression.of(one, np.zeros(len(one)), Simulation().surroundings, rho=0.0)
    _, unit, parts, what = _parts(fitted)
    assert what == "segments of the one run (5 parts)"
    assert (np.sum(parts, axis=0) == 1).all()  # each reading is held out once
    assert np.bincount(unit).tolist() == [21, 20, 21, 20, 21, 20, 21, 20, 21, 20]
    assert (np.diff(unit) >= 0).all()
    several = signals_of(np.zeros(3))
    several = several.take(several.run != 1)
    fitted = Regression.of(several, np.zeros(len(several)), Simulation().surroundings, rho=0.0)
    _, unit, _, what = _parts(fitted)
    assert (what, np.unique(unit).tolist()) == ("whole runs (2 parts)", [0, 1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_levels_are_of_what_each_run_is_at(sign: float) -> None:
    """In the unit of each factor, ascending; a mirrored motion is at the same speeds."""
    levels = np.array([4.0, 0.0, 8.0, 4.0, 0.0, 8.0])
    given = signals_of(levels)
    assert given.velocity is not None
    given = replace(given, velocity=sign * given.velocity)
    place = np.searchsorted([0.0, 4.0, 8.0], levels)[given.run]
    torque = np.abs(np.cos(given.theta[given.run == 0])).mean()
    wanted = {
        "velocity": [10.0, 14.0, 18.0],
        "temperature": [20.0, 24.0, 28.0],
        "mount": [0.0, 4.0, 8.0],
        "torque": [torque * size for size in (3.0, 7.0, 11.0)],
    }
    for factor, values in wanted.items():
        level, found = levels_of_runs(given, factor)
        np.testing.assert_array_equal(level, place, err_msg=factor)
        assert found == pytest.approx(values, abs=0.06), factor
    # A load of one sign has it.
    assert given.torque is not None
    hanging = replace(given, torque=sign * (given.torque * 0.0 + 2.0 + levels[given.run]))
    assert levels_of_runs(hanging, "torque")[1] == pytest.approx(sorted([sign * 2.0, sign * 6.0,
                                                                      sign * 10.0]))  # fmt: skip
    # Beside a load of either sign all count by their sizes, to whichever side they pull; beside
    # a run that feels next to none they have theirs.
    either = given.torque / torque  # of sizes 3 to 11 on average
    pulled = np.where(given.run == 1, -5.0, np.where(given.run == 4, 5.0, either))
    level, found = levels_of_runs(replace(given, torque=sign * pulled), "torque")
    assert found == pytest.approx([5.0, 7.0, 11.0], abs=0.06)
    np.testing.assert_array_equal(level, place)
    small = np.where(given.run == 1, -5.0, np.where(given.run == 4, 5.0, 0.03 * either))
    found = levels_of_runs(replace(given, torque=sign * small), "torque")[1]
    assert found == pytest.approx([-5.0, 0.0, 5.0], abs=0.1)
    # Loads within a tenth of each other are one, to whichever side they pull.
    alike = replace(given, torque=sign * (20.0 + 0.3 * levels[given.run]))
    assert levels_of_runs(alike, "torque") is None
    assert levels_of_runs(given, "time") is None
    assert levels_of_runs(
        replace(given, temperature=20.0 + 0.2 * levels[given.run]), "temperature"
    ) is (None)
    # Of more than five, neighbours are one: all are in one, and values are their means.
    many = np.arange(7) * 5.0
    level, found = levels_of_runs(signals_of(many), "temperature")
    assert len(found) == 5
    assert level[::80].tolist() == [0, 0, 1, 2, 2, 3, 4]
    assert found == pytest.approx([22.5, 30.0, 37.5, 45.0, 50.0], abs=0.02)


def test_a_law_is_held_against_each_level_that_was_left_out() -> None:
    """A delay at three speeds: before, its error and the noise; after, the noise alone."""
    given = signals_of(np.array([0.0, 8.0, 20.0] * 2), 200)
    effect, around = EFFECTS["latency"], Simulation().surroundings
    column = effect.columns(given, around, {})[:, 0]
    error = column * (6.0 / np.std(column))
    noise = np.random.default_rng(15).standard_normal(len(given))
    fitted = Regression.of(given, error + noise, around, rho=0.0)
    fitted = fitted.with_terms([effect.propose(fitted)])
    rng = np.random.default_rng(16)
    found = gains_by_level(fitted, [[0]], False, given.run, rng)[0]
    assert (found.factor, found.unit) == ("velocity", "deg/s")
    assert found.levels == found.held_out == pytest.approx([10.0, 18.0, 30.0])
    assert found.rms_before == pytest.approx(np.hypot(6.0, 1.0), rel=0.03)
    assert found.rms_after == pytest.approx(1.0, rel=0.05)
    assert found.reducible_share == pytest.approx(1.0, abs=0.01)
    # One that shows at the fastest speed alone is not asked where it does not show.
    weak = Regression.of(given, 0.012 * error + noise, around, rho=0.0)
    weak = weak.with_terms([effect.propose(weak)])
    found = gains_by_level(weak, [[0]], False, given.run, rng)[0]
    assert found.levels == pytest.approx([10.0, 18.0, 30.0])
    assert found.held_out == []
    assert (found.rms_before, found.rms_after, found.reducible_share) == (None, None, None)


@pytest.mark.parametrize(
    ("levels", "held", "words"),
    [
        ((1.0, 2.0), (1.0, 2.0), "fitted at one level, tested at the other"),
        ((1.0, 2.0), (2.0,), "tested at the other; the other levels are needed for the fit"),
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), "tested at levels between and beyond"),
        ((1.0, 2.0, 3.0), (3.0,), "between and beyond those fitted; the other levels are"),
        ((1.0, 2.0, 3.0), (2.0,), "tested at levels between those fitted; the other levels are"),
    ],
)
def test_it_is_said_how_far_a_law_was_carried(levels, held, words) -> None:
    said = _reach(list(levels), list(held))
    assert words in said
    assert ("needed" in said) == (len(held) < len(levels))


def test_a_delay_gains_what_it_explains() -> None:
    given = signals_of(np.arange(RUNS) * 2.0, 200)
    around = Simulation().surroundings
    noise = np.random.default_rng(8).standard_normal(len(given))
    without = Regression.of(given, noise + 3.0 * given.direction, around, rho=0.0)
    delayed = without.with_terms([EFFECTS["backlash"].propose(without)])
    gain = measure_delay_gain(without, delayed)
    assert gain.before[0] == pytest.approx(np.hypot(1.0, 3.0), rel=0.04)
    assert gain.after[0] == pytest.approx(1.0, rel=0.04)
    assert gain.after[1] < gain.before[1]
    assert gain.reducible_share == pytest.approx(1.0, abs=0.02)
    assert gain.interval[0] <= gain.reducible_share <= gain.interval[1]
    assert gain.interval[1] - gain.interval[0] < 0.1
    assert gain.holdout == "whole runs (5 parts)"


def test_a_gain_is_told_with_each_number_at_its_name() -> None:
    level = LevelGain("velocity", "deg/s", [5.0, 30.0], [5.0], 21.0, 22.0, 0.23, (0.1, 0.4), "law")
    gain = Gain("runs", (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 0.7, (0.6, 0.8), 0.09, "note", level)
    told = gain.to_dict()
    names = [f"{name}_{when}_arcsec" for when in ("before", "after")
             for name in ("rms", "peak_to_peak", "max_abs")]  # fmt: skip
    assert [told[name] for name in names] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert (told["reducible_share"], told["reducible_share_interval"]) == (0.7, [0.6, 0.8])
    assert (told["control_share"], told["note"], told["holdout"]) == (0.09, "note", "runs")
    assert str(gain) == repr(gain) == "Gain(rms 1 -> 4 arcsec, share 0.7, runs)"
    of_level = told["by_level"]
    assert (of_level["rms_before_arcsec"], of_level["rms_after_arcsec"]) == (21.0, 22.0)
    assert (of_level["levels"], of_level["held_out"]) == ([5.0, 30.0], [5.0])
    assert of_level["reducible_share_interval"] == [0.1, 0.4]


def test_zeros_of_their_own_are_the_medians_of_held_out_runs() -> None:
    """A wild reading and another run's zero move none of the others."""
    given = signals_of(np.zeros(3), 81)
    zeros = np.array([5.0, -700.0, 90.0])
    noise = np.random.default_rng(13).normal(size=len(given))
    noise[7] += 1e6
    residual = zeros[given.run] + noise
    base = np.ones((len(given), 1))
    law = HoldOutModel(np.array([2.0]), [], Simulation().surroundings)
    left = residual_at_held_out(law, given, base, residual, False)
    np.testing.assert_allclose(left, residual - 2.0)
    own = residual_at_held_out(law, given, base, residual, True)
    for start, stop in given.run_bounds():
        part = residual[start:stop]
        np.testing.assert_allclose(own[start:stop], part - np.sort(part)[40], atol=1e-9)
    # The three numbers of what is left, of either sign.
    for sign in (-1.0, 1.0):
        e = sign * np.array([1.0, -2.0, 4.0])
        assert error_numbers(e) == pytest.approx((np.sqrt(7.0), 6.0, 4.0))
