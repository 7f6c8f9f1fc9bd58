"""From effects and findings to a correction model, measured on runs held out."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle import errors
from trueangle.cli import main
from trueangle.diagnosis.correction import (
    NOT_AT_RUN_TIME,
    extend_model,
    terms_from_effects,
    without_terms,
)
from trueangle.effects import EFFECTS, KINDS, Effect
from trueangle.model.terms import TERMS
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

ARCSEC = 1.0 / 3600.0

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (
    Harmonic("output", 1, 60.0, 30.0),
    Harmonic("motor", 1, 20.0, 10.0),
    Harmonic("motor", 2, 8.0, 100.0),
)

# One of each kind, with every parameter in use.
TABLES = {
    "backlash": {
        "half_width_arcsec": 15.0, "lines": [[1.0, 3.0, 40.0], [2.0, 1.5, 200.0]]
    },
    "direction_dependent_pattern": {
        "orders": [1.0, 3.0], "amplitudes_arcsec": [6.0, 2.0], "phases_deg": [40.0, 200.0]
    },
    "presliding_hysteresis": {"amplitude_arcsec": 20.0, "length_deg": 3.0, "start_state": 1.0},
    "latency": {"delay_s": 4e-4},
    "varying_line": {
        "order": 3.0, "follows": "speed", "amplitude_arcsec": 0.4, "phase_deg": 70.0
    },
    "channel_skew": {"delay_s": 2e-4, "order": 100.0, "phase_deg": 40.0},
    "filter_lag": {"cutoff_hz": 60.0, "damping": 0.7},
    "thermal_drift": {
        "zero_arcsec_per_K": 0.8,
        "pattern_per_K": 2e-3,
        "lines_per_K": [[1.0, 0.3, 40.0], [51.0, 0.05, 200.0]],
        "reference_C": 25.0,
    },
    "torsional_compliance": {"arcsec_per_Nm": 6.0, "lines_per_Nm": [[1.0, 2.0, 70.0]]},
    "stiffening_compliance": {
        "arcsec_per_Nm": 6.0,
        "arcsec_per_Nm3": 0.01,
        "beyond_knee_arcsec_per_Nm": -2.0,
        "knee_Nm": 3.0,
        "gravity_deg": 30.0,
    },
    "current_coupling": {"arcsec_per_A": 3.0, "lines_per_A": [[100.0, 2.0, 30.0]]},
    "joint_coupling": {"joint": "wrist", "factor": -0.06},
    "load_dependent_gear_error": {"lines_per_Nm": [[100.0, 0.4, 20.0]], "torque": "absolute"},
    "local_defect": {
        "place_deg": 90.0, "width_deg": 8.0, "height_arcsec": 12.0, "shaft": "motor"
    },
    "scale_error": {"relative_error": 5e-5, "start_deg": -2000.0, "stop_deg": 2000.0},
    "curve": {
        "factor": "temperature_place", "at": [21.0, 26.0, 30.0], "value_arcsec": [2.0, 9.0, -4.0],
        "shaft": "motor", "orders": [2.0, 3.0], "phase_deg": [40.0, 75.0],
    },
}  # fmt: skip


def effect(kind):
    return KINDS[kind].from_table(TABLES[kind])


def simulation(*effects, sigma=0.0):
    return Simulation(JOINT, LINES, tuple(effects), sigma)


def designs(start, samples=600):
    """Both directions within each run, three speeds, loads and temperatures."""
    levels = [
        (5, 0, 20, 1.0),
        (40, 6, 32, -0.5),
        (15, -6, 20, -1.0),
        (40, 0, 32, 0.5),
        (5, 6, 26, 0.0),
        (15, -6, 26, 2.0),
    ]
    return [
        RunDesign(
            label=f"{start}-{k}",
            direction=1 if k % 2 else -1,
            speed_deg_s=speed,
            samples=samples,
            spacing="jittered",
            start_deg=start + 7.0 * k,
            turns=2.0,
            reversals=(0.35, 0.7),
            torque_Nm=load,
            temperature_C=warm,
            current_A=current,
            coupled={"wrist": [-10.0 * k, 40.0, 15.0 * k]},
        )
        for k, (speed, load, warm, current) in enumerate(levels)
    ]


def harmonic_model(period, terms=()):
    """The simulation's lines as they are, in units of ``period``."""
    unit = period / 1_296_000.0
    shafts = {}
    for line in LINES:
        a, b = line.coefficients
        shafts.setdefault(line.shaft, []).append((line.order, a * unit, b * unit))
    return ta.HarmonicModel(
        [
            ta.Shaft(name, JOINT.shafts[name], *zip(*rows, strict=True))
            for name, rows in shafts.items()
        ],
        period=period,
        terms=terms,
    )


