"""Form errors: what a cause explains beyond the errors in the forms of larger ones."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..support.arrays import Array

#: Share of a cause's energy that its form may leave: one known to 3 %.
FORM = 1e-3

#: Sizes of form errors tried, in units of those expected; deviance from which on they show.
SIZES = np.geomspace(0.03, 10.0, 26).tolist()
SHOWN = 6.0

#: Share of the strongest combination of form errors from which on another one counts.
DISTINCT = 1e-6

#: Share of the noise below which what a form leaves does not matter.
SLIGHT = 0.01


def form_error_columns(regression: Regression, exempt: Collection[str] = ()) -> Array:
    """Form errors of the causes found as columns, each with its expected size.

    None of the causes ``exempt``: a further element of a cause is not explained by its form error.
    """
    causes: dict[str, list[tuple[Extension, Array]]] = {}
    for term, coefficients in regression.fitted():
        if coefficients.size and term.cause not in exempt:
            causes.setdefault(term.cause, []).append((term, coefficients))
    columns = [np.zeros((regression.n, 0))]
    for cause, terms in causes.items():
        size = float(np.std(sum(t.columns @ c for t, c in terms)))
        found = EFFECTS[cause].bends(regression.signals, terms)
        spread = np.std(found, axis=0)
        kept = spread > 1e-9 * size
        if np.sqrt(FORM) * size > SLIGHT * np.sqrt(regression.variance):
            columns.append(found[:, kept] * (np.sqrt(FORM) * size / spread[kept]))
    return np.hstack(columns)


def beside_form_errors(regression: Regression, exempt: Collection[str] = ()) -> Regression:
    """The regression with `form_error_columns` fitted too, for scores; itself without any."""

    def build() -> Regression | None:
        columns = form_error_columns(regression, exempt)
        return regression.jointly_with(columns, 1.0) if columns.shape[1] else None

    present = {term.cause for term in regression.terms}
    made = regression.cache.of_fit(("bends", *sorted(present & set(exempt))), build)
    return regression if made is None else made


def told_from_form_errors(regression: Regression, extension: Extension) -> Extension:
    """The extension with the evidence that it has beyond form errors of the other causes."""
    beside = beside_form_errors(regression, {extension.cause})
    if beside is regression:
        return extension
    share = share_beside_form_errors(regression, beside, [extension])
    return replace(extension, deviance=extension.deviance * share)


def share_beside_form_errors(
    regression: Regression, beside: Regression, extensions: Sequence[Extension]
) -> float:
    """Share of the joint deviance of ``extensions`` that remains beyond the form errors."""
    saved = []
    effects = [e.run_effect.columns for e in extensions if e.run_effect is not None]
    for each in (regression, beside):
        if effects:
            saved.append(each.propose_run_effect("", {}, effects[0]).deviance)
        else:
            saved.append(each.gain(np.hstack([e.columns for e in extensions]))[0])
    return min(saved[1] / saved[0], 1.0) if saved[0] > 0.0 else 1.0


def with_form_errors(regression: Regression) -> Regression:
    """The regression with the errors that the forms make in its coefficients.

    Form errors B with coefficients ``ξ ~ N(0, κ²)`` shift what is fitted without
    them by ``X⁺ Bξ``. ``κ`` is the one that makes the residual most likely (0
    where it is hardly better than none), and ``ξ`` has its mean and covariance given
    the residual.
    """
    bends = form_error_columns(regression)
    count = bends.shape[1]
    if not count:
        return regression
    columns = regression.whiten(bends)
    known = regression.q.T @ columns
    rest = columns - regression.q @ known
    _, s, vt = np.linalg.svd(rest, full_matrices=False)
    kept = s > DISTINCT * s[0]
    s, vt = s[kept], vt[kept]
    moment = vt @ (rest.T @ regression.r) / s
    variance = regression.variance

    def deviance(kappa: float) -> float:
        wider = 1.0 + (kappa * s) ** 2 / variance
        return float(np.sum(moment**2 / variance * (1.0 - 1.0 / wider) - np.log(wider)))

    kappa = max(SIZES, key=deviance)
    if deviance(kappa) < SHOWN:
        return regression
    wider = variance + (kappa * s) ** 2
    mean = vt.T @ (kappa**2 * s * moment / wider)
    # The mean, what the residual determines of the form errors, and what it does not: as roots,
    # since their products are no variances below zero.
    told = vt.T * (kappa * np.sqrt(variance / wider))
    untold = kappa * (np.eye(count) - vt.T @ vt)
    roots = regression.back @ known @ np.column_stack([mean, told, untold])
    return replace(regression, form_errors=np.asarray(roots @ roots.T))
