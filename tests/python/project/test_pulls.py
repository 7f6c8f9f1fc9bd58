"""What `tests/pulls` says of pulls and p values that are right, and of those that are not."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "pulls"))

import table
from asked import Chance, Pull, Told, pulls_of, scored
from rooms import ROOMS, of_room
from trueangle.estimation.quantity import quantity

SEEDS = range(91_000, 91_200)


def told(rms: float = 1.0, mean: float = 0.0, power: float = 1.0, careful: str = "") -> list[str]:
    """What misses of such a pull and such a p value (evenly drawn, to a power)."""

    def case(seed: int) -> Told:
        rng = np.random.default_rng(seed)
        yield Pull("error", mean + rms * rng.normal(), careful)
        yield Chance("p", rng.uniform() ** power, careful)

    print("seeds", SEEDS)
    return [row.misses for row in table.rows_of("drawn", case, SEEDS)]


def test_what_is_right_does_not_miss() -> None:
    assert told() == ["", ""]


def test_what_is_wrong_misses_by_what_is_wrong() -> None:
    assert told(rms=1.4)[0].startswith("rms 1.")
    assert told(rms=0.6)[0].startswith("rms 0.")
    assert told(mean=0.5)[0].endswith("mean +0.50") or "mean +0." in told(mean=0.5)[0]
    assert told(power=2.0)[1].startswith("p of p")
    assert told(power=0.5)[1].startswith("p of p")


def test_what_is_careful_misses_on_one_side() -> None:
    assert told(rms=0.6, power=0.5, careful="a bound") == ["", ""]
    error, p = told(rms=1.4, power=2.0, careful="a bound")
    assert error
    assert p


def test_numbers_that_few_seeds_tell_miss() -> None:
    def case(seed: int) -> Told:
        if seed % 2:
            yield Pull("error", (-1.0) ** (seed // 2))

    (row,) = table.rows_of("half", case, SEEDS)
    assert row.misses == "told by 100 of 200 seeds"
    (row,) = table.rows_of("none", lambda seed: [], SEEDS)
    assert row.misses == "no seed tells it"


def test_an_error_without_a_truth_is_refused_and_another_form_is_none() -> None:
    found = {"size": quantity(2.0, 0.5), "phase_deg": quantity(359.0, 2.0), "order": quantity(3.0)}
    assert list(pulls_of(found, {"size": 1.0, "phase_deg": 1.0, "order": 3.0})) == [
        Pull("size", 2.0),
        Pull("phase_deg", -1.0),
    ]
    assert not list(pulls_of(found, {"size": 1.0, "phase_deg": 1.0, "order": 4.0}))
    with pytest.raises(KeyError, match="phase_deg states an error"):
        list(pulls_of(found, {"size": 1.0, "order": 3.0}))


def test_students_tails_are_those_of_a_normal_distribution() -> None:
    """97.5 %: 2.776 standard errors of four degrees of freedom, 1.960 of known ones."""
    assert scored(2.7764451, 4.0) == pytest.approx(1.9599640, rel=1e-6)
    assert scored(-2.7764451, 4.0) == pytest.approx(-1.9599640, rel=1e-6)
    assert scored(3.0, np.inf) == 3.0


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_has_cases_and_the_first_tells_a_number(room: str) -> None:
    cases = of_room(room)
    name, case = next(iter(cases.items()))
    assert list(case(SEEDS[0])), name
