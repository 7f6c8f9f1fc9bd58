"""Coefficients, amplitudes, phases and the zero of a fit, beside all that it may allow for.

Where runs tell the noise the errors have few degrees of freedom, and pulls are Student's: they are
taken as scores of a normal distribution by the freedom that the fit states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trueangle as ta
from asked import Case, Chance, Pull, Told, angle_apart, generator, scored
from estimation.test_covariance import LINES, SIGMA, TRUE, correlated
from fitting import test_nuisance as nuisances
from fitting import test_prior as priors
from fitting import test_sandwich as robust

Array = NDArray[np.float64]

ORDERS = [order for order, *_ in LINES]

#: Why the error of a zero may be wide where runs tell those of the coefficients.
_ZERO = "wider by as much as those of the coefficients: zeros of runs do not tell it"


@dataclass(frozen=True)
class Design:
    """Runs of one joint: how many, of how many readings, over what, in which noise."""

    runs: int = 1
    readings: int = 240
    travel: float = 360.0
    memory: float = 0.0
    noise: Callable[[np.random.Generator, Array], Array] | None = None
    argument: str = "reference"
    options: Mapping[str, Any] = field(default_factory=dict)

    def read(self, rng: np.random.Generator) -> tuple[list[ta.CalibrationRun], float]:
        """The runs, and the circular mean of their zeros."""
        runs, zeros = [], rng.uniform(-5.0, 5.0, self.runs)
        for k, zero in enumerate(zeros):
            start = rng.uniform(0.0, 360.0) if self.travel >= 360.0 else 20.0
            x = np.linspace(start, start + self.travel, self.readings, endpoint=False)
            x = x[:: 1 if k % 2 else -1]
            # Lines stand in the angle that the model is a function of.
            error = sum(c * np.sin(np.radians(n * x + p)) for n, c, p in LINES) + zero
            drawn = SIGMA * correlated(rng, self.memory, x.size)
            scatter = drawn if self.noise is None else self.noise(rng, drawn)
            if self.argument == "indicated":
                runs.append(ta.CalibrationRun(x - error - scatter, x, 360.0))
            else:
                runs.append(ta.CalibrationRun(x, x + error + scatter, 360.0))
        return runs, float(np.degrees(np.angle(np.exp(1j * np.radians(zeros)).mean())))


def glitches(rng: np.random.Generator, drawn: Array) -> Array:
    """A reading in fifty far off, to either side."""
    far = (rng.random(drawn.size) < 0.02) * rng.choice([-40.0, 40.0], drawn.size)
    return np.asarray(drawn + SIGMA * far)


def swings(rng: np.random.Generator, drawn: Array) -> Array:
    """Lines of each run's own, which no white noise has."""
    turn = np.linspace(0.0, 2.0 * np.pi, drawn.size)
    own = rng.normal(size=(2, 2))
    waves = own[0, 0] * np.cos(turn) + own[0, 1] * np.sin(turn)
    waves += own[1, 0] * np.cos(2.0 * turn) + own[1, 1] * np.sin(2.0 * turn)
    return np.asarray(drawn + SIGMA * waves)


DESIGNS = {
    "white, one run": Design(),
    "white, few readings": Design(readings=16),
    "white, six runs": Design(runs=6, readings=90),
    "white, part of a turn": Design(runs=3, readings=150, travel=280.0),
    "of the indicated angle": Design(argument="indicated", options={"argument": "indicated"}),
    "remembers, one run": Design(readings=2000, travel=720.0, memory=0.8),
    "remembers, two runs": Design(runs=2, readings=1000, travel=720.0, memory=0.6),
    "remembers, six runs": Design(runs=6, readings=200, memory=0.9),
    "remembers, twelve runs": Design(runs=12, readings=100, memory=0.6),
    "runs that differ": Design(runs=8, readings=100, noise=swings),
    "glitches, huber": Design(noise=glitches, options={"loss": "huber"}),
    "glitches, tukey": Design(noise=glitches, options={"loss": "tukey"}),
    "white, tukey": Design(runs=3, readings=60, options={"loss": "tukey"}),
}


