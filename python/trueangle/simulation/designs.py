"""How a run is measured: angles, speed, load, temperature, mount; the rotor as an inertia."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..joint.pattern import Pattern
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.signals import COUPLED

ARCSEC_PER_RAD: Final = ARCSEC_PER_TURN / (2.0 * math.pi)


class RotorDrive(NamedTuple):
    """What moves a shaft, in radians and seconds; the friction that drifts, in deg/s^2."""

    place: float
    speed: float
    decay: float
    cogging: float
    order: float
    phase: float
    imbalance: float
    low: float
    band: float
    friction_deg_s2: float
    memory_s: float


class RotorMotion(NamedTuple):
    """Angle (deg), speed (deg/s) and acceleration by the motor (deg/s^2) at every reading."""

    angle: Array
    speed: Array
    driven: Array


def rotor_angle(
    drive: RotorDrive, time: Array, pattern: Pattern, rng: np.random.Generator
) -> RotorMotion:
    """Where the shaft is at ``time``, integrated from the start of the run.

    ::

        θ̈ = -γθ̇ + c sin(mθ + φ) + u sin(θ + ψ) + f(t) + a

    with viscous friction ``γ`` (none at constant speed), cogging, imbalance and a friction
    that drifts, all as accelerations, and ``a`` the acceleration that a velocity loop commands. The
    loop is closed on the encoder under test: with what the encoder reads, r, and its speed,

    ::

        a = ω_b (ṙ₀ - ṙ) + 1/4 ω_b² (r₀ - r),
        T(s) = (ω_b s + ω_b²/4) / ((s + ω_b/2)²),

    so that the shaft moves by ``-Tε`` and the log shows ``(1 - T)ε``.

    Parameters
    ----------
    drive : Drive
    time : ndarray
        Seconds, ascending from the start of the run.
    pattern : Pattern
        Lines that the loop sees; other effects and noise do not move the shaft.
    rng : numpy.random.Generator
        Of the friction that drifts.

    Raises
    ------
    ArgumentError
        The shaft runs away.
    """
    place, start, rate, cogging, order, phase, imbalance, low, band, *_ = drive
    viscous = 0.0 if band else rate  # a loop gives what friction takes
    lines = (
        [
            (m, complex(a, -b) / ARCSEC_PER_RAD)
            for m, a, b in zip(
                pattern.orders.tolist(),
                pattern.cosine.tolist(),
                pattern.sine.tolist(),
                strict=True,
            )
        ]
        if band
        else []
    )

    def seen(x: float) -> tuple[float, float]:
        """The pattern at ``x`` and its slope."""
        value = slope = 0.0
        for m, line in lines:
            term = line * complex(math.cos(m * x), math.sin(m * x))
            value += term.real
            slope -= m * term.imag
        return value, slope

    zero = seen(place)[0]

    def loop(t: float, x: float, v: float) -> float:
        value, slope = seen(x)
        wanted = start * math.exp(-rate * t)
        way = start * t if rate == 0.0 else start * -math.expm1(-rate * t) / rate
        reading = x + value - zero - place
        lag = band * (wanted - v * (1.0 + slope)) + 0.25 * band * band * (way - reading)
        return lag - rate * wanted

    def pushed(x: float, v: float) -> float:
        a = -viscous * v
        if cogging:
            a += cogging * math.sin(order * x + phase)
        if imbalance:
            a += imbalance * math.sin(x + low)
        return a

    fastest = max([order if cogging else 1.0, *(m for m, _ in lines)])
    # Radians that the fastest term turns by in one step of the integration, at most: Runge and
    # Kutta's rule of fourth order is then right to some 1e-6 of what the term moves.
    longest = 0.1 / max(fastest * abs(start) * max(1.0, math.exp(-rate * time[-1])), band, 1e-12)
    friction = np.radians(_drift(drive, time, rng)).tolist()
    n = time.size
    angle, speed, driven = np.empty(n), np.empty(n), np.zeros(n)
    x, v, before = place, start, 0.0
    for i, now in enumerate(time.tolist()):
        f = friction[i]
        steps = max(1, math.ceil((now - before) / longest))
        h = (now - before) / steps
        for j in range(steps if h > 0.0 else 0):
            t = before + j * h
            a1 = f + pushed(x, v)
            x2, v2 = x + 0.5 * h * v, v + 0.5 * h * a1
            if band:
                a1 += loop(t, x, v)
                v2 = v + 0.5 * h * a1
                a2 = f + pushed(x2, v2) + loop(t + 0.5 * h, x2, v2)
                x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
                a3 = f + pushed(x3, v3) + loop(t + 0.5 * h, x3, v3)
                x4, v4 = x + h * v3, v + h * a3
                a4 = f + pushed(x4, v4) + loop(t + h, x4, v4)
            else:
                a2 = f + pushed(x2, v2)
                x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
                a3 = f + pushed(x3, v3)
                x4, v4 = x + h * v3, v + h * a3
                a4 = f + pushed(x4, v4)
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not abs(v) < 1e9:
            raise ArgumentError("the shaft runs away: make cogging, imbalance and loop weaker")
        angle[i], speed[i] = x, v
        if band:
            driven[i] = loop(now, x, v)
        before = now
    return RotorMotion(np.degrees(angle), np.degrees(speed), np.degrees(driven))


def _drift(drive: RotorDrive, time: Array, rng: np.random.Generator) -> Array:
    """A friction's acceleration at every reading, with the correlation time ``memory_s``."""
    size = drive.friction_deg_s2
    if size == 0.0:
        return np.zeros(time.size)
    keep = np.exp(-np.diff(time, prepend=time[0]) / drive.memory_s)
    shocks = rng.standard_normal(time.size) * size
    found, state = np.empty(time.size), float(shocks[0])
    fresh = np.sqrt(1.0 - keep**2) * shocks
    for i, (k, new) in enumerate(zip(keep.tolist(), fresh.tolist(), strict=True)):
        state = k * state + (new if i else 0.0)
        found[i] = state
    return found


