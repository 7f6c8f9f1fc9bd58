"""Two channels of a sensor, sine and cosine: their constants, and the angle that these give."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..errors import ArgumentError
from ..support.angles import check_period, checked_sign, wrap
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.display_units import ErrorUnit

#: Names of the constants, in the order of their covariance.
CONSTANTS: Final = ("offset_cosine", "offset_sine", "amplitude", "gain_ratio", "phase_deg")

#: Phases at which the error of a curve is sampled, and the highest order kept of it.
_SAMPLES: Final = 512
_HIGHEST: Final = 64


#: Roles of two tracks.
TRACKS: Final = ("sine", "cosine", "sine2", "cosine2")

#: Periods in a turn, at most, as of order numbers.
MOST_PERIODS: Final = 1_000_000


class ChannelHarmonic(NamedTuple):
    """``z_k`` of the curve, relative to its fundamental: ``order`` k, real and imaginary part."""

    order: int
    re: float
    im: float
    std: float = 0.0
    """Standard error of either part."""


def _harmonic(entry: tuple[float, ...]) -> ChannelHarmonic:
    if not isinstance(entry, tuple) or len(entry) not in (3, 4):
        raise ArgumentError(f"harmonics must be (order, re, im, std) each, got {entry!r:.60}")
    return ChannelHarmonic(*entry)  # type: ignore[arg-type]  # an order is a whole number


@told_kinds
@dataclass(frozen=True)
class Channels:
    """Constants of a sine and a cosine channel.

    ::

        cosine = o_c + A cos φ,    sine = o_s + A g sin(φ + δ),
        angle = direction * φ * period / (2 pi periods_per_turn)

    Parameters
    ----------
    offset_sine, offset_cosine : float
        Middle of each channel, in the unit of the channels.
    amplitude : float
        ``A``, of the cosine.
    gain_ratio : float
        ``g``, amplitude of the sine over that of the cosine.
    phase_deg : float
        ``δ``, how far the sine leads a quarter of a period behind the cosine, degrees.
    direction : {1, -1}
        -1 where the phase falls as the angle rises.
    periods_per_turn : int
        Periods of the channels in a turn.
    period : float
        One turn in the unit of the angle.
    harmonics : tuple of ChannelHarmonic
        What the closed curve holds beyond these, relative to the fundamental.
    covariance : array_like, shape (5, 5), optional
        Of offset_cosine, offset_sine, amplitude, gain_ratio, phase_deg.
    second : Channels, optional
        A second track, of another number of periods without a common divisor: it chooses the
        period of the first.
    second_zero_deg : float
        Phase of the second track where that of the first and the angle are zero.
    excitation_deg : float, optional
        Of a resolver: phase of the channels against the excitation; sine and cosine are relative to
        it.

    Raises
    ------
    ArgumentError
        Numbers that are not finite, an amplitude or gain that is not positive, a phase
        from 90 degrees on.

    Examples
    --------
    >>> channels = Channels(offset_sine=0.1, gain_ratio=1.02, period=360.0)
    >>> round(float(channels.correct(0.1 + 1.02 * 0.5, 3**0.5 / 2)), 9)
    30.0
    """

    offset_sine: float = 0.0
    offset_cosine: float = 0.0
    amplitude: float = 1.0
    gain_ratio: float = 1.0
    phase_deg: float = 0.0
    direction: int = 1
    periods_per_turn: int = 1
    period: float = 2.0 * math.pi
    harmonics: tuple[ChannelHarmonic, ...] = ()
    covariance: tuple[tuple[float, ...], ...] | None = field(default=None, repr=False)
    second: Channels | None = None
    second_zero_deg: float = 0.0
    excitation_deg: float | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "period", check_period(self.period))
        put(self, "direction", checked_sign(self.direction))
        put(self, "periods_per_turn", checked_periods(self.periods_per_turn))
        for name in (*CONSTANTS, "second_zero_deg"):
            value = float(getattr(self, name))
            if not math.isfinite(value):
                raise ArgumentError(f"{name} must be finite, got {value!r}")
            put(self, name, value)
        for name in ("amplitude", "gain_ratio"):
            if not getattr(self, name) > 0.0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)!r}")
        if not abs(self.phase_deg) < 90.0:
            raise ArgumentError(f"phase_deg must be between -90 and 90, got {self.phase_deg!r}")
        put(self, "harmonics", tuple(map(_harmonic, self.harmonics)))
        for h in self.harmonics:
            if h.order in (-1, 0, 1) or not all(map(math.isfinite, h[1:])):
                raise ArgumentError(f"a harmonic has an order from 2 or to -2, got {h!r}")
        if self.second is not None:
            if self.excitation_deg is not None:
                raise ArgumentError("two tracks with an excitation are not known: leave one out")
            checked_track_periods((self.periods_per_turn, self.second.periods_per_turn))
            if self.second.period != self.period or self.second.second is not None:
                raise ArgumentError("second must be one track of the same period of the angle")
        if self.covariance is not None:
            rows = np.asarray(self.covariance, dtype=np.float64)
            if rows.shape != (len(CONSTANTS),) * 2 or not np.isfinite(rows).all():
                raise ArgumentError(
                    f"covariance must be {len(CONSTANTS)} x {len(CONSTANTS)} finite numbers, got "
                    f"shape {rows.shape}"
                )
            put(self, "covariance", tuple(map(tuple, rows.tolist())))

    @classmethod
    def of_amplitudes(
        cls, offset: complex, cosine: complex, sine: complex, **fields: Any
    ) -> Channels:
        """Of ``Re(offset + cosine exp(i φ))`` and ``Im(offset + sine exp(i φ))``.

        The phase is counted from where the cosine is at its top.
        """
        return cls(
            offset_sine=offset.imag,
            offset_cosine=offset.real,
            amplitude=abs(cosine),
            gain_ratio=abs(sine) / abs(cosine),
            phase_deg=math.degrees(cmath.phase(sine / cosine)),
            **fields,
        )

    @cached_property
    def constants(self) -> tuple[float, float, float, float, float, float]:
        """What the core decodes by: offsets, inverse amplitudes, slope, unit of the angle."""
        phase = math.radians(self.phase_deg)
        along = self.amplitude * self.gain_ratio * math.cos(phase)
        return (
            self.offset_cosine,
            self.offset_sine,
            1.0 / self.amplitude,
            1.0 / along,
            math.tan(phase),
            self.direction * self.period / (2.0 * math.pi * self.periods_per_turn),
        )

    @cached_property
    def _decoder(self) -> _core.Decoder:
        return _core.Decoder(self.constants)

    def off(self, sine: Array, cosine: Array) -> tuple[list[float], int | None]:
        """Sums of how readings are off the curve, and the first dropout (`_core.Decoder.off`)."""
        pair = (np.ascontiguousarray(v, dtype=np.float64) for v in (sine, cosine))
        return self._decoder.off(*pair)

    @property
    def offset(self) -> complex:
        """``z_0``, relative to the fundamental."""
        return complex(self.offset_cosine, self.offset_sine) / abs(self.fundamental)

    @property
    def fundamental(self) -> complex:
        """``z_1`` of ``cosine + i sine``."""
        return self._first(1.0)

    @property
    def image(self) -> complex:
        """``z_(-1)`` relative to the fundamental: what gain and phase make."""
        z1 = self._first(1.0)
        return self._first(-1.0) * z1 / abs(z1) ** 2

    def _first(self, sign: float) -> complex:
        sine = self.gain_ratio * cmath.exp(1j * math.radians(self.phase_deg) * sign)
        return 0.5 * self.amplitude * (1.0 + sign * sine)

    @property
    def roles(self) -> tuple[str, ...]:
        """Roles of the columns that are decoded."""
        if self.excitation_deg is not None:
            return ("sine", "cosine", "excitation")
        return ("sine", "cosine") if self.second is None else TRACKS

    def demodulated(self, sine: Array, cosine: Array, excitation: Array) -> tuple[Array, Array]:
        """Sine and cosine over the excitation, for every reading those of its period.

        Raises
        ------
        ArgumentError
            No periods of four readings and more.
        """
        e, y, x = (np.ascontiguousarray(v, dtype=np.float64) for v in (excitation, sine, cosine))
        found = _core.demodulate(e, y, x, math.radians(self.excitation_deg or 0.0))
        if found is None:
            raise ArgumentError("the excitation has no periods of 4 readings and more")
        counts = np.diff(found[0]).astype(np.intp)
        return np.repeat(found[1], counts), np.repeat(found[2], counts)

    def angle(self, sine: ArrayLike, cosine: ArrayLike, *second: ArrayLike) -> Array:
        """The angle by offsets, gain and phase, harmonics not yet corrected.

        In ``(-period / 2, period / 2] / periods_per_turn``, with sine and cosine of a second track
        in a whole turn; NaN for what is not finite.
        """
        plain = _elementwise(self._decoder.angles, sine, cosine)
        if not second:
            return plain
        turn, periods = self.period, self.periods_per_turn
        fine = self._corrected(plain.copy())
        number, _ = self._chosen(fine, *second)
        absolute = fine + number * (turn / periods)
        # The period is that of the corrected angle: the plain one may be beyond its end.
        angle = plain + np.rint((absolute - plain) * (periods / turn)) * (turn / periods)
        return np.asarray(angle - turn * np.ceil(angle / turn - 0.5))

    def unwrapped(self, sine: Array, cosine: Array) -> Array:
        """The same from reading to reading, without jumps of a period."""
        return np.unwrap(self.angle(sine, cosine), period=self.period / self.periods_per_turn)

    def angle_of(self, *readings: float) -> float:
        """The same of one reading."""
        return float(self.angle(*readings))

    def mismatch(
        self, sine: ArrayLike, cosine: ArrayLike, sine2: ArrayLike, cosine2: ArrayLike
    ) -> Array:
        """How far two tracks are off agreeing on a period, in periods: beyond 0.5 it is wrong."""
        plain = _elementwise(self._decoder.angles, sine, cosine)
        return self._chosen(self._corrected(plain), sine2, cosine2)[1]

    def _chosen(self, fine: Array, sine2: ArrayLike, cosine2: ArrayLike) -> tuple[Array, Array]:
        """Number of the period by the second track, and the mismatch.

        ::

            (p1 (ψ2 - δ) - p2 ψ1) / 2 pi = p2 k  (mod p1)
        """
        assert self.second is not None
        first, other = self.periods_per_turn, self.second.periods_per_turn
        coarse = np.asarray(self.second.correct(sine2, cosine2)) / self.period
        zero = self.second_zero_deg / 360.0
        steps = first * (other * coarse - zero) - other * first * fine / self.period
        whole = np.rint(steps)
        return np.mod(whole * pow(other, -1, first), first), np.asarray(steps - whole)

    def _corrected(self, angle: Array) -> Array:
        series = self._series
        return angle if series is None else np.asarray(series.correct(angle, out=angle))

    def correct(self, sine: ArrayLike, cosine: ArrayLike, *second: ArrayLike) -> Any:
        """The angle by offsets, gain, phase and harmonics.

        Parameters
        ----------
        sine, cosine : array_like
            Readings of the channels, of one shape.
        *second : array_like
            Sine and cosine of the second track, where there is one.

        Returns
        -------
        float or ndarray
            In the unit of ``period``, within half a period of the channels about zero, with a
            second track within half a turn.
        """
        corrected = self._corrected(self.angle(sine, cosine, *second))
        return float(corrected) if corrected.ndim == 0 else corrected

    @cached_property
    def _series(self) -> _core.Series | None:
        orders, cosine, sine = self.error_harmonics()
        if not orders:
            return None
        cycles = float(self.periods_per_turn)
        return _core.Series(self.period, 0.0, [cycles], [orders], [cosine], [sine], "reference")

    def curve(self, phase: Array) -> tuple[Array, Array]:
        """Sine and cosine channel at phases of the fundamental, with their harmonics."""
        z1 = self.fundamental
        turn, size = cmath.phase(z1), abs(z1)
        z = (
            complex(self.offset_cosine, self.offset_sine)
            + z1 * np.exp(1j * phase)
            + self._first(-1.0) * np.exp(-1j * phase)
        )
        for k, re, im, _ in self.harmonics:
            z = z + size * complex(re, im) * np.exp(1j * k * (phase + turn))
        return z.imag.copy(), z.real.copy()

    def error_series(self) -> NDArray[np.complex128]:
        """Error that the harmonics leave in `angle`: amplitudes of the orders from 1, radians.

        ::

            error = sum_k Re(e_k exp(i k φ))

        Of the curve itself, to all orders of the harmonics.
        """
        phase = 2.0 * math.pi * np.arange(_SAMPLES) / _SAMPLES
        found = self.angle(*self.curve(phase)) / self.constants[-1]
        error = wrap(found - phase, 2.0 * math.pi)
        # Counted from where the error's mean is zero: the zero of the angle is free.
        turned = np.exp(-1j * np.arange(1, _HIGHEST + 1) * error.mean())
        return np.asarray(np.fft.rfft(error)[1 : _HIGHEST + 1] * turned * (2.0 / _SAMPLES))

    def error_harmonics(self) -> tuple[list[int], list[float], list[float]]:
        """The same as a correction: orders of the channels' period, cosine, sine by the angle.

        In the unit of ``period``.
        """
        if not self.harmonics:
            return [], [], []
        # Orders far below the standard error of the harmonics cost time and correct nothing.
        # Amplitudes, radians, that no double angle resolves; those below a tenth of a standard
        # error are not corrected.
        least = max(1e-12, 0.1 * max(h.std for h in self.harmonics))
        found = self.error_series()
        kept = np.flatnonzero(np.abs(found) > least)
        # The angle falls with the phase where the direction is -1.
        part = self.constants[-1] * found[kept]
        sine = -self.direction * part.imag
        return (kept + 1).tolist(), part.real.tolist(), sine.tolist()

    def replace(self, **changes: Any) -> Channels:
        """A copy with some fields changed, checked again."""
        return replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Each constant with its standard error: ``{"value", "std"}``."""
        cov = np.zeros((5, 5)) if self.covariance is None else np.asarray(self.covariance)
        stds = dict(zip(CONSTANTS, np.sqrt(np.diag(cov)).tolist(), strict=True))
        rows = self.to_table()
        del rows["covariance"]
        for name in (*CONSTANTS, "direction", "periods_per_turn"):
            rows[name] = {"value": rows[name], "std": stds.get(name, 0.0)}
        size = abs(self.fundamental)
        for name in ("offset_sine", "offset_cosine"):
            rows[f"{name}_relative"] = {key: value / size for key, value in rows[name].items()}
        if self.second is not None:
            rows["second"] = self.second.to_dict()
        return rows

    def constant_lines(self) -> list[str]:
        """The constants with their standard errors, as lines of a summary."""
        rows = self.to_dict()
        names = {
            "offset_sine": "offset of the sine",
            "offset_cosine": "offset of the cosine",
            "amplitude": "amplitude of the cosine",
            "gain_ratio": "gain, sine over cosine",
            "phase_deg": "phase error, deg",
        }
        lines = [f"{'channels':24s} {'value':>12s} {'+-':>10s}"]
        for name, words in names.items():
            value, std = ErrorUnit("", 1.0).pair(*rows[name].values())
            lines.append(f"{words:24s} {value:>12s} {std:>10s}")
        lines += [
            f"harmonic {h.order:<15d} {abs(complex(h.re, h.im)):12.5f} {h.std:10.2g}"
            for h in self.harmonics
        ]
        if self.excitation_deg is not None:
            lines.append(f"{'phase to the excitation, deg':24s} {self.excitation_deg:8.3f}")
        if self.second is not None:
            lines += ["second track", *self.second.constant_lines()[1:]]
        return lines

    def to_table(self) -> dict[str, Any]:
        """The object that a model file holds."""
        second = {}
        if self.second is not None:
            zero = self.second_zero_deg
            second = {"second": self.second.to_table(), "second_zero_deg": zero}
        if self.excitation_deg is not None:
            second["excitation_deg"] = self.excitation_deg
        return {
            **{name: getattr(self, name) for name in CONSTANTS},
            "direction": self.direction,
            "periods_per_turn": self.periods_per_turn,
            "harmonics": [h._asdict() for h in self.harmonics],
            "covariance": None if self.covariance is None else [*map(list, self.covariance)],
            **second,
        }

    @classmethod
    def from_table(cls, table: Mapping[str, Any], period: float) -> Channels:
        """From what `to_table` made."""
        entries = dict(table)
        entries["harmonics"] = tuple(ChannelHarmonic(**h) for h in entries.get("harmonics", ()))
        if entries.get("second") is not None:
            entries["second"] = cls.from_table(entries["second"], period)
        return cls(period=period, **entries)


