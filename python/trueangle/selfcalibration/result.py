"""What a self-calibration found: orders estimated, what is blind, patterns held out; as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import counted, laid_out, order_ranges, wrapped_lines
from ..support.plainresult import PlainResult, plain_fields
from .channelcauses import ChannelDiagnosis

#: Seconds of arc in a radian.
ARCSEC = ARCSEC_PER_TURN / (2.0 * math.pi)


@dataclass(frozen=True)
class OrderEstimate:
    """One order: ``cosine``, ``sine`` and their standard error in arcsec."""

    order: float
    cosine: float
    sine: float
    std: float
    """Standard error of the amplitude (and of the sine along it), arcsec."""
    retained: float
    """Share of the order that motion and other unknowns leave: 1 all, 0 none."""
    std_factor: float
    """Standard error over the limit of white noise with the true angle known."""
    of: str = "the encoder"
    """Where the error comes from: one source, or several that cannot be separated."""

    @property
    def amplitude(self) -> float:
        """``C = hypot(A, B)`` in arcsec."""
        return math.hypot(self.cosine, self.sine)

    @property
    def phase_deg(self) -> float:
        """``phi = atan2(A, B)`` in degrees from 0: the term is ``C sin(k x + phi)``."""
        return math.degrees(math.atan2(self.cosine, self.sine)) % 360.0

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        sizes = "amplitude_arcsec=amplitude phase_deg std_arcsec=std retained std_factor of"
        return plain_fields(self, f"order {sizes}") | {"order": _whole(self.order)}


def _whole(order: float) -> float:
    return int(order) if float(order).is_integer() else order


@dataclass(frozen=True)
class Blind:
    """Orders that cannot be given as the encoder's, why, and what would show them."""

    orders: tuple[float, ...]
    because: str
    measure: str

    @classmethod
    def zero(cls, because: str) -> Blind:
        """The zero, which only a mark shows."""
        return cls((0.0,), because, "set the zero at a mark or an index pulse")

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return plain_fields(self, "orders because measure") | {
            "orders": [*map(_whole, self.orders)]
        }


@dataclass(frozen=True)
class HeldOutPattern:
    """A pattern found on one part of the readings, judged on another."""

    fitted_on: str
    judged_on: str
    rms_before: float
    rms_after: float
    """Error of single readings on the part held out, arcsec, noise included."""
    p: float
    """Probability of so great a difference between the two patterns by noise alone."""

    @property
    def agrees(self) -> bool:
        """Whether noise alone makes this difference in one case of a thousand."""
        return self.p > 0.001

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        rms = "rms_before_arcsec=rms_before rms_after_arcsec=rms_after"
        return plain_fields(self, f"fitted_on judged_on {rms} p agrees")


