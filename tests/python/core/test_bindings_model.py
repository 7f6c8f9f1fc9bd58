"""Models of the core as callers hand them over: counts, bounds, states, what is refused."""

import json
import multiprocessing.process
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest

from trueangle import _core
from trueangle.errors import ArgumentError, MissingSignalError, NotInvertibleError
from trueangle.model.forms import Play, Scaled

TURN = 360.0
#: Of the angles of a turn, a few operations.
ROUNDING = 1e-12 * TURN


class Term:
    """A term of nothing but forms."""

    kind = "tried"

    def __init__(self, *forms):
        self._forms = forms

    def forms(self):
        return self._forms


def series(period=TURN, orders=(1, 2), cosine=(0.3, 0.1), sine=(0.2, -0.05), **more):
    lists = [list(orders)], [list(cosine)], [list(sine)]
    return _core.Series(period, 0.0, [1.0], *lists, **more)


def corrector(*forms):
    return _core.Corrector(series(), [Term(*forms)] if forms else [])


@pytest.mark.parametrize("factor", [1, 7, 30_000, 50_000])
def test_the_bound_of_a_slope_counts_common_factors_of_orders_once(factor):
    """Orders k times as high, k times as small: the same curve k times in a turn, as steep."""
    orders, cosine, sine = np.array([1, 2, 5]), np.array([0.3, 0.1, 0.2]), np.array([0.2, 0.1, 0.3])
    size = 1.05 / (orders * np.hypot(cosine, sine)).sum()
    x = np.linspace(0.0, 2.0 * np.pi, 20_000)[:, None] * orders
    slope = size * orders * (sine * np.cos(x) - cosine * np.sin(x))
    true = np.abs(slope.sum(axis=1)).max()
    assert true < 1.0
    found = series(
        2.0 * np.pi, factor * orders, size * cosine / factor, size * sine / factor
    ).slope_bound
    # A grid of 32 samples in the period of the highest order: within 1/cos(pi/32).
    assert true * (1.0 - 1e-6) <= found <= 1.005 * true


def test_a_slope_of_one_has_no_inverse():
    with pytest.raises(NotInvertibleError, match=r"reaches 1\.000000"):
        series(2.0 * np.pi, (1,), (1.0,), (0.0,)).correct(0.9)
    assert series(2.0 * np.pi, (1,), (0.9,), (0.0,)).correct(0.9) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("what", ["orders", "cosine", "sine"])
@pytest.mark.parametrize("count", [0, 2])
def test_a_series_has_a_list_for_each_shaft(what, count):
    lists = {"orders": [[1]], "cosine": [[0.1]], "sine": [[0.0]]}
    lists[what] *= count
    with pytest.raises(ArgumentError, match=f"{what} has {count} lists, cycles has 1"):
        _core.Series(TURN, 0.0, [1.0], *lists.values())


@pytest.mark.parametrize("method", ["error", "slope", "correct"])
def test_memory_of_both_sides_is_one_or_apart(method):
    take = getattr(series(), method)
    for given, out in (
        (slice(0, 400), slice(0, 400)),
        (slice(0, 800, 2), slice(1, 801, 2)),
        (slice(0, 400), slice(400, 800)),
        (slice(799, 399, -1), slice(0, 400)),
        (slice(400, 800), slice(399, None, -1)),
    ):
        memory = np.linspace(-300.0, 900.0, 801)
        expected = take(memory[given].copy())
        take(memory[given], memory[out])
        np.testing.assert_array_equal(memory[out], expected)
    for given, out in (
        (slice(0, 400), slice(399, 799)),
        (slice(399, 799), slice(0, 400)),
        (slice(400, None, -1), slice(0, 401)),
        (slice(0, 800, 2), slice(0, 400)),
    ):
        memory = np.linspace(-300.0, 900.0, 801)
        with pytest.raises(ArgumentError, match="overlaps"):
            take(memory[given], memory[out])


