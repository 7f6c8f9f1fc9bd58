"""Fleets: orders of each unit, the common pattern, p of sound units, a further unit by the prior.

Deviations between units and of repeated runs are told without an error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

import trueangle as ta
from asked import Case, Chance, Pull, Told, generator, scored
from fleets import made
from fleets.test_outliers import drift, memory, nothing

Array = NDArray[np.float64]
Noise: TypeAlias = Callable[[np.random.Generator, int], Array]

ORDERS = [1, 2, 3, 4]
PLACES = np.arange(0.0, 360.0, 3.0)

#: What is in the readings of each run beside white noise.
MORE = {"white": nothing, "that drift": drift, "that remember": memory}

#: Why p of units may be too large.
CAREFUL = "the smaller of two tests, times two"


def sines(order: ta.fleets.result.UnitOrder) -> Array:
    """Cosine and sine of an order, arcsec."""
    phase = np.radians(order.phase_deg)
    return np.array([np.sin(phase), np.cos(phase)]) * order.amplitude / made.ARCSEC


def sound(name: str, count: int = 12, dates: tuple[str | None, ...] = (None,)) -> Case:
    """Units of which nothing is the matter."""
    more = MORE.get(name, nothing)

    def case(seed: int) -> Told:
        rng = generator(seed, name)
        own: dict[str, Array] = {}

        def kept(u: int, t: int, b: Array) -> tuple[Array, float]:
            own[f"u{u}"] = b.copy()
            return b, 0.0

        read = made.units(rng, count, noise=1.0, change=kept, places=PLACES, dates=dates)
        runs = [
            replace(run, indicated=run.indicated + made.ARCSEC * more(rng, len(run)))
            for run in read
        ]
        found = ta.fleet(runs, orders=ORDERS)
        for unit in found.units:
            for order, true in zip(unit.orders, own[unit.unit], strict=True):
                for value, truth in zip(sines(order), true, strict=True):
                    yield Pull("orders of units", (value - truth) / (order.std / made.ARCSEC))
            yield Chance("p of units", unit.p, CAREFUL)
        for row, (a, b) in zip(found.common, made.MEAN, strict=True):
            # Known by as many units as there are.
            for value, truth in ((row.cosine, a), (row.sine, b)):
                pull = (value / made.ARCSEC - truth) / (row.std / made.ARCSEC)
                yield Pull("common pattern", scored(pull, 2.0 * (count - 1)))
        if len(dates) == 1:
            yield from further(rng, found, more)

    return case


def further(rng: np.random.Generator, fleet: ta.Fleet, more: Noise) -> Told:
    """One more unit of the design, read once, under the fleet's prior."""
    true: dict[int, Array] = {}

    def kept(u: int, t: int, b: Array) -> tuple[Array, float]:
        true[u] = b
        return b, 0.0

    (run,) = made.units(rng, 1, noise=1.0, runs=1, change=kept, places=PLACES)
    run = replace(run, indicated=run.indicated + made.ARCSEC * more(rng, len(run)))
    fit = ta.fit(run, prior=fleet)
    pairs = [(a, b) for s in fit.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    stds = np.sqrt(np.diag(fit.covariance))[1:] / made.ARCSEC
    away = (np.ravel(pairs) / made.ARCSEC - np.ravel(true[0])) / stds
    for pull, freedom in zip(away, fit.freedom[1:], strict=True):
        yield Pull("a further unit, by the prior", scored(float(pull), float(freedom)))


def cases() -> Mapping[str, Case]:
    """Fleets of one date and of two."""
    return {
        **{f"units {name}": sound(name) for name in MORE},
        "forty units": sound("forty", 40),
        "units calibrated twice": sound("twice", dates=("2026-01-10", "2026-07-10")),
    }
