"""Which gear ratio two encoders are read with: as given, whole, or measured; and what is told."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from trueangle.selfcalibration import dual
from trueangle.selfcalibration.dualfit import RatioEstimate, estimate_dual_ratio
from trueangle.selfcalibration.gearlines import GearedChannels

SEED = 59_200

GIVEN, ASKED = (True, False), (True, True)
FREE = (False, False)

WHOLE = "give the count of teeth as `gear_ratio=`"


def used(
    monkeypatch: pytest.MonkeyPatch,
    start: float,
    measured: float,
    std: float,
    given: bool,
    asked: bool,
) -> dual._UsedRatio:
    estimate = RatioEstimate(measured, std)
    monkeypatch.setattr(dual, "estimate_dual_ratio", lambda *args: estimate)
    found = dual._ratio(None, start, "auto", 3.0, given, asked)  # type: ignore[arg-type]
    assert found.measured is estimate
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("start", "measured", "std", "how", "ratio", "told"),
    [
        # As given: told where the readings exclude it, by six errors and a part in 10 000.
        (100.0, 100.05, 0.01, GIVEN, 100.0, ""),
        (100.0, 100.07, 0.01, GIVEN, 100.0, "a gear ratio of {}, not {:g}, which is kept"),
        (100.0, 99.93, 0.01, GIVEN, 100.0, "a gear ratio of {}, not {:g}, which is kept"),
        (100.0, 100.009, 0.001, GIVEN, 100.0, ""),
        (100.0, 100.011, 0.001, GIVEN, 100.0, "not {1:g}, which is kept"),
        # Asked for: kept within four errors, else as measured, a whole one within four of it.
        (100.0, 100.039, 0.01, ASKED, 100.0, "a gear ratio of {}; {:g} stays"),
        (100.0, 100.041, 0.01, ASKED, 100.041, "is estimated: {}, not {:g}, taken as 100.041"),
        (100.0, 101.039, 0.01, ASKED, 101.0, "is estimated: {}, not {:g}, taken as 101"),
        (100.0, 100.961, 0.01, ASKED, 101.0, "is estimated: {}, not {:g}, taken as 101"),
        # Nothing given: whole within four errors.
        (100.2, 100.03, 0.01, FREE, 100.0, "is estimated: {}, taken as 100"),
        (100.2, 100.05, 0.01, FREE, 100.05, "is estimated: {}, taken as 100.05"),
        (0.3, 0.4, 0.2, FREE, 1.0, "as well: give the count of teeth as `gear_ratio=`, taken as 1"),
    ],
)  # fmt: skip
def test_a_ratio_is_used_as_the_readings_leave_it(
    start: float, measured: float, std: float, how: tuple[bool, bool], ratio: float, told: str,
    sign: float, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    found = used(monkeypatch, sign * start, sign * measured, std, *how)
    assert found.used == pytest.approx(sign * ratio, rel=1e-12)
    numbers = f"{sign * measured:.7g} (std {std:.2g})"
    wanted = told.format(numbers, sign * start).replace("taken as ", f"taken as {'-' * (sign < 0)}")
    assert wanted in found.note
    assert bool(found.note) == bool(told)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("std", "range_told"), [(0.124, False), (0.126, True), (0.3, True)])
def test_a_range_of_ratios_is_told_where_teeth_are_not(
    std: float, range_told: bool, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four errors to either side that hold more than one whole number; counts are positive."""
    found = used(monkeypatch, sign * 50.2, sign * 50.1, std, *FREE)
    assert found.used == sign * 50.0
    low, high = 50.1 - 4.0 * std, 50.1 + 4.0 * std
    told = f"any from {low:.4g} to {high:.4g} explains the readings as well: {WHOLE}"
    assert (told in found.note) == range_told


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("how", "ratio", "told"),
    [
        (GIVEN, 50.2, ""),
        (ASKED, 50.2, "do not separate the gear ratio from orders of the output: {} is kept"),
        (FREE, 50.0, "separate the gear ratio from orders of the output; give it as `gear_ratio=`"),
    ],
)  # fmt: skip
def test_readings_that_do_not_tell_the_ratio_leave_the_one_that_is_known(
    how: tuple[bool, bool], ratio: float, told: str, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = used(monkeypatch, sign * 50.2, sign * 50.2, math.inf, *how)
    assert found.used == sign * ratio
    assert found.note.endswith(told.format(f"{sign * 50.2:g}"))
    assert bool(found.note) == bool(told)


def over_an_arc(rng: np.random.Generator, turns: float, orders: Sequence[int]) -> GearedChannels:
    """One way over some turns, lines of 10 to 200 arcsec in noise of 5; the ratio is 50.3."""
    theta = np.linspace(0.0, 2.0 * np.pi * turns, 800) + rng.uniform(0.0, 2.0 * np.pi)
    error = rng.normal(0.0, 5.0, theta.size)
    for k in orders:
        error += rng.uniform(10.0, 200.0) * np.sin(k * theta + rng.uniform(0.0, 2.0 * np.pi))
    return GearedChannels([50.3 * theta], [theta + np.radians(error / 3600.0)], [None])


@pytest.mark.parametrize("orders", [(1, 2), (1, 2, 3, 5), (2, 4)], ids=str)
@pytest.mark.parametrize("turns", [0.4, 0.6, 0.9, 1.5])
def test_a_ratio_is_as_certain_as_orders_that_nobody_sees_leave_it(
    turns: float, orders: Sequence[int]
) -> None:
    """Over an arc, errors had been of the orders chosen: a third of them were ten times too small.

    Where it is not told, or hardly, nothing is claimed.
    """
    print("seed", SEED)
    rng = np.random.default_rng([SEED, int(10 * turns), *orders])
    pulls = []
    for _ in range(24):
        found = estimate_dual_ratio(over_an_arc(rng, turns, orders), 50.25, "auto", turns)
        if np.isfinite(found.std):
            pulls.append((found.value - 50.3) / found.std)
    print(turns, orders, len(pulls), np.std(pulls) if pulls else None)
    if turns > 0.5:
        assert len(pulls) > 20
        # Of 24 pulls the root of the mean square is so once in 10 000 times.
        assert 0.55 < np.sqrt(np.mean(np.square(pulls))) < 1.6
    assert not pulls or np.abs(pulls).max() < 4.5
