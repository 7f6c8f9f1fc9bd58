"""From a diagnosis to the correction: effects as terms, and the model fitted around them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..correction.term import Term
from ..effects import EFFECTS, Effect
from ..errors import ArgumentError
from ..fitting.fit import fit
from ..joint.signals import join_runs
from ..runs import CalibrationRun, as_runs

if TYPE_CHECKING:
    from ..model import Argument, HarmonicModel
    from ..simulation.simulation import Simulation

__all__ = ["NOT_AT_RUN_TIME", "extend_model", "terms_from_effects", "without_terms"]

#: Causes that no corrector can take off while the joint runs, and why.
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
    for effect in effects:
        if isinstance(effect, Mapping):
            table = dict(effect)
            effect = EFFECTS[table.pop("kind")].from_table(table)
        terms += effect.to_terms(period, cycles)
    return tuple(terms)


def without_terms(
    runs: CalibrationRun | Iterable[CalibrationRun], model: HarmonicModel
) -> list[CalibrationRun]:
    r"""The runs as a joint without the model's terms would have given them.

    With :math:`\varphi = \theta - v\tau` the reference becomes :math:`\varphi` and the
    indicated angle loses the terms' error there: what is left is for the harmonics.

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
        )
        terms = error + late - plain.error(seen)
        cleaned.append(replace(run, reference=seen, indicated=run.indicated - terms))
    return cleaned


def extend_model(
    model: HarmonicModel,
    runs: CalibrationRun | Iterable[CalibrationRun],
    simulation: Simulation,
) -> HarmonicModel:
    """The correction model extended by the effects of a simulation, fitted to the runs.

    Effects become terms with the simulation's parameters; lines that the model lacks
    become orders; the harmonics are fitted anew to what the terms leave, so that nothing
    is taken off twice.

    Parameters
    ----------
    model : HarmonicModel
        Its orders and argument are kept; terms it has are replaced.
    runs : CalibrationRun or iterable of them
        In the unit of the model.
    simulation : Simulation
        As `trueangle.diagnose` extended it.

    Raises
    ------
    MissingSignalError
        A run lacks a signal that a term needs.
    """
    found = as_runs(runs)
    cycles, orders = _shafts(model, simulation)
    travel = [360.0 / run.period * run.unwrapped_reference for run in found]
    span = min(float(x.min()) for x in travel), max(float(x.max()) for x in travel)
    effects = [effect.over(*span) for effect in simulation.effects]
    terms = terms_from_effects(effects, model.period, simulation.joint.shafts)
    extended = model.replace(terms=terms)
    for _ in range(_ROUNDS):
        fitted = fit(
            without_terms(found, extended),
            orders,
            shafts=cycles,
            argument=_argument(model, simulation),
        ).model
        extended = fitted.replace(terms=extended.terms)
        if not any(term.is_built_on_harmonics for term in extended.terms):
            break
    return extended


def _argument(model: HarmonicModel, simulation: Simulation) -> Argument:
    """The pattern's argument: an effect may say that it is the indicated angle."""
    if any(effect.changes_argument for effect in simulation.effects):
        return "indicated"
    return model.argument


def _shafts(
    model: HarmonicModel, simulation: Simulation
) -> tuple[dict[str, float], dict[str, set[int]]]:
    """Cycles and orders of the model's shafts and of the lines found.

    A line that is no whole order of its shaft gets a shaft of its own.
    """
    cycles = {shaft.name: shaft.cycles_per_turn for shaft in model.shafts}
    orders = {shaft.name: set(shaft.orders) for shaft in model.shafts}
    joint = simulation.joint
    known = np.array(model.orders)
    for shaft, order in (line for effect in simulation.effects for line in effect.to_lines()):
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