@dataclass(frozen=True)
class SelfCalibration(PlainResult):
    """Result of `trueangle.selfcal`.

    Attributes
    ----------
    method : str
        ``"spin-down"``, ``"heads"``, ``"shifts"``, ``"dual"`` or ``"channels"``.
    model : HarmonicModel
        Of what may be corrected; its record states that there was no reference.
    orders : tuple of OrderEstimate
        Numbers that are given, each with the name of what it is.
    sums : tuple of OrderEstimate
        Numbers that are not the encoder's alone, with all names.
    blind : tuple of Blind
    held_out : dict of str to HeldOut
        ``"odd_even_turns"``, ``"speeds"``, ``"directions"`` and the like.
    notes : tuple of str
    noise_arcsec : float
        Standard deviation of one reading about the fit.
    readings : int
    turns : float
    beside : dict
        What was fitted jointly: ripple, reversal error, head angles, facets and others.
    coverage_deg : float, optional
        Of channels: how much of their period the readings cover.
    limit_arcsec : float, optional
        Of channels: standard deviation of the angle by that of their constants (Cramer-Rao).
    diagnosis : ChannelDiagnosis, optional
        Of channels: causes of the error of their angle.
    """

    method: str
    model: HarmonicModel
    orders: tuple[OrderEstimate, ...]
    sums: tuple[OrderEstimate, ...]
    blind: tuple[Blind, ...]
    held_out: Mapping[str, HeldOutPattern]
    notes: tuple[str, ...]
    noise_arcsec: float
    readings: int
    turns: float
    beside: Mapping[str, Any] = field(default_factory=dict)
    coverage_deg: float | None = None
    limit_arcsec: float | None = None
    diagnosis: ChannelDiagnosis | None = None

    def to_dict(self) -> dict[str, Any]:
        """The result as plain values, angles in arcsec."""
        return {
            "method": self.method,
            "calibrated_without_reference": True,
            **plain_fields(self, "orders sums blind held_out noise_arcsec readings turns beside"),
            **self._plain_channels(),
            "notes": list(self.notes),
        }

    @property
    def channels(self) -> Channels | None:
        """Constants of a sine and a cosine channel that the model decodes with."""
        return self.model.channels

    def _plain_channels(self) -> dict[str, Any]:
        if self.channels is None:
            return {}
        return {
            "channels": self.channels.to_dict(),
            "coverage_deg": self.coverage_deg,
            "limit_arcsec": self.limit_arcsec,
            "diagnosis": self.diagnosis and self.diagnosis.to_dict(),
        }

    def _brief(self) -> str:
        return (
            f"{self.method}, {counted(self.orders, 'order')} of {self.readings} readings, noise "
            f"{self.noise_arcsec:.3g} arcsec"
        )

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The result as text.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """
        return _summary(self, errors_in)


def order_estimates(
    orders: Sequence[float],
    coefficients: Array,
    covariance: Array,
    retained: Array,
    limit: float,
    of: Sequence[str] | str = "the encoder",
) -> list[OrderEstimate]:
    """Orders from cosine and sine in turn (radians), with their covariance.

    ``limit`` is the standard error of a coefficient in white noise with the true angle
    known, in radians.
    """
    found = []
    for i, order in enumerate(orders):
        pair = slice(2 * i, 2 * i + 2)
        a, b = (float(v) for v in coefficients[pair])
        block = covariance[pair, pair]
        size = math.hypot(a, b)
        along = np.array([a, b]) / size if size > 0.0 else np.array([1.0, 0.0])
        std = math.sqrt(max(float(along @ block @ along), 0.0))
        mean = math.sqrt(max(0.5 * float(np.trace(block)), 0.0))
        found.append(
            OrderEstimate(
                order=float(order),
                cosine=a * ARCSEC,
                sine=b * ARCSEC,
                std=std * ARCSEC,
                retained=float(np.min(retained[pair])),
                std_factor=mean / limit if limit > 0.0 else math.inf,
                of=of if isinstance(of, str) else of[i],
            )
        )
    return found


def blind_words(orders: Sequence[float]) -> str:
    """What is blind, in words: orders, or the zero."""
    return f"order{'s' * (len(orders) > 1)} {order_ranges(orders)}" if any(orders) else "zero"


def _summary(result: SelfCalibration, errors_in: ErrorsIn = "auto") -> str:
    """Numbers, what they are numbers of, what is blind, tests, notes."""
    sizes = [result.noise_arcsec, *(o.amplitude for o in (*result.orders, *result.sums))]
    largest = max(filter(math.isfinite, sizes), default=0.0)
    unit = error_unit(errors_in, largest, result.model.period)
    rms = math.sqrt(0.5) * math.hypot(*(o.amplitude for o in result.orders))
    answer = "" if result.channels else "NO CORRECTION: no order is due to the encoder alone; "
    answer = f"Encoder error {unit.text(rms)} rms; " if result.orders else answer
    # A part that another one predicts is reason enough: the notes allow for the others.
    failed = [] if any(t.agrees for t in result.held_out.values()) else [*result.held_out.values()]
    lines = [
        *(f"NOT CONFIRMED: {t.judged_on} disagrees with {t.fitted_on}." for t in failed[:1]),
        f"{answer}{result.method} without a reference: {result.readings} readings, "
        f"{result.turns:.1f} turns, noise {unit.text(result.noise_arcsec)}",
    ]
    if not result.orders and result.channels is None:
        lines += [f"What to do: {blind.measure}." for blind in result.blind if any(blind.orders)]
    if result.diagnosis is not None:
        lines += ["", *result.diagnosis.lines()]
    if result.channels is not None:
        lines += ["", *_constants(result, unit)]
    if result.orders:
        lines += ["", *_table(result.orders, unit)]
    if result.sums:
        lines += ["", "due to the encoder and another source:", *_table(result.sums, unit)]
    lines += ["", "not identifiable"]
    for blind in result.blind:
        lines += wrapped_lines(unit.spoken(f"{blind_words(blind.orders)}: {blind.because}"), 4, 2)
        lines += wrapped_lines(f"remedy: {blind.measure}", 6, 4)
    if result.held_out:
        lines += ["", "held out"]
        for test in result.held_out.values():
            verb = "predict" if test.fitted_on.endswith("s") else "predicts"
            agree = "agree" if test.agrees else "DISAGREE"
            lines.append(
                f"  {test.fitted_on} {verb} {test.judged_on}: {unit.number(test.rms_before)} -> "
                f"{unit.number(test.rms_after)} {unit.name} rms, they {agree} (p = {test.p:.2g})"
            )
    lines += [f"note: {note}" for note in result.notes]
    return laid_out(lines)


def _constants(result: SelfCalibration, unit: ErrorUnit) -> list[str]:
    """Constants of the channels with their standard errors, and how well they settle the angle."""
    assert result.channels is not None
    lines = result.channels.constant_lines()
    sense = "rises" if result.channels.direction > 0 else "falls"
    if result.limit_arcsec is not None and result.coverage_deg is not None:
        lines.append(
            f"standard error of the angle from these constants: {unit.text(result.limit_arcsec)}; "
            f"{result.coverage_deg:.0f} deg of the period covered; phase {sense} with the angle"
        )
    return lines


def _table(orders: tuple[OrderEstimate, ...], unit: ErrorUnit) -> list[str]:
    names = {o.of for o in orders} != {"the encoder"}
    lines = [
        f"   order  {f'amplitude/{unit.name}':>16}      +-  phase/deg  retained  factor"
        + ("  source" if names else "")
    ]
    for o in orders:
        size, std = unit.pair(o.amplitude, o.std)
        lines.append(
            f"{o.order:8g} {size:>17} {std:>7} {o.phase_deg:10.2f} {o.retained:9.3f} "
            f"{o.std_factor:7.2f}" + (f"  {o.of}" if names else "")
        )
    lines.append("retained: share that the motion does not hide; factor: standard error over that")
    return [*lines, "of readings with a reference"]