def pulls_of_fit(fit: Any, true: Array, zero: float | None = None, careful: str = "") -> Told:
    """Of each coefficient, amplitude and phase; ``true`` are cosine and sine of each order."""
    pairs = [(a, b) for s in fit.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    stds, freedom = np.sqrt(np.diag(fit.covariance)), fit.freedom
    for k, (value, truth) in enumerate(zip(np.ravel(pairs), true, strict=True)):
        order = f"cosine, sine of order {fit.orders[k // 2]:g}"
        yield Pull(order, scored((value - truth) / stds[1 + k], freedom[1 + k]))
    for k, (a, b) in enumerate(np.reshape(true, (-1, 2))):
        least = float(freedom[1 + 2 * k : 3 + 2 * k].min())
        away = fit.amplitudes[k] - math.hypot(a, b)
        yield Pull("amplitudes", scored(away / fit.amplitude_std[k], least))
        phase = math.degrees(math.atan2(a, b))
        away = math.radians(angle_apart(math.degrees(fit.phases[k]), phase))
        yield Pull("phases", scored(away / fit.phase_std[k], least))
    if zero is not None:
        away = angle_apart(fit.model.constant, zero)
        yield Pull("zero", scored(away / stds[0], freedom[0]), careful)


def plain(name: str) -> Case:
    """Runs of a design."""
    design = DESIGNS[name]

    def case(seed: int) -> Told:
        runs, zero = design.read(generator(seed, name))
        fit = ta.fit(runs, orders=ORDERS, **design.options)
        careful = _ZERO if fit.uncertainty.kind == "cluster" else ""
        yield from pulls_of_fit(fit, TRUE, zero, careful)

    return case


def drifts(rng: np.random.Generator) -> Callable[..., Any]:
    """A drift of each run's own: of a fixed one a spline leaves the same each time."""
    phases = rng.uniform(0.0, 2.0 * np.pi, 8)
    return lambda r, x, t, s, v: 0.05 * np.sin(2.5 * t / t[-1] + phases[r])


#: What each nuisance is asked beside: the effect in the readings.
BESIDE: dict[str, tuple[Callable[..., Any] | None, str]] = {
    "none": (nuisances.none, "auto"),
    "ramp": (nuisances.ramp, "ramp"),
    "direction": (nuisances.reversal, "direction"),
    "velocity": (nuisances.lag, "velocity"),
    "drift": (None, "drift"),
    "drift, found": (None, "auto"),
}


def beside(name: str) -> Case:
    """What is fitted beside the pattern, and taken out."""
    effect, asked = BESIDE[name]
    true = np.ravel(
        [[c * np.sin(np.radians(p)), c * np.cos(np.radians(p))] for _, c, p in nuisances.LINES]
    )

    def case(seed: int) -> Told:
        rng = generator(seed, name)
        there = drifts(rng) if effect is None else effect
        runs = nuisances.runs_with(there, int(rng.integers(2**62)), count=3)
        fit = ta.fit(runs, orders=[order for order, *_ in nuisances.LINES], nuisance=asked)
        yield from pulls_of_fit(fit, true)

    return case


def sandwich(loss: Any, count: int, runs: int, noise: str, hit: int) -> Case:
    """A robust loss in the noises of its own test."""
    name = f"{loss} {count} {runs} {noise} {hit}"

    def case(seed: int) -> Told:
        read = robust.read(generator(seed, name), count, runs, noise, hit)
        fit = ta.fit(read, orders=[1], loss=loss)
        yield from pulls_of_fit(fit, np.array([30.0 / 3600.0, 0.0]))

    return case


def prior(seed: int) -> Told:
    """A unit drawn from a prior, read at a dozen places: what is told is a posterior."""
    rng = generator(seed, "prior")
    known = priors.prior_of(360.0)
    true = known.mean + np.sqrt(known.variance) * rng.standard_normal(known.mean.size)
    x = np.sort(rng.uniform(0.0, 330.0, 14))
    waves = [f(np.radians(k * x)) for k in (1.0, 3.0, 7.0) for f in (np.cos, np.sin)]
    error = np.column_stack(waves) @ true + priors.NOISE * 360.0 * rng.normal(size=x.size)
    fit = ta.fit(ta.CalibrationRun(x, x + error, 360.0), prior=known, loss="linear")
    stds = np.sqrt(np.diag(fit.covariance))
    pairs = [(a, b) for s in fit.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    found = np.ravel(pairs)
    for k in range(true.size):
        yield Pull("coefficients", (found[k] - true[k]) / stds[1 + k])
    yield Pull("zero", fit.model.constant / stds[0])


def selection(memory: float) -> Case:
    """A choice of orders where there are none: errors of all, and the chance of the strongest."""

    def case(seed: int) -> Told:
        rng = generator(seed, f"selection {memory}")
        runs = []
        for _ in range(4):
            x = np.linspace(0.0, 360.0, 200, endpoint=False) + rng.uniform(0.0, 360.0)
            error = SIGMA * correlated(rng, memory, x.size) + rng.uniform(-5.0, 5.0)
            runs.append(ta.CalibrationRun(x, x + error, 360.0))
        found = ta.select_orders(runs)
        for row in found.table:
            if not row.retained:
                yield Pull("cosine, sine of no order", row.cosine / row.standard_error)
                yield Pull("cosine, sine of no order", row.sine / row.standard_error)
        least = min(row.log10_false_alarm for row in found.table)
        yield Chance("chance of the strongest", 10.0**least, "Bonferroni's bound, 1 at most")

    return case


def cases() -> Mapping[str, Case]:
    """All of them."""
    return {
        **{name: plain(name) for name in DESIGNS},
        **{f"nuisance: {name}": beside(name) for name in BESIDE},
        "huber, outliers in few": sandwich("huber", 40, 2, "normal", 2),
        "tukey, outliers in few": sandwich("tukey", 40, 2, "normal", 2),
        "huber, long tails": sandwich("huber", 48, 1, "logistic", 0),
        "prior": prior,
        "orders of white noise": selection(0.0),
        "orders of noise that remembers": selection(0.6),
    }