#: Readings of one run, at most: a simulation holds some 150 bytes of each.
MAX_SAMPLES = 20_000_000
#: Turns and degrees, at most: beyond, an angle has no digits left for an arcsec.
_MOST_TURNS = 1e6

SPACINGS = ("uniform", "jittered", "random", "clock")

#: A run without lines: nothing for a loop to follow.
_NO_LINES = Pattern(np.zeros(0), np.zeros(0), np.zeros(0))


@told_kinds
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
    spacing : {"jittered", "uniform", "random", "clock"}
        Equal steps, equal steps each moved at random within its own, random angles, or
        equal steps of time, as a logger reads.
    start_deg : float
    turns : float
        Whole travel, summed over the segments between reversals.
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
        The reference is that encoder then, and reads with the lines of ``reference_error``.
    loop_bandwidth_hz : float, optional
        The speed is held by a loop closed on the encoder under test
        (`rotor_angle`).
    cogging_deg_s2, cogging_order, cogging_phase_deg : float
        Acceleration ``c sin(m theta + phase)`` of the shaft by cogging.
    imbalance_deg_s2, imbalance_phase_deg : float
        Acceleration ``u sin(theta + phase)`` by imbalance.
    friction_deg_s2, friction_memory_s : float
        Standard deviation and correlation time of a friction that drifts.
    deg_s2_per_A : float, optional
        Acceleration per ampere; the current that the loop commands is added to ``current_A``.
    motor_sigma_arcsec : float, optional
        The motor's own angle is recorded too, not reduced, with this noise.
    coupled : mapping of str to list of float
        Other joints of a robot: the angles (degrees) that each passes in straight lines, evenly
        spaced over the travel of the run; one angle where it does not move.
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
    loop_bandwidth_hz: float | None = None
    cogging_deg_s2: float = 0.0
    cogging_order: float = 1.0
    cogging_phase_deg: float = 0.0
    imbalance_deg_s2: float = 0.0
    imbalance_phase_deg: float = 0.0
    friction_deg_s2: float = 0.0
    friction_memory_s: float = 2.0
    deg_s2_per_A: float | None = None
    motor_sigma_arcsec: float | None = None
    coupled: tuple[tuple[str, tuple[float, ...]], ...] = ()

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
        self._check_rotor(refuse)
        others = self.coupled.items() if isinstance(self.coupled, Mapping) else self.coupled
        coupled = tuple((joint, tuple(map(float, angles))) for joint, angles in others)
        if any(not joint or not angles for joint, angles in coupled):
            raise refuse("coupled", "an angle or more of each other joint by its name")
        object.__setattr__(self, "coupled", coupled)

    def _check_rotor(self, refuse: Callable[[str, str], ArgumentError]) -> None:
        """What disturbs the commanded speed needs a speed, in one direction."""
        for name in ("loop_bandwidth_hz", "cogging_order", "friction_memory_s", "deg_s2_per_A"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise refuse(name, "positive")
        for name in ("cogging_deg_s2", "imbalance_deg_s2", "friction_deg_s2"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise refuse(name, "positive, or 0 for none")
        if self.motor_sigma_arcsec is not None and not 0.0 <= self.motor_sigma_arcsec < math.inf:
            raise refuse("motor_sigma_arcsec", "positive, or 0 for none")
        if self.deg_s2_per_A is not None and self.loop_bandwidth_hz is None:
            raise refuse("deg_s2_per_A", "given with loop_bandwidth_hz, whose current it is")
        if self.is_moved and (self.reversals or self.speed_deg_s == 0.0):
            raise ArgumentError(
                "cogging, imbalance, friction and loops need a speed_deg_s and no reversals"
            )

    @property
    def is_moved(self) -> bool:
        """Something moves the shaft in addition to the commanded speed."""
        pushes = (self.cogging_deg_s2, self.imbalance_deg_s2, self.friction_deg_s2)
        return self.loop_bandwidth_hz is not None or any(pushes)

    @property
    def decay_per_s(self) -> float:
        """Share of its speed that a coasting shaft loses in a second; 0 at constant speed."""
        if self.speed_end_deg_s is None:
            return 0.0
        return (self.speed_deg_s - self.speed_end_deg_s) / (360.0 * self.turns)

    @property
    def _drive(self) -> RotorDrive:
        """What moves the shaft."""
        return RotorDrive(
            math.radians(self.start_deg),
            math.radians(self.speed_deg_s) * self.direction,
            self.decay_per_s,
            math.radians(self.cogging_deg_s2),
            self.cogging_order,
            math.radians(self.cogging_phase_deg),
            math.radians(self.imbalance_deg_s2),
            math.radians(self.imbalance_phase_deg),
            2.0 * math.pi * (self.loop_bandwidth_hz or 0.0),
            self.friction_deg_s2,
            self.friction_memory_s,
        )

    def path(self, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Travel and unwrapped angle of every reading, degrees, in the order taken."""
        n = self.samples
        share = np.arange(n) / n
        if self.spacing == "jittered":
            share = (np.arange(n) + rng.random(n)) / n
        elif self.spacing == "random":
            share = np.sort(rng.random(n))
        elif self.spacing == "clock" and self.decay_per_s != 0.0:
            assert self.speed_end_deg_s is not None
            lost = 1.0 - self.speed_end_deg_s / self.speed_deg_s
            share = -np.expm1(share * math.log1p(-lost)) / lost
        knots = np.array([0.0, *self.reversals, 1.0])
        signs = self.direction * (-1.0) ** np.arange(knots.size - 1)
        angles = np.concatenate([[0.0], np.cumsum(signs * np.diff(knots))])
        travel = 360.0 * self.turns
        return travel * share, self.start_deg + travel * np.interp(share, knots, angles)

    def measure(
        self, rng: np.random.Generator, label: str, pattern: Pattern = _NO_LINES
    ) -> CalibrationRun:
        """The run with an ideal joint: indicated equals reference; degrees.

        ``pattern`` is what a loop that is closed on the encoder follows.
        """
        travel, angle = self.path(rng)
        n = self.samples
        knots = np.array([0.0, *self.reversals]) * (360.0 * self.turns)
        stretch = np.searchsorted(knots, travel, side="right") - 1
        signs = self.direction * (-1.0) ** stretch
        speed = np.full(n, self.speed_deg_s)
        if self.speed_deg_s == 0.0:
            time = np.arange(n, dtype=np.float64)
        elif self.decay_per_s == 0.0:
            time = travel / self.speed_deg_s
        else:
            speed = self.speed_deg_s - self.decay_per_s * travel
            time = np.log(self.speed_deg_s / speed) / self.decay_per_s
        motion = RotorMotion(angle, np.asarray(signs * speed), np.zeros(n))
        if self.is_moved:
            motion = rotor_angle(self._drive, time, pattern, rng)
        temperature = np.full(n, float(self.temperature_C))
        if self.temperature_end_C is not None:
            share = travel / (360.0 * self.turns)
            temperature += (self.temperature_end_C - self.temperature_C) * share
        moment = self.gravity_Nm * np.sin(np.radians(motion.angle - self.gravity_deg))
        return CalibrationRun(
            motion.angle,
            motion.angle,
            period=360.0,
            time=time,
            temperature=temperature,
            torque=self.torque_Nm + moment,
            # A reference that is an encoder turned for this run has turned on its mount.
            mount=np.full(n, self.mount_deg + (self.shift_deg or 0.0)),
            label=self.label or label,
            velocity=motion.speed,
            signals=self._signals(motion, travel / (360.0 * self.turns)),
        )

    def _signals(
        self, motion: RotorMotion, share: NDArray[np.float64]
    ) -> dict[str, NDArray[np.float64]]:
        """Current, shift and the angles of other joints, where the run has them."""
        found = {}
        if self.current_A is not None or self.deg_s2_per_A is not None:
            driven = motion.driven / (self.deg_s2_per_A or math.inf)
            found["current"] = (self.current_A or 0.0) + driven
        if self.shift_deg is not None:
            found["shift"] = np.full(self.samples, self.shift_deg)
        for joint, angles in self.coupled:
            found[COUPLED + joint] = np.interp(share, np.linspace(0.0, 1.0, len(angles)), angles)
        return found
