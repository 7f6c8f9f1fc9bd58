"""The judge: what a diagnosis of a case amounts to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .cases import Case
from .causes import CAUSES, SAME_FUNCTION
from .forms import FORMS

#: Confirmed names that are right where nothing but this noise is there.
NAMES_OF_NOISE = {
    "out": {"outliers"},
    "burst": {"outliers"},
    "quant": {"quantisation"},
    "cubic": {"outliers"},
}

#: Verdicts on a form that leave the reader with the truth.
TRUTHFUL = frozenset({"named", "factor", "unnamed"})


@dataclass(frozen=True)
class Verdict:
    """The word for an answer, and the confirmed names that are wrong."""

    case: Case
    seed: int
    word: str
    wrong: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"seed {self.seed}, {self.case}: {self.word} {', '.join(self.wrong)}".rstrip()


@dataclass(frozen=True)
class Answer:
    """What a diagnosis states: names and factors, and whether there is a residual unexplained."""

    confirmed: list[str]
    listed: list[str]
    ambiguous: set[str]
    factors: set[str]
    unexplained: bool

    @classmethod
    def of(cls, account: dict[str, Any]) -> Answer:
        """Read the JSON of a diagnosis."""
        findings = [(f["cause"], f["status"] == "confirmed") for f in account["findings"]]
        ambiguous = [x for x in account.get("not_identifiable", []) if x.get("supported")]
        return cls(
            [name for name, confirmed in findings if confirmed],
            [name for name, confirmed in findings if not confirmed],
            {name for entry in ambiguous for name in entry["causes"]},
            {factor["factor"] for factor in account.get("factors", [])},
            account["unexplained"]["found"],
        )

    @property
    def anything(self) -> bool:
        """Whether anything is stated that is not confirmed."""
        return bool(self.unexplained or self.factors or self.listed or self.ambiguous)


def judge(case: Case, seed: int, account: dict[str, Any]) -> Verdict:
    """The verdict on the JSON of a diagnosis."""
    answer = Answer.of(account)
    judged = {"form": judge_form, "nothing": judge_nothing}.get(case.group, judge_causes)
    word, wrong = judged(case, answer)
    return Verdict(case, seed, "false" if wrong else word, tuple(wrong))


def judge_form(case: Case, answer: Answer) -> tuple[str, list[str]]:
    """A right name, else a right factor, else a name half right, else anything at all."""
    form = FORMS[case.parts[0][0]]
    wrong = [c for c in answer.confirmed if c not in form.names | form.arguable]
    if form.names & {*answer.confirmed}:
        return "named", wrong
    if form.factors & answer.factors:
        return "factor", wrong
    if answer.confirmed:
        return "arguable", wrong
    return "unnamed" if answer.anything else "silent", wrong


def judge_nothing(case: Case, answer: Answer) -> tuple[str, list[str]]:
    """Any confirmed name is false, but those of the noise."""
    allowed = NAMES_OF_NOISE.get(case.noise, set())
    wrong = [c for c in answer.confirmed if c not in allowed]
    return "not understood" if answer.unexplained else "quiet", wrong


def judge_causes(case: Case, answer: Answer) -> tuple[str, list[str]]:
    """All names, the strong one alone, or less."""
    hidden = [CAUSES[name] for name, _ in case.parts]
    names = [h.name for h in hidden]
    confirmed = with_same_function(answer.confirmed, names)
    wrong = [c for c in confirmed if c not in {*names}.union(*(h.companions for h in hidden))]
    if {*names} <= {*confirmed}:
        return "named" if confirmed[0] == names[0] else "named, not first", wrong
    if len(names) > 1 and names[0] in confirmed:
        return "strong only", wrong
    if {*names} & {*answer.listed}:
        return "unconfirmed", wrong
    if {*names} & answer.ambiguous:
        return "not distinguished", wrong
    return "unnamed" if answer.anything or confirmed else "silent", wrong


def with_same_function(confirmed: list[str], names: list[str]) -> list[str]:
    """Names confirmed, with a hidden cause in place of those that are together its function."""
    for name in names:
        same = SAME_FUNCTION.get(name, frozenset())
        if same and same <= {*confirmed}:
            confirmed = [name, *(c for c in confirmed if c not in same)]
    return confirmed
