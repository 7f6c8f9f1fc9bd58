"""A joint against a polygon: which orders its facets and clampings can tell, and how well."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from trueangle.errors import NoModelError

SEED = 67_600


def clamped(
    facets: int, steps: tuple[int, ...], size: float, noise: float = 0.5, seed: int = SEED
) -> dict:
    """A joint of every order up to half the facets, of one size, and facets of 2 arcsec."""
    print("seed", seed + facets)
    rng = np.random.default_rng(seed + facets)
    places = np.arange(facets)
    theta = 2.0 * np.pi * places / facets
    orders = np.arange(1, facets // 2 + 1)
    error = size * np.sin(np.outer(theta, orders) + 0.7 * orders).sum(axis=1)
    own = rng.normal(0.0, 2.0, facets)
    table: dict[str, list[np.ndarray]] = {
        "run": [], "indicated_rad": [], "reference_rad": [], "shift_deg": [],
    }  # fmt: skip
    for j, step in enumerate(steps):
        facet = (places + step) % facets
        read = error - own[facet] + noise * rng.normal(size=facets)
        table["run"].append(np.full(facets, j))
        table["indicated_rad"].append(np.mod(theta + ARCSEC * read, 2.0 * np.pi))
        table["reference_rad"].append(2.0 * np.pi * facet / facets)
        table["shift_deg"].append(np.full(facets, 360.0 * step / facets))
    return {name: np.concatenate(parts) for name, parts in table.items()}


def lost(facets: int, steps: tuple[int, ...]) -> list[int]:
    """Orders of which all clampings show the same: whole turns by their steps."""
    return [
        k for k in range(1, facets // 2 + 1)
        if all(k * (step - steps[0]) % facets == 0 for step in steps)
    ]  # fmt: skip


@pytest.mark.parametrize("orders", ["auto", "all"])
@pytest.mark.parametrize(
    ("facets", "steps"),
    [(12, (0, 2, 5)), (9, (0, 2, 5)), (12, (5, 2)), (24, (0, 4)), (12, (0, 4, 2)), (24, (9, 3, 5))],
)
def test_orders_up_to_half_the_facets_are_told_but_those_that_all_shifts_have_alike(
    facets: int, steps: tuple[int, ...], orders: str
) -> None:
    """At half of them the cosine alone, at its place in the table with its own error."""
    top = facets // 2
    given = "auto" if orders == "auto" else list(range(1, top + 1))
    found = ta.selfcal(clamped(facets, steps, 8.0), method="shifts", orders=given)
    blind = lost(facets, steps)
    assert [o.order for o in found.orders] == [k for k in range(1, top + 1) if k not in blind]
    assert [b.orders for b in found.blind] == [(0.0,)] + ([tuple(blind)] if blind else [])
    for o in found.orders:
        half = 2 * o.order == facets
        cosine, sine = 8.0 * np.sin(0.7 * o.order), 0.0 if half else 8.0 * np.cos(0.7 * o.order)
        assert abs(o.cosine - cosine) < 4.5 * o.std
        assert abs(o.sine - sine) < (1e-9 if half else 4.5 * o.std)
        # Of one coefficient the readings' whole power, of two half of it each.
        power = found.readings * o.retained / (1.0 if half else 2.0)
        assert o.std == pytest.approx(found.noise_arcsec / math.sqrt(power), rel=0.05)


@pytest.mark.parametrize(
    ("steps", "freedom"),
    # Zeros, sines and cosines of the joint and facets, less their mean and what is lost.
    [((0, 4, 2), 72 - (3 + 22 + 24 - 1)), ((0, 3), 48 - (2 + 18 + 24 - 1))],
)
def test_noise_is_told_where_facets_and_joint_share_orders(
    steps: tuple[int, ...], freedom: int
) -> None:
    """Places stand on no lattice up to the noise, and what that shows of a lost order is noise."""
    squares = [
        ta.selfcal(
            clamped(24, steps, 8.0, seed=SEED + 100 * k), method="shifts", orders=range(1, 13)
        ).noise_arcsec
        ** 2
        for k in range(12)
    ]
    # 4.5 errors of a variance of so many degrees of freedom.
    assert np.mean(squares) == pytest.approx(0.25, rel=4.5 * math.sqrt(2.0 / (12.0 * freedom)))


@pytest.mark.parametrize(("facets", "steps"), [(12, (0, 1)), (12, (5, 0)), (9, (0, 1))])
def test_without_readings_to_spare_no_error_is_stated(facets: int, steps: tuple[int, ...]) -> None:
    log = clamped(facets, steps, 8.0)
    with pytest.raises(NoModelError, match="not more than the unknowns"):
        ta.selfcal(log, method="shifts")
    # Each order less spares two readings.
    found = ta.selfcal(log, method="shifts", orders=range(1, facets // 2))
    assert found.noise_arcsec > 0.1


@pytest.mark.parametrize(("facets", "order", "like"), [(12, 7, 5), (12, 11, 1), (9, 5, 4)])
def test_an_order_beyond_half_the_facets_is_refused_with_what_it_looks_like(
    facets: int, order: int, like: int
) -> None:
    log = clamped(facets, (0, 1), 8.0)
    with pytest.raises(NoModelError) as told:
        ta.selfcal(log, method="shifts", orders=[1, order])
    said = f"{facets} facets show orders up to {facets // 2}, order {order} looks like order {like}"
    assert said in str(told.value)


def test_without_an_order_that_can_be_told_there_is_no_model() -> None:
    """Shifts of a third of a turn have orders 3 and 6 alike."""
    log = clamped(12, (0, 4, 8), 8.0)
    with pytest.raises(NoModelError, match=re.escape("all shifts are equivalent at orders 3, 6")):
        ta.selfcal(log, method="shifts", orders=[3, 6])


def test_positions_and_facets_are_those_of_the_fit_about_their_means() -> None:
    """What the joint and the facets were given, to their noise; the sums are of no position."""
    print("seed", SEED)
    log = clamped(12, (0, 2, 5), 8.0, noise=0.0)
    beside = ta.selfcal(log, method="shifts", orders=range(1, 7)).beside
    assert beside["positions_deg"] == pytest.approx(np.degrees(log["indicated_rad"][:12]))
    theta = np.radians(np.arange(12) * 30.0)
    error = 8.0 * np.sin(np.outer(theta, np.arange(1, 7)) + 0.7 * np.arange(1, 7)).sum(axis=1)
    assert beside["positions_arcsec"] == pytest.approx(error - error.mean(), abs=0.02)
    rng = np.random.default_rng(SEED + 12)
    facets = rng.normal(0.0, 2.0, 12)
    assert beside["facets_arcsec"] == pytest.approx(facets - facets.mean(), abs=0.02)
    assert beside["shifts_deg"] == pytest.approx([0.0, 60.0, 150.0], abs=0.01)
