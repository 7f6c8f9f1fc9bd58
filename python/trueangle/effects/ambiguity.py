"""An ambiguity of a design of runs: the causes in question, why, and what to measure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..estimation.factor import orthonormal_basis
from ..estimation.quantity import Parameters
from ..estimation.regression import Regression
from ..support.arrays import Array
from ..support.plainresult import ShownResult, plain_fields

#: Share of velocity that direction must leave for latency and backlash to be separated.
OWN_OF_VELOCITY = 0.10

#: The same for velocity against the zero, torque against order 1, its cube against it.
OWN_POWER = 0.02

#: Kelvin of change below which temperature counts as constant.
LEAST_KELVIN = 2.0

#: Runs per level that separate the effect of a level, constant in a run, from zeros of runs.
RUNS_PER_LEVEL = 3


@dataclass(frozen=True)
class Ambiguity(ShownResult):
    """Causes that this data cannot separate, or not detect at all.

    Attributes
    ----------
    causes : tuple of str
    because, measure : str
        Why, and the measurement to add.
    supported : bool
        The readings do show something that one of these causes explains.
    evidence : float or None
        By how much BIC is better with it.
    estimates : dict of str to Parameters
        Estimate of each cause as the only one; where something is detected.
    hypotheses : dict of str to tuple of Effect
        The same as effects of a simulation, lines too: what a plan of further runs assumes.
    factor : str
        What in the design of the runs is at fault: "grid", "mount", "torque", "velocity",
        "temperature", "direction", "run", "time".
    common : str
        The cause whose form is what all of them share, where there is one: naming it claims
        only what the readings show. Another one is named where the readings show what the
        design does not promise to (`Effect.told`).
    """

    causes: tuple[str, ...]
    because: str
    measure: str
    supported: bool = False
    evidence: float | None = None
    estimates: dict[str, Parameters] = field(default_factory=dict)
    factor: str = "run"
    common: str = ""
    hypotheses: dict[str, tuple[Any, ...]] = field(default_factory=dict, repr=False, compare=False)

    def _brief(self) -> str:
        seen = "one of them is detected" if self.supported else "not detected"
        return f"{', '.join(self.causes)}: {seen}"

    def hides(self, cause: str) -> bool:
        """Whether naming this cause would be a guess."""
        return cause in self.causes and cause != self.common

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``not_identifiable``."""
        return plain_fields(self, "causes because measure supported bic_gain=evidence estimates")


def share_left(regression: Regression, columns: Array, *others: Array) -> float:
    """Largest share of power that columns have outside the span of the lines and ``others``."""
    q = orthonormal_basis(np.hstack([regression.base, *others]))
    rest = columns - q @ (q.T @ columns)
    before = np.einsum("ij,ij->j", columns, columns)
    after = np.einsum("ij,ij->j", rest, rest)
    return float(np.max(np.where(before > 0.0, after / before.clip(1e-300), 0.0)))
