"""A measured function of one factor: played, corrected, written and refused."""

import numpy as np
import pytest

import trueangle as ta
from trueangle import errors
from trueangle.diagnosis.correction import extend_model, terms_from_effects
from trueangle.effects import KINDS
from trueangle.joint.signals import join_runs
from trueangle.model.terms import Curve as CurveTerm
from trueangle.simulation import Curve, RunDesign, Simulation, load_simulation, simulate

ARCSEC = 1.0 / 3600.0

#: Each factor with what a run of it records, and a curve over part of what it takes.
CURVES = {
    "speed": Curve("speed", (-30.0, -5.0, 8.0, 40.0), (7.0, -3.0, 2.0, 11.0)),
    "load": Curve("load", (-4.0, -1.0, 3.5), (-9.0, 2.0, 6.0)),
    "temperature": Curve("temperature", (19.0, 24.0, 27.0, 33.0), (1.0, 8.0, -5.0, 0.0)),
    "current": Curve("current", (-1.0, 0.5), (4.0, -3.0)),
    "direction": Curve("direction", (-1.0, 1.0), (-6.0, 6.0)),
    "place": Curve("place", (-330.0, -80.0, 200.0, 335.0), (-6.0, 5.0, -2.0, 6.0)),
    "direction_place": Curve(
        "direction_place", (-1.0, 1.0), (-6.0, 6.0), "output", (3.0,), (50.0,)
    ),
    "speed_place": Curve(
        "speed_place", (-30.0, 0.0, 40.0), (5.0, 0.0, 9.0), "output", (2.0,), (9.0,)
    ),
}

DESIGNS = [
    RunDesign(
        label=f"{k}", direction=1 if k % 2 else -1, speed_deg_s=speed, samples=300, start_deg=5.0,
        turns=0.9, spacing="jittered", reversals=(0.4,), torque_Nm=load, temperature_C=warm,
        current_A=amperes,
    )
    for k, (speed, load, warm, amperes) in enumerate(
        [
            (4.0, -6.0, 17.0, -2.0), (20.0, 0.5, 22.0, 0.0), (55.0, 2.0, 26.0, 0.2),
            (9.0, 5.0, 40.0, 2.0),
        ]
    )
]  # fmt: skip


def left_of(model, runs):
    """Largest error after correction, arcsec."""
    worst = 0.0
    for run in runs:
        signals = {
            "direction": run.direction, "velocity": run.speed, "torque": run.torque,
            "temperature": run.temperature, "current": run.signal("current"),
        }  # fmt: skip
        found = model.correct(run.indicated, **{k: v for k, v in signals.items() if v is not None})
        worst = max(worst, float(np.abs(found - run.reference).max()) / ARCSEC)
    return worst


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_is_played_straight_from_point_to_point(name):
    curve = CURVES[name]
    sim = Simulation().with_effects([curve])
    signals = join_runs(simulate(sim, runs=DESIGNS))
    x = {
        "speed": signals.velocity, "load": signals.torque, "temperature": signals.temperature,
        "current": signals.current, "direction": signals.direction, "place": signals.degrees,
    }[name.removesuffix("_place")]  # fmt: skip
    expected = np.interp(x, curve.at, curve.value_arcsec)
    if curve.orders:
        lines = zip(curve.orders, curve.phase_deg, strict=True)
        expected *= sum(np.sin(m * signals.theta + np.radians(phase)) for m, phase in lines)
    np.testing.assert_allclose(sim.predict(signals), expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_term_takes_off_what_a_curve_does(name, sign):
    runs = simulate(Simulation().with_effects([CURVES[name]]), runs=DESIGNS)
    terms = terms_from_effects([CURVES[name]], 360.0)
    model = ta.HarmonicModel((), period=360.0, terms=terms)
    if sign < 0:
        # Mirrored twice it is itself.
        model = model.replace(terms=tuple(term.mirrored().mirrored() for term in terms))
    assert left_of(model, runs) < 1e-6 < 1.0 < left_of(ta.HarmonicModel((), period=360.0), runs)


@pytest.mark.parametrize("name", CURVES)
def test_a_mirrored_term_is_that_of_the_mirrored_joint(name):
    (term,) = terms_from_effects([CURVES[name]], 360.0)
    one = ta.HarmonicModel((), period=360.0, terms=(term,))
    other = ta.HarmonicModel((), period=360.0, terms=(term.mirrored(),))
    rng = np.random.default_rng(3)
    angle, velocity = rng.uniform(0.0, 360.0, 200), rng.uniform(-60.0, 60.0, 200)
    same = {name: rng.uniform(-9.0, 40.0, 200) for name in ("torque", "temperature", "current")}
    given = {"direction": np.sign(velocity), "velocity": velocity, **same}
    turned = {"direction": -np.sign(velocity), "velocity": -velocity, **same}
    np.testing.assert_allclose(
        other.error(-angle, **turned), -one.error(angle, **given), rtol=0.0, atol=1e-12
    )


def test_a_pattern_that_repeats_is_taken_up_by_orders():
    at = np.linspace(0.0, 360.0, 97)
    values = 8.0 * np.sin(np.radians(2.0 * at + 10.0)) + 3.0 * np.sin(np.radians(5.0 * at))
    curve = Curve("place", tuple(at.tolist()), tuple(values.tolist()))
    assert list(curve.to_lines()) == [("output", 2.0), ("output", 5.0)]
    runs = simulate(Simulation().with_effects([curve]), runs=[RunDesign(samples=720, turns=1.0)])
    model = extend_model(None, runs, Simulation().with_effects([curve]))
    # Straight pieces of a line of order 5 at 96 points leave 1 % of it.
    assert left_of(model, runs) < 0.2


def test_a_file_holds_a_curve_to_the_last_bit(tmp_path):
    sim = Simulation().with_effects(list(CURVES.values()))
    sim.save(tmp_path / "joint.toml")
    assert load_simulation(tmp_path / "joint.toml").effects == sim.effects


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"factor": "spead"}, "factor"),
        ({"at": (1.0,), "value_arcsec": (1.0,)}, "two points"),
        ({"at": (1.0, 1.0)}, "must increase"),
        ({"value_arcsec": (1.0, 2.0, 3.0)}, "equally long"),
        ({"orders": (2.0,)}, "as many phase_deg"),
        ({"orders": (2.0,), "phase_deg": (1.0,)}, "product with the place"),
        ({"factor": "speed_place"}, "product with the place"),
    ],
)
def test_a_curve_that_is_none_is_refused(change, said):
    table = {"factor": "speed", "at": (0.0, 9.0), "value_arcsec": (0.0, 1.0)} | change
    with pytest.raises(errors.ArgumentError, match=said):
        KINDS["curve"].from_table(table)


@pytest.mark.parametrize(
    ("follows", "at", "values", "said"),
    [
        ("load", (0.0, 1.0), (0.0, 1.0), "follows"),
        ("torque", (0.0,), (1.0,), "two points"),
        ("torque", (2.0, 1.0), (0.0, 1.0), "increasing"),
        ("direction", (0.0, 1.0), (-1.0, 1.0), "direction"),
        ("direction", (-1.0, 1.0), (1.0, 1.0), "opposite"),
        ("angle", (0.0, 90.0), (1.0, 2.0), "opposite"),
    ],
)
def test_a_term_that_is_none_is_refused(follows, at, values, said):
    with pytest.raises(errors.ArgumentError, match=said):
        CurveTerm(follows, at, values)
