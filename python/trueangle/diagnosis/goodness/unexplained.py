"""Is something left that has no name? The decision, and how much it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...estimation.linear import linear_residual
from ...joint.pattern import lines_columns
from ...support.plainresult import ShownResult, plain_fields
from .events import reversal_test, start_test, steps_test
from .evidence import Evidence
from .leftover import Leftover
from .noise import Noise, estimate_noise
from .periodogram import order_test, time_test
from .place import LEAST_ORDERS, place_tests
from .scatter import scatter_tests
from .zeros import run_test


@dataclass(frozen=True, eq=False)
class TestedResidual:
    """The residual that is tested.

    Attributes
    ----------
    left : Leftover
        What the whole account leaves.
    loose : Leftover
        The same with free paths in time left in: they would follow anything bound to time.
    noise : Noise
    top : float
        Highest output order that is looked for.
    """

    left: Leftover
    loose: Leftover
    noise: Noise
    top: float


def evidence_of_tests(asked: TestedResidual) -> list[Evidence]:
    """Evidence of every test that can be made of such readings.

    Lines that are new in every run, or in time, are looked for in what those of the place leave:
    an order that every run has is an alias in time, and another order over a part of a run.
    """
    left, loose, noise = asked.left, asked.loose, asked.noise
    found: list[Evidence | None] = [*place_tests(left, asked.top)]
    lines = np.array([order for item in found if item is not None for order in item.lines])
    if lines.size:
        columns = np.column_stack([np.ones(len(left)), lines_columns(left.theta, lines)])
        left = replace(left, residual=linear_residual(columns, left.residual))
    found += [order_test(left, asked.top, noise.correlation), time_test(left, noise.correlation)]
    found += [run_test(asked.left, noise), reversal_test(loose), start_test(loose)]
    return [item for item in [*found, steps_test(loose)] if item is not None]


#: What a path in time looks like that no law prescribes.
FREE_PATH = "a free path in time"

#: Probability with which noise alone may be called unexplained, all deciding tests together.
LEVEL = 0.01

#: Probabilities below this count as equal, and so do those that differ by less than this share:
#: sums in another sequence of operations give the same order of tests.
SURE = 1e-9
ROUNDING = 1e-7

#: Arcsec that something is at least.
SMALLEST = 1e-9


@dataclass(frozen=True)
class Unexplained(ShownResult):
    """Tests of the residual that need no name.

    Attributes
    ----------
    found : bool
        One of the tests of place, direction, run and time fires, at 1 % for all together.
    rms : float
        Of the structure that the firing tests show, arcsec: at least so much is not noise.
    share : float
        Of the variance that is left, free paths in time among it.
    evidence : list of Evidence
        Every test, the firing ones first.
    noise : Noise
        Estimated jointly with a flexible pattern.
    """

    found: bool
    rms: float
    share: float
    evidence: list[Evidence]
    noise: Noise

    @property
    def firing(self) -> list[Evidence]:
        """The deciding tests that fire, the surest first; a free path that was chosen, too."""
        return _firing([item for item in self.evidence if item.decides])

    @property
    def beside_path(self) -> float:
        """Rms of what fires with a free path in time, arcsec: a path is noise to other causes."""
        rest = [item.rms for item in self.firing if item.looks_like != FREE_PATH]
        return max(max(rest), SMALLEST) if rest else 0.0

    @property
    def noise_firing(self) -> list[Evidence]:
        """The tests that describe the noise and fire; they decide nothing."""
        describing = [item for item in self.evidence if not item.decides]
        return [item for item in describing if item.p * len(describing) < LEVEL]

    @property
    def size(self) -> float:
        """`rms` where something is found, which is above zero; else 0."""
        return max(self.rms, SMALLEST) if self.found else 0.0

    def to_dict(self) -> dict[str, Any]:
        """The ``unexplained`` object of a diagnosis."""
        return plain_fields(self, "found rms_arcsec=rms share evidence")


def goodness_of_fit(
    left: Leftover,
    top: float = LEAST_ORDERS,
    sigma: float | None = None,
    loose: Leftover | None = None,
    path: Evidence | None = None,
    aside: Evidence | None = None,
) -> Unexplained:
    """Test a residual for everything that is not noise, without asking for a cause.

    Parameters
    ----------
    left : Leftover
        What an account leaves of the readings.
    top : float
        Highest output order that is looked for.
    sigma : float, optional
        Noise of one reading that the simulation states, arcsec.
    loose : Leftover, optional
        The same with free paths in time left in, for tests of what is bound to time.
    path : Evidence, optional
        Of a free path in time that the account needs.
    aside : Evidence, optional
        Of readings in a row that the account rejects.

    Returns
    -------
    Unexplained
        About 0.3 s for 10 000 readings and 400 orders.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> theta = np.concatenate([rng.uniform(0, 6.28, 300) for _ in range(10)])
    >>> run = np.repeat(np.arange(10), 300)
    >>> clock = np.tile(np.arange(300.0), 10)
    >>> noise = rng.normal(size=3000)
    >>> goodness_of_fit(Leftover(noise, theta, np.ones(3000), run, clock)).found
    False
    >>> left = Leftover(noise + 0.5 * np.sin(7 * theta), theta, np.ones(3000), run, clock)
    >>> goodness_of_fit(left).firing[0].test
    'place'
    """
    noise = estimate_noise(left)
    deciding = evidence_of_tests(TestedResidual(left, left if loose is None else loose, noise, top))
    deciding += [item for item in (path, aside) if item is not None]
    describing = scatter_tests(left, noise, sigma)
    firing = _firing(deciding)
    # Of tests that are all certain the narrower account comes first, and of a line
    # in angle or in time the more significant one.
    rank = {id(item): float(k) for k, item in enumerate(deciding)}
    lines = [item for item in deciding if item.test in ("place within runs", "time periodogram")]
    if len(lines) == 2 and lines[1].statistic > lines[0].statistic * (1.0 + ROUNDING):
        rank[id(lines[1])] = rank[id(lines[0])] - 0.5
    deciding.sort(key=lambda item: (round(np.log(max(item.p, SURE)) / ROUNDING), rank[id(item)]))
    # A free path has no name either: what it explains counts as residual.
    variance = float(np.var((left if loose is None else loose).residual))
    power = min(max((item.rms**2 for item in firing), default=0.0), variance)
    return Unexplained(
        bool(firing),
        float(np.sqrt(power)),
        power / variance if variance > 0.0 else 0.0,
        deciding + describing,
        noise,
    )


def _firing(deciding: list[Evidence]) -> list[Evidence]:
    """Those at 1 % for all together."""
    count = len(deciding)
    return [item for item in deciding if item.p * count < LEVEL or item.looks_like == FREE_PATH]