def signals_of(run, unit=1.0):
    return {
        "direction": run.direction,
        "velocity": run.speed * unit,
        "temperature": run.temperature,
        "torque": run.torque,
        "current": run.signal("current"),
        "coupled_wrist": run.signal("coupled_wrist") * unit,
    }


def rms_arcsec(model, runs, **without):
    left = [
        model.correct(run.indicated, **{**signals_of(run), **without}) - run.reference
        for run in runs
    ]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2))) / ARCSEC


@pytest.mark.parametrize("kind", list(TERMS))
def test_no_parameter_of_an_effect_is_dropped_on_the_way_to_its_term(kind):
    table = TABLES[kind]
    as_it_is = terms_from_effects([effect(kind)], 360.0, JOINT.shafts)
    for name, value in table.items():
        if isinstance(value, str):
            texts = {"absolute": "signed", "motor": "output", "speed": "velocity", "wrist": "arm"}
            other = texts.get(value, "load_place")
        elif isinstance(value, list):
            other = [[x[0], 1.5 * x[1], x[2]] if isinstance(x, list) else 1.5 * x for x in value]
        else:
            other = 0.5 * value
        changed = KINDS[kind].from_table(table | {name: other})
        assert terms_from_effects([changed], 360.0, JOINT.shafts) != as_it_is, name


def test_an_effect_that_no_form_can_carry_is_refused():
    class Wobble(Effect):
        def signal(self, signals, around, rng):
            return np.sin(signals.theta)

    Wobble.kind = "wobble"  # defined without it: the vocabulary stays as it is
    with pytest.raises(errors.ArgumentError, match="'wobble' cannot be corrected"):
        terms_from_effects([Wobble()], 360.0)


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi])
@pytest.mark.parametrize("kind", list(TERMS))
def test_terms_have_the_signs_and_units_of_the_simulation(kind, period):
    unit = period / 360.0
    terms = terms_from_effects([effect(kind)], period, JOINT.shafts)
    assert [term.kind for term in terms] == [kind]
    assert terms == terms_from_effects([effect(kind).to_table()], period, JOINT.shafts)
    model, plain = harmonic_model(period, terms), harmonic_model(period)
    worst = without = 0.0
    for run in ta.simulate(simulation(effect(kind)), seed=3, runs=designs(0.0)):
        x, theta = run.indicated * unit, run.reference * unit
        corrected = model.correct(x, **signals_of(run, unit))
        worst = max(worst, np.abs(corrected - theta).max() / unit / ARCSEC)
        without = max(without, np.abs(plain.correct(x) - theta).max() / unit / ARCSEC)
    # The simulation rounds phases to 1e-12 and adds arcsec to degrees of a few turns.
    assert worst < 1e-6
    assert without > 1.0  # the effect is there to be corrected