def test_a_number_has_the_result_of_an_array_of_one():
    one = corrector(Scaled("temperature", level=0.01), Play(0.02))
    x = 33.0
    alone = one.fresh().correct(x, temperature=3.0, direction=1.0)[0]
    listed = one.fresh().correct([x], temperature=[3.0], direction=[1.0])[0]
    spread = one.fresh().correct(x, temperature=[3.0, 5.0], direction=1.0)[0]
    stepped = one.fresh().step(x, temperature=3.0, direction=1.0)
    assert isinstance(alone, float)
    assert alone == listed[0] == spread[0] == stepped
    assert spread[1] == pytest.approx(spread[0] - 0.02, abs=1e-3)
    warm = corrector(Scaled("temperature", level=0.01))
    both = [warm.step(x, temperature=value) for value in (3.0, 5.0)]
    np.testing.assert_array_equal(warm.fresh().correct(x, temperature=[3.0, 5.0])[0], both)


def test_joints_alike_forget_one_by_one():
    """Play of an indicated reversal: a joint that has turned back is on the other side."""
    alike = _core.Alike(corrector(Play(0.05)), 3)
    forth, back = [10.0, 20.0, 30.0], [5.0, 15.0, 25.0]
    fresh = alike.copy()
    alike.error(forth)
    fresh_errors = fresh.error(back)
    turned = alike.copy()
    errors = turned.error(back)
    np.testing.assert_allclose(errors, series().error(np.array(back)) - 0.05, atol=ROUNDING)
    alike.reset([0, 2])
    found = alike.error(back)
    assert found[1] == errors[1]
    np.testing.assert_array_equal(found[[0, 2]], fresh_errors[[0, 2]])
    assert not np.isclose(fresh_errors, errors).any()


def robot(names=("a", "b"), parts=None):
    given = [corrector(Scaled("temperature", level=0.01)), series()] if parts is None else parts
    return _core.RobotStep(list(names), given)


def test_signals_of_a_robot_are_one_value_or_one_for_each():
    x = np.array([12.0, -40.0])
    expected = [corrector(Scaled("temperature", level=0.01)).step(12.0, temperature=5.0),
                series().correct(-40.0)]  # fmt: skip
    for temperature in (5.0, [5.0], np.array([5.0, 5.0]), np.array([5.0, 99.0])):
        np.testing.assert_array_equal(robot().step(x, temperature=temperature), expected)
    with pytest.raises(ArgumentError, match="temperature"):
        robot().step(x, temperature=[1.0, 2.0, 3.0])
    with pytest.raises(ArgumentError, match="positions"):
        robot().step(x[:1], temperature=5.0)


@pytest.mark.parametrize("names", [(), ("a",), ("a", "b", "c")])
def test_a_robot_has_a_name_for_each_joint(names):
    parts = [] if not names else None
    with pytest.raises(ArgumentError, match="each with a name"):
        robot(names, parts)


def test_a_step_takes_an_angle_and_signals():
    step = corrector().step
    held = _core.Compensator(series()).step
    assert held(20.0) == pytest.approx(step(20.0), abs=ROUNDING)
    assert held(20.0, None) == held(20.0)
    for given in ((), tuple([1.0] * 9)):
        with pytest.raises(TypeError, match=f"got {len(given)} arguments"):
            held(*given)


@pytest.mark.parametrize(("parent", "threads"), [(None, 3), (object(), 1)])
def test_a_process_with_a_parent_in_python_takes_one_thread(parent, threads, monkeypatch):
    monkeypatch.setenv("TRUEANGLE_NUM_THREADS", "3")
    monkeypatch.setattr(multiprocessing.process, "parent_process", lambda: parent)
    assert _core.thread_count() == threads


