"""Every test of what is unexplained, where nothing is: white noise, and noise that remembers.

Of noise that remembers the test of its correlation has no null, and of one that is estimated
beside five lines all others hold as well as of white noise.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from asked import Case, Chance, Pull, Told, entropy
from diagnosis.goodness import readings, test_even
from trueangle.diagnosis.goodness import goodness_of_fit
from trueangle.diagnosis.goodness.leftover import Leftover

#: Highest order that is looked for.
TOP = 64.0

#: Why tests that are bounds fire less often than they say.
CAREFUL = {
    "time periodogram": "as many frequencies as might be independent",
    "place within runs": "as many frequencies as might be independent",
    "steps in time": "allows for medians of noise that remembers",
    "zeros of the runs": "the larger p of two tests",
    "noise against repeats": "both variances are of the same readings",
}
assert set(CAREFUL) > test_even.CAREFUL

#: The same of what a fit of five lines leaves in few runs or on a grid: signs drawn for the level
#: of chance give back what the fit took, and pieces of a run are not quite independent.
FITTED = dict.fromkeys(
    ("place", "place x direction", "place x direction x speed", "time since run",
     "time since reversals"),
    "beside a fit, in few runs",
)  # fmt: skip

#: Designs of the kept tests, and noises.
DESIGNS = ("split", "few", "forward", "grid", "small")
NOISES = ("gauss", "ar 0.5")


def chances(left: Leftover, kind: str, careful: Mapping[str, str]) -> Told:
    """Of every test that can be made; of noise that remembers the pull of its correlation."""
    found = goodness_of_fit(left, TOP, 1.0)
    memory = float(kind.split()[1]) if kind.startswith("ar ") else 0.0
    for item in found.evidence:
        if not (memory and item.test == "correlation"):
            yield Chance(item.test, item.p, careful.get(item.test, ""))
    if memory and found.noise.correlation:
        yield Pull("correlation", (found.noise.correlation - memory) / found.noise.std)


def loaded(kind: str) -> Case:
    """Runs of all kinds, with loads and temperatures: every test there is."""

    def case(seed: int) -> Told:
        left = test_even.noise(seed)
        rng = np.random.default_rng(entropy(seed, f"loaded {kind}"))
        parts = [readings.noise(kind, left.clock[a:b], rng) for a, b in left.bounds]
        made = Leftover(
            np.concatenate(parts), left.theta, left.direction, left.run, left.clock, True,
            left.factors,
        )  # fmt: skip
        yield from chances(made, kind, CAREFUL)

    return case


def design(name: str, kind: str) -> Case:
    """What a fit of five lines leaves."""

    def case(seed: int) -> Told:
        left = readings.leftover(name, kind, 500_000 + seed)
        yield from chances(left, kind, CAREFUL | FITTED)

    return case


def cases() -> Mapping[str, Case]:
    """White and not."""
    return {
        **{f"loaded, {kind}": loaded(kind) for kind in NOISES},
        **{f"{name}, {kind}": design(name, kind) for name in DESIGNS for kind in NOISES},
    }
