"""What a model says of itself, that it repeats and what it needs, against what it does."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import trueangle as ta
from trueangle import errors
from trueangle.errors import ArgumentError
from trueangle.model.records import MOST_TURNS, FitRecord
from trueangle.model.term import TERMS as KINDS
from trueangle.model.terms import (
    ChannelSkew,
    CurrentCoupling,
    Curve,
    DirectionalPattern,
    JointCoupling,
    ScaleError,
    VaryingLine,
)

A = 1e-3
ORDERS = ((1.0, 2.0), (1.0, 2.5), (2.5, 1.0), (3.0, 0.5, 2.0), (4.0,), (0.25,))
PLACES = np.linspace(1.0, 340.0, 40)
SIGNALS = {"direction": 1.0, "velocity": 3.0, "temperature": 31.0, "torque": 2.0, "current": 1.0}


def lines(orders):
    return {"orders": orders, "cosine": [A] * len(orders), "sine": [0.5 * A] * len(orders)}


TERMS = {
    "backlash": lambda o: ta.Backlash(0.02, **lines(o)),
    "pattern of the direction": lambda o: DirectionalPattern(**lines(o)),
    "warmth": lambda o: ta.ThermalDrift(A, 0.0, *lines(o).values(), 20.0),
    "compliance": lambda o: ta.TorsionalCompliance(A, *lines(o).values()),
    "a gear under load": lambda o: ta.LoadDependentGearError(*lines(o).values(), "absolute"),
    "a line of the speed": lambda o: VaryingLine(**lines(o), follows="speed"),
    "skew of channels": lambda o: ChannelSkew(0.1, o[-1], 20.0),
}


@pytest.mark.parametrize("period", [360.0, 1.0])
@pytest.mark.parametrize("orders", ORDERS)
@pytest.mark.parametrize("name", TERMS)
def test_a_term_repeats_after_a_turn_where_all_its_orders_are_whole(name, orders, period):
    model = ta.HarmonicModel([], period=period, terms=[TERMS[name](orders)])
    places = PLACES * period / 360.0
    given = {name: np.full(places.size, value) for name, value in SIGNALS.items()}
    first, later = (model.error(places + k * period, **given) for k in (0, 1))
    assert model.is_periodic == np.allclose(first, later, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("half_width", [-0.5, 0.5, 3.0])
@pytest.mark.parametrize("sizes", [(), (0.4,), (2.0, 2.0), (-2.0, 0.9), (0.3, -0.1)])
def test_a_direction_is_needed_where_play_may_be_negative(half_width, sizes):
    """Somewhere on the turn lines of any phase all point one way."""
    orders = tuple(range(1, len(sizes) + 1))
    play = ta.Backlash(half_width, orders, sizes, (0.0,) * len(sizes))
    model = ta.HarmonicModel([], period=360.0, terms=[play])
    assert ("direction" in model.signals) == (half_width < sum(map(abs, sizes)))
    if "direction" in model.signals:
        with pytest.raises(errors.MissingSignalError, match="needs direction"):
            model.correct([1.0, 2.0])
    else:
        model.correct([1.0, 2.0])


def every_term():
    """One of each kind, of each way that its parameters may take."""
    own = lines((1.0, 2.0))
    return (
        *(make((1.0, 2.0)) for make in TERMS.values()),
        ta.ThermalDrift(A), ta.ThermalDrift(A, 2e-3), ta.FilterLag(4.0), ta.FilterLag(4.0, 0.6),
        ta.Latency(0.002), ChannelSkew(0.002, 3.0), ta.LocalDefect(100.0, 8.0, 0.01, 3.0),
        ta.StiffeningCompliance(A, A, A, 1.0, 30.0), ScaleError(2e-4, -90.0, 250.0),
        ta.PreslidingHysteresis(0.02, 3.0), CurrentCoupling(A), VaryingLine(**own),
        JointCoupling("elbow", A), Curve("current", (0.0, 1.0), (A, -A)),
    )  # fmt: skip


def test_a_term_is_built_on_harmonics_where_it_changes_with_them():
    """At the same angle that the encoder saw; of every kind that there is."""
    shaft = ta.Shaft("output", 1, [1, 3], [0.2, 0.0], [0.0, 0.1])
    for term in every_term():
        given = {name: np.full(PLACES.size, value) for name, value in SIGNALS.items()}
        added = []
        for shafts in ((), (shaft,)):
            plain = ta.HarmonicModel(shafts, period=360.0)
            model = plain.replace(terms=(term,))
            told = {name: given.get(name, PLACES) for name in model.signals}
            late = getattr(term, "delay_s", 0.0) if term.kind == "latency" else 0.0
            seen = PLACES - late * SIGNALS["velocity"]
            added.append(model.error(PLACES, **told) - plain.error(seen))
        changes = not np.allclose(*added, rtol=0.0, atol=1e-9)
        assert term.is_built_on_harmonics == changes, term
    own = {kind for kind, made in KINDS.items() if made.__module__.startswith("trueangle.")}
    assert {term.kind for term in every_term()} == own


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_mirrored_term_is_that_of_angles_counted_the_other_way(argument):
    """There, back and on: what follows travel takes the same way."""
    shaft = ta.Shaft("output", 1, [1, 3], [0.2, 0.0], [0.0, 0.1])
    places = np.concatenate([PLACES, PLACES[::-1] - 0.3, PLACES + 0.2])
    way = np.repeat([1.0, -1.0, 1.0], PLACES.size)
    others = (
        VaryingLine(**lines((1.0, 2.0)), follows="torque"),
        ta.StiffeningCompliance(A, A, A, 1.0),
        ta.LoadDependentGearError(*lines((1.0, 2.0)).values(), "signed"),
    )
    for term in (*every_term(), *others):
        model = ta.HarmonicModel([shaft], 0.7, 360.0, argument, terms=(term,), indicated_sign=-1)
        own = model.in_sensor_sense()
        assert own.terms[0].mirrored() == term
        signals = {name: SIGNALS.get(name, places) for name in model.uses_signals}
        kept = {k: v for k, v in signals.items() if k not in ("velocity", "direction")}
        for given in ({"direction": way, "velocity": 3.0 * way}, {}):
            moving = {k: v for k, v in given.items() if k in signals}
            if set(model.signals) <= {*kept, *moving}:
                against = {k: -v for k, v in moving.items()}
                expected = -model.error(places, **kept, **moving)
                found = own.error(-places, **kept, **against)
                np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12, err_msg=term.kind)


#: A term by one of its parameters, the values next to a border that are taken, and the border's
#: or those beyond that are not.
BORDERS = {
    "cutoff_hz": (ta.FilterLag, (1e-300,), (0.0, -1.0)),
    "damping": (lambda x: ta.FilterLag(1.0, x), (1e-300, 5.0), (0.0, -0.5)),
    "order": (lambda x: ChannelSkew(0.1, x), (1e-300,), (0.0, -1.0)),
    "orders": (lambda x: ta.Backlash(0.1, (1.0, x), (A, A), (A, A)), (1e-300,), (0.0, -1.0)),
    "length": (lambda x: ta.PreslidingHysteresis(0.1, x), (1e-300,), (0.0, -1.0)),
    "start": (lambda x: ta.PreslidingHysteresis(0.1, 1.0, x), (0.0, 1.0), (-1e-300, 1.0 + 1e-15)),
    "knee_Nm": (lambda x: ta.StiffeningCompliance(A, A, A, x), (0.0, 1.0), (-1e-300,)),
    "width": (lambda x: ta.LocalDefect(1.0, x, A), (1e-300,), (0.0, -1.0)),
    "cycles_per_turn": (lambda x: ta.LocalDefect(1.0, 1.0, A, x), (1e-300,), (0.0, -1.0)),
    "relative_error": (lambda x: ScaleError(x, 0.0, 1.0), (1.0 - 1e-15, -1.0 + 1e-15), (1.0, -1.0)),
    "stop": (lambda x: ScaleError(A, 1.0, x), (1.0 + 1e-15,), (1.0, 0.0)),
}


@pytest.mark.parametrize("name", BORDERS)
def test_a_parameter_is_refused_from_its_border_on(name):
    make, taken, refused = BORDERS[name]
    for value in taken:
        make(value)
    for value in refused:
        with pytest.raises(errors.ArgumentError, match=rf"\b{name} must be "):
            make(value)


SHAFT = ta.Shaft("output", 1, [1], [0.0], [1e-3])
RECORD = FitRecord(samples=10, runs=2, span=(0.0, 1.0), residual=0.1, offsets=(0.0, 0.0))

#: In periods of the most turns that an angle may have.
TAKEN: tuple[dict[str, Any], ...] = (
    {"span": (-1.0, 1.0)},
    {"span": (0.25, 0.25)},  # readings at one angle
    {"span": (-1.0, -1.0)},
    {"residual": 0.0},
    {"residual": 1.0},
    {"offsets": (-1.0, 1.0)},
)
REFUSED: tuple[tuple[dict[str, Any], str], ...] = (
    ({"span": (-1.001, 1.0)}, r"fit\.span's start"),
    ({"span": (-1.0, 1.001)}, r"fit\.span's stop"),
    ({"span": (0.25, 0.2499)}, r"fit\.span must not stop before it starts, got \("),
    ({"span": (math.nan, 1.0)}, r"fit\.span's start"),
    ({"residual": -1e-9}, r"fit\.residual"),
    ({"residual": 1.001}, r"fit\.residual"),
    ({"residual": math.nan}, r"fit\.residual"),
    ({"offsets": (0.0, -1.001)}, r"fit\.offsets\[1\]"),
    ({"offsets": (1.001, 0.0)}, r"fit\.offsets\[0\]"),
)


def of(period: float, record: FitRecord) -> ta.HarmonicModel:
    return ta.HarmonicModel([SHAFT], period=period, fit=record)


def scaled(change: dict[str, Any], period: float) -> FitRecord:
    far = MOST_TURNS * period
    times = {
        key: tuple(far * one for one in value) if isinstance(value, tuple) else far * value
        for key, value in change.items()
    }
    return replace(RECORD, **times)


@pytest.mark.parametrize("period", [360.0, 4096.0])
@pytest.mark.parametrize("change", TAKEN)
def test_what_angles_of_the_period_can_have_is_taken(change: dict[str, Any], period: float):
    record = scaled(change, period)
    assert of(period, record).fit == record


@pytest.mark.parametrize("period", [360.0, 4096.0])
@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_no_angle_of_the_period_can_have_is_refused(
    change: dict[str, Any], told: str, period: float
):
    with pytest.raises(ArgumentError, match=told):
        of(period, scaled(change, period))


@pytest.mark.parametrize("what", ["samples", "runs", "ridge", "offset_spread"])
def test_counts_and_sizes_are_not_below_zero(what: str):
    assert of(360.0, replace(RECORD, **{what: 0, "residual": None})).fit is not None
    for wrong in (-1e-9, math.nan):
        with pytest.raises(ArgumentError, match=rf"fit\.{what}"):
            of(360.0, replace(RECORD, **{what: wrong}))
