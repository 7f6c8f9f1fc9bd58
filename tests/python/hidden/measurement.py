"""What is logged: true motion, hidden effects, noise and rounding become CalibrationRuns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trueangle import CalibrationRun

from .designs import Design, Scene
from .joint import Joint
from .source import Source

Array = NDArray[np.float64]

ARCSEC = 1.0 / 3600.0

#: Resolution of the indicated angle, arcsec: encoders of 14, 17 and 19 bit at a ratio of 100.
RESOLUTIONS = (0.791, 0.099, 0.025)

#: Scatter of the time stamps, seconds.
TIME_JITTER = 2e-5


@dataclass(frozen=True)
class Habit:
    """How the logger works: nothing of it is a cause."""

    sigma: float = 1.5
    noise: str = "normal"  # "correlated", "heavy"
    resolution: float = 0.1
    wrapped: bool = False
    velocity: bool = False


def random_habit(rng: np.random.Generator) -> Habit:
    """Noise of 1 to 2 arcsec and a random way of logging."""
    return Habit(
        sigma=float(rng.uniform(1.0, 2.0)),
        resolution=float(rng.choice(RESOLUTIONS)),
        wrapped=bool(rng.integers(2)),
        velocity=bool(rng.integers(2)),
    )


def measure(
    joint: Joint,
    design: Design,
    scenes: Sequence[Scene],
    sources: Sequence[Source],
    habit: Habit,
    rng: np.random.Generator,
) -> list[CalibrationRun]:
    """Log every scene of a joint that hides the effects of ``sources``."""
    signals = [source.signals(joint, scenes) for source in sources]
    factors = [source.noise_factors(scenes) for source in sources]
    runs = []
    for i, scene in enumerate(scenes):
        error = joint.zero + joint.pattern(scene.theta)
        reference = scene.theta.copy()
        noise = habit.sigma * _noise(habit.noise, scene.theta.size, rng)
        for source, signal, factor in zip(sources, signals, factors, strict=True):
            noise = noise * factor[i]
            error = error + signal[i]
            if source.of_reference:
                # The reference reads high where the error appears low.
                reference -= signal[i] * ARCSEC
                error = error - signal[i]
        indicated = scene.theta + (error + noise) * ARCSEC
        step = habit.resolution * ARCSEC
        indicated = np.round(indicated / step) * step
        if habit.wrapped:
            reference, indicated = reference % 360.0, indicated % 360.0
        stamps = scene.time + rng.uniform(-TIME_JITTER, TIME_JITTER, scene.time.size)
        logged = {
            "time": np.maximum.accumulate(stamps),
            "temperature": np.round(scene.temperature, 1),
            "torque": np.round(scene.torque + rng.normal(0, 0.01, scene.torque.size), 2),
            "mount": scene.mount,
        }
        runs.append(
            CalibrationRun(
                reference,
                indicated,
                period=360.0,
                label=scene.label,
                velocity=_encoder_speed(scene, rng) if habit.velocity and "time" in design.columns
                else None,
                **{name: logged[name] for name in design.columns},
            )
        )  # fmt: skip
    return runs


def _encoder_speed(scene: Scene, rng: np.random.Generator) -> Array:
    """A drive's velocity estimate: 0.2 % of scatter, steps of 1e-4 deg/s."""
    return np.round(scene.velocity * rng.normal(1.0, 0.002, scene.velocity.size), 4)


def _noise(kind: str, size: int, rng: np.random.Generator) -> Array:
    """Noise of unit standard deviation."""
    if kind == "normal":
        return rng.normal(size=size)
    if kind == "heavy":
        return np.asarray(rng.standard_t(5, size) / np.sqrt(5.0 / 3.0))
    if kind == "correlated":
        # An AR(1) process: neighbours share half of their noise.
        rho, white = 0.5, rng.normal(size=size)
        noise = np.empty(size)
        noise[0] = white[0]
        for i in range(1, size):
            noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * white[i]
        return noise
    raise ValueError(f"unknown noise {kind!r}")
