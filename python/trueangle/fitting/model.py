"""The model that a fit makes: its coefficients, its record, and what not to trust."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from .._core import __version__
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.records import FitRecord, Provenance
from ..support.angles import wrap
from .rounding import COUNTED

if TYPE_CHECKING:
    from .result import FitResult


def build_model(fit: FitResult) -> HarmonicModel:
    """The fitted series with its covariance, record and provenance."""
    problem, solution = fit.problem, fit.fitted.solution
    covariance, condition = fit.uncertainty.covariance, solution.condition_number
    sources = dict.fromkeys(run.source for run in problem.runs if run.source is not None)
    return HarmonicModel(
        shafts=tuple(
            Shaft(shaft.name, shaft.cycles_per_turn, shaft.orders, tuple(a), tuple(b))
            for shaft, a, b in zip(problem.shafts, solution.cosine, solution.sine, strict=True)
        ),
        constant=solution.constant,
        period=problem.period,
        argument=problem.argument,
        covariance=covariance if np.isfinite(covariance).all() else None,
        condition_number=condition if np.isfinite(condition) else None,
        fit=_record(fit),
        provenance=Provenance(tuple(sources), f"trueangle {__version__}"),
    )


def fit_notes(fit: FitResult) -> Iterable[str]:
    """What not to trust and why, one sentence each."""
    span, weighted = fit.span, fit.weighted
    if not span.full:
        yield f"Fitted on {span.describe(fit.problem.period)} only: outside it is extrapolated."
    if fit.missing:
        rows = "row" if fit.missing == 1 else "rows"
        yield f"{fit.missing} {rows} with an empty cell left out."
    yield from (_sentence(remark) for remark in fit.remarks)
    if fit.ridge > 0.0:
        where = "arc" if fit.problem.is_periodic else "travel"
        yield (
            f"On this {where} the orders nearly cancel: a ridge of {fit.ridge:.1e} keeps the "
            "amplitudes small; single coefficients have no meaning of their own. Standard errors "
            "and intervals hold what the ridge may have taken from the pattern, for patterns "
            "of the sizes that the readings show, on average over the travel."
        )
    if weighted.wild:
        yield f"{weighted.wild} outlier{'s' if weighted.wild > 1 else ''} set aside."
    if fit.uncertainty.note:
        yield _sentence(fit.uncertainty.note)
    fractional = [s.name for s in fit.problem.shafts if s.cycles_per_turn % 1.0]
    if fractional:
        yield (
            f"Shaft {', '.join(fractional)} does not turn a whole number of times per output "
            "turn: the error does not repeat after one turn, angles must be unwrapped."
        )
    if fit.evidence is not None and fit.evidence.notes:
        yield from map(_sentence, fit.evidence.notes)
    elif (verified := _verified(fit)) is not None:
        yield _sentence(verified[1])


def _sentence(note: str) -> str:
    return f"{note[:1].upper()}{note[1:]}."


def _record(fit: FitResult) -> FitRecord:
    problem, solution = fit.problem, fit.fitted.solution
    variance = solution.residual_variance
    used = fit.offsets[np.isfinite(fit.offsets)]
    around = wrap(used - solution.constant, problem.period)
    verified = _verified(fit)
    return FitRecord(
        samples=problem.readings,
        runs=len(problem.runs),
        span=(fit.span.start, fit.span.stop),
        residual=math.sqrt(variance) if math.isfinite(variance) else None,
        method=solution.method,
        loss=fit.loss,
        wild=fit.weighted.wild,
        ridge=fit.ridge,
        offsets=tuple(used.tolist()),
        offset_spread=float(around.std(ddof=1)) if used.size > 1 else 0.0,
        positions=None if verified is None else verified[0],
        note=" ".join(fit.notes),
    )


def _verified(fit: FitResult) -> tuple[int, str] | None:
    """Distinct positions and where the model is verified; None for free or many angles."""
    from .orders.verdicts import verified_positions

    runs = fit.problem.runs
    if fit.problem.readings > COUNTED:
        return None
    verified = verified_positions(runs, *fit.joint)
    return None if verified.between else (verified.count, verified.sentence)
