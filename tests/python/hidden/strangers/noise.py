"""Noise of one run, of about one standard deviation a reading."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .designs import Array, Generator


def autoregressive(count: int, share: float, rng: Generator) -> Array:
    """Noise of which each reading shares so much with the next."""
    fresh = rng.normal(size=count) * np.sqrt(1 - share**2)
    noise = np.empty(count)
    noise[0] = rng.normal()
    for i in range(1, count):
        noise[i] = share * noise[i - 1] + fresh[i]
    return noise


def pink(count: int, rng: Generator) -> Array:
    """Noise whose power falls with the frequency, as 1/f."""
    long = 8 * count
    frequency = np.fft.rfftfreq(long)
    frequency[0] = 1
    normal = rng.normal(size=frequency.size) + 1j * rng.normal(size=frequency.size)
    amplitude = normal * frequency**-0.5
    amplitude[0] = 0
    noise = np.fft.irfft(amplitude, long)[:count]
    return noise / noise.std()


def outliers(count: int, rng: Generator) -> Array:
    noise = rng.normal(size=count)
    return noise + (rng.random(count) < 0.015) * rng.choice([-1, 1], count) * rng.uniform(
        6, 40, count
    )


def bursts(count: int, rng: Generator) -> Array:
    noise = rng.normal(size=count)
    starts = rng.random(count) < 0.004
    return noise + np.convolve(starts, np.ones(5), "same").clip(0, 1) * 9


def cubic(count: int, rng: Generator) -> Array:
    normal = rng.normal(size=count)
    return normal + 0.12 * (normal**3 - 3 * normal)


def walk_and_white(count: int, rng: Generator) -> Array:
    return np.cumsum(rng.normal(size=count)) * 0.07 + rng.normal(size=count) * 0.7


NOISE: dict[str, Callable[[int, Generator], Array]] = {
    "white": lambda count, rng: rng.normal(size=count),
    "ar4": lambda count, rng: autoregressive(count, 0.4, rng),
    "t6": lambda count, rng: rng.standard_t(6, count) / np.sqrt(1.5),
    "ar95": lambda count, rng: (
        0.9 * autoregressive(count, 0.95, rng) + 0.44 * rng.normal(size=count)
    ),
    "ar8": lambda count, rng: autoregressive(count, 0.8, rng),
    "pink": pink,
    "walkwhite": walk_and_white,
    "walk": lambda count, rng: np.cumsum(rng.normal(size=count)) * 0.12,
    "out": outliers,
    "burst": bursts,
    # Rounded to 3 of these, when it is read.
    "quant": lambda count, rng: 0.5 * rng.normal(size=count),
    "cubic": cubic,
}
