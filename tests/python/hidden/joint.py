"""The true joint: its periodic error, and the simulation file that knows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATIOS = (50.0, 80.0, 100.0, 120.0)

#: (shaft, order of the shaft, smallest and greatest amplitude in arcsec): the main lines of
#: a strain wave joint with its encoder on the motor shaft.
LINES = (
    ("output", 1, 6.0, 16.0),
    ("output", 2, 3.0, 9.0),
    ("output", 3, 1.5, 5.0),
    ("motor", 1, 6.0, 16.0),
    ("motor", 2, 8.0, 20.0),
    ("wave_generator", 2, 12.0, 32.0),
    ("motor", 3, 2.0, 8.0),
    ("motor", 4, 3.0, 8.0),
)


@dataclass(frozen=True)
class Line:
    """``amplitude * sin(order * cycles * theta + phase)`` in arcsec and degrees."""

    shaft: str
    order: int
    amplitude: float
    phase: float


@dataclass(frozen=True)
class Joint:
    """A joint whose pattern consists of known lines; circular spline fixed."""

    gear_ratio: float
    lines: tuple[Line, ...]
    zero: float  # arcsec, common to all runs

    def cycles(self, shaft: str) -> float:
        """Turns of ``shaft`` per output turn."""
        return {
            "output": 1.0,
            "motor": self.gear_ratio,
            "wave_generator": self.gear_ratio + 1.0,
        }[shaft]

    @property
    def orders(self) -> Array:
        """Output orders of the lines."""
        return np.array([line.order * self.cycles(line.shaft) for line in self.lines])

    @property
    def amplitudes(self) -> Array:
        return np.array([line.amplitude for line in self.lines])

    @property
    def phases(self) -> Array:
        """Radians."""
        return np.radians([line.phase for line in self.lines])

    def pattern(self, theta: Array) -> Array:
        """Periodic error in arcsec at true angles in degrees."""
        angle = np.radians(theta)[:, None] * self.orders + self.phases
        return np.asarray(np.sin(angle) @ self.amplitudes)

    def scaled(self, factor: float) -> Joint:
        """The same joint with every amplitude multiplied by ``factor``."""
        lines = tuple(replace(line, amplitude=line.amplitude * factor) for line in self.lines)
        return replace(self, lines=lines)

    def without(self, keep: tuple[str, ...]) -> Joint:
        """What a simulation believes that knows only the lines of some shafts."""
        return replace(self, lines=tuple(line for line in self.lines if line.shaft in keep))

    def simulation(self, sigma: float) -> str:
        """The TOML text of a simulation that knows this pattern and nothing else."""
        text = [
            "[joint]",
            f"gear_ratio = {self.gear_ratio!r}",
            'fixed_member = "circular_spline"',
            'encoder_side = "motor"',
            "pole_pairs = 1",
        ]
        for line in self.lines:
            text += [
                "",
                "[[harmonic]]",
                f'shaft = "{line.shaft}"',
                f"order = {line.order}",
                f"amplitude_arcsec = {line.amplitude:.6f}",
                f"phase_deg = {line.phase:.6f}",
            ]
        return "\n".join([*text, "", "[noise]", f"sigma_arcsec = {sigma:.3f}", ""])


def random_joint(rng: np.random.Generator) -> Joint:
    """A joint with a common gear ratio and random amplitudes and phases."""
    ratio = float(rng.choice(RATIOS))
    lines = tuple(
        Line(shaft, order, float(rng.uniform(low, high)), float(rng.uniform(0.0, 360.0)))
        for shaft, order, low, high in LINES
    )
    return Joint(ratio, lines, zero=float(rng.uniform(-5.0, 5.0)))
