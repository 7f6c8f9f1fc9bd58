"""The lines and effects that a simulation claims, compared with the readings."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import fields, replace

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.missing_order import MissingOrder
from ..estimation.extension import Extension
from ..estimation.linear import wald_statistic
from ..estimation.regression import ROUNDING, Regression
from ..joint.pattern import Harmonic, JointPattern
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.arrays import Array
from ..support.distributions import normal_tail
from .beliefs import LEVEL, Belief, is_changed, judge_line, verdict_of_factor
from .finding import Finding
from .gain import measure_belief_gains
from .identifiability import ambiguity_of_cause, open_origins, with_open_origins
from .penalty import NEW_CAUSE
from .unseenorders import with_unseen_orders

#: Fields of effects, in addition to those in arcsec, that their signal is proportional to.
LINEAR = ("delay_s", "relative_error", "pattern_per_K", "coefficient")

#: Departure of a scaled effect's signal from the scaled signal, of its largest value.
PROPORTIONAL = 1e-3

#: A factor nearer to nothing than this drops the effect.
NOTHING = 0.05

#: Share of its amplitude by which a line at another order may differ from the assumed one.
AS_LARGE = 0.15


def _scaled_effect(
    effect: Effect, factor: float, signals: Signals, around: JointPattern
) -> Effect | None:
    """The effect ``factor`` times as strong; None where its signal is not proportional."""
    changes: dict[str, object] = {}
    for entry in fields(effect):  # type: ignore[arg-type]
        value = getattr(effect, entry.name)
        if isinstance(value, float) and ("arcsec" in entry.name or entry.name in LINEAR):
            changes[entry.name] = factor * value
        elif "arcsec" in entry.name and isinstance(value, tuple):
            changes[entry.name] = tuple(factor * size for size in value)
        elif isinstance(value, tuple) and value and isinstance(value[0], tuple):
            changes[entry.name] = tuple((m, factor * a, phase) for m, a, phase in value)
    other = replace(effect, **changes)  # type: ignore[type-var]
    before, after = effect.expected(signals, around), other.expected(signals, around)
    limit = PROPORTIONAL * max(float(np.abs(before).max()), 1e-300)
    return other if float(np.abs(after - factor * before).max()) <= limit else None


def effects_as_measured(
    regression: Regression,
    believed: Simulation,
    sim: Simulation,
    spots: Sequence[Ambiguity] = (),
) -> Simulation | None:
    """The simulation with the strength of one refuted effect as measured; None where none is.

    A term of the same cause counts with it, and so does one that these runs cannot distinguish from
    it (``spots``): a correction of an assumed value is no further cause.
    """
    signals, around = regression.signals, sim.surroundings
    worst: tuple[float, Simulation] | None = None
    for k, effect in enumerate(believed.effects):
        if not effect.transfers:
            continue
        column = effect.expected(signals, around)
        alike = {effect.kind}.union(*(s.causes for s in spots if effect.kind in s.causes))
        kept_terms = [term for term in regression.terms if term.cause not in alike]
        rest = regression
        if len(kept_terms) < len(regression.terms):
            rest = regression.with_terms(kept_terms)
        found = _factor(rest, column)
        if found is None:
            continue
        factor, std = found
        z = abs(factor) / max(std, 1e-300)
        if 2.0 * normal_tail(z) > LEVEL or (worst is not None and z <= worst[0]):
            continue
        total = 1.0 + factor
        other = _scaled_effect(effect, total, signals, around)
        if other is None:
            continue
        kept = list(believed.effects)
        if abs(total) < max(NOTHING, 3.0 * std):
            other = _scaled_effect(effect, 0.0, signals, around) or other
        kept[k] = other
        worst = (z, replace(believed, effects=tuple(kept)))
    return None if worst is None else worst[1]


def _factor(regression: Regression, column: Array) -> tuple[float, float] | None:
    """Coefficient of a column fitted jointly with all else, and its standard error."""
    if not np.any(column) or float(np.abs(column).max()) < ROUNDING:
        return None
    x, excited = regression.projected(column[:, None])
    if not excited.all():
        return None
    power = float(x[:, 0] @ x[:, 0])
    return float(x[:, 0] @ regression.r) / power, float(np.sqrt(regression.variance / power))


def judged_beliefs(
    regression: Regression,
    sim: Simulation,
    believed: Simulation,
    spots: list[Ambiguity],
    with_gain: bool,
    moved: Set[float] = frozenset(),
) -> tuple[list[Belief], Simulation]:
    """Verdicts on every line and effect, and the simulation with refuted ones as measured.

    Lines that something else acts on (``moved``), or that may hide behind another cause in
    these runs, are not judged; the latter become entries of what is not identifiable.
    """
    lines, harmonics = _lines(with_unseen_orders(regression), sim, spots, with_gain, moved)
    effects: list[Belief] = []
    refuted: list[tuple[int, tuple[Array, Array]]] = []
    for old, new in zip(sim.effects, believed.effects, strict=True):
        belief = _effect(regression, sim, old, new)
        if belief is not None:
            if belief.verdict != "confirmed":
                errors = [e.expected(regression.signals, sim.surroundings) for e in (old, new)]
                refuted.append((len(effects), (errors[0], errors[1])))
            effects.append(belief)
    if with_gain and refuted:
        gains = measure_belief_gains(regression, [], [change for _, change in refuted])
        for (k, _), gain in zip(refuted, gains, strict=True):
            effects[k] = replace(effects[k], gain=gain)
    kept = tuple(
        new
        for new in believed.effects
        if not new.transfers
        or np.any(new.expected(regression.signals, sim.surroundings))
        or new in sim.effects
    )
    return [*lines, *effects], replace(sim, harmonics=harmonics, effects=kept)


def _effect(regression: Regression, sim: Simulation, old: Effect, new: Effect) -> Belief | None:
    if not old.transfers:
        return None
    signals, around = regression.signals, sim.surroundings
    column = old.expected(signals, around)
    found = _factor(regression, column)
    if found is None:
        return None
    change, std = found
    power = float(column @ column)
    told = float(new.expected(signals, around) @ column) / power
    factor = told + change
    size = float(np.sqrt(power / column.size))
    return Belief(
        old.kind,
        verdict_of_factor(factor, std),
        {"factor": 1.0, "rms_arcsec": size},
        {"factor": factor, "rms_arcsec": abs(factor) * size},
        {"factor": std, "rms_arcsec": std * size},
    )


def changed_lines(regression: Regression) -> dict[float, slice]:
    """Orders whose lines are not as they are believed, each with its columns of the base."""
    wider, found = with_unseen_orders(regression), {}
    for k, order in enumerate(regression.belief.pattern.orders.tolist()):
        where = slice(1 + 2 * k, 3 + 2 * k)
        spread = wider.robust(np.arange(where.start, where.stop))
        if is_changed(wider.coefficients[where], spread):
            found[order] = where
    return found


def _lines(
    regression: Regression,
    sim: Simulation,
    spots: list[Ambiguity],
    with_gain: bool,
    moved: Set[float],
) -> tuple[list[Belief], tuple[Harmonic, ...]]:
    pattern, joint = regression.belief.pattern, regression.belief.joint
    if pattern.orders.size == 0 or any(EFFECTS[t.cause].changes_lines for t in regression.terms):
        return [], sim.harmonics
    acted_on = {term.shape["carrier"] for term in regression.terms if "carrier" in term.shape}
    found: list[Belief] = []
    refuted: list[tuple[int, slice]] = []
    harmonics = list(sim.harmonics)
    for k, order in enumerate(pattern.orders):
        if order in acted_on | moved:
            continue  # modulation takes from its carrier what it gives to the sidebands
        where = slice(1 + 2 * k, 3 + 2 * k)
        shaft, number = joint.name_order(float(order)) or ("output", float(order))
        believed = pattern.cosine[k], pattern.sine[k]
        change = regression.coefficients[where]
        spread = regression.robust(np.arange(where.start, where.stop))
        belief = judge_line(f"{shaft} order {number:g}", believed, change, spread)
        if belief.verdict != "confirmed":
            doubt = _doubt(regression, float(order), change, spread, spots)
            if doubt:
                continue
            refuted.append((len(found), where))
            harmonics = _corrected(harmonics, sim, float(order), shaft, number, belief)
        found.append(belief)
    if with_gain and refuted:
        gains = measure_belief_gains(regression, [where for _, where in refuted])
        for (k, _), gain in zip(refuted, gains, strict=True):
            found[k] = replace(found[k], gain=gain)
    return found, tuple(harmonics)


def _doubt(
    regression: Regression, order: float, change: Array, spread: Array, spots: list[Ambiguity]
) -> bool:
    """Whether a line may be another one behind the positions.

    That, or what else may have changed it, is then reported among ``spots``.
    """
    log_grid = float(np.log(regression.belief.pattern.orders.size))
    extension = Extension(
        MissingOrder.kind, {"output_order": order}, np.zeros((regression.n, 0)), 2, log_grid
    )
    doubt = ambiguity_of_cause(extension, regression, spots)
    origins = open_origins(extension, regression, spots) if doubt is None else [doubt]
    if not origins:
        return False
    deviance = wald_statistic(change, spread)
    evidence = deviance - 2.0 * regression.log_n - 2.0 * log_grid
    if evidence > NEW_CAUSE:
        spots[:] = with_open_origins(spots, origins, evidence)
    return doubt is not None


def _corrected(
    harmonics: Sequence[Harmonic],
    sim: Simulation,
    order: float,
    shaft: str,
    number: float,
    belief: Belief,
) -> list[Harmonic]:
    """The lines with the measured one in place of those of its order."""
    kept = [
        line
        for line in harmonics
        if abs(sim.joint.output_order(line.shaft, line.order) - order) > 1e-9 * order
    ]
    if belief.verdict == "absent":
        return kept
    measured = belief.measured
    return [*kept, Harmonic(shaft, number, measured["amplitude_arcsec"], measured["phase_deg"])]


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