@pytest.mark.parametrize("kind", list(TERMS))
def test_what_the_terms_leave_is_harmonics(kind):
    terms = terms_from_effects([effect(kind)], 360.0, JOINT.shafts)
    model = harmonic_model(360.0, terms)
    runs = ta.simulate(simulation(effect(kind)), seed=4, runs=designs(0.0))
    for run in without_terms(runs, model):
        expected = harmonic_model(360.0).error(run.reference)
        np.testing.assert_allclose(run.error, expected, rtol=0, atol=1e-6 * ARCSEC)


def test_a_known_simulation_extends_the_model_down_to_the_noise():
    sigma = 1.0
    effects = [effect(k) for k in ("backlash", "latency", "thermal_drift", "torsional_compliance")]
    truth = simulation(*effects, sigma=sigma)
    train = ta.simulate(truth, seed=1, runs=designs(0.0))
    held_out = ta.simulate(truth, seed=2, runs=designs(3.3))
    model = ta.fit(train, {"output": [1], "motor": [1, 2]}, gear_ratio=50.0).model
    extended = extend_model(model, train, truth)
    before, after = rms_arcsec(model, held_out), rms_arcsec(extended, held_out)
    assert before > 20.0
    # 3600 readings: the rms of the noise itself is known to 1.2 %, the fit adds 0.2 %.
    assert after < 1.05 * sigma
    assert extended.signals == ("velocity", "temperature", "torque")
    with pytest.raises(errors.MissingSignalError, match="needs torque"):
        rms_arcsec(extended, held_out, torque=None)


def test_a_line_found_becomes_an_order_and_the_rest_of_the_model_stays():
    missing = EFFECTS["missing_order"].from_table(
        {"shaft": "wave_generator", "order": 2, "amplitude_arcsec": 9.0, "phase_deg": 10.0}
    )
    train = ta.simulate(simulation(missing), seed=1, runs=designs(0.0))
    model = ta.fit(train, {"output": [1], "motor": [1, 2]}, gear_ratio=50.0).model
    extended = extend_model(model, train, simulation(missing))
    assert {s.name: s.orders for s in extended.shafts} == {
        "output": (1,),
        "motor": (1, 2),
        "wave_generator": (2,),
    }
    assert rms_arcsec(extended, train) < 1e-6 < 1.0 < rms_arcsec(model, train)


def test_a_pattern_of_the_indicated_angle_changes_the_argument():
    train = ta.simulate(simulation(effect("latency")), seed=1, runs=designs(0.0))
    model = ta.fit(train, {"output": [1], "motor": [1, 2]}, gear_ratio=50.0).model
    shift = EFFECTS["argument_error"].from_table({"coefficient": -1.0})
    assert extend_model(model, train, simulation(shift)).argument == "indicated"


def test_diagnosing_extends_the_correction(tmp_path, capsys):
    """From runs to a better model on the command line, measured on runs held out."""
    sigma = 1.0
    play = EFFECTS["backlash"].from_table({"half_width_arcsec": 15.0})
    effects = [play, effect("latency"), effect("torsional_compliance")]
    truth = simulation(*effects, sigma=sigma)
    train = ta.simulate(truth, seed=1, runs=designs(0.0, samples=400))
    held_out = ta.simulate(truth, seed=2, runs=designs(3.3))
    model = ta.fit(train, {"output": [1], "motor": [1, 2]}, gear_ratio=50.0).model
    model.save(tmp_path / "joint.json")
    simulation().save(tmp_path / "joint.toml")
    rows = ["run,reference_deg,indicated_deg,time_s,temperature_C,torque_Nm"]
    rows += [
        f"{run.label},{a!r},{b!r},{t!r},{warm!r},{load!r}"
        for run in train
        for a, b, t, warm, load in zip(
            *(
                column.tolist()
                for column in (run.reference, run.indicated, run.time, run.temperature, run.torque)
            ),
            strict=True,
        )
    ]
    (tmp_path / "runs.csv").write_text("\n".join(rows) + "\n")
    command = ["diagnose", str(tmp_path / "runs.csv"), "--simulation", str(tmp_path / "joint.toml")]
    better = tmp_path / "better.json"
    models = ["--model", str(tmp_path / "joint.json"), "--corrected-model", str(better)]
    assert main([*command, *models]) == 0
    assert f"Extended correction model: {better}" in capsys.readouterr().out
    extended = ta.load_model(better)
    assert {term.kind for term in extended.terms} == {e.kind for e in effects}
    # Parameters found from 2400 readings instead of given.
    assert rms_arcsec(extended, held_out) < 1.1 * sigma < 20.0 < rms_arcsec(model, held_out)

    assert main([*command, "--model", str(tmp_path / "joint.json")]) == 1
    assert "belong together" in capsys.readouterr().err


