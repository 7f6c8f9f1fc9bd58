"""Questions of the exam and how their answers are judged."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from trueangle import CalibrationRun

from ..answer import STANDARD_ERRORS, diagnose, scored
from ..case import Case as HiddenCase
from ..case import Question
from ..causes import CAUSES, draw
from ..designs import DESIGNS
from ..joint import Joint, Line, random_joint
from ..measurement import ARCSEC, Habit, measure, random_habit
from ..reversal import Backlash
from ..slow import Wander
from ..source import Source
from .episodes import EPISODES, episode
from .inexact import INEXACT
from .inexact import draw as draw_inexact
from .logs import BURSTS, LINES, TABLE_SIGMA, TABLES, table, with_bursts
from .structures import SHAPES, structure
from .timebound import FORMS, SIGMA, there_and_back, timebound

#: Noise of the exam beyond what the logger of the hidden exam knows, and bits of rounding.
NOISES = ("normal", "heavy", "ar 0.5", "ar 0.9", "uniform", "wander")
BITS = (12, 13, 14, 15, 16)

#: Sizes of effects bound to time, in standard deviations of the noise: one is drawn.
TIMEBOUND = (2.0, 4.0, 8.0)

#: Correlations of the noise in runs there and back.
CORRELATIONS = (0.5, 0.8, 0.9, 0.95, 0.97)

#: Drifting zeros without any effect.
DRIFTS = ("walk", "flicker")

#: Wrong beliefs: how the simulation differs from the joint, and the verdict that is right.
BELIEFS = {
    "absent line": "absent",
    "twice": "overestimated",
    "half": "underestimated",
    "phase": "wrong_phase",
    "sign": "wrong_phase",
    "absent backlash": "absent",
    "backlash twice": "overestimated",
    "gear ratio": "wrong_gear_ratio",
}

#: Large and small effects that stand together at 1 : 0.2.
SEVERAL = (
    ("backlash", "thermal_drift"),
    ("torsional_compliance", "backlash"),
    ("presliding_hysteresis", "zero_slip"),
    ("latency", "missing_order"),
    ("missing_order", "backlash"),
    ("thermal_drift", "sidebands", "torsional_compliance"),
    ("torsional_compliance", "missing_order", "outliers"),
)

#: Causes asked at eight sigma: those whose forms the library knows to a few percent.
HIGH = (
    "presliding_hysteresis",
    "thermal_drift",
    "torsional_compliance",
    "stiffening_compliance",
    "load_dependent_gear_error",
    "drift_within_run",
    "sidebands",
    "reference_error",
    "backlash",
    "latency",
)

#: Outliers and local defects take too few readings, non-integer orders slip: not at 8 sigma.
SIGMAS = 8.0


@dataclass(frozen=True)
class Case:
    """One question: a group, what is hidden, how strongly, and a seed."""

    group: str  # one of `JUDGES`
    kind: str
    scale: float = 1.0
    seed: int = 0

    def __str__(self) -> str:
        return f"{self.group}: {self.kind} x{self.scale:g}, seed {self.seed}"

    def rng(self) -> np.random.Generator:
        return np.random.default_rng([self.seed, 71, zlib.crc32((self.group + self.kind).encode())])


@dataclass(frozen=True)
class Verdict:
    """The judged answer."""

    case: Case
    right: bool
    confirmed: tuple[str, ...]
    listed: tuple[str, ...]
    unexplained: bool
    evidence: str
    seconds: float
    scores: dict[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        return (
            f"{'ok  ' if self.right else 'FAIL'} {self.case}: {list(self.confirmed)}"
            f"{' listed ' + str(list(self.listed)) if self.listed else ''} "
            f"{'unexplained: ' + self.evidence if self.unexplained else ''} "
            f"{', '.join(f'{n} {s:+.1f} se' for n, s in self.scores.items())} {self.seconds:.1f} s"
        )


def ask(case: Case) -> Verdict:
    """Pose a case, diagnose it and judge the answer."""
    question, truth, text = POSERS[case.group](case)
    report, seconds = diagnose(question, text)
    found = report["findings"]
    confirmed = tuple(f["cause"] for f in found if f.get("status", "confirmed") == "confirmed")
    listed = tuple(f["cause"] for f in found if f.get("status", "confirmed") != "confirmed")
    unexplained = report.get("unexplained") or {"found": False, "evidence": []}
    firing = unexplained["evidence"][0]["says"] if unexplained["found"] else ""
    right = JUDGES[case.group](case, report, confirmed, bool(unexplained["found"]), truth)
    scores = scored(question.sources, found)
    if case.group == "inexact":
        right = right and all(abs(score) <= STANDARD_ERRORS for score in scores.values())
    return Verdict(
        case, right, confirmed, listed, bool(unexplained["found"]), firing, seconds, scores
    )


def _question(
    case: Case, joint: Joint, habit: Habit, sources: tuple[Source, ...], rng: np.random.Generator
) -> Question:
    name = "rich" if rng.integers(2) else "rich_constant_load"
    if any(isinstance(s, Source) and s.cause == "stiffening_compliance" for s in sources):
        name = "rich"
    design = DESIGNS[name]
    scenes = design.scenes(rng)
    sized = tuple(s.sized(joint, scenes, rms) for s, rms in ((s, s.size) for s in sources))
    for source in sized:
        joint = source.adapt(joint)
    runs = measure(joint, design, scenes, sized, habit, rng)
    return Question(HiddenCase((), design=name), joint, scenes, sized, habit, runs)


Posed = tuple[Question, Any, str | None]


def outside(case: Case) -> Posed:
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    hidden = replace(structure(case.kind, rng), size=case.scale * habit.sigma)
    question = _question(case, joint, habit, (hidden,), rng)
    return question, SHAPES[case.kind][1], None


def bound_to_time(case: Case) -> Posed:
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    size = float(rng.choice(TIMEBOUND)) * habit.sigma
    hidden = replace(timebound(case.kind, rng), size=case.scale * size)
    question = _question(case, joint, habit, (hidden,), rng)
    return question, FORMS[case.kind][1], None


def episodes(case: Case) -> Posed:
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    size = float(rng.choice(TIMEBOUND)) * habit.sigma
    hidden = replace(episode(case.kind, rng), size=case.scale * size)
    question = _question(case, joint, habit, (hidden,), rng)
    return question, EPISODES[case.kind][1], None


def bursts(case: Case) -> Posed:
    """Glitches of a few readings in a row, and nothing else."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    question = _question(case, joint, habit, (), rng)
    length, size = case.kind.split(" of ")
    runs, rows = with_bursts(question.runs, int(length), float(size) * habit.sigma, rng)
    return replace(question, runs=runs), rows, None


