"""A running step takes another model between two samples, in whatever thread."""

import pickle
import threading

import numpy as np
import pytest

import trueangle as ta

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
