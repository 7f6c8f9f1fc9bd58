"""Wind-up in proportion to torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.load import TorsionalComplianceTerm
from ..support.angles import from_arcsec
from .ambiguity import OWN_POWER, Ambiguity, share_left
from .effect import Reported
from .factor import FactorEffect
from .search import Array, Fitted, shows_line


@dataclass(frozen=True)
class TorsionalCompliance(FactorEffect):
    """Wind-up in proportion to torque: ``ε = τ [c + g(θ)]``.

    Parameters
    ----------
    arcsec_per_Nm : float
        c = 1/K: the measured torque at the reading times the compliance.
    lines_per_Nm : list of [output order, arcsec per Nm, phase_deg]
        g: gravity, where the torque column holds the load and not its moment
        (order 1).
    """

    arcsec_per_Nm: float = 0.0
    lines_per_Nm: tuple[tuple[float, float, float], ...] = ()

    kind: ClassVar[str] = TorsionalComplianceTerm.kind
    sentence: ClassVar[str] = (
        "The gear and its parts twist under torque: the error is proportional to the torque, "
        "and under gravity follows it once per turn."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    form_of: ClassVar[tuple[str, ...]] = ("load", "load_sign")
    measure: ClassVar[str] = "repeat the runs at a second, known load (or with the arm off)"
    acts_on_runs: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        torque = torque_of(signals)
        return np.asarray(
            torque * (self.arcsec_per_Nm + line_sum(signals.theta, self.lines_per_Nm))
        )

    @classmethod
    def scale(cls, signals: Signals, kind: str) -> Array | None:
        return signals.torque

    @classmethod
    def shapes(cls, regression: Regression) -> list[dict[str, Any]]:
        torque = regression.signals.torque
        if torque is None or not torque.any():
            return []
        if not cls._is_line(regression):
            return [{"what": "zero"}, {"what": "line", "order": 1.0}]
        # Where its columns are those of a line, a line is what the readings show: but on an arc on
        # which none is looked for.
        shown = bool(shows_line(regression.signals, np.ones(1))[0])
        return [] if shown else [{"what": "zero"}]

    @classmethod
    def imitate(cls, regression: Regression) -> Extension | None:
        if not (unloaded(regression.signals) or cls.shapes(regression)):
            columns = torque_of(regression.signals)[:, None]
            shape = {"what": "zero"}
            return regression.propose(cls.kind, shape, columns, log_grid=float(np.log(2.0)))
        return None

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        direct, lines = cls.single(terms, "zero"), cls.line_rows(terms)
        parameters: Parameters = {}
        if direct:
            parameters["arcsec_per_Nm"] = quantity(*direct)
        elif lines:
            parameters["arcsec_per_Nm"] = quantity(lines[0][1], lines[0][3])
        if lines:
            parameters["gravity_arcsec_per_Nm"] = quantity(lines[0][1], lines[0][3])
            parameters["gravity_phase_deg"] = quantity(lines[0][2], lines[0][4])
        effect = TorsionalCompliance(
            direct[0] if direct else 0.0, tuple((m, c, p) for m, c, p, *_ in lines)
        )
        return parameters, [effect]

    @classmethod
    def form_limits(cls, regression: Regression, terms: Sequence[Fitted]) -> Parameters:
        """``departure_arcsec``: of a cube of the torque from proportion, where that is largest.

        A spring that stiffens too little to be detected is a linear one to that accuracy.
        """
        torque = torque_of(regression.signals)
        top = float(np.abs(torque).max())
        if top == 0.0 or cls.single(terms, "zero") is None:
            return {}
        share = torque / top
        low = np.hstack([line_columns(regression.signals.theta, k) for k in (1, 2, 3)])
        cube = (share**3)[:, None]
        if share_left(regression, cube, low, share[:, None]) < OWN_POWER:
            return {}  # too few loads to determine it
        column, _ = regression.projected(cube)
        power = float(column[:, 0] @ column[:, 0])
        cubic = float(column[:, 0] @ regression.r) / power
        # What proportion cannot take of the cube.
        slope = float(share @ share**3) / float(share @ share)
        most = float(np.abs(share**3 - slope * share).max())
        std = float(np.sqrt(regression.variance / power))
        return {"departure_arcsec": quantity(cubic * most, std * most)}

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        because = unloaded(regression.signals)
        if because:
            yield cls.blind(because)
            return
        if cls._is_line(regression):
            yield cls.blind("one load: its wind-up is part of the zero or of order 1")

    @classmethod
    def _is_line(cls, regression: Regression) -> bool:
        """All runs have one load: the twist is part of the zero or of order 1."""
        signals = regression.signals

        def build() -> bool:
            torque = torque_of(signals)[:, None]
            first = line_columns(signals.theta, 1)
            return share_left(regression, torque, first) < OWN_POWER

        return bool(regression.of_pattern(f"{cls.kind} as a line", None, build))

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        lines = line_values(self.lines_per_Nm, period)
        return (TorsionalComplianceTerm(from_arcsec(self.arcsec_per_Nm, period), **lines),)


def torque_of(signals: Signals) -> Array:
    """Torque at every reading; zeros where none was recorded."""
    return np.zeros(len(signals)) if signals.torque is None else signals.torque


def unloaded(signals: Signals) -> str:
    """Why no effect of torque can be detected in any case; empty where one may be."""
    if signals.torque is None:
        return "no torque was recorded"
    return "" if signals.torque.any() else "all runs are unloaded"
