"""What is in the readings beside a pattern: found, told, taken out, or refused."""

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.cli.values import declared_shafts
from trueangle.errors import ArgumentError
from trueangle.fitting.nuisance import Nuisance

SIGMA = 0.002
LINES = ((1, 0.05, 30.0), (3, 0.02, 200.0))


def sweeps(seed, count=4, there_and_back=True, turns=2.0, noise=SIGMA):
    """Runs of constant but unlike speeds, with time; angle, time and sense of each."""
    rng = np.random.default_rng(seed)
    for r in range(count):
        speed = 5.0 * (1.0 + r)
        there = np.arange(0.0, 360.0 * turns, 2.0)
        x = np.concatenate([there, there[::-1]]) if there_and_back else there
        t = np.arange(x.size) * 2.0 / speed
        error = sum(c * np.sin(np.radians(k * x + p)) for k, c, p in LINES)
        sense = np.repeat([1.0, -1.0], there.size)[: x.size]
        if there_and_back:
            sense[there.size] = 1.0  # it stands where it turned
        yield r, x, t, sense, sense * speed, error + noise * rng.normal(size=x.size), rng


def runs_with(effect, seed=0, **design):
    return [
        ta.CalibrationRun(x, x + e + effect(r, x, t, s, v) + r, 360.0, time=t, label=f"r{r}")
        for r, x, t, s, v, e, _ in sweeps(seed, **design)
    ]


def none(r, x, t, s, v):
    return 0.0 * x


def ramp(r, x, t, s, v):
    return 4e-4 * x


def reversal(r, x, t, s, v):
    return 0.03 * s


def lag(r, x, t, s, v):
    return -0.004 * v


def drift(r, x, t, s, v):
    return 0.05 * np.sin(2.5 * t / t[-1] + r)


@pytest.mark.parametrize(
    ("effect", "kind"),
    [(ramp, "ramp"), (reversal, "direction"), (lag, "velocity"), (drift, "drift")],
)
@pytest.mark.parametrize("orders", [None, [1, 3]])
def test_an_effect_is_found_taken_out_and_told(effect, kind, orders):
    runs = runs_with(effect)
    found = ta.fit(runs, orders, nuisance="auto")
    assert kind in found.nuisance.kinds
    assert found.orders == (1, 3)
    assert found.amplitudes == pytest.approx([0.05, 0.02], abs=6 * SIGMA / np.sqrt(5000))
    assert found.residual_std == pytest.approx(SIGMA, rel=0.1)
    assert any("itted jointly with the pattern" in note for note in found.notes)
    assert ta.fit(runs, [1, 3]).residual_std > 3.0 * SIGMA
    # The one reading where the travel turns has another speed than differences say.
    assert {1, 3} <= set(ta.select_orders(runs, nuisance="auto").orders)


def test_sizes_are_those_put_in():
    assert ta.fit(runs_with(ramp), [1, 3], nuisance="ramp").nuisance.slope == pytest.approx(
        4e-4, rel=0.01
    )
    found = ta.fit(runs_with(reversal), [1, 3], nuisance=["direction"]).nuisance
    assert found.half_width == pytest.approx(0.03, rel=0.01)
    assert ta.fit(runs_with(lag), [1, 3], nuisance="velocity").nuisance.delay == pytest.approx(
        -0.004, rel=0.01
    )


@pytest.mark.parametrize("seed", range(5))
def test_clean_runs_have_none(seed):
    runs = runs_with(none, seed)
    found = ta.fit(runs, nuisance="auto")
    assert found.nuisance.kinds == ()
    alone = ta.fit(runs)
    assert found.orders == alone.orders
    # What the evidence knows of the noise moves a coefficient by a part of its standard error.
    apart = found.amplitudes * np.exp(1j * found.phases)
    apart -= alone.amplitudes * np.exp(1j * alone.phases)
    assert np.abs(apart).max() < 0.3 * SIGMA / np.sqrt(1440)


def test_what_the_design_cannot_tell_is_left_and_told():
    """One direction at one speed: a lag is a zero, nothing to take out."""
    runs = runs_with(lag, there_and_back=False)
    found = ta.fit(runs, nuisance="auto")
    assert "velocity" not in found.nuisance.kinds
    with pytest.raises(ArgumentError, match="needs runs that reverse"):
        ta.fit(runs[:1], nuisance="direction")


