"""Sensors of few counts, as tests of fits and of diagnoses read them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import trueangle as ta


@dataclass(frozen=True)
class Sensor:
    """A sensor of few counts on a joint with one line, in runs there and back.

    Sizes are in counts.
    """

    bits: int
    places: int
    runs: int
    spread: bool
    noise: float
    amplitude: float
    order: int
    seed: int

    @property
    def count(self) -> float:
        """Degrees."""
        return 360.0 / 2**self.bits

    @property
    def sizes(self) -> tuple[float, float]:
        """Cosine and sine of the line, degrees."""
        phase = np.random.default_rng([self.seed, 8]).uniform(0.0, 2.0 * np.pi)
        size = self.amplitude * self.count
        return size * float(np.sin(phase)), size * float(np.cos(phase))

    def read(self) -> list[ta.CalibrationRun]:
        """Runs at the same places, there and back in turn."""
        rng, runs = np.random.default_rng([self.seed, 7]), []
        zero = rng.uniform(-1.0, 1.0)
        cosine, sine = np.array(self.sizes) / self.count
        for k in range(self.runs):
            at = np.arange(self.places) + (rng.uniform(size=self.places) if self.spread else 0.0)
            theta = (at * 360.0 / self.places)[:: -1 if k % 2 else 1]
            x = self.order * np.radians(theta)
            error = cosine * np.cos(x) + sine * np.sin(x) + zero
            error = error + self.noise * rng.standard_normal(self.places)
            indicated = np.round(theta / self.count + error) * self.count
            time = 0.1 * np.arange(self.places)
            runs.append(ta.CalibrationRun(theta, indicated, period=360.0, time=time))
        return runs


def any_sensor(seed: int) -> Sensor:
    rng = np.random.default_rng([seed, 3])
    return Sensor(
        bits=int(rng.choice([10, 12, 14])),
        places=int(rng.choice([36, 72, 200, 400])),
        runs=int(rng.integers(1, 5)),
        spread=bool(rng.integers(2)),
        noise=float(rng.choice([0.0, 0.05, 0.15, 0.3])),
        amplitude=float(rng.choice([0.0, 0.0, 0.5, 1.0, 3.0])),
        order=int(rng.integers(1, 6)),
        seed=seed,
    )