def checked_periods(value: Any) -> int:
    """A number of periods in a turn, checked.

    Raises
    ------
    ArgumentError
    """
    try:
        whole = int(value)
    except (TypeError, ValueError, OverflowError):
        whole = 0
    if whole != value or not 1 <= whole <= MOST_PERIODS:
        raise ArgumentError(
            f"periods_per_turn must be a whole number from 1 to {MOST_PERIODS}, got {value!r}"
        )
    return whole


def checked_track_periods(value: Any) -> tuple[int, ...]:
    """Periods in a turn of one track or of two, checked.

    Raises
    ------
    ArgumentError
    """
    periods = tuple(map(checked_periods, value if isinstance(value, tuple | list) else (value,)))
    if len(periods) not in (1, 2) or (len(periods) == 2 and math.gcd(*periods) > 1):
        raise ArgumentError(
            f"periods_per_turn must be one number or two without a common divisor, got {value!r}"
        )
    return periods


def _elementwise(angles: Any, sine: ArrayLike, cosine: ArrayLike) -> Array:
    try:
        y, x = (np.asarray(values, dtype=np.float64) for values in (sine, cosine))
    except (TypeError, ValueError) as cause:
        raise ArgumentError(f"sine and cosine must be numbers: {cause}") from None
    if y.shape != x.shape:
        raise ArgumentError(f"sine and cosine must have one shape, got {y.shape} and {x.shape}")
    return np.asarray(angles(y.reshape(-1), x.reshape(-1))).reshape(y.shape)
