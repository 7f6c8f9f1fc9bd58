"""Self-calibration: cosine and sine of every order, numbers beside them, p of parts held out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import trueangle as ta
from asked import Case, Chance, Pull, Told, generator
from selfcalibration import test_dual_numbers as dual
from selfcalibration import test_dual_ratio as dual_ratio
from selfcalibration import test_shifts as shifts
from selfcalibration.test_pulls import DESIGNS, LINES
from trueangle.selfcalibration.dualfit import estimate_dual_ratio


def design(name: str) -> Case:
    """One of the kept designs, under seeds of its own."""
    make, options, _ = DESIGNS[name]

    def case(seed: int) -> Told:
        found = ta.selfcal(make(generator(seed, name)), orders=list(LINES), **options)
        given = {o.order: o for o in found.orders}
        for k, (size, phase) in LINES.items():
            if (o := given.get(float(k))) is not None:
                for value, truth in ((o.cosine, np.sin(phase)), (o.sine, np.cos(phase))):
                    yield Pull(f"order {k}", (value - size * truth) / o.std)
        for part, held in found.held_out.items():
            yield Chance(f"held out: {part}", held.p)

    return case


def beside(seed: int) -> Told:
    """Delay, reversal error and ratio of a geared joint that swings."""
    found = dual.selfcal(dual.there_and_back(int(generator(seed, "beside").integers(2**62))))
    for name, (std, hidden) in dual.HIDDEN.items():
        yield Pull(name, (found.beside[name] - hidden) / found.beside[std])
    for part, held in found.held_out.items():
        yield Chance(f"held out: {part}", held.p)


def ratio(turns: float) -> Case:
    """The ratio over so many turns, with orders beyond those beside which it is estimated."""

    def case(seed: int) -> Told:
        rng = generator(seed, "ratio")
        channels = dual_ratio.over_an_arc(rng, turns, (1, 2, 3, 5))
        found = estimate_dual_ratio(channels, 50.25, "auto", turns)
        if np.isfinite(found.std):
            yield Pull("ratio", (found.value - 50.3) / found.std)

    return case


def facets(seed: int) -> Told:
    """Facets of a polygon about their mean, drawn anew in each seed."""
    rng = generator(seed, "facets")
    true = rng.normal(0.0, 2.0, 12)
    log = shifts.polygon(int(rng.integers(2**62)), true)
    beside = ta.selfcal(log, method="shifts", orders=[1, 2, 3]).beside
    away = np.array(beside["facets_arcsec"]) - (true - true.mean())
    for pull in away / np.array(beside["facets_std_arcsec"]):
        yield Pull("facets", float(pull))


def cases() -> Mapping[str, Case]:
    """Every kept design of every method, and the numbers beside."""
    return {
        **{name: design(name) for name in DESIGNS},
        "geared, numbers beside": beside,
        **{f"geared, {turns:g} turns": ratio(turns) for turns in (0.6, 0.9, 1.5)},
        "facets": facets,
    }