def tables(case: Case) -> Posed:
    """Equal steps of a direct drive of which nothing is believed."""
    rng = case.rng()
    positions, runs = map(int, case.kind.split(" x "))
    habit = Habit(sigma=TABLE_SIGMA)
    joint = Joint(1.0, (), 0.0)
    text = '[joint]\ngear_ratio = 1.0\nfixed_member = "none"\nencoder_side = "output"\n'
    question = Question(HiddenCase(()), joint, (), (), habit, table(positions, runs, rng))
    return question, [order for order, _ in LINES], text


def turning(case: Case) -> Posed:
    """Play, or nothing, in runs there and back under correlated noise."""
    rng = case.rng()
    joint, habit = random_joint(rng), Habit(sigma=SIGMA)
    play, rho, *bend = case.kind.split()
    acceleration = float(rng.uniform(60.0, 200.0)) if bend else np.inf
    runs = there_and_back(joint, float(rho), float(play), rng, acceleration)
    names = frozenset({"backlash"} if float(play) else ())
    return Question(HiddenCase(()), joint, (), (), habit, runs), names, None


def drifting(case: Case) -> Posed:
    """A zero that drifts on a free path, of one to four times the noise at the end of a run."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    hidden = Wander(kind=case.kind, seed=int(rng.integers(2**31)))
    size = float(rng.uniform(1.0, 4.0)) * habit.sigma * case.scale
    return _question(case, joint, habit, (replace(hidden, size=size),), rng), None, None


def nothing(case: Case) -> Posed:
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    if case.kind.startswith("bits"):
        step = 1_296_000.0 / 2 ** int(case.kind.split()[1]) / joint.gear_ratio
        habit = replace(habit, resolution=step)
    elif case.kind in ("normal", "heavy"):
        habit = replace(habit, noise=case.kind)
    else:
        habit = replace(habit, sigma=1e-9)
    question = _question(case, joint, habit, (), rng)
    if habit.sigma == 1e-9:
        sigma = float(rng.uniform(1.0, 2.0))
        runs = [_noisy(run, case.kind, sigma, rng) for run in question.runs]
        question = replace(question, runs=runs, habit=replace(habit, sigma=sigma))
    return question, None, None


def _noisy(
    run: CalibrationRun, kind: str, sigma: float, rng: np.random.Generator
) -> CalibrationRun:
    """A run with noise of another kind added."""
    n = len(run)
    if kind == "uniform":
        noise = rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), n)
    elif kind == "wander":
        assert run.time is not None
        u = (run.time - run.time[0]) / (run.time[-1] - run.time[0])
        k = np.arange(1, 31)
        waves = np.cos(np.pi * np.outer(u, k) + rng.uniform(0.0, 6.28, 30)) / np.sqrt(k)
        noise = rng.normal(size=n) + waves @ rng.normal(size=30)
    else:
        rho = float(kind.split()[1])
        noise = rng.normal(size=n)
        for i in range(1, n):
            noise[i] = rho * noise[i - 1] + np.sqrt(1.0 - rho**2) * noise[i]
    return replace(run, indicated=run.indicated + sigma * ARCSEC * noise)


def belief(case: Case) -> Posed:
    """The simulation believes something that the joint does otherwise."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    k = int(rng.integers(len(joint.lines)))
    line, believed, sources, extra = joint.lines[k], joint, (), ""
    if case.kind == "absent line":
        believed = replace(joint, lines=(*joint.lines, Line("output", 7, 6.0, 40.0)))
        line = believed.lines[-1]
    elif case.kind in ("twice", "half", "phase", "sign"):
        wrong = {
            "twice": replace(line, amplitude=2.0 * line.amplitude),
            "half": replace(line, amplitude=0.5 * line.amplitude),
            "phase": replace(line, phase=line.phase + float(rng.uniform(50.0, 120.0))),
            "sign": replace(line, phase=line.phase + 180.0),
        }[case.kind]
        believed = replace(joint, lines=tuple(wrong if x is line else x for x in joint.lines))
    elif case.kind == "gear ratio":
        believed = replace(joint, gear_ratio=joint.gear_ratio + float(rng.choice([-0.5, 0.5, 1.0])))
    else:
        width = 3.0
        extra = f'\n[[effect]]\nkind = "backlash"\nhalf_width_arcsec = {2.0 * width}\n'
        if case.kind == "backlash twice":
            sources = (replace(Backlash(), size=width),)
    question = _question(case, joint, habit, sources, rng)
    return question, line, believed.simulation(habit.sigma) + extra