def test_lines_of_the_reference_are_fitted_and_not_in_the_model():
    rng = np.random.default_rng(4)
    x = np.sort(rng.uniform(0.0, 360.0, 3000))
    e = (
        0.05 * np.sin(np.radians(x))
        + 0.03 * np.sin(np.radians(50 * x))
        + SIGMA * rng.normal(size=3000)
    )
    run = ta.CalibrationRun(x, x + e, 360.0)
    for orders in (None, [1]):
        found = ta.fit(run, orders, reference_orders=[50, 100])
        assert found.orders == (1,)
        assert found.residual_std == pytest.approx(SIGMA, rel=0.1)
        assert any("lines of the reference" in note for note in found.notes)


@pytest.mark.parametrize("mounted", ["anew", "once"])
def test_a_reference_that_is_mounted_anew_has_its_phase_in_every_run(mounted):
    """A stepper as the reference: its zero, and so the phase of its lines, is new in every run."""
    rng = np.random.default_rng(41)
    runs, turned = [], []
    for r in range(5):
        zero = rng.uniform(0.0, 7.2) if mounted == "anew" else 3.0
        x = np.sort(rng.uniform(0.0, 360.0, 2000))
        lines = 0.03 * np.sin(np.radians(50 * (x + zero))) + 0.01 * np.sin(np.radians(100 * x))
        e = sum(c * np.sin(np.radians(k * x + p)) for k, c, p in LINES) + lines
        runs.append(ta.CalibrationRun(x, x + e + SIGMA * rng.normal(size=2000) + r, 360.0))
        turned.append(50 * zero)
    for orders in (None, [1, 3]):
        found = ta.fit(runs, orders, argument="reference", reference_orders=[50, 100])
        assert found.orders == (1, 3)
        assert found.residual_std == pytest.approx(SIGMA, rel=0.05)
        assert found.amplitudes == pytest.approx([0.05, 0.02], abs=6 * SIGMA / np.sqrt(5000))
        assert ("turned" in found.nuisance.kinds) == (mounted == "anew")
    if mounted == "anew":
        (order, amplitude, phases), _ = found.nuisance.turned
        assert (order, amplitude) == (50.0, pytest.approx(0.03, rel=0.02))
        off = np.degrees(phases) - turned
        assert np.abs(ta.wrap(off, 360.0)).max() < 6.0 * np.degrees(SIGMA / 0.03 / np.sqrt(1000))
        (told,) = (note for note in found.notes if "its zero changes" in note)
        assert "not in the model" in told
        assert "order 50: 108 arcsec" in told
    chosen = ta.select_orders(runs, argument="reference", reference_orders=[50, 100])
    assert chosen.orders == (1, 3)
    assert any("its zero changes" in n for n in chosen.notes) == (mounted == "anew")


def test_standard_errors_grow_beside_a_nuisance():
    """An arc travelled once at one speed: a drift takes much of what order 1 says."""
    x = np.linspace(0.0, 340.0, 400)
    rng = np.random.default_rng(5)
    hit = []
    for _ in range(60):
        e = 0.05 * np.sin(np.radians(x)) + SIGMA * rng.normal(size=x.size)
        run = ta.CalibrationRun(x, x + e, 360.0, time=x / 5.0)
        found = ta.fit(run, [1], nuisance="ramp", ridge=0.0)
        low, high = found.interval()[2]
        hit.append(low < 0.05 < high)
    assert found.nuisance.inflation[1] > 1.5
    assert np.mean(hit) > 0.88  # 95 % of 60, three standard deviations


def test_unknown_names_are_refused():
    runs = runs_with(none)
    with pytest.raises(ArgumentError, match="nuisance must be 'auto', 'none' or some of"):
        ta.fit(runs, nuisance="temperature")
    with pytest.raises(ArgumentError, match="--shaft must look like"):
        declared_shafts(["worm"])
    assert declared_shafts(["worm=144", "belt = 2.5"]) == {"worm": 144.0, "belt": 2.5}


def test_a_declared_shaft_is_looked_for_and_named():
    rng = np.random.default_rng(6)
    x = np.linspace(0.0, 720.0, 6000)
    e = (
        0.05 * np.sin(np.radians(x))
        + 0.02 * np.sin(np.radians(2 * 37.5 * x))
        + SIGMA * rng.normal(size=x.size)
    )
    chosen = ta.select_orders(ta.CalibrationRun(x, x + e, 360.0), shafts={"belt": 37.5})
    assert chosen.by_shaft == {"output": (1, 75)} or chosen.by_shaft["belt"] == (2,)
    assert any("twice per turn of the belt" in str(e) for e in chosen.row(75).explanations)


