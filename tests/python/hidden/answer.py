"""What `diagnose` answered, reduced to what the exam judges."""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import trueangle as ta

from .case import Case, Question, pose
from .source import Source

#: Standard errors within which a parameter counts as found.
STANDARD_ERRORS = 3.0


@dataclass(frozen=True)
class Answer:
    """The judged answer to one case."""

    case: Case
    found: tuple[str, ...]  # causes in the order found
    blind: tuple[str, ...]  # causes reported as not identifiable
    untold: tuple[tuple[str, ...], ...]  # causes of which one is seen, and not told which
    scores: dict[str, float]  # (estimate - truth) / std of the shared parameters
    shares: dict[str, float]  # reducible share per finding
    reasons: str  # text of not_identifiable
    visible: float
    seconds: float
    confirmed: tuple[str, ...] = ()

    @property
    def first(self) -> str:
        """The cause named first, or "none"."""
        return self.found[0] if self.found else "none"

    @property
    def right_first(self) -> bool:
        """A true cause was named first; nothing, where nothing is hidden."""
        return self.first in (self.case.causes or ("none",))

    @property
    def exact(self) -> bool:
        """All true causes and no others."""
        return set(self.found) == set(self.case.causes)

    @property
    def extra(self) -> tuple[str, ...]:
        """Causes named that are not there."""
        return tuple(c for c in self.found if c not in self.case.causes)

    @property
    def false(self) -> tuple[str, ...]:
        """Causes confirmed that are not there."""
        return tuple(c for c in self.confirmed if c not in self.case.causes)

    @property
    def repeated(self) -> bool:
        """One cause was named more than once."""
        return len(set(self.found)) < len(self.found)

    @property
    def honest(self) -> bool:
        """Every hidden cause is reported as not identifiable, and no wrong one is named.

        The form that it shares with others is no wrong name where it is said which they are.
        """
        hidden = set(self.case.causes)
        open_origin = {c for causes in self.untold if hidden & set(causes) for c in causes}
        return hidden <= set(self.blind) and set(self.extra) <= open_origin

    def record(self) -> dict[str, Any]:
        """A row for the artefact file."""
        return {**asdict(self), "first": self.first, "exact": self.exact, "honest": self.honest}


def ask(case: Case) -> Answer:
    """Pose a case, diagnose it and judge the answer."""
    return judge(pose(case))


def diagnose(question: Question, simulation: str | None = None) -> tuple[dict[str, Any], float]:
    """The diagnosis as the contract's JSON object, and the seconds it took."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "joint.toml"
        path.write_text(simulation or question.simulation, encoding="utf-8")
        loaded = ta.load_simulation(path)
    start = time.perf_counter()
    result = ta.diagnose(question.runs, loaded)
    seconds = time.perf_counter() - start
    return as_json(result), seconds


def as_json(result: Any) -> dict[str, Any]:
    """A `Diagnosis` as the object that ``trueangle diagnose --json`` prints."""
    text = result.to_json()
    found = json.loads(text) if isinstance(text, str) else text
    assert isinstance(found, dict)
    return found


def judge(question: Question) -> Answer:
    """Diagnose and compare with the truth."""
    report, seconds = diagnose(question)
    findings = report["findings"]
    scores = scored(question.sources, findings)
    blind = report["not_identifiable"]
    return Answer(
        case=question.case,
        found=tuple(finding["cause"] for finding in findings),
        blind=tuple(cause for entry in blind for cause in entry["causes"]),
        untold=tuple(tuple(entry["causes"]) for entry in blind if entry["supported"]),
        scores=scores,
        shares={f["cause"]: _share(f) for f in findings},
        reasons=" | ".join(f"{entry['because']} -> {entry['measure']}" for entry in blind),
        visible=question.visible(),
        seconds=seconds,
        confirmed=tuple(f["cause"] for f in findings if f["status"] == "confirmed"),
    )


def scored(sources: Iterable[Source], findings: list[dict[str, Any]]) -> dict[str, float]:
    """Distance of every shared parameter from the truth, in stated standard errors."""
    scores: dict[str, float] = {}
    for source in sources:
        for finding in findings:
            if finding["cause"] == source.cause:
                scores |= _scores(source.cause, source.parameters(), finding["parameters"])
                break
    return scores


def _scores(cause: str, truth: dict[str, float], found: dict[str, Any]) -> dict[str, float]:
    scores = {}
    for name, true in truth.items():
        if name in found:
            value, std = found[name]["value"], found[name]["std"]
            if isinstance(value, (int, float)) and std:
                # The sign of a spring constant or a step is a matter of convention.
                scores[f"{cause}.{name}"] = (abs(value) - abs(true)) / std
    return scores


def _share(finding: dict[str, Any]) -> float:
    share = (finding.get("gain") or {}).get("reducible_share")
    if isinstance(share, dict):
        share = share.get("value")
    return math.nan if share is None else float(share)
