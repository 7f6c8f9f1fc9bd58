"""Low orders of the output that were not found: over an arc they are nearly those that were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects.local_defect import WHOLE_TURN
from ..effects.scale_error import ScaleError
from ..estimation.linear import NormalEquations
from ..estimation.regression import Regression
from ..joint.pattern import lines_columns
from ..support.arrays import Array

#: Cycles over the travel up to which an order takes part of its neighbours'.
FEW_CYCLES = 5.0

#: ln of the odds below which a model is not gone on from, and models at most.
NEGLIGIBLE, MOST_MODELS = 12.0, 4000


def with_unseen_orders(regression: Regression) -> Regression:
    """The regression with what other low orders, or a ramp, may be over an arc.

    They are nearly collinear with those found, and may be in their place or beside them.
    Coefficients have the mixture over models of low orders, about those of the fit.
    """
    low = _low_terms(regression)
    if not low:
        return regression
    beyond: Array = regression.cache.of_fit("unseen orders", lambda: _beyond(regression, low))
    before = 0.0 if regression.form_errors is None else regression.form_errors
    return replace(regression, form_errors=before + beyond)


def _beyond(regression: Regression, low: Sequence[int]) -> Array:
    """Second moment of the account's coefficients about theirs, beyond their own variances.

    Over models S of the low orders found, all others up to the highest and one more, and a ramp,
    beside all other columns:

    ::

        ln p(S) = 1/2 m_S' C_S m_S + 1/2 ln|C_S P_S|,    C_S = (G_SS + P_S)⁻¹

    with G and m of the whitened columns in units of the noise, and P the information that they are
    as large as what was found. Before any reading each is as likely as not: over an arc a smooth
    error has no reason to be the fewest orders.
    """
    theta, design = regression.signals.theta, regression.design
    names = [regression.terms[k].line for k in low]
    up_to = np.arange(1.0, max(filter(None, names)) + 2.0)
    others = np.setdiff1d(up_to, regression.around.pattern.orders)
    blocks = [lines_columns(theta, np.array([k])) for k in others]
    blocks += [] if None in names else [theta[:, None]]
    places = [regression.place(k) for k in low]
    for block in blocks:
        places.append(np.arange(block.shape[1]) + design.shape[1])
        design = np.hstack([design, block])
    fitted, count = np.zeros(design.shape[1]), len(regression.coefficients)
    fitted[:count] = regression.coefficients
    found = sum(t.columns @ c for t, c in (regression.fitted()[k] for k in low))
    known = np.zeros(fitted.size)
    for at in places:
        # Of an amplitude, or of the rms of a ramp about its mean.
        known[at] = (1.0 if at.size > 1 else np.var(design[:, at])) / np.var(found)
    free = np.flatnonzero(known == 0.0)
    white = regression.whiten(design) / np.sqrt(regression.variance)
    left = regression.r / np.sqrt(regression.variance)
    sums = NormalEquations.of_rows(white, left + white @ fitted)

    def of_model(model: frozenset[int]) -> tuple[float, Array, Array]:
        """Ln of its probability up to a constant, means and variances of all coefficients."""
        at = np.concatenate([free, *(places[k] for k in model)])
        own, prior = sums.among(at), known[at]
        solved = NormalEquations(own.gram + np.diag(prior), own.moment).solved()
        mean, variance = np.zeros((2, fitted.size))
        mean[at], variance[at] = solved.coefficients[:, 0], solved.inverse.diagonal()
        log = own.moment @ mean[at] + np.log(prior[free.size :]).sum() - solved.log_determinant
        return 0.5 * float(log), mean, variance

    # The account's, and all near the most probable, one change after another.
    models: dict[frozenset[int], tuple[float, Array, Array]] = {}
    new = {frozenset(range(len(low)))}
    while new and len(models) < MOST_MODELS:
        models |= {model: of_model(model) for model in new}
        least = max(found[0] for found in models.values()) - NEGLIGIBLE
        near = [model for model in new if models[model][0] > least]
        new = {model ^ {k} for model in near for k in range(len(places))} - models.keys()
    odds, means, variances = map(np.array, zip(*models.values(), strict=True))
    weights = np.exp(odds - np.logaddexp.reduce(odds))
    off = (means - fitted)[:, :count]
    wider = weights @ variances[:, :count] - variances[0, :count]
    return np.asarray((off.T * weights) @ off + np.diag(np.maximum(wider, 0.0)))


def arc_note(regression: Regression) -> str:
    """What the names of orders over an arc rest on; nothing over a whole turn."""
    if not _low_terms(regression):
        return ""
    turns = _turns(regression)
    return (
        f"{turns:.2g} turns are too few to separate a ramp from low orders: the smallest set of "
        "orders that fits is given, and its +- includes this doubt"
    )


def _turns(regression: Regression) -> float:
    """Travel of all runs together."""
    return float(np.ptp(regression.signals.theta)) / (2.0 * np.pi)


def _low_terms(regression: Regression) -> list[int]:
    """Over an arc: terms that are whole orders of few cycles over it, and a ramp beside them."""
    turns = _turns(regression)
    if turns >= WHOLE_TURN:
        return []
    low = {
        k: term.line
        for k, term in enumerate(regression.terms)
        if term.cause == ScaleError.kind
        or (term.line is not None and term.line % 1.0 == 0.0 and term.line * turns <= FEW_CYCLES)
    }
    return [*low] if any(low.values()) else []
