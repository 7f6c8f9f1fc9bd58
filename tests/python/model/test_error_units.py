"""Units of errors in what is printed, and numbers rounded to their uncertainty."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle.cli import build_parser, main
from trueangle.errors import ArgumentError
from trueangle.support.display_units import ERROR_UNITS, error_unit, significant_digits

#: Commands that print errors.
PRINTING = {
    "fit",
    "orders",
    "diagnose",
    "selfcal",
    "compare",
    "correct",
    "import",
    "export",
    "join",
}


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        ("arcsec", "7228.0 +- 3.1 arcsec"),
        ("deg", "2.00778 +- 0.00086 deg"),
        ("mrad", "35.042 +- 0.015 mrad"),
        ("auto", "2.00778 +- 0.00086 deg"),
        (65536, "365.50 +- 0.16 count"),
    ],
)
def test_one_error_in_every_unit(asked, shown):
    assert error_unit(asked, largest=7228.0).text(7228.0, 3.1) == shown


def test_small_errors_stay_in_arcsec():
    assert error_unit("auto", largest=3599.0).name == "arcsec"
    assert error_unit("auto", largest=3600.0).name == "deg"


def test_counts_are_those_of_the_readings():
    assert error_unit("count", period=4096.0).text(1_296_000.0 / 4096.0) == "1.000 count"
    with pytest.raises(ArgumentError, match="`counts_per_turn="):
        error_unit("count", period=360.0)


@pytest.mark.parametrize("asked", ["minutes", -1.0, math.nan])
def test_other_units_are_refused(asked):
    with pytest.raises(ArgumentError):
        error_unit(asked)


@given(
    st.floats(-1e6, 1e6),
    st.floats(1e-6, 1e5),
    st.sampled_from([unit for unit in ERROR_UNITS if unit != "count"]),
)
def test_rounding_loses_less_than_a_twentieth_of_the_uncertainty(value, std, asked):
    """Two digits of the uncertainty: half a unit of the second is at most 5 % of it."""
    unit = error_unit(asked, largest=abs(value))
    shown, spread = map(float, unit.pair(value, std))
    one = std * unit.per_arcsec
    # Uncertainties of ten units and more are shown whole: half a unit then is below 5 % too.
    assert abs(shown - value * unit.per_arcsec) <= 0.0501 * one
    assert abs(spread - one) <= 0.0501 * one


@given(st.floats(1e-9, 1e9))
def test_four_digits_are_kept(value):
    text = significant_digits(value)
    assert "e" not in text
    assert float(text) == pytest.approx(value, rel=5.1e-4)


@pytest.mark.parametrize("command", sorted(PRINTING))
def test_commands_that_print_errors_take_a_unit(command):
    assert "--errors-in" in build_parser().commands[command]._option_string_actions


@pytest.fixture
def runs(tmp_path):
    """Two degrees of order 1, as a table in degrees."""
    theta = np.arange(0.0, 360.0, 2.0)
    rng = np.random.default_rng(19)
    rows = ["run,reference_deg,indicated_deg"]
    for run in range(3):
        error = 2.008 * np.sin(np.radians(theta)) + rng.normal(0.0, 0.002, theta.size)
        rows += [f"{run},{a!r},{b!r}" for a, b in zip(theta.tolist(), (theta + error).tolist(),
                                                     strict=True)]  # fmt: skip
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def printed(arguments, capsys):
    assert main([str(a) for a in arguments]) == 0
    return capsys.readouterr().out


def test_large_errors_are_printed_in_degrees(runs, tmp_path, capsys):
    text = printed(["fit", runs, "-o", tmp_path / "m.json", "--orders", "1"], capsys)
    row = re.search(r"output +1 +(\S+) +(\S+)", text)
    assert float(row[1]) == pytest.approx(2.008, abs=0.001)
    assert float(row[2]) == pytest.approx(0.002 * math.sqrt(2 / 540), rel=1 / 3)  # of 3 runs
    assert " deg standard deviation" in text
    assert "arcsec" not in text


@pytest.mark.parametrize("unit", ["arcsec", "mrad"])
@pytest.mark.parametrize("command", ["fit", "orders"])
def test_a_unit_is_printed_as_asked_for(command, unit, runs, tmp_path, capsys):
    arguments = [command, runs, "--orders", "1,2", "--errors-in", unit]
    arguments += ["-o", tmp_path / "m.json"] if command == "fit" else []
    text = printed(arguments, capsys)
    wanted = {"arcsec": 7228.8, "mrad": 35.046}[unit]
    numbers = [float(word) for word in re.findall(r"\d+\.\d+", text)]
    assert min(abs(number / wanted - 1.0) for number in numbers) < 1e-3
    assert unit in text


def test_counts_are_taken_from_the_command_line(runs, tmp_path, capsys):
    model = tmp_path / "m.json"
    arguments = ["fit", runs, "-o", model, "--orders", "1", "--errors-in", "count"]
    assert main([str(a) for a in arguments]) == 1
    assert "--counts-per-turn" in capsys.readouterr().err
    text = printed([*arguments, "--counts-per-turn", "65536"], capsys)
    assert "count" in text
    assert re.search(r"output +1 +365\.\d+", text)


def test_json_stays_in_arcsec(runs, tmp_path, capsys):
    arguments = ["fit", runs, "-o", tmp_path / "m.json", "--orders", "1", "--json"]
    one = printed([*arguments, "--errors-in", "deg"], capsys)
    assert one == printed(arguments, capsys)
    assert '"amplitude_arcsec": 72' in one


def test_every_summary_takes_a_unit(runs):
    read = ta.read_runs(runs)
    fit = ta.fit(read, [1])
    assert "7228." in fit.summary(errors_in="arcsec")
    assert "7228." in ta.select_orders(read, [1, 2]).summary(errors_in="arcsec")
    assert "7228." in ta.compare(fit.model, ta.fit(read, [2]).model).summary(errors_in="arcsec")


SEED = 20
MODELS = 1000
#: Of them, one in so many is asked by every type of number too.
TYPED = 20
#: A float32 result holds the double to half a place of its last bit, and the error to a few
#: places of single precision; the angles of a test reach three turns.
SINGLE = 4.0 * np.finfo(np.float32).eps


def models():
    """Random models: whole and fractional gears, steep and gentle, constants of many turns."""
    rng = np.random.default_rng(SEED)
    for number in range(MODELS):
        period = float(rng.choice([360.0, 2.0 * np.pi, 1.0, 65536.0]))
        shafts, slope = [], 0.0
        for name in "abc"[: rng.integers(1, 4)]:
            cycles = float(rng.choice([1.0, 2.0, 50.0, 101.0, 50.5, 7.3, 1.0 / 3.0]))
            orders = np.sort(rng.choice(np.arange(1, 40), rng.integers(1, 6), replace=False))
            cosine, sine = rng.normal(size=(2, orders.size))
            slope += 2.0 * np.pi / period * cycles * float(orders @ np.hypot(cosine, sine))
            shafts.append((name, cycles, orders, cosine, sine))
        scale = rng.choice([1e-3, 0.1, 0.45, 0.6, 0.95]) / slope
        yield (
            number,
            rng,
            ta.HarmonicModel(
                [ta.Shaft(n, f, k, a * scale, b * scale) for n, f, k, a, b in shafts],
                constant=float(rng.choice([0.0, 0.01, 1.0, 1e3, 1e6]) * period * rng.normal()),
                period=period,
                argument=str(rng.choice(["reference", "indicated"])),
                terms=[ta.Backlash(1e-4 * period)] if number % 10 == 0 and slope else (),
            ),
        )


def differing(model, x):
    """Doors that give another bit than an array in one call."""
    wanted = model.correct(x) if not model.terms else model.corrector()(x)
    step, corrector, stepper = model.compensator(), model.corrector(), model.corrector().step
    found = {
        "compensator": [step(v) for v in x.tolist()],
        "corrector": corrector(x),
        "its step": [stepper(v) for v in x.tolist()],
        "one by one": [v for corrector in [model.corrector()] for v in map(corrector, x.tolist())],
    }
    if not model.terms:
        found["scalar"] = [model.correct(v) for v in x.tolist()]
        found["in place"] = model.correct(x, out=x.copy())
        found["backwards"] = model.correct(x[::-1])[::-1]
    return [name for name, values in found.items() if not np.array_equal(values, wanted)]


def test_every_door_gives_the_same_bits():
    wrong = []
    for number, rng, model in models():
        x = rng.uniform(-3.0, 3.0, 11) * model.period
        wrong += [(number, name) for name in differing(model, x)]
    assert not wrong, f"seed {SEED}: {len(wrong)}, such as {wrong[:5]}"


def test_every_type_of_number_gives_the_bits_of_its_value():
    for number, rng, model in models():
        if number % TYPED or model.terms:
            continue
        whole = rng.integers(0, 120, 9)
        wanted = model.correct(whole.astype(float))
        step = model.compensator()
        for dtype in ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", ">i4", "f8", ">f8"):
            given = whole.astype(dtype)
            assert np.array_equal(model.correct(given), wanted), (SEED, number, dtype)
            assert [step(v) for v in given] == wanted.tolist(), (SEED, number, dtype)
        single = whole.astype("f4")
        assert [step(v) for v in single] == wanted.tolist(), (SEED, number)
        # An array of single precision is corrected in that.
        size = np.abs(wanted).max() + np.abs(whole).max()
        assert np.abs(model.correct(single) - wanted).max() <= SINGLE * size, (SEED, number)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_gear_whose_pattern_repeats_after_two_turns(argument):
    shaft = ta.Shaft("s", 50.5, [11], [0.0513], [0.0])
    model = ta.HarmonicModel([shaft], constant=3.6, period=360.0, argument=argument)
    assert differing(model, np.linspace(-360.0, 720.0, 1001)) == []


@pytest.mark.parametrize("cycles", [1.0, 2.5, 50.5])
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_what_is_no_angle_has_none_by_any_door(cycles, argument):
    shaft = ta.Shaft("s", cycles, [1, 3], [0.01 / cycles, 0.0], [0.0, 0.002 / cycles])
    model = ta.HarmonicModel([shaft], argument=argument)
    for x in (np.nan, np.inf, -np.inf):
        found = [model.correct(x), *model.correct(np.array([0.1, x]))[1:], model.compensator()(x)]
        assert np.isnan(found).all(), (x, found)
