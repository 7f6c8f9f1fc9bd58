"""The readings with what is already known projected out: candidates are scored in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..simulation.effects import Surroundings
from ..simulation.effects.effect import line_columns
from ..simulation.pattern import Pattern
from ..simulation.signals import Signals
from .blocks import Blocks, block_gram
from .linebasis import LineBasis
from .repeatability import repeated_part
from .whitening import RunEffect, Whitener, lag_correlation

__all__ = ["ROUNDING", "Proposal", "Space"]

Array = NDArray[np.float64]

#: Residuals are taken at most this many robust standard deviations large: wild readings
#: must not make causes, and normal ones are not touched.
CLIP = 4.0

#: Arcsec below which what is left is the rounding of angles (1e-12 of a turn).
ROUNDING = 1e-6

#: Share of a column's power that must be left after projection for it to count at all.
EXCITED = 1e-4

#: Size at which an effect is expected, in standard deviations of one reading. A coefficient
#: costs ln(size^2 n) (Kass and Wasserman 1995; size 1 is Schwarz's price). Up to
#: `FEW_READINGS` effects must be as large as the noise to matter; of many more are taken
#: because effects are smaller.
EXPECTED_SIZE = 0.3
FEW_READINGS = 900

#: Runs from which they, and not the readings, are what informs on a variance between runs.
ENOUGH_RUNS = 8

#: Ratios of variance (run effect to one reading) that are tried.
RATIOS = np.geomspace(1e-5, 1e8, 53)


@dataclass(frozen=True, eq=False)
class Proposal:
    r"""A candidate extension with its evidence.

    .. math:: \text{bic gain} = 2\Delta\ln L - k \ln n_e - 2 \ln(\text{grid})

    with :math:`n_e` the readings, or the runs for the variance of a run effect, that
    inform on a parameter.

    Attributes
    ----------
    cause : str
    shape : dict
        What was searched for: order, length, place ... enough to rebuild the columns.
    columns : ndarray, shape (n, p)
        Regressors; none for a run effect.
    run_effect : RunEffect or None
    parameters : int
        k.
    log_grid : float
        ln of the number of alternatives that were searched.
    deviance : float
        2 ln of the likelihood ratio.
    """

    cause: str
    shape: dict[str, Any]
    columns: Array
    parameters: int
    log_grid: float = 0.0
    deviance: float = 0.0
    log_n: float = 0.0
    run_effect: RunEffect | None = None
    coefficients: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def bic_gain(self) -> float:
        """Evidence: the deviance less the price of its parameters and of the search."""
        return self.deviance - self.parameters * self.log_n - 2.0 * self.log_grid


class Space:
    """Readings, what the simulation expects of them, and the terms chosen so far.

    Parameters
    ----------
    signals : Signals
    residual : ndarray
        Measured minus simulated error, arcsec, unfolded.
    around : Surroundings
        The joint and the pattern that the simulation believes.
    weights : ndarray, optional
    lines : LineBasis, optional
        Shared between spaces of the same readings.
    """

    def __init__(
        self,
        signals: Signals,
        residual: Array,
        around: Surroundings,
        weights: Array | None = None,
        lines: LineBasis | None = None,
        rho: float | None = None,
    ) -> None:
        self.signals = signals
        self.residual = residual
        self.belief = around
        self.around = around
        self.weights = weights
        self.fixed_rho = rho
        self.bounds = signals.run_bounds()
        self.n = len(signals)
        self.log_n = price_of_parameter(self.n)
        runs = len(self.bounds)
        #: What a variance between runs costs.
        self.log_runs = float(np.log(runs)) if runs >= ENOUGH_RUNS else self.log_n
        self.lines = lines if lines is not None else LineBasis(signals.theta, around.joint)
        self.base = np.column_stack(
            [np.ones(self.n), *(line_columns(signals.theta, m) for m in around.pattern.orders)]
        )
        self.terms: list[Proposal] = []
        #: What causes proposed beside given terms; shared by spaces of the same readings.
        self.memory: dict[Any, Any] = {}
        self.update()
        #: `deviance` without any term.
        self.start = self.deviance

    # -- model -------------------------------------------------------------------

    def with_terms(self, terms: Iterable[Proposal], rho: float | None = None) -> Space:
        """A space of the same readings with other terms (and this correlation of the noise)."""
        other = object.__new__(Space)
        other.__dict__.update(self.__dict__)
        other.terms = list(terms)
        if rho is not None:
            other.fixed_rho = rho
        other.update()
        return other

    def without_repeats(self, by_direction: bool = False) -> Space:
        """The space without what repeats at the same place; itself where nothing does."""
        left = np.where(self.wild, 0.0, self.left)
        repeated = repeated_part(left, self.signals, by_direction)
        if not repeated.any():
            return self
        other = object.__new__(Space)
        other.__dict__.update(self.__dict__)
        other.residual = self.residual - repeated
        other.memory = {}
        other.update()
        other.start = self.start + other.deviance - self.deviance
        return other

    def update(self) -> None:
        """Fit the terms: run effects, correlation, clipping, projection."""
        design = np.hstack([self.base, *(term.columns for term in self.terms)])
        self.design = design
        effects = [term.run_effect for term in self.terms if term.run_effect is not None]
        target, rho = self.residual, self.fixed_rho or 0.0
        self._noise: Whitener | None = None  # under which the design is projected
        for _ in range(2):
            self._project(target, rho, effects)
            left = self.residual - design @ self.coefficients
            left -= self.whiten.run_part(left)
            scale = self.root_weights * left
            spread = 1.4826 * float(np.median(np.abs(scale - np.median(scale))))
            limit = CLIP * max(spread, 1e-12) / self.root_weights
            wild = np.abs(left) > limit
            if self.fixed_rho is None:
                kept = np.clip(left, -limit, limit) * self.root_weights
                rho = lag_correlation(kept, self.signals.clock, self.bounds)
            settled = not wild.any() and rho == self.whiten.rho
            if settled:
                break
            target = np.where(
                wild, self.residual - left + np.clip(left, -limit, limit), self.residual
            )
        if len(effects) > 1:
            for k in range(len(effects)):
                effects[k] = self._refit_ratio(target, rho, effects, k)
        if len(effects) > 1 or not settled:
            self._project(target, rho, effects)
        self.target, self.wild = target, wild
        kept_effects = iter(effects)
        self.terms = [
            replace(term, run_effect=next(kept_effects)) if term.run_effect is not None else term
            for term in self.terms
        ]
        self.left = self.residual - design @ self.coefficients
        self.around = Surroundings(self.belief.joint, self._pattern())

    @property
    def root_weights(self) -> Array:
        """Square roots of the weights."""
        return np.ones(self.n) if self.weights is None else np.sqrt(self.weights)

    def _project(self, target: Array, rho: float, effects: list[RunEffect]) -> None:
        """Fit the design to ``target`` under this noise."""
        if self._noise is None or self._noise.rho != rho or self._noise.effects != effects:
            self._noise = self.whiten = Whitener(self.bounds, rho, effects, self.weights)
            columns = self.whiten(self.design)
            scale = np.sqrt(np.einsum("ij,ij->j", columns, columns))
            scale[scale == 0.0] = 1.0
            u, s, vt = np.linalg.svd(columns / scale, full_matrices=False)
            kept = s > 1e-7 * s[0]
            self.q = u[:, kept]
            self.back = vt[kept].T / s[kept] / scale[:, None]
            self.unscaled_covariance = self.back @ self.back.T
        y = self.whiten(target)
        inner = self.q.T @ y
        self.r = y - self.q @ inner
        self.rss = max(float(self.r @ self.r), 1e-300)
        self.coefficients = self.back @ inner

    def _refit_ratio(
        self, target: Array, rho: float, effects: list[RunEffect], k: int
    ) -> RunEffect:
        others = [effect for j, effect in enumerate(effects) if j != k]
        self._project(target, rho, others)
        ratio, _ = self.run_effect_gain(effects[k].columns)
        return RunEffect(effects[k].columns, max(ratio, 1e-9))

    def _pattern(self) -> Pattern:
        """The believed pattern with the missing orders found so far.

        Not with the fitted corrections: an effect on the pattern (a filter) would be
        taken for one in part, and then act on a pattern that it has already changed.
        """
        belief = self.belief.pattern
        orders = [*belief.orders]
        pairs = [*zip(belief.cosine, belief.sine, strict=True)]
        for term, coefficients in self.fitted():
            if term.cause == "missing_order":
                orders.append(term.shape["output_order"])
                pairs.append((coefficients[0], coefficients[1]))
        array = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        return Pattern(np.array(orders, dtype=np.float64), array[:, 0], array[:, 1])

    def fitted(self) -> list[tuple[Proposal, Array]]:
        """Every term with its coefficients."""
        found = []
        start = self.base.shape[1]
        for term in self.terms:
            stop = start + term.columns.shape[1]
            found.append((term, self.coefficients[start:stop]))
            start = stop
        return found

    def covariance(self, k: int) -> Array:
        """Covariance of the coefficients of term ``k``."""
        start = self.base.shape[1] + sum(t.columns.shape[1] for t in self.terms[:k])
        stop = start + self.terms[k].columns.shape[1]
        return np.asarray(self.unscaled_covariance[start:stop, start:stop] * self.variance)

    @property
    def variance(self) -> float:
        """Variance of one reading's noise, arcsec squared."""
        return float(self.rss / max(self.n - self.q.shape[1], 1))

    @property
    def is_explained(self) -> bool:
        """Nothing but rounding is left (of simulated runs without noise)."""
        return self.variance < ROUNDING**2

    @property
    def deviance(self) -> float:
        """-2 ln of the likelihood, up to a constant of the readings."""
        return float(self.n * np.log(self.rss / self.n)) + float(self.whiten.log_determinant)

    @property
    def bic(self) -> float:
        """Deviance plus the price of the terms' parameters and searches."""
        price = sum(t.parameters * t.log_n + 2.0 * t.log_grid for t in self.terms)
        return self.deviance + price

    # -- scores ------------------------------------------------------------------

    def projected(self, columns: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Whitened columns with what is known taken out, and which are excited."""
        x = self.whiten(columns)
        before = np.einsum("ij,ij->j", x, x)
        x = x - self.q @ (self.q.T @ x)
        after = np.einsum("ij,ij->j", x, x)
        return x, after > EXCITED * np.maximum(before, 1e-300)

    def gain(self, columns: Array) -> tuple[float, Array]:
        """Deviance that ``columns`` save together, and their coefficients."""
        x, excited = self.projected(columns)
        coefficients = np.zeros(columns.shape[1])
        if not excited.all():
            return 0.0, coefficients
        gram = x.T @ x
        scale = np.sqrt(np.diag(gram))
        values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        if values[0] < EXCITED * values[-1]:
            return 0.0, coefficients
        moment = vectors.T @ (x.T @ self.r / scale)
        saved = float(np.sum(moment**2 / values))
        coefficients = (vectors @ (moment / values)) / scale
        return self.as_deviance(saved), coefficients

    def coefficients_with(self, proposal: Proposal) -> Array:
        """Coefficients of all terms so far if a proposal joined them."""
        moved = self.back @ (self.q.T @ self.whiten(proposal.columns))
        return np.asarray(self.coefficients - moved @ proposal.coefficients)

    def gains(self, columns: Array) -> Array:
        """Deviance that each column saves alone."""
        x, excited = self.projected(columns)
        power = np.einsum("ij,ij->j", x, x)
        saved = (x.T @ self.r) ** 2 / np.maximum(power, 1e-300)
        return np.where(excited, self.as_deviances(saved), 0.0)

    def block_gains(self, blocks: Blocks) -> Array:
        """Deviance that each block of columns saves alone, as `gain` of each."""
        found = np.zeros(blocks.count)
        for where, width, columns, gram in blocks.groups:
            x = self.whiten(columns)
            before = gram if x is columns else block_gram(x, width)
            known = (self.q.T @ x).reshape(self.q.shape[1], -1, width)
            moment = (self.r @ x).reshape(-1, width)
            after = before - np.einsum("kbi,kbj->bij", known, known)
            power = np.einsum("bii->bi", after)
            limit = EXCITED * np.maximum(np.einsum("bii->bi", before), 1e-300)
            excited = (power > limit).all(axis=1)
            scale = np.sqrt(np.where(excited[:, None], power, 1.0))
            values, vectors = np.linalg.eigh(after / (scale[:, :, None] * scale[:, None, :]))
            excited &= values[:, 0] > EXCITED * values[:, -1]
            turned = np.einsum("bij,bi->bj", vectors, moment / scale)
            saved = np.sum(turned**2 / np.where(excited[:, None], values, 1.0), axis=1)
            found[where] = self.as_deviances(np.where(excited, saved, 0.0))
        return found

    def remembered(self, name: str, key: object, build: Callable[[], Any]) -> Any:
        """What ``build`` makes for ``key``; of every name the last one is kept.

        The pattern is part of the key.
        """
        pattern = self.around.pattern
        key = (key, *(a.tobytes() for a in (pattern.orders, pattern.cosine, pattern.sine)))
        kept = self.memory.get(("kept", name))
        if kept is None or kept[0] != key:
            kept = self.memory["kept", name] = (key, build())
        return kept[1]

    def fixed_gains(self, columns: Array) -> Array:
        """Deviance that each column saves with the coefficient 1."""
        x, excited = self.projected(columns)
        saved = 2.0 * (x.T @ self.r) - np.einsum("ij,ij->j", x, x)
        return np.where(excited, self.as_deviances(saved), 0.0)

    def as_deviance(self, saved: float) -> float:
        """``n ln(RSS/(RSS - saved))``."""
        return float(self.as_deviances(np.array([saved]))[0])

    def as_deviances(self, saved: Array) -> Array:
        """`as_deviance` of each."""
        share = np.minimum(saved / self.rss, 1.0 - 1e-15)
        return np.asarray(-self.n * np.log1p(-share))

    def line_gains(self) -> Array:
        """Deviance that a line of each order of `lines` saves (two coefficients)."""
        whitened = None if self.whiten.is_identity else self.whiten(self.lines.values)
        cosines, sines, mixed = self.lines.products(whitened)
        # Cosines and sines side by side, real.
        e = (self.lines.values if whitened is None else whitened).view(np.float32)
        known = (self.q.astype(np.float32).T @ e).astype(np.float64)
        moment = (self.r.astype(np.float32) @ e).astype(np.float64)
        aa = cosines - (known[:, 0::2] ** 2).sum(axis=0)
        bb = sines - (known[:, 1::2] ** 2).sum(axis=0)
        ab = mixed - (known[:, 0::2] * known[:, 1::2]).sum(axis=0)
        determinant = aa * bb - ab**2
        c, s = moment[0::2], moment[1::2]
        excited = determinant > 1e-3 * (0.5 * (cosines + sines)) ** 2
        saved = (bb * c * c - 2.0 * ab * c * s + aa * s * s) / np.where(excited, determinant, 1.0)
        return np.where(excited, self.as_deviances(np.maximum(saved, 0.0)), 0.0)

    def run_effect_gain(self, columns: Array) -> tuple[float, float]:
        """Best ratio of variances of a run effect and the deviance it saves."""
        z = self.whiten(columns)
        stacked = np.column_stack([self.q, self.r])
        gram = np.array([z[a:b].T @ z[a:b] for a, b in self.bounds])
        moment = np.array([z[a:b].T @ stacked[a:b] for a, b in self.bounds])
        values, vectors = np.linalg.eigh(gram)
        values = np.maximum(values, 0.0)
        kept = values > 1e-12 * values.max(initial=1e-300)
        turned = np.einsum("jki,jkl->jil", vectors, moment)
        b = (turned / np.sqrt(np.where(kept, values, 1.0))[:, :, None])[kept]
        power = values[kept]
        bq, br = b[:, :-1], b[:, -1]
        scale = max(float(power.max(initial=0.0)), 1e-300)

        def saved(trial: float) -> float:
            shrink = trial * power / (1.0 + trial * power)
            cross = bq.T @ (shrink * br)
            inner = np.eye(bq.shape[1]) - bq.T @ (shrink[:, None] * bq)
            inner[np.diag_indices_from(inner)] += 1e-12
            total = float(br @ (shrink * br)) + float(cross @ np.linalg.solve(inner, cross))
            return self.as_deviance(total) - float(np.log1p(trial * power).sum())

        # Every fourth ratio first: the maximum is broad.
        trials = RATIOS / scale
        coarse = range(0, trials.size, 4)
        middle = max(coarse, key=lambda k: saved(float(trials[k])))
        near = range(max(middle - 3, 0), min(middle + 4, trials.size))
        deviance = {k: saved(float(trials[k])) for k in near}
        k = max(near, key=lambda k: deviance[k])
        ratio, best = (float(trials[k]), deviance[k]) if deviance[k] > 0.0 else (0.0, 0.0)
        return ratio, best

    def propose(
        self,
        cause: str,
        shape: dict[str, Any],
        columns: Array,
        parameters: int | None = None,
        log_grid: float = 0.0,
        deviance: float | None = None,
    ) -> Proposal:
        """Proposal of regressors with their evidence in this space."""
        saved, coefficients = self.gain(columns)
        return Proposal(
            cause,
            shape,
            columns,
            columns.shape[1] if parameters is None else parameters,
            log_grid,
            saved if deviance is None else deviance,
            self.log_n,
            coefficients=coefficients,
        )

    def propose_run_effect(
        self, cause: str, shape: dict[str, Any], columns: Array, log_grid: float = 0.0
    ) -> Proposal:
        """Proposal of a run effect with its evidence in this space."""
        ratio, deviance = self.run_effect_gain(columns)
        return Proposal(
            cause,
            shape,
            np.zeros((self.n, 0)),
            1,
            log_grid,
            deviance,
            self.log_runs,
            RunEffect(columns, ratio),
        )

    def hopeless(self, deviance: float, parameters: int, log_grid: float = 0.0) -> bool:
        """A coarse search this far below its price gains nothing by refining."""
        return 1.5 * deviance + 10.0 < parameters * self.log_n + 2.0 * log_grid

    def has(self, cause: str) -> bool:
        """A term of this cause is among the terms."""
        return any(term.cause == cause for term in self.terms)


def price_of_parameter(readings: int) -> float:
    """Units of BIC that a coefficient costs."""
    informing = max(min(readings, FEW_READINGS), EXPECTED_SIZE**2 * readings)
    return float(np.log(max(informing, 2.0)))