def test_every_cause_is_a_term_or_a_line_or_has_a_reason():
    lines = {"missing_order", "sidebands", "argument_error"}
    assert set(EFFECTS) == (set(TERMS) - {"curve"}) | set(NOT_AT_RUN_TIME) | lines
    assert not set(TERMS) & set(NOT_AT_RUN_TIME)
    found = [EFFECTS["zero_slip"].from_table({"standard_deviation_arcsec": 1.0})]
    assert terms_from_effects(found, 360.0) == ()


def test_an_effect_of_an_unknown_shaft_is_refused():
    with pytest.raises(errors.ArgumentError, match="declare the ratio of shaft 'motor'"):
        terms_from_effects([effect("local_defect")], 360.0)


def corrected_by_steps(model, runs):
    """rms of what `step` leaves of the runs, arcsec, sample by sample."""
    left = []
    for run in runs:
        step = model.corrector().step
        rows = zip(run.indicated, run.speed, run.direction, strict=True)
        corrected = [step(x, velocity=v, direction=d) for x, v, d in rows]
        left.append(np.array(corrected) - run.reference)
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2))) / ARCSEC


@pytest.mark.parametrize(
    ("hidden", "kind"),
    [
        ({"half_width_arcsec": 12.0, "lines": [[1.0, 8.0, 40.0]]}, "backlash"),
        ({"cutoff_hz": 14.0, "damping": 0.5}, "filter_lag"),
    ],
)
def test_all_of_a_finding_reaches_the_corrected_model_and_its_steps(hidden, kind, tmp_path):
    sigma = 0.3
    truth = simulation(EFFECTS[kind].from_table(hidden), sigma=sigma)
    train = ta.simulate(truth, seed=1, runs=designs(0.0, samples=900))
    held_out = ta.simulate(truth, seed=2, runs=designs(3.3))
    found = ta.diagnose(train, simulation(), gain=False)
    assert found.findings[0].cause == kind
    model = ta.fit(train, {"output": [1], "motor": [1, 2]}, gear_ratio=50.0).model
    better = tmp_path / "better.json"
    found.correction(model, train).save(better)
    extended = ta.load_model(better)
    before = rms_arcsec(model, held_out)
    # Parameters found from 5400 readings: what is left is the noise and a tenth.
    assert corrected_by_steps(extended, held_out) < 1.1 * sigma < 0.3 * before
    assert rms_arcsec(extended, held_out) < 1.1 * sigma
    # The extended simulation of the finding, written and read, says the same.
    found.extended.save(tmp_path / "better.toml")
    again = ta.load_simulation(tmp_path / "better.toml")
    np.testing.assert_allclose(again.predict(train), found.extended.predict(train))


# A reading at the very end of the span comes back a rounding error beyond it.
@pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")
def test_a_sideband_of_broken_order_gets_a_shaft_of_its_own():
    joint = Joint(50.5, "circular_spline", "motor")
    bands = EFFECTS["sidebands"].from_table(
        {"carrier": 50.5, "offsets": [-1, 1], "amplitudes_arcsec": [4, 3], "phases_deg": [10, 50]}
    )
    truth = Simulation(joint, (Harmonic("motor", 1, 20.0, 10.0),), (bands,))
    train = ta.simulate(truth, seed=1, runs=designs(0.0))
    model = ta.fit(train, {"motor": [1]}, gear_ratio=50.5).model
    extended = extend_model(model, train, truth)
    assert rms_arcsec(extended, train) < 1e-6 < 1.0 < rms_arcsec(model, train)


