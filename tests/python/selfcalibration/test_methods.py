"""Whole self-calibrations: every unit, both mirrors, any order of runs; the numbers beside."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from selfcalibration import exam
from trueangle.errors import ArgumentError, NoModelError
from trueangle.selfcalibration.orderchoice import significant_orders
from trueangle.selfcalibration.projected import Projected, harmonic_unknowns
from trueangle.simulation import Harmonic, RunDesign, Simulation

from .test_other_methods import dual_log, heads_log, shifts_log

#: Relative; a fit ends when its steps are below a fiftieth of its errors.
SAME = 1e-6
UNITS = {"deg": 360.0, "turn": 1.0}


def in_unit(log: dict, unit: str) -> dict:
    """A log of radians in another unit."""
    scale = UNITS[unit] / (2.0 * np.pi)
    return {
        name.replace("_rad", f"_{unit}"): values * scale if name.endswith("_rad") else values
        for name, values in log.items()
    }


def numbers(value: object) -> list[float]:
    """All numbers of a result, in order."""
    if isinstance(value, dict):
        return [n for key in sorted(value) for n in numbers(value[key])]
    if isinstance(value, list | tuple):
        return [n for one in value for n in numbers(one)]
    return [float(value)] if isinstance(value, int | float) else []


def assert_same(a: ta.SelfCalibration, b: ta.SelfCalibration) -> None:
    left, right = ({k: v for k, v in r.to_dict().items() if k != "notes"} for r in (a, b))
    np.testing.assert_allclose(numbers(left), numbers(right), rtol=SAME, atol=1e-6)


LOGS = {
    "heads": (lambda: heads_log([0.0, 119.2, 203.7], 11, n=900), {"orders": [1, 2, 5]}),
    "shifts": (lambda: shifts_log([0.0, 84.4, 240.7], 12, n=128), {"orders": [1, 2, 5]}),
    "dual": (lambda: dual_log(7.3, 13), {"gear_ratio": 7.3, "orders": [1, 2, 7]}),
}


@pytest.mark.parametrize("method", LOGS)
@pytest.mark.parametrize("unit", UNITS)
def test_every_unit_gives_the_same_result(method: str, unit: str) -> None:
    make, options = LOGS[method]
    log = make()
    found = ta.selfcal(log, method=method, **options)
    assert_same(found, ta.selfcal(in_unit(log, unit), method=method, **options))


@pytest.mark.parametrize("method", LOGS)
def test_a_mirrored_joint_gives_mirrored_patterns(method: str) -> None:
    make, options = LOGS[method]
    log = make()
    mirrored = {n: -v if n.endswith("_rad") or n == "shift_deg" else v for n, v in log.items()}
    found = ta.selfcal(log, method=method, **options)
    other = ta.selfcal(mirrored, method=method, **options)
    for a, b in zip(found.orders, other.orders, strict=True):
        assert b.cosine == pytest.approx(-a.cosine, abs=0.03 * a.std)
        assert b.sine == pytest.approx(a.sine, abs=0.03 * a.std)
        assert b.std == pytest.approx(a.std, rel=1e-3)
        assert b.retained == pytest.approx(a.retained, rel=1e-3)
    assert other.noise_arcsec == pytest.approx(found.noise_arcsec, rel=1e-4)
    assert (other.readings, other.turns) == (found.readings, pytest.approx(found.turns, rel=1e-3))


def test_heads_tell_their_numbers() -> None:
    found = ta.selfcal(heads_log([0.0, 119.2, 203.7], 11, n=3000), orders=range(1, 9))
    assert found.readings == 9000
    assert found.turns == pytest.approx(3.0, abs=0.01)
    assert found.noise_arcsec == pytest.approx(5.0, rel=0.05)
    assert found.beside["head_angles_deg"] == pytest.approx([0.0, 119.2, 203.7], abs=0.02)
    test = found.held_out["odd_even_turns"]
    rms = np.hypot(5.0, np.sqrt(sum((300.0 / k) ** 2 for k in range(1, 9)) / 2.0))
    assert test.rms_before == pytest.approx(rms, rel=0.02)
    assert 5.0 < test.rms_after < 5.2
    assert test.p > 1e-3
    assert (test.fitted_on, test.judged_on) == ("odd turns", "even turns")
    # What the mean of three heads keeps: most of it is of order 3 or 8.
    mean = {
        k: abs(np.exp(1j * np.radians(k * np.array([0.0, 119.2, 203.7]))).mean()) * 300.0 / k
        for k in range(1, 9)
    }
    worst = max(mean, key=mean.__getitem__)
    (note,) = [n for n in found.notes if "the mean of the heads keeps" in n]
    assert f"of order {worst}," in note
    assert float(note.split("keeps ")[1].split()[0]) == pytest.approx(mean[worst], abs=1.0)
    assert found.notes[0] == "the model corrects the reading of head 1"
    assert found.model.fit.samples == 9000
    assert [b.orders for b in found.blind] == [(0.0,)]
    for turns, noted in ((0.9, True), (1.1, False)):
        theta = np.linspace(0.0, turns * 2.0 * np.pi, 900)
        rng = np.random.default_rng(5)
        log = {
            f"head{i + 1}_rad": np.mod(theta + a + 1e-3 * np.sin(theta + a)
                                       + 1e-5 * rng.normal(size=900), 2.0 * np.pi)
            for i, a in enumerate((0.0, 2.0, 3.3))
        }  # fmt: skip
        short = ta.selfcal(log, orders=[1, 2])
        assert any("turns were travelled" in n for n in short.notes) == noted
        assert any("keeps none" in n for n in short.notes) or short.orders[0].amplitude > 100.0


def test_heads_that_are_wrong_are_named() -> None:
    log = heads_log([0.0, 119.2, 203.7], 11, n=300)
    for angles in ([0.0, 119.2], [0.0, 119.2, np.nan]):
        with pytest.raises(ArgumentError, match="one angle for each of 3 heads"):
            ta.selfcal(log, head_angles=angles)
    with pytest.raises(NoModelError, match=r"two heads or more .* got head1"):
        ta.selfcal({"head1_rad": log["head1_rad"]}, method="heads")
    noise = {n: v * 0.0 + np.radians(120.0 * k) for k, (n, v) in enumerate(log.items())}
    rng = np.random.default_rng(6)
    noise = {n: v + 1e-5 * rng.normal(size=v.size) for n, v in noise.items()}
    with pytest.raises(NoModelError, match="differ at no significant order"):
        ta.selfcal(noise, method="heads")


def test_dual_encoders_tell_their_numbers() -> None:
    log = dual_log(7.3, 13)
    found = ta.selfcal(log, gear_ratio=7.3)
    assert found.readings == 6000
    assert found.turns == pytest.approx(3.0, abs=0.01)
    assert found.noise_arcsec == pytest.approx(5.0, rel=0.05)
    want = {1.0: (100.0, 0.3), 2.0: (50.0, 1.0), 7.0: (40.0, 2.0)}
    for o in found.orders:
        if o.order in want:
            size, phase = want[o.order]
            assert abs(o.cosine - size * np.sin(phase)) < 4.5 * o.std
            assert abs(o.sine - size * np.cos(phase)) < 4.5 * o.std
            assert o.std == pytest.approx(5.0 * np.sqrt(2.0 / 6000.0), rel=0.1)
            assert o.of == f"output {o.order:g} (output encoder or gear)"
    for test in found.held_out.values():
        assert test.p > 1e-3
        rms = np.sqrt(25.0 + (100.0**2 + 50.0**2 + 40.0**2 + 60.0**2 + 30.0**2) / 2.0)
        assert test.rms_before == pytest.approx(rms, rel=0.05)
        assert 4.7 < test.rms_after < 5.5
    assert found.beside["gear_ratio"] == 7.3
    assert abs(found.beside["gear_ratio_measured"] - 7.3) < 4.5 * found.beside["gear_ratio_std"]
    with pytest.raises(ArgumentError, match="gear_ratio must be motor turns per output turn"):
        ta.selfcal(log, method="dual", gear_ratio=0.0)
    with pytest.raises(ArgumentError, match="gear_ratio must be motor turns per output turn"):
        ta.selfcal(log, method="dual", gear_ratio=np.inf)


def test_shifts_tell_their_numbers() -> None:
    found = ta.selfcal(shifts_log([0.0, 84.4, 240.7], 8200), orders=range(1, 9))
    assert found.readings == 3 * 512
    assert found.turns == pytest.approx(3.0, abs=0.02)
    # Two readings of 2 arcsec each.
    assert found.noise_arcsec == pytest.approx(2.0 * np.sqrt(2.0), rel=0.06)
    assert found.beside["shifts_deg"] == pytest.approx([0.0, 84.4, 240.7], abs=0.01)
    assert [b.orders for b in found.blind] == [(0.0,)]
    others = found.beside["other"]
    assert [o["order"] for o in others] == list(range(1, 9))
    for k, o in enumerate(others, 1):
        assert abs(o["amplitude_arcsec"] - 200.0 / k) < 4.5 * o["std_arcsec"]
        assert o["phase_deg"] == pytest.approx(np.degrees(1.3 * k) % 360.0, abs=1.0)
        assert o["std_arcsec"] == pytest.approx(found.orders[k - 1].std, rel=0.1)
    assert any("coupling" in key for key in found.beside)
    assert found.beside["coupling_arcsec"] < 1.0


def test_an_order_stands_out_where_chance_makes_none_of_thirty_so_large() -> None:
    """Chi-squared of cosine and sine by their covariance, at a hundredth for all together."""
    orders = [float(k) for k in range(1, 31)]
    half = np.array([[2.0, 0.0], [0.7, 0.5]])
    limit = float(stats.chi2.isf(0.01 / 30.0, 2))
    size = np.sqrt(limit * np.where(np.arange(30) % 3 == 0, 1.01, 0.99))
    turned = np.stack([np.cos(np.arange(30.0)), np.sin(np.arange(30.0))], axis=1)
    values = (size[:, None] * turned) @ half.T
    columns = tuple(harmonic_unknowns("the encoder", orders))
    one = np.ones(60)
    told = Projected(columns, np.eye(60), one, one, 1.0, 900.0)
    covariance = np.kron(np.eye(30), half @ half.T)
    kept = significant_orders(told, values.ravel(), covariance, orders)
    assert kept == tuple(orders[::3])


#: Seeds of these tests: none of the exam's.
FIRST = 7_300_000

#: Standard deviations by which an rms of a few seeds may be off: one in 15 000 beyond 4.
FAR = 4.0


def seeds(count):
    print("seeds", FIRST, "to", FIRST + count - 1)
    return range(FIRST, FIRST + count)


def test_the_limit_of_white_noise_is_met():
    # Cosine and sine of three orders: the rms of n numbers scatters by 1 / sqrt(2 n).
    figure = next(exam.limit(seeds(6)))
    print(figure)
    assert abs(figure.value - 1.0) < FAR / np.sqrt(2.0 * 6 * 6)


@pytest.mark.parametrize("row", [exam.weighed, exam.ripple, exam.wander])
def test_stated_errors_hold(row):
    # 95 % inside two standard errors: of 30 numbers 24 or fewer with probability 1 in 500.
    figure = next(row(seeds(5)))
    print(figure)
    assert figure.value >= 24 / 30


@pytest.mark.parametrize("row", [exam.one_speed, exam.loop, exam.heads])
def test_what_is_blind_is_refused(row):
    figure = next(row(seeds(5)))
    print(figure)
    assert figure.value == 1.0


def test_closure_and_dual_are_at_their_limits():
    for row, count in ((exam.closure, 12), (exam.dual, 6)):
        for figure in row(seeds(count)):
            print(figure)
            assert figure.met


COAST = RunDesign(
    speed_deg_s=3600.0, speed_end_deg_s=720.0, turns=100.0, samples=20_000, spacing="uniform"
)


@pytest.fixture(scope="module")
def runs():
    lines = (Harmonic("output", 1, 300.0, 20.0), Harmonic("output", 2, 150.0, 60.0))
    return ta.simulate(Simulation(harmonics=lines, sigma_arcsec=20.0, runs=(COAST,)), seed=8401)


def test_a_simulated_coast_slows_down_by_itself(runs):
    run = runs[0]
    speed = np.gradient(run.reference, run.time)
    assert speed[5] == pytest.approx(3600.0, rel=0.01)
    assert speed[-5] == pytest.approx(720.0, rel=0.01)
    # Viscous friction: the logarithm of the speed falls in proportion to time.
    bend = np.polyfit(run.time[1:-1], np.log(speed[1:-1]), 2)
    assert abs(bend[0]) < 1e-4 * abs(bend[1])
    with pytest.raises(ArgumentError, match="speed_end_deg_s"):
        RunDesign(speed_end_deg_s=-1.0)


def test_a_report_says_what_had_no_reference(runs, tmp_path):
    found = ta.selfcal(runs, orders=[1, 2], loop="open", ripple="none")
    assert [round(o.amplitude) for o in found.orders] == [300, 150]
    path = tmp_path / "joint.json"
    found.model.save(path)
    made = ta.report(runs, orders=[1, 2], model=path)
    told = made.content["given_model"]
    assert told["calibrated_without_reference"] is True
    assert any("zero" in said for said in told["blind"])
    assert told["after_arcsec"] == pytest.approx(20.0, rel=0.05)
    assert told["before_arcsec"] > 200.0
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    page = made.html
    assert page.index("calibrated without a reference") < page.index('class="verdict') + 400
