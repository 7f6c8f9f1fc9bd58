"""Numbers and notes of an export: the same in every unit, and said in the case they are for."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.proof import prove_export
from trueangle.model.records import FitRecord

PERIODS = {"rad": 2.0 * math.pi, "turn": 1.0, "count": 4096.0}


def described(period: float = 360.0, std: float = 1e-4, **more) -> ta.HarmonicModel:
    """Two shafts, a play, a latency and a friction over part of a turn, in one unit."""
    unit = period / 360.0
    shafts = [
        ta.Shaft("output", 1, [1, 2], [0.3 * unit, 0.0], [0.0, 0.1 * unit]),
        ta.Shaft("motor", 3, [1], [0.02 * unit], [0.01 * unit]),
    ]
    terms = (ta.Backlash(0.05 * unit), ta.Latency(0.002), ta.terms.PreslidingHysteresis(
        0.01 * unit, 5.0 * unit))  # fmt: skip
    fit = FitRecord(900, 1, (20.0 * unit, 140.0 * unit), 0.001 * unit,
                    signals=(("velocity", -90.0 * unit, 60.0 * unit),))  # fmt: skip
    covariance = np.diag([25.0, *[1.0] * 6]) * (std * unit) ** 2
    given = {"terms": terms, "fit": fit, "constant": 0.25 * unit, "covariance": covariance}
    return ta.HarmonicModel(shafts, period=period, **{**given, **more})


@pytest.mark.parametrize(
    ("target", "unit"),
    [("csv", "rad"), ("csv", "count"), ("c", "turn"), ("simplefoc", "rad"), ("twincat", "turn")],
)
def test_a_model_in_another_unit_makes_the_same_table(target: str, unit: str) -> None:
    options = {"entries": 64} if target != "twincat" else {"entries": 72}
    made, other = (
        ta.export_model(described(period), target, bits=12, **options).to_dict()
        for period in (360.0, PERIODS[unit])
    )
    for one in (made, other):
        del one["sha256"]
    # Bounds are those of the rounding of angles too; words have their numbers to four digits.
    for name, value in made.items():
        if isinstance(value, float):
            assert other[name] == pytest.approx(value, rel=1e-5, abs=1e-7), name
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for row, its in zip(value, other[name], strict=True):
                assert row.keys() == its.keys()
                for key, one in row.items():
                    near = pytest.approx(one, rel=1e-5, abs=1e-6) if isinstance(one, float) else one
                    assert its[key] == near, (name, key)
        else:
            assert other[name] == value, name


@pytest.mark.parametrize(("std", "said"), [(1e-6, True), (1e-2, False)])
def test_a_format_coarser_than_what_is_known_is_told(std: float, said: bool) -> None:
    """Of a 16-bit table: what its numbers leave against the model's own uncertainty."""
    model = described(std=std, terms=(), fit=None)
    made = ta.export_model(model, "c", entries=64, number="q15", bits=12)
    notes = [n for n in made.notes if n.startswith("the number format adds")]
    assert len(notes) == said
    # Six coefficients of one variance: half of each is what a turn has on the mean.
    known = math.sqrt(3.0) * std * 3600.0
    for note in notes:
        floor, uncertainty = map(float, re.findall(r"\d[\d.e-]*(?= arcsec| *$)|[\d.e-]+$", note))
        assert floor == pytest.approx(made.floor_arcsec, rel=5e-3)
        assert uncertainty == pytest.approx(known, rel=5e-3)


def test_the_order_that_loses_most_is_the_one_that_the_summary_names() -> None:
    lines = ta.Shaft("output", 1, [3, 7], [0.2, 0.0], [0.0, 1e-4])
    made = ta.export_model(ta.HarmonicModel([lines], period=360.0), "csv", entries=24, bits=12)
    worst = max(made.lost, key=lambda row: row["arcsec"])
    assert worst["order"] < max(row["order"] for row in made.lost)
    said = re.search(r"of the orders, (\S+) loses most: (\S+) arcsec", made.summary("arcsec"))
    assert said is not None
    assert float(said[1]) == worst["order"]
    assert float(said[2]) == pytest.approx(worst["arcsec"], rel=0.01)


@pytest.mark.parametrize("target", ["csv", "c"])
def test_the_smallest_table_leaves_room_for_what_is_beside_it(target: str) -> None:
    """A bound that the smallest table keeps without the terms, and not with them."""
    model = described()
    options = {"bits": 12}
    size = {"csv": 36, "c": 8}[target]
    small = ta.export_model(model, target, entries=size, **options)
    beside = small.max_difference_total_arcsec - small.max_difference_arcsec
    asked = beside + 0.9 * small.max_difference_arcsec
    made = ta.export_model(model, target, max_arcsec=asked, **options)
    assert made.max_difference_total_arcsec <= asked
    assert made.entries > small.entries


def test_tables_of_several_shafts_add_up_and_name_the_outputs_orders() -> None:
    """The motor's first order is the third of the output; two tables of 17 knots of 4 bytes."""
    made = ta.export_model(described(terms=()), "c", entries=16, number="q31", bits=12)
    assert [row["order"] for row in made.lost] == [1.0, 2.0, 3.0]
    assert made.entries == sum(row["entries"] for row in made.tables) == 32
    assert made.bytes == sum(row["bytes"] for row in made.tables) == 2 * 17 * 4
    assert [row["cycles_per_turn"] for row in made.tables] == [1.0, 3.0]


@pytest.mark.parametrize(
    ("target", "options"),
    [
        ("c", {"max_arcsec": 1.0}),
        ("rust", {"max_arcsec": 2.0, "number": "f32"}),
        ("simplefoc", {"max_arcsec": 90.0}),
        ("moteus", {"max_arcsec": 90.0}),
        ("c", {}),
    ],
)
def test_every_input_is_evaluated_once_for_the_table_that_is_written(
    target: str, options: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    proven: list[int] = []

    def counted(corrections: object, exact: object, bits: int, *rest: object) -> object:
        proven.append(bits)
        return prove_export(corrections, exact, bits, *rest)

    monkeypatch.setattr("trueangle.export.export.prove_export", counted)
    made = ta.export_model(described(terms=()), target, bits=17, **options)
    assert proven.count(17) == 1
    assert "every one of 131072 inputs" in made.proof
