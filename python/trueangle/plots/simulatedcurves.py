"""What the pictures of a diagnosis show: measured and simulated, gains, the residual; its names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ..effects.effect import title_of
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, circular_mean, wrap
from ..support.display_units import ErrorUnit
from .curves import Points, reference_degrees, run_label

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis, Finding
    from ..simulation import Simulation

#: Names of line counts that a finding may have: parameter, and how it is reported.
_PLACES: Final = {
    "order": "order {:g}",
    "carrier": "around order {:g}",
    "frequency_hz": "{:.3g} Hz",
}


@dataclass(frozen=True)
class GainBar:
    """Share of the reducible error that a cause takes away on held-out runs, percent."""

    cause: str
    share: float
    low: float
    high: float


@dataclass(frozen=True)
class ErrorLeft:
    """Rms of held-out readings, arcsec: with all causes in place, then without each of them."""

    rows: tuple[tuple[str, float], ...]
    noise: float

    def axis(self, unit: ErrorUnit) -> str:
        """Title of the axis of sizes."""
        return f"rms left of held-out readings / {unit.name}"

    def told(self, unit: ErrorUnit) -> str:
        """The picture in a sentence."""
        rows = ", ".join(f"{name} {unit.text(rms)}" for name, rms in self.rows)
        return f"Rms left of held-out readings: {rows}; noise {unit.text(self.noise)}."


def simulated_points(
    runs: Sequence[CalibrationRun], sim: Simulation
) -> list[tuple[Points, Points]]:
    """Measured and simulated error of every run about one common zero, arcsec."""
    factor = ARCSEC_PER_TURN / runs[0].period
    expected = [sim.predict(run) for run in runs]
    zero = circular_mean(
        np.concatenate(
            [r.indicated - r.reference - e / factor for r, e in zip(runs, expected, strict=True)]
        ),
        runs[0].period,
    )
    found = []
    for number, (run, simulated) in enumerate(zip(runs, expected, strict=True)):
        measured = factor * wrap(run.indicated - run.reference - zero, run.period)
        x, label = reference_degrees(run), run_label(run, number)
        found.append((Points(label, x, measured), Points(label, x, simulated)))
    return found


def error_left_of(diagnosis: Diagnosis) -> ErrorLeft | None:
    """From the gains of the findings that carry over to new runs; None where none does."""
    known = [
        (name, finding.gain)
        for name, finding in zip(finding_names(diagnosis), diagnosis.findings, strict=True)
        if finding.gain is not None and finding.gain.reducible_share is not None
    ]
    if not known:
        return None
    together = ("with all causes", known[0][1].after[0])
    without = (("without " + name, gain.before[0]) for name, gain in known)
    return ErrorLeft((together, *without), diagnosis.noise)


def gain_bars(diagnosis: Diagnosis) -> list[GainBar]:
    """Findings whose gain carries over to new runs."""
    return [
        GainBar(
            name,
            100.0 * gain.reducible_share,
            100.0 * gain.interval[0],
            100.0 * gain.interval[1],
        )
        for name, finding in zip(finding_names(diagnosis), diagnosis.findings, strict=True)
        if (gain := finding.gain) is not None
        and gain.reducible_share is not None
        and gain.interval is not None
    ]


def finding_names(diagnosis: Diagnosis) -> list[str]:
    """Names of the findings, strongest first: the cause, and of what line or shaft it is.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from trueangle.reports.demo import demo_simulation
    >>> believed = replace(demo_simulation(), harmonics=())
    >>> runs = ta.simulate(demo_simulation(), seed=0)
    >>> finding_names(ta.diagnose(runs, believed))[:2]
    ['periodic error: wave generator 2', 'periodic error: motor 2']
    """
    names = [_name(finding) for finding in diagnosis.findings]
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(f"{name} ({seen[name]})" if seen[name] > 1 else name)
    return found


def _name(finding: Finding) -> str:
    cause = title_of(finding.cause)
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
