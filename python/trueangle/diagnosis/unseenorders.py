"""Low orders of the output that were not found: over an arc they are nearly those that were."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..effects.local_defect import WHOLE_TURN
from ..effects.missing_order import MissingOrder
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
    Coefficients have the mixture over models of low orders (`_Arc`), about those of the fit.
    """
    if not _low_terms(regression):
        return regression
    arc, count = _Arc.of(regression), len(regression.coefficients)
    beyond: Array = regression.cache.of_fit("unseen orders", arc.spread)[:count, :count]
    before = 0.0 if regression.form_errors is None else regression.form_errors
    return replace(regression, form_errors=before + beyond)


def with_likeliest_orders(regression: Regression) -> Regression:
    """Over an arc: with the most probable low orders, or a ramp, in the place of those it has.

    Steps that add or remove one at a time stop at others that are nearly the same.
    """
    low = _low_terms(regression)
    if not low:
        return regression
    rest = regression.with_terms(t for k, t in enumerate(regression.terms) if k not in low)
    grid = max(regression.terms[k].log_grid for k in low)
    arc = _Arc.of(regression)
    models = arc.models()
    found = [
        ScaleError.propose(rest) if order is None else MissingOrder.at(rest, order, grid)
        for order in (arc.names[k] for k in max(models, key=lambda model: models[model][0]))
    ]
    return regression.with_terms([*rest.terms, *filter(None, found)])


class _Arc(NamedTuple):
    """Models S of low orders and a ramp over an arc, beside all other columns of an account.

    ::

        ln p(S) = 1/2 m_S' C_S m_S + 1/2 ln|C_S P_S|,    C_S = (G_SS + P_S)⁻¹

    with G and m of the whitened columns in units of the noise, and P the information that they are
    as large as what was found. Before any reading each is as likely as not: over an arc a smooth
    error has no reason to be the fewest orders.
    """

    names: list[float | None]  #: Orders, and None for the ramp.
    columns: list[NDArray[np.int64]]  #: Of each of them, among all.
    account: frozenset[int]  #: Those that the account has.
    gram: Array
    moment: Array
    prior: Array  #: P of every column, 0 of those that are free.
    fitted: Array  #: Coefficients of the account.

    @classmethod
    def of(cls, regression: Regression) -> Self:
        """Those found, all others up to the highest and one more, and a ramp; none believed."""
        theta, low = regression.signals.theta, _low_terms(regression)
        names = [regression.terms[k].line for k in low]
        last = int(max(order for order in names if order is not None)) + 1
        names += np.setdiff1d(np.arange(1.0, last + 1.0), regression.around.pattern.orders).tolist()
        blocks = [lines_columns(theta, np.array([k])) for k in names[len(low) :]]
        if None not in names:
            names.append(None)
            blocks.append(theta[:, None])
        count = regression.design.shape[1]
        ends = count + np.cumsum([0, *(block.shape[1] for block in blocks)])
        columns = [regression.place(k) for k in low]
        columns += [np.arange(a, b) for a, b in itertools.pairwise(ends)]
        design = np.hstack([regression.design, *blocks])
        found = sum(t.columns @ c for t, c in (regression.fitted()[k] for k in low))
        prior = np.zeros(design.shape[1])
        for at in columns:
            # Of an amplitude, or of the rms of a ramp about its mean.
            prior[at] = (1.0 if at.size > 1 else np.var(design[:, at])) / np.var(found)
        fitted = np.append(regression.coefficients, np.zeros(design.shape[1] - count))
        white = regression.whiten(design)
        gram = white.T @ white / regression.variance
        moment = white.T @ regression.r / regression.variance + gram @ fitted
        return cls(names, columns, frozenset(range(len(low))), gram, moment, prior, fitted)

    def of_model(self, model: frozenset[int]) -> tuple[float, Array, Array]:
        """Ln of its probability up to a constant, mean and covariance of all coefficients."""
        at = np.concatenate([np.flatnonzero(self.prior == 0.0), *(self.columns[k] for k in model)])
        precision = self.gram[np.ix_(at, at)] + np.diag(self.prior[at])
        solved = NormalEquations(precision, self.moment[at], 0.0, 0).solved()
        mean, covariance = np.zeros(len(self.fitted)), np.zeros_like(self.gram)
        mean[at], covariance[np.ix_(at, at)] = solved.coefficients[:, 0], solved.inverse
        own = np.log(self.prior[at][self.prior[at] > 0.0]).sum() - solved.log_determinant
        return 0.5 * float(self.moment @ mean + own), mean, covariance

    def models(self) -> dict[frozenset[int], tuple[float, Array, Array]]:
        """`of_model` of the account and of all near the most probable, one change after another."""
        models: dict[frozenset[int], tuple[float, Array, Array]] = {}
        new = {self.account}
        while new and len(models) < MOST_MODELS:
            models |= {model: self.of_model(model) for model in new}
            least = max(found[0] for found in models.values()) - NEGLIGIBLE
            near = [model for model in new if models[model][0] > least]
            new = {model ^ {k} for model in near for k in range(len(self.columns))} - models.keys()
        return models

    def spread(self) -> Array:
        """Second moment of the account's coefficients about theirs, beyond their own variances."""
        models = self.models()
        odds, means, covariances = map(np.array, zip(*models.values(), strict=True))
        weights = np.exp(odds - np.logaddexp.reduce(odds))
        off = means - self.fitted
        wider = weights @ (covariances - models[self.account][2]).diagonal(axis1=1, axis2=2)
        return np.asarray((off.T * weights) @ off + np.diag(np.maximum(wider, 0.0)))


def arc_note(regression: Regression) -> str:
    """What the names of orders over an arc rest on; nothing over a whole turn."""
    if not _low_terms(regression):
        return ""
    turns = _turns(regression)
    return (
        f"{turns:.2g} turns are too few to separate a ramp from low orders: the "
        "fewest that explain the readings are named, and their errors allow for the others"
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