def test_the_telescope_without_its_drift(data_dir):
    (run,) = ta.read_runs(data_dir / "telescope_worm.csv")
    count = int(0.6 * len(run))
    parts = [
        ta.CalibrationRun(run.reference[s], run.indicated[s], 360.0, time=run.time[s])
        for s in (slice(0, count), slice(count, None))
    ]
    for options in ({"orders": [144, 288]}, {"shafts": {"worm": 144.0}}):
        found = ta.fit(parts[0], nuisance="auto", **options)
        assert found.orders == (144, 288)
        with pytest.warns(ta.errors.OutsideSpanWarning):
            left = (found.model.correct(parts[1].indicated) - parts[1].reference) * 3600.0
        left -= np.polyval(np.polyfit(parts[1].time, left, 1), parts[1].time)
        # 3.33 by cubic spline and orders 144, 288 in numpy; 5.9 uncorrected.
        assert np.sqrt(np.mean(left**2)) <= 3.7


def test_the_haptic_joint_with_direction_and_velocity(data_dir):
    table = np.genfromtxt(data_dir / "haptic_joint_dual_encoder.csv", delimiter=",", names=True)
    half = len(table) // 2
    ratio = np.polyfit(table["reference_deg"][:half], table["motor_deg"][:half], 1)[0]
    first, second = (
        ta.CalibrationRun(t["reference_deg"], t["motor_deg"] / ratio, 360.0, time=t["time_s"])
        for t in (table[:half], table[half:])
    )
    found = ta.fit(
        first, {"motor": range(1, 9)}, gear_ratio=ratio, fixed_member="none", nuisance="auto"
    )
    assert {"direction", "velocity"} <= set(found.nuisance.kinds)
    error = found.model.error(second.reference) + found.nuisance.predict(second)
    left = (second.centred_error - error) * 3600.0
    # 165 arcsec in numpy; a line alone leaves 768.
    assert (left - left.mean()).std() <= 185.0


def test_the_commands_take_nuisances_and_shafts(tmp_path, capsys):
    lines = ["run,time_s,reference_deg,indicated_deg"]
    for run in runs_with(reversal):
        rows = zip(run.time.tolist(), run.reference.tolist(), run.indicated.tolist(), strict=True)
        lines += [f"{run.label},{t!r},{x!r},{y!r}" for t, x, y in rows]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(lines) + "\n")
    model = tmp_path / "m.json"
    command = [
        "fit",
        str(path),
        "-o",
        str(model),
        "--nuisance",
        "auto",
        "--shaft",
        "worm=40",
        "--json",
    ]
    assert main(command) == 0
    found = json.loads(capsys.readouterr().out)
    assert [o["order"] for o in found["orders"]] == [1, 3]
    assert any("reversal error" in note for note in found["notes"])
    assert main(["orders", str(path), "--nuisance", "direction", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert {1, 3} <= {row["order"] for row in printed["orders"] if row["retained"]}
    assert main(["fit", str(path), "-o", str(model), "--nuisance", "wind"]) == 1
    assert "wind" in capsys.readouterr().err


def test_what_was_taken_out_is_said_with_its_size_and_unit():
    taken = Nuisance(("ramp", "direction", "velocity", "drift", "reference", "turned"),
                     slope=3.14e-6, half_width=0.002, delay=-0.0005, intervals=1,
                     reference=((2.0, 0.1, 0.2), (5.0, 0.3, 0.4)),
                     turned=((3.0, 0.001, (0.1, 0.2)),), shares=(("drift", 0.25),))  # fmt: skip
    beside = "fitted jointly with the pattern, and not in the model: "
    assert [s.removeprefix(beside) for s in taken.sentences(360.0)] == [
        "a ramp of 3.14 ppm of the angle (a wrong scale or ratio)",
        "a reversal error of +-7.2 arcsec with the direction",
        "an error of -0.5 ms times the velocity (a delay)",
        "a drift in time (cubic spline of 1 interval in every run), 25 % of the held-out error",
        "2 lines of the reference",
        "lines of the reference with a new phase in every run, because its zero "
        "changes (order 3: 3.6 arcsec)",
    ]
    assert "of 2 intervals in" in next(iter(Nuisance(("drift",), intervals=2).sentences(360.0)))
    turn = Nuisance(("direction",), half_width=0.002 / 360.0)
    assert next(iter(turn.sentences(1.0))).endswith("of +-7.2 arcsec with the direction")
