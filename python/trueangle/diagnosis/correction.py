"""From a diagnosis to the correction: effects as terms, and the model fitted around them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects import EFFECTS, KINDS, Effect
from ..errors import ArgumentError
from ..joint.signals import join_runs
from ..model.model import HarmonicModel
from ..model.term import Term
from ..runs.run import CalibrationRun, as_runs
from ..simulation.simulation import EFFECT
from ..support.angles import unwrapped
from ..support.argumentkinds import of_type
from ..support.signals import coupled_joint

if TYPE_CHECKING:
    from ..fitting.argument import AnyArgument
    from ..simulation.simulation import Simulation

#: Causes that no corrector can subtract while the joint runs, and why.
NOT_AT_RUN_TIME: dict[str, str] = {
    kind: effect.not_at_run_time for kind, effect in EFFECTS.items() if effect.not_at_run_time
}

#: Rounds of fitting harmonics around terms that are built from them (pattern, filter).
_ROUNDS = 3


def terms_from_effects(
    effects: Iterable[Effect | Mapping[str, Any]],
    period: float,
    shafts: Mapping[str, float] | None = None,
) -> tuple[Term, ...]:
    """Terms of the effects that have one, in units of ``period``.

    Parameters
    ----------
    effects : iterable of Effect or of their tables
        Of a simulation or of findings (``Finding.effects``), in arcsec and degrees; those
        without a term (lines, and the causes of `NOT_AT_RUN_TIME`) are passed over.
    period : float
    shafts : mapping of str to float, optional
        Cycles per output turn of the shafts that effects name (``Joint.shafts``).

    Raises
    ------
    ArgumentError
        An effect of a shaft that is not among them, or one that no form can carry.

    Examples
    --------
    >>> terms_from_effects([{"kind": "backlash", "half_width_arcsec": 36.0}], 360.0)
    (Backlash(half_width=0.01),)
    """
    cycles = {"output": 1.0, **(shafts or {})}
    terms: list[Term] = []
    for i, effect in enumerate(effects):
        if isinstance(effect, Mapping):
            table = dict(effect)
            effect = KINDS[table.pop("kind")].from_table(table)
        of_type(f"effects[{i}]", effect, Effect, EFFECT)
        terms += effect.to_terms(period, cycles)
    return tuple(terms)


def without_terms(
    runs: CalibrationRun | Iterable[CalibrationRun], model: HarmonicModel
) -> list[CalibrationRun]:
    """The runs as a joint without the model's terms would have given them.

    With ``φ = θ - vτ`` the reference becomes ``φ`` and the
    indicated angle loses the terms' error there: the harmonics are fitted to the residual.

    Raises
    ------
    MissingSignalError
        A run lacks a signal that a term needs.
    """
    plain = model.replace(terms=())
    delay = sum(getattr(term, "delay_s", 0.0) for term in model.terms)
    cleaned = []
    for run in as_runs(runs):
        if run.period != model.period:
            raise ArgumentError(
                f"the model's period is {model.period:g}, that of the runs {run.period:g}"
            )
        theta = run.unwrapped_reference
        velocity = run.speed
        late = 0.0 if velocity is None else velocity * delay
        seen = theta - late
        error = model.error(
            theta,
            direction=join_runs([run]).direction,
            velocity=velocity,
            temperature=run.temperature,
            torque=run.torque,
            current=run.signal("current"),
            **_coupled(run),
        )
        terms = error + late - plain.error(seen)
        cleaned.append(replace(run, reference=seen, indicated=run.indicated - terms))
    return cleaned


def _coupled(run: CalibrationRun) -> dict[str, Any]:
    """Angles of other joints as signals of a correction, unwrapped."""
    return {
        name: unwrapped(values, run.period)
        for name, values in run.signals.items()
        if coupled_joint(name)
    }


def extend_model(
    model: HarmonicModel | None,
    runs: CalibrationRun | Iterable[CalibrationRun],
    simulation: Simulation,
    argument: AnyArgument = "auto",
) -> HarmonicModel:
    """The correction model extended by the effects of a simulation, fitted to the runs.

    Effects become terms with the simulation's parameters; lines that the model lacks
    become orders; the harmonics are fitted again to what the terms leave, so that nothing
    is subtracted twice.

    Parameters
    ----------
    model : HarmonicModel or None
        Its orders and argument are kept; terms it has are replaced. Without one the orders are
        the simulation's own lines and those of its effects.
    runs : CalibrationRun or iterable of them
        In the unit of the model.
    simulation : Simulation
        As `trueangle.diagnose` extended it.
    argument : {"auto", "reference", "indicated"}
        As of `trueangle.fit`; ``"auto"`` is that of the model, where there is one.

    Raises
    ------
    MissingSignalError
        A run lacks a signal that a term needs.
    NotInvertibleError
        The error is too steep for a model of the true angle.
    """
    from ..fitting.fit import fit  # slow to import, and few diagnoses need a model

    found = as_runs(runs)
    if argument == "auto":
        argument = _argument(model, simulation)
    start = model
    if start is None:
        start = HarmonicModel((), period=found[0].period)
        beside = tuple((line.shaft, line.order) for line in simulation.harmonics)
    else:
        beside = ()
    if argument == "indicated":
        start = start.replace(argument=argument)
    cycles, orders = _shafts(start, simulation, beside)
    travel = [360.0 / run.period * run.unwrapped_reference for run in found]
    span = min(float(x.min()) for x in travel), max(float(x.max()) for x in travel)
    effects = [effect.over(*span) for effect in simulation.effects]
    terms = terms_from_effects(effects, start.period, simulation.joint.shafts)
    extended = start.replace(terms=terms)
    for _ in range(_ROUNDS):
        fitted = fit(
            without_terms(found, extended),
            orders,
            shafts=cycles,
            argument=argument,
        ).model
        record = None if fitted.fit is None else replace(fitted.fit, signals=_ranges(found))
        extended = fitted.replace(terms=extended.terms, fit=record)
        if not any(term.is_built_on_harmonics for term in extended.terms):
            break
    return extended


def _ranges(runs: Sequence[CalibrationRun]) -> tuple[tuple[str, float, float], ...]:
    """Each signal of the runs with its lowest and highest value."""
    ranges = []
    others = dict.fromkeys(name for run in runs for name in run.signals if coupled_joint(name))
    for name in ("velocity", "temperature", "torque", "current", *others):
        columns = [run.speed if name == "velocity" else run.signal(name) for run in runs]
        values = [column[np.isfinite(column)] for column in columns if column is not None]
        if any(column.size for column in values):
            everything = np.concatenate(values)
            ranges.append((name, float(everything.min()), float(everything.max())))
    return tuple(ranges)


def _argument(model: HarmonicModel | None, simulation: Simulation) -> AnyArgument:
    """The pattern's argument: an effect may state that it is the indicated angle."""
    if any(effect.changes_argument for effect in simulation.effects):
        return "indicated"
    return "auto" if model is None else model.argument


def _shafts(
    model: HarmonicModel, simulation: Simulation, lines: Iterable[tuple[str, float]]
) -> tuple[dict[str, float], dict[str, set[int]]]:
    """Cycles and orders of the model's shafts, of ``lines`` and of those found.

    A line that is not a whole order of its shaft gets its own shaft.
    """
    cycles = {shaft.name: shaft.cycles_per_turn for shaft in model.shafts}
    orders = {shaft.name: set(shaft.orders) for shaft in model.shafts}
    joint = simulation.joint
    known = np.array(model.orders)
    found = (line for effect in simulation.effects for line in effect.to_lines())
    for shaft, order in (*lines, *found):
        at = joint.output_order(shaft, order)
        if np.isclose(known, at, rtol=1e-9).any():
            continue
        known = np.append(known, at)
        name, turns, k = (
            (shaft, joint.shafts[shaft], int(order))
            if order == int(order)
            else (f"order {at:g}", at, 1)
        )
        cycles.setdefault(name, turns)
        orders.setdefault(name, set()).add(k)
    return cycles, orders
