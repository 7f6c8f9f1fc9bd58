"""From a diagnosis to the correction: effects as terms, and the model fitted around them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..runs import CalibrationRun, as_runs
from . import TERMS, Term

if TYPE_CHECKING:
    from ..model import Argument, HarmonicModel
    from ..simulation.effects import Effect
    from ..simulation.simulation import Simulation

__all__ = ["NOT_AT_RUN_TIME", "extend_model", "terms_from_effects", "without_terms"]

#: Causes that no corrector can take off while the joint runs, and why.
NOT_AT_RUN_TIME: dict[str, str] = {
    "zero_slip": "the zero of a run is not known before the run is referenced: set it anew",
    "drift_within_run": "no signal shows the drift; log the temperature and look for its part",
    "non_integer_order": "its phase is new in every run",
    "scale_error": "the ratio that turns counts into angles is wrong: put it right there",
    "reference_error": "it is an error of the reference, not of the joint",
    "outliers": "a single reading does not tell a fault from a motion",
    "missed_counts": "a step is told from a motion only afterwards, in the log",
    "heteroscedastic_noise": "scatter has no value to subtract, only a weight",
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
        An effect of a shaft that is not among them.

    Examples
    --------
    >>> terms_from_effects([{"kind": "backlash", "half_width_arcsec": 36.0}], 360.0)
    (Backlash(half_width=0.01),)
    """
    cycles = {"output": 1.0, **(shafts or {})}
    terms = []
    for effect in effects:
        table = dict(effect if isinstance(effect, Mapping) else effect.to_table())
        if table["kind"] not in TERMS:
            continue
        shaft = table.get("shaft", "output")
        if shaft not in cycles:
            raise ArgumentError(f"{table['kind']}: how fast shaft {shaft!r} turns is not known")
        table["cycles_per_turn"] = cycles[shaft]
        terms.append(TERMS[table["kind"]].from_effect(table, period))
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
    from ..joint.signals import join_runs

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
    from ..fitting.fit import fit

    found = as_runs(runs)
    cycles, orders = _shafts(model, simulation)
    terms = terms_from_effects(simulation.effects, model.period, simulation.joint.shafts)
    extended = model.replace(terms=terms)
    for _ in range(_ROUNDS):
        fitted = fit(
            without_terms(found, extended),
            orders,
            shafts=cycles,
            argument=_argument(model, simulation),
        ).model
        extended = fitted.replace(terms=extended.terms)
        if not any(_is_built_on_harmonics(term) for term in extended.terms):
            break
    return extended


def _is_built_on_harmonics(term: Term) -> bool:
    return term.kind == "filter_lag" or bool(getattr(term, "pattern_per_K", 0.0))


def _argument(model: HarmonicModel, simulation: Simulation) -> Argument:
    """The pattern's argument: an ``argument_error`` of -1 says the indicated angle."""
    for effect in simulation.effects:
        if effect.kind == "argument_error" and effect.to_table().get("coefficient", -1.0):
            return "indicated"
    return model.argument


def _shafts(
    model: HarmonicModel, simulation: Simulation
) -> tuple[dict[str, float], dict[str, set[int]]]:
    """Cycles and orders of the model's shafts and of the lines found."""
    cycles = {shaft.name: shaft.cycles_per_turn for shaft in model.shafts}
    orders = {shaft.name: set(shaft.orders) for shaft in model.shafts}
    joint = simulation.joint.shafts
    known = np.array(model.orders)
    for shaft, order in _lines(simulation.effects):
        if shaft not in joint or order != int(order):
            continue
        if np.isclose(known, order * joint[shaft], rtol=1e-9).any():
            continue
        cycles.setdefault(shaft, joint[shaft])
        orders.setdefault(shaft, set()).add(int(order))
    return cycles, orders


def _lines(effects: Sequence[Effect]) -> Iterable[tuple[str, float]]:
    """(shaft, order) of the lines among the effects."""
    for effect in effects:
        table = effect.to_table()
        if table["kind"] == "missing_order":
            yield table["shaft"], table["order"]
        elif table["kind"] == "sidebands":
            for offset in table["offsets"]:
                yield "output", table["carrier"] + offset
