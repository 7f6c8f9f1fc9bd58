"""One cause that the readings support."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..effects import EFFECTS, Effect
from ..estimation.estimate import Parameters, Quantity
from ..support.plainresult import Shown
from .confirmation import CONFIRMED
from .gain import Gain


@dataclass(frozen=True)
class Finding(Shown):
    """One cause that the readings support.

    Attributes
    ----------
    cause : str
        Of the vocabulary of causes.
    parameters : dict of str to Quantity
        ``.value`` and ``.std`` by the names of the contract.
    evidence : dict
        ``bic_gain``, ``deviance`` (2 ln of the likelihood ratio), ``parameters``,
        ``log_grid``.
    gain : Gain or None
        On held-out runs; None for causes of the scatter.
    rivals : list of (str, float)
        Other causes and how much less each explains in its place (BIC); tried for the
        first four findings.
    effects : list of Effect
        What extends the simulation, where it is confirmed.
    status : str
        "confirmed", or "not_confirmed" where its gain on held-out data does not exclude
        zero: listed, and kept out of the extended simulation and of corrections.
    reason : str
        Why it is not confirmed.
    group : tuple of int
        Its terms in the regression.
    """

    cause: str
    parameters: Parameters
    evidence: dict[str, float]
    gain: Gain | None
    rivals: list[tuple[str, float]]
    effects: list[Effect] = field(repr=False, default_factory=list)
    status: str = CONFIRMED
    reason: str = ""
    group: tuple[int, ...] = field(repr=False, default=())

    @property
    def confirmed(self) -> bool:
        """Fit to extend the simulation and to correct."""
        return self.status == CONFIRMED

    def _brief(self) -> str:
        sizes = [f"{name} {q.value:.4g}" for name, q in self.parameters.items() if _is_number(q)]
        return ", ".join([self.cause, *sizes[:2], self.status])

    def summary(self) -> str:
        """The finding as readable text."""
        from .summary import finding_text

        return finding_text(self)

    @property
    def sentence(self) -> str:
        """The physics in one sentence."""
        return EFFECTS[self.cause].sentence

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``findings``."""
        return {
            "cause": self.cause,
            "status": self.status,
            "status_reason": self.reason,
            "parameters": {name: q.to_dict() for name, q in self.parameters.items()},
            "evidence": self.evidence,
            "gain": None if self.gain is None else self.gain.to_dict(),
            "rivals": [{"cause": cause, "bic_gap": gap} for cause, gap in self.rivals],
            "physics": self.sentence,
            "correctable": self.cause not in EFFECTS or not EFFECTS[self.cause].not_at_run_time,
        }


def _is_number(quantity: Quantity) -> bool:
    return isinstance(quantity.value, int | float)
