"""A line of fixed frequency in time, with a new phase in every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from ..support.arrays import quantile
from .ambiguity import Ambiguity
from .drawing import Drawing
from .drift_within_run import DriftWithinRun
from .effect import ALWAYS, Effect, Reported, Spots
from .missing_order import MissingOrder
from .non_integer_order import NonIntegerOrder
from .randomphase import RandomPhaseLine
from .search import Array, Fitted, golden_maximum

#: Trial frequencies per resolution cell (one over the length of a run), and at most.
OVERSAMPLING = 3
MOST_TRIALS = 2**17


#: Cycles that a run must show: fewer are a slow curve, not a line.
LEAST_CYCLES = 3.0

#: Share of its frequency by which a line may differ from run to run (a converter's clock).
FREQUENCY_DRIFT = 0.015

#: Readings that a run must have to be searched.
LEAST_READINGS = 16


#: Golden sections of a search about a trial frequency.
SECTIONS = 14

#: Share of a resolution cell within which an order and a frequency are hardly separated.
UNRESOLVED = 0.5


@dataclass(frozen=True)
class TimePeriodic(Effect):
    """A disturbance of fixed frequency: ``ε = C sin(2π f t + φ_j)``.

    Parameters
    ----------
    frequency_hz : float
        f, or the frequency it appears at where the sampling folds it.
    amplitude_arcsec : float
    """

    frequency_hz: float
    amplitude_arcsec: float

    kind: ClassVar[str] = "time_periodic"
    title: ClassVar[str] = "line in time"
    size_name: ClassVar[str] = "amplitude_arcsec"
    sentence: ClassVar[str] = (
        "Mains, a converter's clock, vibration, or an alias of one of them: a "
        "line of fixed frequency in time, with a new phase in every run."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "run"
    form_of: ClassVar[tuple[str, ...]] = ("frequency",)
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        MissingOrder: "a second speed, or several runs that start at one angle",
        DriftWithinRun: "longer runs",
        NonIntegerOrder: "a second speed: an order moves in hertz, a line in time does not",
    }
    measure: ClassVar[str] = "time stamps, several runs, two speeds or a record at rest"
    transfers: ClassVar[bool] = False
    flexible_below: ClassVar[float] = ALWAYS
    not_at_run_time: ClassVar[str] = "its phase is new in every run; shield or filter its source"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        phase = rng.uniform(0.0, 2.0 * np.pi, signals.runs)[signals.run]
        turn = 2.0 * np.pi * self.frequency_hz * signals.clock
        return np.asarray(self.amplitude_arcsec * np.sin(turn + phase))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        if of.signals.time is None:
            return None
        return cls(of.between(0.1, 0.4) * of.reading_rate(), size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.signals.time is None or regression.has(cls.kind):
            return None
        found = _periodogram(regression)
        if found is None:
            return None
        frequencies, p, sizes = found
        # No frequency of its own in every run can bring more.
        if regression.is_dominated(float(p.max(axis=0).sum()), 1, np.log(frequencies.size)):
            return None
        tried = [_fixed(frequencies, p, sizes), _drifting(frequencies, p)]
        step = float(frequencies[1] - frequencies[0])
        best: Extension | None = None
        refined: dict[tuple[float, ...], list[float]] = {}
        for place, deviance, log_grid in tried:
            unlikely = regression.is_pruned(deviance, 1, log_grid)
            if unlikely or regression.is_dominated(deviance, 1, log_grid):
                continue
            start = frequencies[place].tolist()
            if (*start,) not in refined:  # both may begin at one frequency for all runs
                refined[(*start,)] = _refined(regression, start, step)
            shape = {"frequency_hz": refined[(*start,)]}
            waves = cls.waves(regression.signals, shape["frequency_hz"])
            extension = regression.propose_run_effect(cls.kind, shape, waves, log_grid)
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        if best is None or best.bic_gain <= 0.0 or cls._keeps_phase(regression, best):
            return None
        return best

    @staticmethod
    def waves(signals: Signals, frequencies: Sequence[float]) -> Array:
        """Cosine and sine of the line in every run, shape (n, 2)."""
        if len({*frequencies}) == 1:
            return line_columns(2.0 * np.pi * signals.clock, frequencies[0])
        _, run = np.unique(signals.run, return_inverse=True)
        turn = 2.0 * np.pi * np.asarray(frequencies)[run] * signals.clock
        return line_columns(turn, 1.0)

    @staticmethod
    def _keeps_phase(regression: Regression, found: Extension) -> bool:
        """An order of the angle with one phase for all runs explains as much.

        Phases that are new in each of R runs leave a share of 1/R to one phase for all.
        """
        signals = regression.signals
        speed = float(np.median(np.abs(signals.turns_per_s)))
        if speed == 0.0:
            return False
        order = float(np.median(found.shape["frequency_hz"])) / speed
        near = max(
            UNRESOLVED / max(float(np.median(signals.run_turns())), 1e-9), FREQUENCY_DRIFT * order
        )
        orders = regression.lines.orders
        known = np.concatenate([orders, regression.around.pattern.orders])
        share = 0.5 + 1.0 / signals.runs
        return any(
            regression.gain(line_columns(signals.theta, float(m)))[0] > share * found.deviance
            for m in known[np.abs(known - order) < near]
        )

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension = terms[0][0]
        frequencies = np.array(extension.shape["frequency_hz"])
        frequency = float(np.median(frequencies))
        waves = cls.waves(regression.signals, extension.shape["frequency_hz"])
        line = RandomPhaseLine(regression, cls.kind, waves)
        amplitude, amplitude_std = line.amplitude()
        std = line.place_std(2.0 * np.pi * regression.signals.clock)
        if std is not None:
            std = max(std, float(frequencies.std()) / frequencies.size**0.5)
        parameters = {
            "frequency_hz": quantity(frequency, std),
            "amplitude_arcsec": quantity(amplitude, amplitude_std),
        }
        if np.ptp(frequencies) > 0.0:
            parameters["frequencies_hz"] = quantity(frequencies)
        return parameters, [TimePeriodic(frequency, amplitude)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.time is None:
            yield cls.blind("no time stamps were recorded")

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != cls.kind or regression.signals.velocity is None:
            return None
        speed = np.abs(regression.signals.turns_per_s)
        moving = speed[speed > 0.0]
        level = float(np.median(moving)) if moving.size else 0.0
        # Share of its level by which the speed must change to distinguish a line in time from an
        # order.
        if not level or quantile(moving, 0.9) - quantile(moving, 0.1) > 0.1 * level:
            return None
        order = float(np.median(extension.shape["frequency_hz"])) / level
        # Orders of the fastest shaft beyond which no bearing has lines: at one speed a line up
        # there is one of time.
        if order > 12.0 * max(regression.belief.joint.shafts.values()):
            return None
        return cls.blind(
            f"one speed: a line of {order * level:.4g} Hz and one of order {order:.4g} with a "
            "new phase in every run are the same",
            NonIntegerOrder,
        )


def _periodogram(
    regression: Regression,
) -> tuple[Array, Array, Array] | None:
    """Frequencies, normalised power (frequency, run) of the residual, readings per run."""
    signals, bounds = regression.signals, regression.bounds
    sizes = np.array([stop - start for start, stop in bounds], dtype=np.float64)
    spans = np.array([float(np.ptp(signals.clock[a:b])) for a, b in bounds])
    if sizes.min() < LEAST_READINGS or spans.min() <= 0.0:
        return None
    span = float(np.median(spans))
    top = 0.5 * float(np.median((sizes - 1.0) / spans))
    step = 1.0 / (OVERSAMPLING * span)
    count = min(int(top / step), MOST_TRIALS)
    low = int(np.ceil(LEAST_CYCLES / span / step))
    if count <= low + 2:
        return None
    # Bins of a time that wraps after one over the step: exact at multiples of the step.
    # Bins of time per period of the highest frequency: the quick search then loses 2 % there.
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    e = regression.left_within_runs
    e = np.where(regression.outlying, 0.0, e)
    power = np.empty((count - low, len(bounds)))
    for j, (start, stop) in enumerate(bounds):
        clock = signals.clock[start:stop]
        part = e[start:stop]
        place = np.round((clock - clock[0]) * step * bins).astype(np.int64) % bins
        wave = np.fft.rfft(np.bincount(place, part - part.mean(), minlength=bins))[low:count]
        power[:, j] = wave.real**2 + wave.imag**2
    # The sum of the two squared normalised coefficients in a run, 2 on average.
    p = 2.0 * power / (sizes * regression.variance)
    return np.asarray(step * np.arange(low, count)), p, sizes


def _fixed(frequencies: Array, p: Array, sizes: Array) -> tuple[NDArray[np.int64], float, float]:
    """Places of one frequency for all runs, its deviance and the price of the search."""
    best = np.zeros(frequencies.size)
    for ratio in np.geomspace(1e-3, 1e3, 13):
        x = ratio * sizes
        deviance = (p * (x / (2.0 + x))).sum(axis=1) - 2.0 * np.log1p(x / 2.0).sum()
        best = np.maximum(best, deviance)
    k = int(np.argmax(best))
    log_grid = float(np.log(2.0 * frequencies.size / OVERSAMPLING))
    return np.full(sizes.size, k), float(best[k]), log_grid


def _drifting(frequencies: Array, p: Array) -> tuple[NDArray[np.int64], float, float]:
    """Places of a frequency that differs a little from run to run."""
    nowhere = np.zeros(p.shape[1], dtype=np.int64)
    bands = np.log(frequencies[-1] / frequencies[0]) / FREQUENCY_DRIFT
    count = max(int(np.ceil(bands * FREQUENCY_DRIFT / np.log1p(FREQUENCY_DRIFT))) - 1, 0)
    middles = float(frequencies[0]) * (1.0 + FREQUENCY_DRIFT) ** np.arange(1, count + 1)
    low, high = np.searchsorted(
        frequencies, np.outer([1.0 - FREQUENCY_DRIFT, 1.0 + FREQUENCY_DRIFT], middles)
    )
    wide = high - low > OVERSAMPLING
    low, high = low[wide], high[wide]
    if not low.size:
        return nowhere, -np.inf, 0.0
    # The power after the last frequency is never the largest: bands may end there.
    padded = np.vstack([p, np.full((1, p.shape[1]), -np.inf)])
    deviances = np.maximum.reduceat(padded, np.column_stack([low, high]).ravel())[::2].sum(axis=1)
    cells = (high - low) / OVERSAMPLING
    # A band of n cells has n + 1 points of independent power.
    log_grids = np.log(2.0 * bands) + p.shape[1] * np.log(cells + 1.0)
    k = int(np.argmax(deviances - 2.0 * log_grids))
    places = low[k] + p[low[k] : high[k]].argmax(axis=0)
    return places, float(deviances[k]), float(log_grids[k])


def _refined(regression: Regression, frequencies: list[float], step: float) -> list[float]:
    """Frequencies between the trial ones: one for all runs, or one a run.

    One frequency for all runs is the best jointly with the fitted terms, which explain a part.
    """
    if len({*frequencies}) == 1:
        f, turn = frequencies[0], 2.0 * np.pi * regression.signals.clock
        return [regression.drawn_line(turn, f - step, f + step, SECTIONS)[0]] * len(frequencies)
    e = regression.left_within_runs
    e = np.where(regression.outlying, 0.0, e)
    turn = 2.0 * np.pi * regression.signals.clock

    def power(f: float, start: int, stop: int) -> float:
        sums = _core.unit_sums(turn[start:stop], e[None, start:stop], [0], f, 1.0, 1)
        return float((sums**2).sum())

    return [
        float(golden_maximum(partial(power, start=a, stop=b), f - step, f + step, 10)[0])
        for f, (a, b) in zip(frequencies, regression.bounds, strict=True)
    ]
