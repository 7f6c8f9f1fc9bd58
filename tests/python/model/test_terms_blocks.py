"""Batches by blocks against single steps, to the last bit, on motion that suits no block."""

import math
import pickle
import threading

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms

pytestmark = pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")

# Around the vectors of 4 and 8 readings and the blocks of 128.
LENGTHS = (1, 2, 7, 8, 9, 127, 128, 129, 255, 257, 401)

# The contract: theta + error(theta) = indicated is solved to below 1e-12 of a turn.
SOLVED = 1e-12


def lines(rng, unit, broken):
    count = int(rng.integers(1, 4))
    orders = rng.choice([1, 2, 3, 12, 50, 100], count, replace=False) + 0.5 * broken
    size = 3e-3 * unit / orders.max()
    return {
        "orders": tuple(orders),
        "cosine": tuple(rng.normal(0.0, size, count)),
        "sine": tuple(rng.normal(0.0, size, count)),
    }


def random_terms(rng, unit, directed):
    """One to four terms of any kind."""
    some = [lines(rng, unit, bool(rng.integers(2))) for _ in range(6)]
    pool = [
        terms.TorsionalCompliance(1e-3 * unit, **some[0]),
        terms.CurrentCoupling(1e-3 * unit, **some[1]),
        terms.LoadDependentGearError(**some[2], torque="absolute"),
        terms.ThermalDrift(1e-3 * unit, 1e-2, **some[3]),
        terms.LocalDefect(100.0 * unit, 3.0 * unit, 0.01 * unit, 2.5),
        terms.ScaleError(1e-3, -100.0 * unit, 150.0 * unit),
        terms.StiffeningCompliance(1e-3 * unit, 1e-5 * unit, 1e-3 * unit, 2.0),
        terms.StiffeningCompliance(1e-3 * unit, 1e-5 * unit, 1e-3 * unit, 2.0, 30.0 * unit),
        terms.Backlash(0.02 * unit),
        terms.Backlash(0.02 * unit, **lines(rng, unit, False)),
        terms.PreslidingHysteresis(0.01 * unit, 2.0 * unit, 0.5),
        terms.PreslidingHysteresis(-0.004 * unit, 0.5 * unit),
    ]
    if directed:
        pool += [
            terms.Latency(1e-3),
            terms.ChannelSkew(1e-6, 8.0, 30.0),
            terms.FilterLag(200.0),
            terms.FilterLag(150.0, 0.5),
            terms.DirectionalPattern(**some[4]),
            terms.VaryingLine(**{**some[5], "cosine": some[5]["sine"]}, follows="torque"),
        ]
    chosen = rng.choice(len(pool), int(rng.integers(1, 5)), replace=False)
    return [pool[i] for i in chosen]


def random_motion(rng, n, unit):
    """A swing, a walk, a joint at rest in noise, angles within one turn, or jerks."""
    t = np.arange(n)
    noise = rng.normal(0.0, 0.01, n)
    ways = [
        170.0 * np.sin(t / 60.0) + 0.1 * noise,
        np.cumsum(rng.normal(0.0, 1.0, n)),
        20.0 + noise,
        (0.7 * t) % 360.0,
        np.cumsum(np.sin(t / 40.0)) + 30.0 * noise,
    ]
    theta = ways[int(rng.integers(len(ways)))] * unit
    velocity = np.diff(theta, prepend=theta[0]) * 1000.0
    velocity[rng.uniform(size=n) < 0.2] = 0.0
    signals = {
        "velocity": velocity,
        "temperature": 20.0 + 5.0 * np.sin(t / 100.0),
        "torque": 4.0 * np.sin(t / 30.0),
        "current": np.cos(t / 70.0),
    }
    return theta, signals


def with_gaps(rng, values):
    values = values.copy()
    values[rng.uniform(size=values.size) < 0.02] = rng.choice([np.nan, np.inf, -np.inf])
    return values


@pytest.mark.parametrize("seed", range(60))
def test_blocks_give_what_steps_give(seed):
    rng = np.random.default_rng(seed)
    period = [360.0, 2.0 * math.pi, 1.0, 65536.0][seed % 4]
    directed = bool(seed % 3)
    unit = period / 360.0
    shafts = [ta.Shaft("output", 1.0, (1, 3), (0.05 * unit, 0.0), (0.01 * unit, 0.02 * unit))]
    if seed % 5 == 4:
        shafts.append(ta.Shaft("odd", 7.5, (1, 2), (0.01 * unit, 0.0), (0.0, 0.003 * unit)))
    model = ta.HarmonicModel(
        shafts,
        constant=rng.normal(0.0, 30.0) * unit,
        period=period,
        argument="indicated" if seed % 7 == 6 else "reference",
        terms=random_terms(rng, unit, directed),
    )
    theta, signals = random_motion(rng, int(rng.choice(LENGTHS)), unit)
    if seed % 2:
        theta = with_gaps(rng, theta)
        signals = {name: with_gaps(rng, values) for name, values in signals.items()}
    if not directed:
        del signals["velocity"]
    whole = model.correct(theta, **signals)
    step = model.compensator()
    steps = [
        step(x, **dict(zip(signals, values, strict=True)))
        for x, *values in zip(theta.tolist(), *(c.tolist() for c in signals.values()), strict=True)
    ]
    np.testing.assert_array_equal(steps, whole, err_msg=f"seed {seed}: {model.terms}")

    # And back: what is corrected has the error that leads to it.
    if model.argument == "reference" and not model.follows_travel:
        good = np.isfinite(whole)
        given = {name: values[good] for name, values in signals.items()}
        back = whole[good] + model.error(whole[good], **given)
        np.testing.assert_allclose(back, theta[good], rtol=0.0, atol=SOLVED * period)