def several(case: Case) -> Posed:
    """A large effect and one or two of a fifth of its size."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    causes = case.kind.split("+")
    rich = DESIGNS["rich"].scenes(rng)
    drawn = []
    for k, cause in enumerate(causes):
        source = draw(cause, 1.0, joint, rich, rng)
        rms = 4.0 * case.scale * CAUSES[cause][1] * (1.0 if k == 0 else 0.2)
        drawn.append(replace(source, size=rms))
    return _question(case, joint, habit, tuple(drawn), rng), frozenset(causes), None


def high(case: Case) -> Posed:
    """One effect of eight sigma."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    source = draw(case.kind, 1.0, joint, DESIGNS["rich"].scenes(rng), rng)
    hidden = replace(source, size=SIGMAS * habit.sigma)
    return _question(case, joint, habit, (hidden,), rng), frozenset({case.kind}), None


def inexact(case: Case) -> Posed:
    """One effect whose form is off by a few percent, with a parameter that is known."""
    rng = case.rng()
    joint, habit = random_joint(rng), random_habit(rng)
    hidden = replace(draw_inexact(case.kind, rng), size=INEXACT[case.kind] * habit.sigma)
    return _question(case, joint, habit, (hidden,), rng), frozenset({hidden.cause}), None


POSERS: dict[str, Callable[[Case], Posed]] = {
    "outside": outside,
    "timebound": bound_to_time,
    "episodes": episodes,
    "bursts": bursts,
    "tables": tables,
    "turning": turning,
    "drifting": drifting,
    "nothing": nothing,
    "belief": belief,
    "several": several,
    "high": high,
    "inexact": inexact,
}


