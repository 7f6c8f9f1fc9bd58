"""One correction by every door: compensator, corrector, its step, scalars and arrays agree."""

import numpy as np
import pytest

import trueangle as ta

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