THREADS = """\
import json, os, sys
import trueangle._core as core
alone = core.thread_count()
import multiprocessing as mp
def told(queue):
    queue.put(core.thread_count())
if __name__ == "__main__":
    context = mp.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=told, args=(queue,))
    child.start()
    inside = queue.get()
    child.join()
    print(json.dumps([alone, core.thread_count(), inside, core.thread_count(3)]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a child is started by fork")
def test_a_child_of_multiprocessing_takes_one_thread():
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, check=True)
    alone, after, inside, asked = json.loads(done.stdout)
    assert alone == after >= 1
    assert (inside, asked) == (1, 3)


@pytest.mark.parametrize("path", [None, "table", "cubics", "exact", "direct"])
@pytest.mark.parametrize("shift", [-40, 30])
def test_a_unit_of_a_power_of_two_changes_no_digit(path, shift):
    """Angles near, a million and 2^52 turns away; a number, few and many of them."""
    unit = 2.0**shift
    own = series()
    sizes = [[[unit * a for a in part]] for part in ((0.3, 0.1), (0.2, -0.05))]
    other = _core.Series(TURN * unit, 0.0, [1.0], [[1, 2]], *sizes)
    x = np.linspace(-700.0, 1100.0, 8001)
    # Exact in both units.
    near = np.round(x * 1024.0) / 1024.0
    far = np.round(x / 4.0) * 1024.0 + 2.0**52 * TURN
    kind = np.float32 if path == "cubics" else np.float64
    for angles in (near, np.round(x) + 1e6 * TURN, far, near[:3]):
        angles = angles.astype(kind)
        for name, scale in (("error", unit), ("slope", 1.0), ("correct", unit)):
            if name == "slope" and path in ("cubics", "table"):
                continue
            found = getattr(other, name)((angles * unit).astype(kind), path=path)
            expected = getattr(own, name)(angles, path=path)
            np.testing.assert_array_equal(found, scale * expected)
    assert other.correct(33.0 * unit) == unit * own.correct(33.0)
    assert other.slope_bound == pytest.approx(own.slope_bound, rel=1e-14)


@pytest.mark.parametrize("path", ["exact", "direct"])
@pytest.mark.parametrize("cycles", [1.0, 2.5, 0.37, 101.25])
@pytest.mark.parametrize("turns", [0, 3, -1000, 10**6, 10**9])
def test_phases_are_those_of_exact_fractions(path, cycles, turns):
    """Of shafts that do not come back with the turn, too, however many turns there were."""
    taken = _core.Series(TURN, 0.0, [cycles], [[1, 3]], [[0.4, -0.1]], [[0.3, 0.2]])
    # Numbers that a double holds.
    angles = [turns * TURN + k * 11.375 for k in range(-20, 40)]
    expected = []
    for x in angles:
        turn = [k * Fraction(cycles) * Fraction(x) / 360 % 1 for k in (1, 3)]
        one, three = (2.0 * np.pi * float(t) for t in turn)
        expected.append(0.4 * np.cos(one) + 0.3 * np.sin(one)
                        - 0.1 * np.cos(three) + 0.2 * np.sin(three))  # fmt: skip
    found = taken.error(np.array(angles), path=path)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("argument", ["indicated", "reference"])
def test_what_correction_takes_off_is_the_error(argument):
    """Of the indicated angle at once, of the true one where it is found; a batch as its steps."""
    # Where play is crossed the true angle jumps back: what is taken off is another way's.
    play = [Play(0.02)] if argument == "indicated" else []
    terms = [Term(Scaled("temperature", level=0.01), *play)]
    taken = _core.Corrector(series(argument=argument), terms)
    x = 300.0 * np.sin(np.linspace(0.0, 7.0, 700))
    given = {"temperature": 3.0}
    corrected, _ = taken.fresh().correct(x, **given)
    at = x if argument == "indicated" else corrected
    errors = taken.fresh().error(at, **given)
    np.testing.assert_allclose(errors, x - corrected, rtol=0, atol=ROUNDING)
    assert np.abs(errors).max() > 0.1
    alone = taken.fresh()
    np.testing.assert_array_equal([alone.error(float(v), **given) for v in at], errors)


def test_a_model_is_coupled_to_so_many_joints_and_no_more():
    joints = [f"coupled_{name}" for name in "abcdefgh"]
    terms = [Scaled(name, level=1e-3 * (k + 1)) for k, name in enumerate(joints)]
    most = 0
    for count in range(1, len(joints) + 1):
        try:
            taken = corrector(*terms[:count], *terms[:count])
        except ArgumentError as error:
            assert f"coupled to {most} other joints, not to" in str(error)  # noqa: PT017
            break
        most = count
        angles = {name: 10.0 * (k + 1) for k, name in enumerate(joints[:count])}
        added = 2.0 * sum(1e-2 * (k + 1) ** 2 for k in range(count))
        assert taken.error(33.0, **angles) == pytest.approx(series().error(33.0) + added)
        with pytest.raises(MissingSignalError, match=joints[count - 1]):
            corrector(*terms[:count]).error(33.0, **dict(list(angles.items())[:-1]))
        with pytest.raises(MissingSignalError, match=f"{joints[0]}, the angle of another joint"):
            corrector(*terms[:count]).step(33.0)
    assert 2 <= most < len(joints)


#: Numbers a knot takes: a value, and for a cubic its slope over a segment.
PER_KNOT = {"linear": 1, "cubic": 2}


def ramp(method, bits, dtype, rise):
    """Knots of a line that rises so much a segment."""
    values = rise * np.arange(2**bits + 1)
    knots = values if method == "linear" else np.column_stack([values, np.full_like(values, rise)])
    return np.ascontiguousarray(knots.ravel(), dtype=dtype)


@pytest.mark.parametrize("method", PER_KNOT)
@pytest.mark.parametrize("bits", [1, 2, 7])
def test_a_line_is_a_line_between_its_knots(method, bits):
    angles = np.linspace(0, 2**32 - 1, 999).astype(np.uint32)
    along = angles / 2.0**32 * 2**bits
    for dtype, rise, near in (
        (np.float32, 0.125, 1e-5),
        (np.int32, 1 << 16, 1.0),
        (np.int16, 9, 1.0),
    ):
        knots = ramp(method, bits, dtype, rise)
        assert knots.size == (2**bits + 1) * PER_KNOT[method]
        found = _core.table_correction(method, knots, bits, 0, angles)
        np.testing.assert_allclose(found, rise * along, rtol=0, atol=near, err_msg=str(dtype))


@pytest.mark.parametrize("method", PER_KNOT)
@pytest.mark.parametrize("bits", [1, 4, 16])
def test_a_table_has_a_knot_at_each_end_of_each_segment(method, bits):
    angles = np.zeros(3, dtype=np.uint32)
    wanted = (2**bits + 1) * PER_KNOT[method]
    assert not _core.table_correction(method, np.zeros(wanted, "i2"), bits, 15, angles).any()
    for size in (wanted - 1, wanted + 1, wanted // 2, 2 * wanted):
        with pytest.raises(ArgumentError, match=f"needs {wanted} numbers.* got {size} numbers"):
            _core.table_correction(method, np.zeros(size, "i2"), bits, 0, angles)
    with pytest.raises(ArgumentError, match="a shift of 16"):
        _core.table_correction(method, np.zeros(wanted, "i2"), bits, 16, angles)


@pytest.mark.parametrize("bits", [0, 17])
def test_a_table_has_1_to_16_bits(bits):
    with pytest.raises(ArgumentError, match="1 to 16 bits"):
        _core.table_correction("linear", np.zeros(2, "i2"), bits, 0, np.zeros(1, dtype=np.uint32))
    with pytest.raises(ArgumentError, match="no method"):
        _core.table_correction("square", np.zeros(3, "i2"), 1, 0, np.zeros(1, dtype=np.uint32))