def _outside_right(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    """The right broader name or `unexplained`, and no false confirmed name."""
    return set(confirmed) <= names and (bool(set(confirmed) & names) or unexplained)


def _nothing_right(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    allowed = {"quantisation"} if case.kind.startswith("bits") else set()
    if case.kind == "wander":  # drift, or unexplained, and nothing else
        return set(confirmed) <= {"drift_within_run"}
    return set(confirmed) <= allowed and not unexplained


def _rows_named(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, rows: Any
) -> bool:
    """Outliers and nothing else, at least 19 of 20 of their rows and hardly any other."""
    if confirmed != ("outliers",) or unexplained:
        return False
    found = report["findings"][0]["parameters"]["rows"]["value"]
    told = {(str(label), int(row)) for label, row in found}
    return len(rows - told) <= 0.05 * len(rows) and len(told - rows) <= 1 + 0.05 * len(rows)


def _low_orders(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, orders: Any
) -> bool:
    found = [f["parameters"].get("order", {}).get("value") for f in report["findings"]]
    return set(confirmed) == {"missing_order"} and sorted(found) == orders and not unexplained


def _named_or_nothing(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    """What is there, or nothing at all; nothing where nothing is."""
    return set(confirmed) <= set(names) and not (unexplained and not names)


def _no_false_companion(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    """A free path brings no companions, and is no cause but where it looks smooth."""
    return set(confirmed) <= {"drift_within_run"}


def _belief_right(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, line: Any
) -> bool:
    wanted = BELIEFS[case.kind]
    if wanted == "wrong_gear_ratio":
        return "wrong_gear_ratio" in confirmed and "missing_order" not in confirmed
    judged = {b["what"]: b["verdict"] for b in report.get("beliefs", [])}
    wrong = {what: verdict for what, verdict in judged.items() if verdict != "confirmed"}
    return list(wrong.values()) == [wanted] and not confirmed


def _all_and_only(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    return set(confirmed) == set(names)


def _no_companion(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    """The cause, and nothing else confirmed; of a free path in time, nothing."""
    if unexplained and set(names) == {"drift_within_run"}:
        return not confirmed
    return set(confirmed) == set(names)


def _named(
    case: Case, report: Any, confirmed: tuple[str, ...], unexplained: bool, names: Any
) -> bool:
    """The cause is named first; its parameters are judged apart."""
    return bool(report["findings"]) and report["findings"][0]["cause"] in names


JUDGES = {
    "outside": _outside_right,
    "timebound": _outside_right,
    "episodes": _outside_right,
    "bursts": _rows_named,
    "tables": _low_orders,
    "turning": _named_or_nothing,
    "drifting": _no_false_companion,
    "nothing": _nothing_right,
    "belief": _belief_right,
    "several": _all_and_only,
    "high": _no_companion,
    "inexact": _named,
}


def cases(group: str, seeds: range, scale: float = 1.0) -> list[Case]:
    """All questions of a group."""
    kinds = {
        "outside": [*SHAPES],
        "timebound": [*FORMS],
        "episodes": [*EPISODES],
        "bursts": [f"{length} of {size:g}" for length, size in BURSTS],
        "tables": [f"{positions} x {runs}" for positions, runs in TABLES],
        "turning": [f"{play} {rho}" for play in (2, 0) for rho in CORRELATIONS],
        "drifting": [*DRIFTS],
        "nothing": [*NOISES, *(f"bits {b}" for b in BITS)],
        "belief": [*BELIEFS],
        "several": ["+".join(s) for s in SEVERAL],
        "high": [*HIGH],
        "inexact": [*INEXACT],
    }[group]
    return [Case(group, kind, scale, seed) for kind in kinds for seed in seeds]
