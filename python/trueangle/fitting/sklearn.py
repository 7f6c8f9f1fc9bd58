"""A transformer of scikit-learn: indicated angles in, true angles out."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MissingExtraError, NoModelError, NotCorrectedWarning
from ..model.model import HarmonicModel
from ..runs.follows import check_follows
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from .fit import fit

try:
    from sklearn.base import BaseEstimator, OneToOneFeatureMixin, TransformerMixin
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError:
    raise MissingExtraError(
        "the transformer needs scikit-learn: pip install 'trueangle[sklearn]'"
    ) from None


class AngleCorrector(OneToOneFeatureMixin, TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Correct columns of indicated angles by models of their errors.

    ::

        θ = r - ε(θ),    ε(θ) = C₀ + Σ_k A_k cos kθ + B_k sin kθ

    Every column is one encoder's reading of the same true angle, which is ``y`` of `fit`. Rows may
    come in any order, as folds and shuffles leave them: nothing here follows time or direction.

    Parameters
    ----------
    orders : iterable of int or "auto"
        Of the output shaft; by default selected by evidence (`trueangle.fit`).
    period : float
        One turn in the unit of all angles: ``2*pi`` (default), 360 ...
    gear_ratio : float, optional
        Makes gear orders candidates.

    Attributes
    ----------
    models_ : list of HarmonicModel or None
        For each column; None where the readings support no order: such a column is left as it is.
    n_features_in_, feature_names_in_
        As scikit-learn has them.

    Raises
    ------
    MissingExtraError
        On import: scikit-learn is not installed.
    ArgumentError
        In `fit`: a column that does not follow ``y`` at all (another unit or sign); and whatever
        else `trueangle.fit` refuses.

    Warns
    -----
    UnitWarning
        In `fit`: angles whose error repeats with 360 and not with the period given.
    NotCorrectedWarning
        In `fit`: a column whose readings support no order, which `transform` leaves as it is.

    Notes
    -----
    ``set_output(transform="pandas")`` and the like, pipelines, clones and searches over parameters
    work as of any transformer; `score` is what a search or `cross_val_score` goes by. The checks
    of scikit-learn pass, but for those whose targets are no angle that the columns follow. The
    cost is that of `trueangle.fit` and `HarmonicModel.correct`.

    Examples
    --------
    >>> theta = np.linspace(0.0, 360.0, 200, endpoint=False)
    >>> read = theta + 0.5 * np.sin(np.radians(theta))
    >>> corrector = AngleCorrector(orders=[1], period=360.0).fit(read[:, None], theta)
    >>> float(np.abs(corrector.transform(read[:, None])[:, 0] - theta).max()) < 1e-9
    True
    """

    def __init__(
        self,
        orders: Iterable[int] | str = "auto",
        *,
        period: float = 2.0 * math.pi,
        gear_ratio: float | None = None,
    ) -> None:
        self.orders = orders
        self.period = period
        self.gear_ratio = gear_ratio

    def fit(self, X: ArrayLike, y: ArrayLike) -> AngleCorrector:
        """Fit a model to every column.

        Parameters
        ----------
        X : array_like, shape (n, encoders)
            Indicated angles.
        y : array_like, shape (n,)
            The true angle.
        """
        indicated, true = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        by_angle = np.argsort(np.mod(true, self.period), kind="stable")
        reference = np.mod(true[by_angle], self.period)
        orders = self.orders if isinstance(self.orders, str) else list(self.orders)
        ascending = np.argsort(true, kind="stable")
        self.models_: list[HarmonicModel | None] = []
        for j, column in enumerate(indicated.T):
            # Before it is taken within a turn, which may be that of another unit.
            check_follows(CalibrationRun(true[ascending], column[ascending], self.period))
            run = CalibrationRun(reference, column[by_angle], self.period)
            try:
                found = fit(run, orders, gear_ratio=self.gear_ratio, argument="reference")
            except NoModelError as error:
                self.models_.append(None)
                warnings.warn(
                    f"column {j} is left as it is: {error}", NotCorrectedWarning, stacklevel=2
                )
            else:
                self.models_.append(found.model)
        return self

    def transform(self, X: ArrayLike) -> NDArray[np.float64]:
        """Corrected angles, of the shape of ``X``."""
        check_is_fitted(self)
        indicated = validate_data(self, X, dtype=np.float64, reset=False)
        corrected: NDArray[np.float64] = indicated.copy()
        for j, model in enumerate(self.models_):
            if model is not None:
                corrected[:, j] = model.correct(indicated[:, j])
        return corrected

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Share of the squared errors that the correction removes, on average over the columns.

        ::

            1 - Σ_i (θ̂_i - θ_i - z)² / Σ_i (r_i - θ_i - z₀)²

        with a separate zero before and after: 1 is perfect, 0 gains nothing, less makes the
        errors worse. A column without any error scores 1 where it stays as it is.

        Parameters
        ----------
        X : array_like, shape (n, encoders)
            Indicated angles.
        y : array_like, shape (n,)
            The true angle.
        """
        check_is_fitted(self)
        indicated, true = validate_data(self, X, y, dtype=np.float64, y_numeric=True, reset=False)
        before = self._squares(indicated, true)
        after = self._squares(self.transform(X), true)
        free = before == 0.0
        gained = 1.0 - np.where(free, after, after / np.where(free, 1.0, before))
        return float(gained.mean())

    def _squares(self, angles: NDArray[np.float64], true: NDArray[np.float64]) -> Any:
        """Sum of squared errors of every column about its own zero."""
        errors = [column - true for column in angles.T]
        return np.array(
            [
                np.square(wrap(error - circular_mean(error, self.period), self.period)).sum()
                for error in errors
            ]
        )

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.required = True
        return tags
