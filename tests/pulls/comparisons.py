"""Two calibrations of one pattern: p of their difference, errors of its orders."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import trueangle as ta
from asked import Case, Chance, Pull, Told, generator, scored
from export.test_equality import calibrated, scattered

#: Designs of readings; those of which orders are chosen compare what was chosen.
DESIGNS: dict[str, dict[str, Any]] = {
    "two runs": {},
    "few readings": {"runs": 1, "count": 40},
    "many runs": {"runs": 20, "count": 30},
    "orders selected": {"orders": None},
}

#: Runs on either side, orders and how much they scatter, memory of the noise.
SCATTERED = {
    "four runs that scatter": ((4, 4), [1], 2.0, 0.0),
    "runs that scatter": ((6, 8), [1, 3], 2.0, 0.0),
    "noise that remembers": ((7, 7), [1, 2, 5], 0.0, 0.9),
}

#: Satterthwaite's freedom of few runs is a guess, and the farthest of several orders is judged.
CAREFUL = "the farthest of the orders, a covariance that few runs tell"


def compared(one: ta.HarmonicModel, other: ta.HarmonicModel, careful: str, freedom: float) -> Told:
    """P of the two, and each order of their difference."""
    found = ta.compare(one, other)
    if found.p is None:
        return
    yield Chance("p", found.p, careful)
    for row in found.orders:
        if row["std_arcsec"] and row["amplitude_arcsec"] is not None:
            phase = math.radians(row["phase_deg"] or 0.0)
            for part in (math.sin(phase), math.cos(phase)):
                pull = row["amplitude_arcsec"] * part / row["std_arcsec"]
                yield Pull("orders", scored(pull, freedom))


def white(name: str) -> Case:
    """White noise."""
    design = DESIGNS[name]
    careful = "an order that one lacks counts 220 times" if "orders" in design else ""

    def case(seed: int) -> Told:
        rng = generator(seed, name)
        models = [calibrated(rng, **design) for _ in range(2)]
        fits = [model.fit for model in models if model.fit is not None]
        freedom = float(sum(fit.samples - fit.runs - 8 for fit in fits))
        yield from compared(models[0], models[1], careful, freedom)

    return case


def of_runs(name: str) -> Case:
    """Covariances by the scatter of runs."""
    runs, orders, size, memory = SCATTERED[name]

    def case(seed: int) -> Told:
        rng = generator(seed, name)
        models = [scattered(rng, count, orders, size, memory) for count in runs]
        known = [model.fit.freedom for model in models if model.fit is not None]
        if all(freedom is not None for freedom in known):
            freedom = float(sum(freedom or 0.0 for freedom in known))
            yield from compared(models[0], models[1], CAREFUL, freedom)

    return case


def cases() -> Mapping[str, Case]:
    """All of them."""
    return {
        **{name: white(name) for name in DESIGNS},
        **{name: of_runs(name) for name in SCATTERED},
    }
