"""Terms at run time in turns: the forms of a model by its period, whatever unit that has."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.export.fmu import fmu_source, variables_of
from trueangle.export.runtimeterms import RunTimeTerms, RunTimeWaves
from trueangle.model import forms

UNITS = (360.0, 2.0 * np.pi, 1.0)


class Given:
    """A term of forms that are given."""

    kind = "given"
    needs = ("torque",)
    follows_travel = False

    def __init__(self, *given):
        self.given = given

    def forms(self):
        return self.given


def cosines(lines, x, unit):
    turns = 2.0 * np.pi * x / unit
    return sum((a * np.cos(m * turns) + b * np.sin(m * turns) for m, a, b in lines), 0.0 * x)


def sines(waves, x):
    return sum(
        (c * np.sin(2.0 * np.pi * (m * x + p)) for m, c, p in zip(*waves, strict=True)), 0.0 * x
    )


def value(form, x, signal, unit, around):
    """What the documentation of a form states; ``around`` are its lines and harmonics."""
    match form:
        case forms.Scaled():
            moved = signal - form.origin
            return (abs(moved) if form.absolute else moved) * (form.level + around)
        case forms.Spring():
            m = signal
            if form.gravity is not None:
                m = signal * np.sin(2.0 * np.pi * (x - form.gravity) / unit)
            beyond = np.sign(m) * np.maximum(np.abs(m) - form.knee, 0.0)
            return form.linear * m + form.cubic * m**3 + form.beyond * beyond
        case forms.Bump():
            away = np.mod(form.cycles * x - form.place + unit / 2.0, unit) - unit / 2.0
            return form.height * np.exp(-(away**2) / (2.0 * form.width**2))
        case forms.Ramp():
            middle = 0.5 * (form.start + form.stop)
            return form.slope * (np.clip(x, form.start, form.stop) - middle)
    raise AssertionError(form)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("signal", ["velocity", "torque"])
def test_forms_in_turns_are_those_of_the_model_by_its_period(signal, unit):
    """Of velocities in turns per second; other signals keep their units."""
    seed = 20261128
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    a, b, c, d, e, f = rng.normal(0.0, 1.0, 6)
    lines = ((1.0, a, b), (4.5, c, d))
    given = (
        forms.Scaled(signal, a, lines, origin=0.2),
        forms.Scaled(signal, a, lines, 0.4, -0.3, absolute=True),
        forms.Spring(signal, a, b, c, 0.3),
        forms.Spring(signal, d, e, f, 0.2, gravity=0.3 * unit),
        forms.Bump(0.2 * unit, 0.03 * unit, a, 3.0),
        forms.Ramp(0.4, -0.2 * unit, 0.7 * unit),
    )
    shaft = ta.Shaft("motor", 2.5, (1, 3), (e, f), (a, c))
    model = ta.HarmonicModel((shaft,), period=unit, argument="indicated")
    made = RunTimeTerms.of(model, (Given(*given),), "auto")
    x = rng.uniform(-1.0, 1.0, 400)
    harmonics = cosines(((2.5, e, a), (7.5, f, c)), x, 1.0)
    np.testing.assert_allclose(unit * sines(made.series, x), harmonics, atol=1e-12)
    for told in (-0.9, 0.1, 0.6):
        for form, turned, waves in zip(given, made.smooth, made.waves, strict=True):
            around = 0.0 * x
            if isinstance(form, forms.Scaled):
                around = cosines(form.lines, x, 1.0) + form.relative * harmonics
                assert (turned.lines, turned.relative) == ((), 0.0)
            wanted = value(form, unit * x, told, unit, around)
            by = unit if signal == "velocity" else 1.0
            found = value(turned, x, told / by, 1.0, sines(waves, x))
            np.testing.assert_allclose(unit * found, wanted, atol=1e-9)


def test_delays_and_play_add_up_and_springs_keep_to_themselves():
    line, other = (3.0, 0.36, -0.72), (2.5, 0.0, 0.36)
    given = (
        forms.Lag(0.002), forms.Play(0.72, (line,)), forms.Friction(0.18, 3.6, 0.25),
        forms.Lag(-0.0005), forms.Play(-1.08, (other,)), forms.Friction(-0.36, 7.2),
    )  # fmt: skip
    model = ta.HarmonicModel((), period=360.0)
    made = RunTimeTerms.of(model, (Given(*given[:3]), Given(*given[3:])), "auto")
    assert (made.delay, made.play) == (pytest.approx(0.0015), pytest.approx(-0.001))
    assert made.springs == (forms.Friction(0.0005, 0.01, 0.25), forms.Friction(-0.001, 0.02))
    x = np.linspace(0.0, 1.0, 33)
    wanted = cosines((line, other), x, 1.0)
    np.testing.assert_allclose(360.0 * sines(made.places, x), wanted, atol=1e-12)
    assert (made.smooth, made.waves) == ((), ())


@pytest.mark.parametrize(
    ("given", "shaped", "whole"),
    [
        ((), False, True),
        ((forms.Play(0.1),), False, True),
        ((forms.Play(0.1, ((2.0, 0.1, 0.0),)),), True, True),
        ((forms.Play(0.1, ((2.5, 0.1, 0.0),)),), True, False),
        ((forms.Friction(0.1, 1.0),), True, True),
        ((forms.Scaled("torque", 0.1),), False, True),
        ((forms.Scaled("torque", 0.1, ((2.0, 0.1, 0.0),)),), True, True),
        ((forms.Scaled("torque", 0.1, ((2.5, 0.1, 0.0),)),), True, False),
        ((forms.Spring("torque", 0.1),), False, True),
        ((forms.Spring("torque", 0.1, gravity=0.0),), True, True),
        ((forms.Bump(0.1, 0.1, 0.1),), True, True),
        ((forms.Ramp(0.1, 0.0, 1.0),), True, False),
    ],
)
def test_what_depends_on_the_angle_is_searched_and_may_need_the_turn(given, shaped, whole):
    made = RunTimeTerms.of(ta.HarmonicModel((), period=360.0), (Given(*given),), "auto")
    assert (made.shaped, made.whole) == (shaped, whole)


@pytest.mark.parametrize("largest", [0.0, 1e-3, 0.25])
def test_float_arithmetic_is_off_by_what_the_file_states(largest):
    made = RunTimeTerms.of(ta.HarmonicModel((), period=360.0), (T.Backlash(0.1),), "auto")
    assert "2^-20 of their sum and 4 units of 2^-32 turns" in made.use("f", "s", "0")
    assert made.rounding(largest) == 2.0**-20 * largest + 4.0 * 2.0**-32


DIRECTIONAL = T.DirectionalPattern((1.0,), (0.1,), (0.0,))


@pytest.mark.parametrize(
    ("terms", "asked", "way", "signals"),
    [
        ((T.Latency(0.1), T.CurrentCoupling(1.0), T.TorsionalCompliance(1.0), T.ThermalDrift(1.0)),
         "auto", "", ("velocity", "temperature", "torque", "current")),
        ((T.Backlash(0.1),), "auto", "angle", ()),
        ((T.Backlash(0.1), T.Latency(0.1)), "auto", "velocity", ("velocity",)),
        ((T.Backlash(0.1),), "velocity", "velocity", ("velocity",)),
        ((T.Backlash(0.1), T.ThermalDrift(1.0)), "signal", "direction",
         ("temperature", "direction")),
        ((DIRECTIONAL,), "auto", "velocity", ("velocity",)),
    ],
)  # fmt: skip
def test_signals_stand_in_the_order_of_the_structure_and_the_direction_last(
    terms, asked, way, signals
):
    made = RunTimeTerms.of(ta.HarmonicModel((), period=360.0), terms, asked)
    assert (made.way, made.signals, made.travels) == (way, signals, bool(way))
    assert made.kinds == tuple(term.kind for term in terms)


def test_waves_are_their_lines():
    """Amplitude and phase of a sine in turns; a line of nothing is left out."""
    seed = 20261127
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    lines = [(m, *rng.normal(0.0, 1.0, 2)) for m in (1.0, 2.5, 7.0)]
    lines += [(4.0, 0.0, -1.0), (5.0, 1.0, 0.0)]
    waves = RunTimeWaves.of([(9.0, 0.0, 0.0), *lines])
    assert waves.orders == (1.0, 2.5, 7.0, 4.0, 5.0)
    assert all(0.0 <= phase < 1.0 for phase in waves.phases)
    x = rng.uniform(0.0, 2.0, 50)
    np.testing.assert_allclose(sines(waves, x), cosines(lines, x, 1.0), atol=1e-12)
    steep = 2.0 * np.pi * sum(m * np.hypot(a, b) for m, a, b in lines)
    assert waves.slope == pytest.approx(steep)
    assert not waves.whole
    assert RunTimeWaves((1.0, 7.0), (1.0, 1.0), (0.0, 0.0)).whole


#: Of powers of two, so that no number is rounded on the way.
PERIODS = (1.0, 64.0, 4096.0)


def model(period, argument):
    size = period / 1024.0
    shafts = [ta.Shaft("output", 1, [1, 3], [2.0 * size, 0.5 * size], [size, -0.25 * size])]
    return ta.HarmonicModel(
        shafts, constant=16.0 * size, period=period, argument=argument,
        terms=[
            ta.terms.Backlash(0.5 * size),
            # Lengths and places are angles too; times, torques and temperatures are none.
            ta.terms.PreslidingHysteresis(0.25 * size, 8.0 * size, 0.5),
            ta.terms.StiffeningCompliance(size, 0.5 * size, 2.0 * size, 4.0, gravity=32.0 * size),
            ta.terms.TorsionalCompliance(size),
            ta.terms.LocalDefect(64.0 * size, 16.0 * size, 2.0 * size),
            ta.terms.ScaleError(0.125, -256.0 * size, 256.0 * size),
            ta.terms.ThermalDrift(0.5 * size, 0.25),
            ta.terms.CurrentCoupling(0.5 * size),
            ta.terms.LoadDependentGearError((2.5,), (size,), (0.5 * size,)),
            ta.terms.Latency(0.25),
            ta.terms.FilterLag(8.0, 0.5),
        ],
    )  # fmt: skip


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("sensor", [False, True])
def test_the_source_of_a_unit_is_the_same_in_every_unit_of_angle(argument, sensor):
    sources = []
    for period in PERIODS:
        one = model(period, argument)
        sources.append(fmu_source(one, variables_of(one, sensor), sensor, "").splitlines())
    np.testing.assert_array_equal(sources[1], sources[0])
    np.testing.assert_array_equal(sources[2], sources[0])
    # The zero in turns.
    assert any("0.015625" in line for line in sources[0])


@pytest.mark.parametrize(("target", "found"), [
    ("c", r"\(uint32_t\)x - (-?\w+?)u?\)"), ("rust", r"x as u32\)\.wrapping_sub\((-?\w+)\)"),
])  # fmt: skip
@pytest.mark.parametrize("angle", [-410.0, -30.0, -1e-12, 0.0, 30.0, 359.9999, 360.0, 725.0])
def test_the_way_down_is_a_place_within_the_turn(target, found, angle):
    """A word of 32 bits, whatever turn the angle of gravity is given in."""
    one = ta.HarmonicModel(
        [ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0,
        terms=[ta.StiffeningCompliance(1e-3, gravity=angle)],
    )  # fmt: skip
    (place,) = re.findall(found, ta.export_model(one, target, bits=10).text)
    assert 0 <= int(place) < 2**32
    away = int(place) / 2**32 - angle / 360.0
    assert abs(away - round(away)) <= 0.5001 / 2**32


def test_functions_of_shafts_of_one_name_are_counted():
    names = ["a b", "a-b", "A b", "c", "a_b"]
    shafts = [ta.Shaft(name, k, [1], [0.1], [0.0]) for k, name in enumerate(names, 1)]
    made = ta.export_model(ta.HarmonicModel(shafts, period=360.0), "c", bits=10, name="f")
    told = re.findall(r"Table (\w+):", made.text)
    assert told == ["a_b", "a_b_2", "a_b_3", "c", "a_b_4"]