# Readings are jittered: one may lie a little beyond those of the other runs.
@pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")
def test_a_wrong_scale_goes_from_the_finding_into_the_corrected_model(tmp_path, capsys):
    """Turns there and back: found, corrected, stepped, stored; not carried by a table."""
    relative, start = 2e-5, -100.0
    runs = [
        RunDesign(
            label=f"r{k}", samples=720, spacing="jittered", start_deg=start, turns=6.0,
            reversals=(0.35, 0.7), speed_deg_s=20.0 + 10.0 * k,
        )
        for k in range(4)
    ]  # fmt: skip
    truth = Simulation(JOINT, LINES, (EFFECTS["scale_error"](relative),), 1.0, tuple(runs))
    believed = Simulation(JOINT, LINES, (), 1.0, tuple(runs))
    measured = ta.simulate(truth, seed=77)
    result = ta.diagnose(measured, believed)
    (found,) = [f for f in result.findings if f.cause == "scale_error"]
    assert found.parameters["relative_error"].value == pytest.approx(relative, rel=0.02)
    assert found.to_dict()["correctable"]
    orders = {"output": [1], "motor": [1, 2]}
    before = ta.fit(measured, orders, gear_ratio=50, nuisance="ramp").model
    assert before.partial_span is None
    after = result.correction(before, measured)
    (term,) = after.terms
    after.save(tmp_path / "m.json")
    assert term.kind == "scale_error"
    assert not after.is_periodic
    travel = [run.unwrapped_reference for run in measured]
    assert term.start == pytest.approx(min(x.min() for x in travel))
    # The reading at a turning point takes no part: the ramp ends with the one before.
    step = max(np.abs(np.diff(x)).max() for x in travel)
    assert term.stop == pytest.approx(max(x.max() for x in travel), abs=step)
    assert after.partial_span == (term.start, term.stop)
    held = ta.simulate(truth, seed=78)
    # Noise of 1 arcsec; the ramp alone has some 750 deg * 2e-5 / sqrt(12), 15 arcsec.
    assert spread_arcsec(after, held) < 1.1 < 5.0 < spread_arcsec(before, held)
    with pytest.warns(errors.OutsideSpanWarning):
        beyond = ta.load_model(tmp_path / "m.json").correct(term.stop + 3.0 * 2 * math.pi)
    plain = after.replace(terms=()).correct(term.stop + 3.0 * 2 * math.pi)
    # Beyond the travel the ramp is held at its end.
    assert plain - beyond == pytest.approx(0.5 * relative * (term.stop - term.start), rel=0.03)
    run = held[0]
    steps = np.array([after.corrector().step(x) for x in run.indicated])
    np.testing.assert_allclose(steps, after.correct(run.indicated), rtol=0, atol=1e-12)
    assert ta.load_model(tmp_path / "m.json") == after
    told = ta.export_model(after, "c", tmp_path / "m.h")
    assert "scale_error" in told.summary()
    # A ramp believed without a travel is corrected over that of the runs.
    (believed_term,) = extend_model(before, measured, truth).terms
    assert (believed_term.start, believed_term.stop) == pytest.approx(
        (term.start, term.stop), abs=step
    )
    with pytest.raises(errors.ArgumentError, match="give start_deg and stop_deg"):
        terms_from_effects([{"kind": "scale_error", "relative_error": 1e-5}], 360.0)


def spread_arcsec(model, runs):
    """rms of what is left, each run about its own zero."""
    parts = [model.correct(run.indicated) - run.reference for run in runs]
    return float(np.sqrt(np.mean(np.concatenate([p - p.mean() for p in parts]) ** 2))) / ARCSEC
