"""Effects other than a pattern: ramp, drift, direction, velocity, the reference.

::

    e_rj = z_r + pattern(x_rj) + s u_rj + d sign_rj + τ v_rj + g_r(t_rj)

with the unwrapped angle ``u``, the sense and the speed of travel, and a cubic spline ``g`` of
the time of each run. They are fitted jointly with the pattern and taken out of the readings;
what remains is then fitted as usual, which gives the same pattern as one joint fit (Frisch
and Waugh).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..errors import ArgumentError
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from ..support.suggestions import did_you_mean

#: What may be requested, in the order in which it is reported.
KINDS: Final = ("ramp", "direction", "velocity", "drift")


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What was taken out of the readings.

    Attributes
    ----------
    kinds : tuple of str
    slope : float
        Of a ramp: error per angle, the relative error of a scale.
    half_width : float
        Of the direction: half of the reversal error, unit of the runs.
    delay : float
        Of the velocity: error per velocity, seconds; negative where the reading lags.
    intervals : int
        Of the spline in time; 0 without drift.
    reference : tuple of (order, A, B)
        Lines that the reference makes, the same in every run.
    turned : tuple of (order, amplitude, phases)
        The same where the reference was remounted for every run: one amplitude, and a phase
        in every run, radians.
    shares : mapping of str to float
        Part of the held-out sum of squares that each kind took away.
    unseparated : tuple of str
        Kinds that lower the error as much but cannot be distinguished from the pattern.
    inflation : tuple of float
        Their factor on the standard errors of ``A, B`` of each order.
    """

    kinds: tuple[str, ...] = ()
    slope: float = 0.0
    half_width: float = 0.0
    delay: float = 0.0
    intervals: int = 0
    reference: tuple[tuple[float, float, float], ...] = ()
    turned: tuple[tuple[float, float, tuple[float, ...]], ...] = ()
    shares: tuple[tuple[str, float], ...] = ()
    unseparated: tuple[str, ...] = ()
    inflation: tuple[float, ...] = ()

    def predict(self, run: CalibrationRun) -> Array:
        """Error of a run by ramp, direction and velocity; a drift belongs to its own run."""
        error = np.zeros(len(run))
        if self.slope:
            angle = run.unwrapped_reference
            error += self.slope * (angle - angle.mean())
        if self.half_width:
            error += self.half_width * run.direction
        if self.delay and (speed := run.speed) is not None:
            error += self.delay * speed
        return error

    def sentences(self, period: float) -> Iterable[str]:
        """What was taken out, for the notes."""
        words = {
            "ramp": f"a ramp of {1e6 * self.slope:.3g} ppm of the angle (a wrong scale or ratio)",
            "direction": f"a reversal error of +-{1_296_000.0 * abs(self.half_width) / period:.3g} "
            "arcsec with the direction",
            "velocity": f"an error of {1e3 * self.delay:.3g} ms times the velocity (a delay)",
            "drift": f"a drift in time (cubic spline of {self.intervals} "
            f"interval{'s' if self.intervals > 1 else ''} in every run)",
            "reference": f"{len(self.reference)} lines of the reference",
            "turned": "lines of the reference with a new phase in every run, "
            f"because its zero changes ({', '.join(self._told(period))})",
        }
        shares = dict(self.shares)
        for kind in self.kinds:
            gain = f", {100.0 * shares[kind]:.2g} % of the held-out error" if kind in shares else ""
            yield f"fitted jointly with the pattern, and not in the model: {words[kind]}{gain}"
        for kind in self.unseparated:
            yield (
                f"{words[kind].split(' of ')[0]} would also lower the error, but these runs cannot "
                "separate it from the pattern: run `ta.diagnose(...)`, or measure in both "
                "directions, at several speeds and over more turns"
            )

    def _told(self, period: float) -> Iterable[str]:
        for order, amplitude, _ in self.turned:
            yield f"order {order:g}: {1_296_000.0 * amplitude / period:.3g} arcsec"


def asked_nuisance(asked: str | Iterable[str]) -> tuple[str, ...] | None:
    """Kinds of ``"none"``, ``"drift,ramp"`` or a list of names; None for ``"auto"``.

    Raises
    ------
    ArgumentError
        Unknown names.
    """
    if asked == "none":
        return ()
    if asked == "auto":
        return None
    names = asked.split(",") if isinstance(asked, str) else list(asked)
    names = [name.strip() for name in names if name.strip() and name.strip() != "none"]
    unknown = [name for name in names if name not in KINDS]
    if unknown:
        raise ArgumentError(
            f"nuisance must be 'auto', 'none' or some of {', '.join(KINDS)}, got {unknown[0]!r}"
            f"{did_you_mean(unknown[0], ('auto', 'none', *KINDS))}"
        )
    return tuple(kind for kind in KINDS if kind in names)
