"""What findings are called in pictures and tables: no two alike."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis, Finding

__all__ = ["finding_names"]

#: Names of line counts that a finding may have: parameter, and how it is told.
_PLACES: Final = {
    "order": "order {:g}",
    "carrier": "around order {:g}",
    "frequency_hz": "{:.3g} Hz",
}


def finding_names(diagnosis: Diagnosis) -> list[str]:
    """Names of the findings, strongest first: the cause, and of what line or shaft it is.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from trueangle.reports.demo import demo_simulation
    >>> believed = replace(demo_simulation(), harmonics=())
    >>> runs = ta.simulate(demo_simulation(), seed=0)
    >>> finding_names(ta.diagnose(runs, believed))[:2]
    ['missing order: wave generator 2', 'missing order: motor 2']
    """
    names = [_name(finding) for finding in diagnosis.findings]
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(f"{name} ({seen[name]})" if seen[name] > 1 else name)
    return found


def _name(finding: Finding) -> str:
    cause = finding.cause.replace("_", " ")
    values = {name: quantity.value for name, quantity in finding.parameters.items()}
    shaft, order = values.get("shaft"), values.get("order")
    if isinstance(shaft, str):
        shaft = shaft.replace("_", " ")
        return f"{cause}: {shaft} {order:g}" if _is_number(order) else f"{cause}: {shaft}"
    for name, words in _PLACES.items():
        if _is_number(values.get(name)):
            return f"{cause}: {words.format(values[name])}"
    return cause


def _is_number(value: object) -> bool:
    return isinstance(value, int | float)
