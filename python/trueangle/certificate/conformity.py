"""Specifications and statements of conformity: a limit, a decision rule, the risk that is left."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from ..errors import ArgumentError
from ..support.distributions import student_tail
from ..support.suggestions import check_choice

#: Decision rules, and by how many expanded uncertainties the acceptance limit lies inside.
RULES: Final[Mapping[str, float]] = {"simple": 0.0, "guard_band": 1.0}

#: Statements from the best to the worst; only the first and the last are those of a binary rule.
_STATEMENTS: Final = ("pass", "conditional_pass", "conditional_fail", "fail")


@dataclass(frozen=True)
class Specification:
    """What the error of indication must not exceed at any position, and how that is decided.

    Attributes
    ----------
    limit_arcsec : float
        Tolerance limit TL: the error must lie within ``+-limit_arcsec``.
    decision_rule : {"simple", "guard_band"}
        Simple acceptance, w = 0, or a guard band w = U (ILAC-G8:09/2019, 4.2).

    Raises
    ------
    ArgumentError
        A limit that is not positive and finite, another rule.
    """

    limit_arcsec: float
    decision_rule: str

    def __post_init__(self) -> None:
        if not (math.isfinite(self.limit_arcsec) and self.limit_arcsec > 0.0):
            raise ArgumentError(f"limit_arcsec must be positive and finite: {self.limit_arcsec!r}")
        check_choice("decision_rule", self.decision_rule, RULES)

    def statement(self, value: float, expanded: float) -> str:
        """What is stated of one value (ILAC-G8:09/2019, 4.2.1 and 4.2.3).

        With the acceptance limit AL = TL - w: ``"pass"`` up to AL, ``"conditional_pass"`` up to
        TL, ``"conditional_fail"`` up to TL + w, ``"fail"`` beyond. Simple acceptance has w = 0
        and knows the first and the last only.

        Examples
        --------
        >>> strict = Specification(10.0, "guard_band")
        >>> [strict.statement(value, 2.0) for value in (8.0, -9.0, 11.0, 13.0)]
        ['pass', 'conditional_pass', 'conditional_fail', 'fail']
        >>> Specification(10.0, "simple").statement(9.0, 2.0)
        'pass'
        """
        band = RULES[self.decision_rule] * expanded
        limits = (self.limit_arcsec - band, self.limit_arcsec, self.limit_arcsec + band)
        if band == 0.0:
            return "pass" if abs(value) <= self.limit_arcsec else "fail"
        return _STATEMENTS[sum(abs(value) > limit for limit in limits)]


def conformance_probability(
    value: float,
    standard: float,
    lower: float,
    upper: float,
    degrees_of_freedom: float = math.inf,
) -> float:
    """Probability that a quantity lies within its tolerance limits (JCGM 106:2012, 7.2).

    ::

        p_c = F((T_U - y) / u) - F((T_L - y) / u)

    with F Student's distribution of the degrees of freedom, the normal one where they are
    infinite; a limit that is not there is infinite.

    Examples
    --------
    Breakdown voltage of a Zener diode, at most -5.40 V: -5.47 V measured, u = 0.05 V.

    >>> round(conformance_probability(-5.47, 0.05, -math.inf, -5.40), 2)
    0.92
    """
    if standard == 0.0:
        return float(lower <= value <= upper)

    def above(limit: float) -> float:
        return student_tail((limit - value) / standard, degrees_of_freedom)

    return max(above(lower) - above(upper), 0.0)


def conformity(
    specification: Specification, positions: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """The statement for all nominal positions together: that of the worst.

    Parameters
    ----------
    specification : Specification
    positions : sequence of mappings
        ``angle_deg, error_arcsec, standard_arcsec, degrees_of_freedom, expanded_arcsec``, as a
        certificate's content has them.

    Returns
    -------
    dict
        ``limit_arcsec, decision_rule, statement, conforms`` (by the binary rule: every value
        within its acceptance limit), ``worst`` position with its acceptance limit and its excess,
        ``counts`` of positions by statement, and the least ``conformance_probability``.
    """
    limit, rule = specification.limit_arcsec, specification.decision_rule
    stated = [
        specification.statement(row["error_arcsec"], row["expanded_arcsec"]) for row in positions
    ]
    bands = [RULES[rule] * row["expanded_arcsec"] for row in positions]
    over = [abs(row["error_arcsec"]) + w for row, w in zip(positions, bands, strict=True)]
    worst = max(range(len(positions)), key=lambda k: (_STATEMENTS.index(stated[k]), over[k]))
    row = positions[worst]
    chances = [
        conformance_probability(
            p["error_arcsec"],
            p["standard_arcsec"],
            -limit,
            limit,
            p["degrees_of_freedom"] or math.inf,
        )
        for p in positions
    ]
    return {
        "limit_arcsec": limit,
        "decision_rule": rule,
        "statement": stated[worst],
        "conforms": all(statement == "pass" for statement in stated),
        "worst": {
            "angle_deg": row["angle_deg"],
            "error_arcsec": row["error_arcsec"],
            "expanded_arcsec": row["expanded_arcsec"],
            "acceptance_limit_arcsec": limit - bands[worst],
            "beyond_limit_arcsec": max(abs(row["error_arcsec"]) - limit, 0.0),
        },
        "counts": {name: stated.count(name) for name in _STATEMENTS},
        "conformance_probability": min(chances),
    }