SEED = 60_317

#: Seconds that threads swap and step beside each other.
LONG = 0.5


def drawn(rng, terms=(), period=360.0):
    sizes = rng.normal(0.0, 2e-4 * period, (2, 3)).tolist()
    return ta.HarmonicModel(
        [ta.Shaft("output", 1.0, [1, 2, 5], *sizes)], period=period, terms=terms
    )


@pytest.fixture
def rng():
    print(f"seed {SEED}")
    return np.random.default_rng(SEED)


def test_from_the_next_step_on_the_other_model_corrects(rng):
    one, other = drawn(rng), drawn(rng)
    step = one.compensator()
    for x in rng.uniform(-720.0, 720.0, 50).tolist():
        step.swap(one)
        assert step(x) == one.correct(x)
        step.swap(other)
        assert step(x) == other.correct(x) != one.correct(x)


def test_terms_keep_what_they_know_of_the_travel(rng):
    """A play that was passed upwards stays passed: as by a step that had the model all along."""
    one, other = drawn(rng, [ta.Backlash(0.05)]), drawn(rng, [ta.Backlash(0.02)])
    up, on = np.arange(0.0, 3.0, 0.1).tolist(), [3.001, 3.002, 3.5]
    step, always = one.compensator(), other.compensator()
    for x in up:
        step(x), always(x)
    step.swap(other)
    assert [step(x) for x in on] == pytest.approx([always(x) for x in on], abs=1e-12)


def test_what_cannot_take_the_place_is_refused_and_nothing_changes(rng):
    one = drawn(rng)
    step = one.compensator()
    with pytest.raises(ta.errors.ArgumentError, match="period 1, and the step 360"):
        step.swap(drawn(rng, period=1.0))
    with pytest.raises(ta.errors.ArgumentError, match="indicated_sign -1, and the step 1"):
        step.swap(drawn(rng).replace(indicated_sign=-1))
    with pytest.raises(ta.errors.ArgumentError, match=r"has terms.*its own compensator\(\)"):
        step.swap(drawn(rng, [ta.Backlash(0.05)]))
    with pytest.raises(ta.errors.KindError, match="model must be a HarmonicModel"):
        step.swap("model.json")
    assert step(12.5) == one.correct(12.5)


def test_all_joints_of_a_robot_are_swapped_together(rng):
    one = ta.Robot({"a": drawn(rng), "b": drawn(rng, [ta.Backlash(0.05)], 1.0)})
    other = ta.Robot({"a": drawn(rng), "b": drawn(rng, [ta.Backlash(0.05)], 1.0)})
    step, fresh = one.compensator(), other.compensator()
    for angles in rng.uniform(0.0, 1.0, (20, 2)).cumsum(axis=0):
        step(angles), fresh(angles)
    step.swap(other)
    angles = np.array([300.0, 30.0])
    np.testing.assert_allclose(step(angles), fresh(angles), atol=1e-12)
    with pytest.raises(ta.errors.ArgumentError, match="joints b, a; they must be a, b"):
        step.swap(ta.Robot({name: other[name] for name in ("b", "a")}))
    with pytest.raises(ta.errors.ArgumentError, match="with the same periods and signs"):
        step.swap(ta.Robot({"a": other["a"].replace(indicated_sign=-1), "b": other["b"]}))


def test_a_pickled_step_swaps_its_own_model(rng):
    one, other = drawn(rng), drawn(rng)
    step = one.compensator()
    copy = pickle.loads(pickle.dumps(step))
    copy.swap(other)
    assert (step(7.0), copy(7.0)) == (one.correct(7.0), other.correct(7.0))


def test_every_sample_is_by_one_model_while_another_thread_swaps(rng):
    models = [drawn(rng) for _ in range(3)]
    step, x = models[0].compensator(), 123.456
    allowed = {model.correct(x) for model in models}
    done, found = threading.Event(), set()

    def work():
        while not done.is_set():
            found.update({step(x) for _ in range(200)})

    workers = [threading.Thread(target=work) for _ in range(2)]
    for worker in workers:
        worker.start()
    timer = threading.Timer(LONG, done.set)
    timer.start()
    while not done.is_set():
        for model in models:
            step.swap(model)
    for thread in (*workers, timer):
        thread.join()
    assert found <= allowed
    assert len(found) > 1
