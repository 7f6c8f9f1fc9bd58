"""What a simulation claims and the readings show at another place or order."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects import EFFECTS
from ..effects.missing_order import MissingOrder
from ..simulation.simulation import Simulation
from .beliefs import Belief
from .finding import Finding

#: Share of its amplitude by which a line at another order may differ from the assumed one.
AS_LARGE = 0.15


def misplaced_beliefs(
    beliefs: Sequence[Belief], findings: Sequence[Finding], sim: Simulation
) -> tuple[list[Belief], list[Finding]]:
    """Assumed values found elsewhere (``wrong_place``), and the other findings.

    An effect of the same kind, or a line of the same shaft that is as large, is no further
    cause: it is the one that is assumed, at another place or order.
    """
    effects = {effect.kind: effect for effect in sim.effects}
    left, found = list(findings), []
    for belief in beliefs:
        shaft = belief.what.split(" order ")[0]
        places = [
            finding
            for finding in left
            if belief.verdict == "absent"
            and finding.confirmed
            and EFFECTS[finding.cause].located
            and (finding.cause == belief.what or _is_line_of_shaft(finding, shaft, belief))
        ]
        if len(places) != 1:
            found.append(belief)
            continue
        (finding,) = places
        left.remove(finding)
        known = {
            name: (q.value, q.std)
            for name, q in finding.parameters.items()
            if isinstance(q.value, float | int) and name != "output_order"
        }
        believed = dict(belief.believed)
        if belief.what in effects:
            table = effects[belief.what].to_table()
            believed |= {name: float(table[name]) for name in known if name in table}
        else:
            believed["order"] = float(belief.what.split(" order ")[1])
        found.append(
            Belief(
                belief.what,
                "wrong_place",
                {name: value for name, value in believed.items() if name in known},
                {name: float(value) for name, (value, _) in known.items()},
                {name: float(std or 0.0) for name, (_, std) in known.items()},
                finding.gain,
            )
        )
    return found, left


def _is_line_of_shaft(finding: Finding, shaft: str, belief: Belief) -> bool:
    """The finding is a line of this shaft as large as the assumed one."""
    if finding.cause != MissingOrder.kind or finding.parameters["shaft"].value != shaft:
        return False
    size, measured = belief.believed.get("amplitude_arcsec"), finding.parameters["amplitude_arcsec"]
    if size is None or not isinstance(measured.value, float):
        return False
    std = measured.std if isinstance(measured.std, float) else 0.0
    return abs(measured.value - size) < max(AS_LARGE * size, 3.0 * std)
