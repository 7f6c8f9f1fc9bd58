"""Two clocks: their offset, their rate, a time on the other clock.

What is not asked: ``std_arcsec`` of joining, which holds interpolation too, as a bound; runs less
what a simulator says, of which only the interpolation is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from asked import Case, Pull, Told, generator
from runs.test_join import NOISE, OFFSET, RATE, motion, pattern
from trueangle.runs.joining.clocks import estimated_clocks
from trueangle.runs.joining.stream import Stream

#: Seconds, memory of the noise, noise in degrees, rate in ppm (None: of two quartzes), declared.
DESIGNS: dict[str, tuple[float, float, float, float | None, float | None]] = {
    "white": (30.0, 0.0, NOISE, RATE, None),
    "remembers": (30.0, 0.9, NOISE, RATE, None),
    "rate declared": (30.0, 0.0, NOISE, 0.0, 0.0),
    "rate hardly known": (20.0, 0.0, 0.5, None, None),
}


def design(name: str) -> Case:
    """Logs of one motion."""
    seconds, memory, noise, rate, declared = DESIGNS[name]

    def case(seed: int) -> Told:
        rng = generator(seed, name)
        # Two quartzes: 0 +- 100 ppm.
        ppm = 100.0 * rng.normal() if rate is None else rate
        t = np.arange(0.0, seconds, 0.01)
        t = t + rng.uniform(0.0, 0.002, t.size)
        drawn = rng.normal(0.0, noise * math.sqrt(1.0 - memory**2), t.size + 300)
        said = motion(t) + pattern(motion(t)) + lfilter([1.0], [1.0, -memory], drawn)[300:]
        s = np.arange(-1.0, seconds + 1.0, 0.004)
        true = motion(s) + rng.normal(0.0, 0.001, s.size)
        there = s + OFFSET + 1e-6 * ppm * (s - t[0])
        found = estimated_clocks(Stream.of(t, said), Stream.of(there, true), None, declared)
        if found.offset_std is None:
            return
        yield Pull("offset", (found.offset - OFFSET) / found.offset_std)
        if declared is None and found.rate_std is not None:
            yield Pull("rate", (found.rate - ppm) / found.rate_std)
        for away in found.to_other(t) - (t + OFFSET + 1e-6 * ppm * (t - t[0])):
            yield Pull("a time on the other clock", float(away) / found.timing_std)

    return case


def cases() -> Mapping[str, Case]:
    """All designs."""
    return {name: design(name) for name in DESIGNS}
