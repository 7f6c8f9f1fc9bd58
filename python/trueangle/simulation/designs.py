"""How a run is measured: angles, direction, speed, load, temperature, mount."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..runs import CalibrationRun

__all__ = ["MAX_SAMPLES", "SPACINGS", "RunDesign"]

#: Readings of one run, at most: a simulation holds some 150 bytes of each.
MAX_SAMPLES = 20_000_000
#: Turns and degrees, at most: beyond, an angle has no digits left for an arcsec.
_MOST_TURNS = 1e6

SPACINGS = ("uniform", "jittered", "random")


@dataclass(frozen=True)
class RunDesign:
    """One ``[[run]]`` of a simulation file.

    Parameters
    ----------
    label : str, optional
    direction : {1, -1}
        Sense in which the run starts.
    speed_deg_s : float
        0: every position is read at rest, one a second.
    speed_end_deg_s : float, optional
        The shaft coasts to this speed with viscous friction: linearly in travel,
        exponentially in time.
    samples : int
    spacing : {"jittered", "uniform", "random"}
        Equal steps, equal steps each moved at random within its own, or random angles.
    start_deg : float
    turns : float
        Whole travel, summed over the stretches between reversals.
    reversals : list of float
        Shares of the travel, ascending in (0, 1), at which the direction turns round.
    torque_Nm : float
        Constant torque at the output.
    gravity_Nm, gravity_deg : float
        Adds ``gravity_Nm * sin(theta - gravity_deg)`` to the torque.
    temperature_C : float
    temperature_end_C : float, optional
        Where given, the temperature runs linearly there.
    mount_deg : float
        How far the reference artefact was turned on its mount.
    current_A : float, optional
        Constant current of the motor; no column where not given.
    shift_deg : float, optional
        How far one of two encoders was turned for this run; no column where not given.
    """

    label: str | None = None
    direction: int = 1
    speed_deg_s: float = 5.0
    samples: int = 360
    spacing: str = "jittered"
    start_deg: float = 0.0
    turns: float = 1.0
    reversals: tuple[float, ...] = ()
    torque_Nm: float = 0.0
    gravity_Nm: float = 0.0
    gravity_deg: float = 0.0
    temperature_C: float = 20.0
    temperature_end_C: float | None = None
    mount_deg: float = 0.0
    current_A: float | None = None
    shift_deg: float | None = None
    speed_end_deg_s: float | None = None

    def __post_init__(self) -> None:
        def refuse(name: str, wanted: str) -> ArgumentError:
            return ArgumentError(f"{name} must be {wanted}, got {getattr(self, name)!r}")

        if self.direction not in (1, -1):
            raise refuse("direction", "1 or -1")
        if not 0.0 <= self.speed_deg_s < math.inf:
            raise refuse("speed_deg_s", "0 (at rest) or positive")
        end = self.speed_end_deg_s
        if end is not None and not (0.0 < end < math.inf and self.speed_deg_s > 0.0):
            raise refuse("speed_end_deg_s", "positive, and speed_deg_s too")
        if not 1 <= self.samples <= MAX_SAMPLES:
            raise refuse("samples", f"from 1 to {MAX_SAMPLES}")
        if self.spacing not in SPACINGS:
            raise refuse("spacing", f"one of {', '.join(SPACINGS)}")
        if not 0.0 < self.turns <= _MOST_TURNS:
            raise refuse("turns", f"positive, at most {_MOST_TURNS:.0g}")
        for name in ("start_deg", "mount_deg", "gravity_deg", "shift_deg"):
            value = getattr(self, name)
            if value is not None and not abs(value) <= 360.0 * _MOST_TURNS:
                raise refuse(name, f"within {_MOST_TURNS:.0g} turns")
        edges = (0.0, *self.reversals, 1.0)
        if any(b <= a for a, b in itertools.pairwise(edges)):
            raise refuse("reversals", "ascending shares of the travel between 0 and 1")

    def path(self, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Travel and unwrapped angle of every reading, degrees, in the order taken."""
        n = self.samples
        share = np.arange(n) / n
        if self.spacing == "jittered":
            share = (np.arange(n) + rng.random(n)) / n
        elif self.spacing == "random":
            share = np.sort(rng.random(n))
        knots = np.array([0.0, *self.reversals, 1.0])
        signs = self.direction * (-1.0) ** np.arange(knots.size - 1)
        angles = np.concatenate([[0.0], np.cumsum(signs * np.diff(knots))])
        travel = 360.0 * self.turns
        return travel * share, self.start_deg + travel * np.interp(share, knots, angles)

    def measure(self, rng: np.random.Generator, label: str) -> CalibrationRun:
        """The run with an ideal joint: indicated equals reference; degrees."""
        travel, angle = self.path(rng)
        n = self.samples
        knots = np.array([0.0, *self.reversals]) * (360.0 * self.turns)
        stretch = np.searchsorted(knots, travel, side="right") - 1
        signs = self.direction * (-1.0) ** stretch
        at_rest = self.speed_deg_s == 0.0
        speed = np.full(n, self.speed_deg_s)
        time = np.arange(n, dtype=np.float64) if at_rest else travel / self.speed_deg_s
        end = self.speed_end_deg_s
        if end is not None and end != self.speed_deg_s:
            loss = (self.speed_deg_s - end) / (360.0 * self.turns)
            speed = self.speed_deg_s - loss * travel
            time = -np.log(speed / self.speed_deg_s) / loss
        temperature = np.full(n, self.temperature_C)
        if self.temperature_end_C is not None:
            share = travel / (360.0 * self.turns)
            temperature += (self.temperature_end_C - self.temperature_C) * share
        constant = {"current": self.current_A, "shift": self.shift_deg}
        moment = self.gravity_Nm * np.sin(np.radians(angle - self.gravity_deg))
        return CalibrationRun(
            angle,
            angle,
            period=360.0,
            time=time,
            temperature=temperature,
            torque=self.torque_Nm + moment,
            mount=np.full(n, self.mount_deg),
            label=self.label or label,
            velocity=np.asarray(signs * speed, dtype=np.float64),
            signals={name: value for name, value in constant.items() if value is not None},
        )
