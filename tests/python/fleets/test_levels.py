"""How the level is shared among orders, and chances of a unit by one of them or by all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from trueangle.fleets.outliers import LEVEL, Deviates, _combined, _f_tail, deviates, level_by_order

SEED = 52_080


@pytest.mark.parametrize(
    ("orders", "shares"),
    [
        ([1, 2, 5, 8], [0.4, 0.2, 0.2, 0.2]),
        ([8, 2, 1], [0.4, 0.2, 0.4]),
        ([5, 8], [0.5, 0.5]),
        ([1], [1.0]),
        ([2], [1.0]),
        ([1, 2], [2.0 / 3.0, 1.0 / 3.0]),
        ([1, 7.3], [0.5, 0.5]),
        ([2, 3, 4, 5, 6], [1.0 / 3.0] + [1.0 / 6.0] * 4),
    ],
)
def test_eccentricity_has_two_fifths_of_the_level_and_tilt_one(
    orders: list[float], shares: list[float]
) -> None:
    """All others have the rest together; of fewer orders each has the more in proportion."""
    found = level_by_order(np.array(orders, dtype=float))
    np.testing.assert_allclose(found, shares, rtol=1e-12)
    assert found.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("d", [1, 2])
def test_a_tail_is_that_of_f(d: int) -> None:
    f, free = np.array([0.3, 1.0, 4.0, 30.0]), np.array([4.0, 9.0, 20.0, 100.0])
    np.testing.assert_allclose(_f_tail(f, d, free), stats.f.sf(f, d, free), rtol=1e-6)


@pytest.mark.parametrize("orders", [1, 2, 5, 17])
def test_a_chance_is_the_least_of_the_orders_or_that_of_all_together(orders: int) -> None:
    """Nine tenths of the level are for single orders, by their shares; the rest is Fisher's."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    chance = rng.uniform(size=(40, orders)) ** rng.integers(1, 9, (40, 1))
    shares = rng.dirichlet(np.ones(orders))
    expected = []
    for row in chance:
        single = min(p / share for p, share in zip(row, shares, strict=True))
        every = stats.combine_pvalues(row, method="fisher").pvalue
        expected.append(single if orders == 1 else min(single / 0.9, every / 0.1))
    np.testing.assert_allclose(_combined(chance, shares), np.minimum(expected, 1.0), rtol=1e-9)


def test_orders_of_a_unit_are_those_outside_the_farthest_first() -> None:
    """At a hundredth shared by all units and orders; the farthest where none is."""
    chance = np.full((5, 4), 0.5)
    limit = LEVEL / 20.0
    chance[1] = [limit, 1.01 * limit, 1e-9, 0.9]
    chance[2] = [0.3, 0.2, 0.4, 0.1]
    empty = np.zeros(0)
    found = Deviates(chance, chance, empty, empty.astype(bool), empty, 0.0)
    assert found.orders(1) == [2, 0]
    assert found.orders(2) == [3]
    assert found.orders(1, 2.0 * LEVEL) == [2, 0, 1]


@pytest.mark.parametrize("d", [1, 2])
@pytest.mark.parametrize("aligned", [True, False])
def test_units_known_unlike_well_are_weighed_by_their_variances(d: int, aligned: bool) -> None:
    """Without one another, one by one, by the formula; and a quarter of them far off."""
    print("seed", SEED + 1)
    rng = np.random.default_rng([SEED + 1, d])
    noise = rng.uniform(0.5, 2.0, 12)
    own = noise[:, None, None] * np.eye(d)
    value = np.sqrt(2.0 + noise)[:, None] * rng.normal(size=(12, d))
    found = deviates([value], [own], aligned)
    w = 1.0 / (found.variances[0] + noise)
    mean = (w @ value) / w.sum() if aligned else np.zeros(d)
    share = w / w.sum() if aligned else np.zeros(12)
    e = w * ((value - mean) ** 2).sum(axis=1) / (1.0 - share)
    freedom = d * (12 - aligned)
    square = (w * ((value - mean) ** 2).sum(axis=1)).sum()
    f = e / d / ((square - e) / (freedom - d))
    np.testing.assert_allclose(found.chance[:, 0], stats.f.sf(f, d, freedom - d), rtol=1e-6)
    np.testing.assert_allclose(found.size[:, 0], np.sqrt(d * f), rtol=1e-9)
    np.testing.assert_allclose(found.unit, found.chance[:, 0], rtol=1e-12)
    for count in (1, 2, 3):
        far = value.copy()
        far[:count] += 1e6 * (1.0 + np.arange(count))[:, None] * (1.0 if d == 1 else [1.0, -1.0])
        outlying = deviates([far], [own], aligned).outlying
        assert np.flatnonzero(outlying).tolist() == list(range(count))


def test_few_units_have_no_scale() -> None:
    """Four degrees of freedom are needed of the others: of two dimensions from four units on."""
    print("seed", SEED + 2)
    value = np.random.default_rng(SEED + 2).normal(size=(6, 2))
    for d, aligned, least in ((2, True, 4), (2, False, 3), (1, True, 6), (1, False, 5)):
        for count in (least - 1, least):
            own = np.zeros((count, d, d))
            found = deviates([value[:count, :d]], [own], aligned)
            assert (found.chance < 1.0).all() == (count == least)
