"""Designs of calibration runs: what is moved, how fast, under which load, and what is logged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .motion import Motion, strokes

Array = NDArray[np.float64]

#: Degrees moved before the first reading, so that backlash and wind-up are in a known state.
#: Fast strokes need up to 12 of them to gain speed.
RUN_IN = 30.0

#: Share of the span of temperatures by which a run warms up while it is measured.
WARM_UP = 0.07


@dataclass(frozen=True)
class Scene:
    """One run as it happens, before it is measured: true values at the readings."""

    motion: Motion
    time: Array
    theta: Array
    velocity: Array
    temperature: Array
    torque: Array
    mount: Array
    label: str


@dataclass(frozen=True)
class Design:
    """Levels of every factor; one run per combination and repeat, in random order."""

    name: str
    travel: str = "reversing"  # "forward", "split" (one direction per run) or "static"
    speeds: tuple[float, ...] = (5.0, 30.0)
    loads: tuple[float, ...] = (0.0, 5.0)
    temperatures: tuple[float, ...] = (20.0, 35.0)
    mounts: tuple[float, ...] = (0.0, 130.0, 250.0)
    repeats: int = 1
    readings: int = 420
    gravity: bool = True  # torque = load * sin(theta - theta_g), else constant in a run
    columns: tuple[str, ...] = ("time", "temperature", "torque", "mount")

    def scenes(self, rng: np.random.Generator) -> list[Scene]:
        """The runs of the design, in the random order in which they are taken."""
        factors = list(product(self.speeds, self.loads, self.temperatures, self.mounts))
        runs = [f for f in factors for _ in range(self.repeats)]
        signs = np.resize([1.0, -1.0], len(runs))
        plumb = float(rng.uniform(0.0, 360.0))
        found = []
        for position, index in enumerate(rng.permutation(len(runs))):
            speed, load, temperature, mount = runs[index]
            motion, time = self._move(speed, float(signs[index]), rng)
            theta = motion.angle(time)
            shape = np.sin(np.radians(theta - plumb)) if self.gravity else np.ones_like(theta)
            warm = WARM_UP * (max(self.temperatures) - min(self.temperatures))
            settle = rng.uniform(20.0, 120.0)
            found.append(
                Scene(
                    motion,
                    time,
                    theta,
                    motion.speed(time),
                    temperature + warm * rng.uniform(-1, 1) * (1 - np.exp(-time / settle)),
                    load * shape,
                    np.full(time.size, mount),
                    f"run{position:02d}",
                )
            )
        return found

    def _move(self, speed: float, sign: float, rng: np.random.Generator) -> tuple[Motion, Array]:
        acceleration = float(rng.uniform(40.0, 120.0))
        if self.travel == "static":
            step = 360.0 / self.readings
            # The last position is the first again: the closure reading of the paper.
            motion = strokes(-RUN_IN, [RUN_IN] + [step] * self.readings, speed, acceleration, 2.0)
            return motion, motion.stops + 1.0
        start = float(rng.uniform(0.0, 360.0))
        if self.travel == "reversing":
            lengths = rng.permutation([380.0, 90.0, 20.0, 250.0, 60.0, 12.0])
            lengths = lengths * rng.uniform(0.96, 1.1, lengths.size)
            lengths *= rng.choice([-1.0, 1.0]) * np.resize([1.0, -1.0], lengths.size)
        else:
            lengths = np.array([rng.uniform(365.0, 400.0)])
            lengths *= sign if self.travel == "split" else 1.0
        # A run-in in the direction of the first stroke, joined without a stop.
        lengths[0] += np.sign(lengths[0]) * RUN_IN
        start -= np.sign(lengths[0]) * RUN_IN
        path = float(np.abs(lengths).sum()) - RUN_IN
        if self.travel != "reversing":
            lengths[-1] += np.sign(lengths[-1]) * RUN_IN  # measured at constant speed only
        motion = strokes(start, list(lengths), speed, acceleration, float(rng.uniform(0.0, 0.3)))
        begin = float(motion.times_at_travel(np.array([RUN_IN]), 0.0)[0])
        # The controller also logs where a stroke ends, so that direction is never in doubt.
        ends = motion.stops if self.travel == "reversing" else np.empty(0)
        count = self.readings - ends.size
        travel = (np.arange(count) + rng.uniform(0.02, 0.98, count)) * path / count
        time = np.concatenate([motion.times_at_travel(travel, begin), ends])
        return motion, np.sort(time)


#: Both directions within each run, 2 speeds, 2 loads, 2 temperatures, 3 mounts: 24 runs.
RICH = Design("rich")

_ONE = Design(
    "one_of_everything",
    travel="forward",
    speeds=(30.0,),
    loads=(5.0,),
    temperatures=(20.0,),
    mounts=(0.0,),
    repeats=12,
)

#: Designs that lack something; what each cannot see is in `blind.CASES`.
DESIGNS = {
    design.name: design
    for design in (
        RICH,
        replace(RICH, name="rich_constant_load", gravity=False),
        replace(RICH, name="one_direction", travel="forward"),
        replace(RICH, name="one_speed", speeds=(30.0,), repeats=2),
        replace(RICH, name="one_load", loads=(5.0,), repeats=2),
        replace(RICH, name="one_load_constant", loads=(5.0,), repeats=2, gravity=False),
        replace(RICH, name="one_temperature", temperatures=(20.0,), repeats=2),
        replace(RICH, name="one_mount", mounts=(0.0,), repeats=3),
        replace(
            RICH, name="no_columns", speeds=(30.0,), loads=(5.0,), repeats=4, columns=()
        ),
        replace(_ONE, name="split_one_speed", travel="split"),
        _ONE,
        replace(_ONE, name="one_run", travel="reversing", repeats=1, readings=2000),
        replace(_ONE, name="paper", travel="static", repeats=6, readings=36),
        replace(
            _ONE, name="static_dense", travel="static", repeats=4, readings=997,
            loads=(0.0, 5.0), mounts=(0.0, 130.0, 250.0),
        ),
    )
}  # fmt: skip
