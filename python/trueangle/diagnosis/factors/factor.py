"""What the error follows: one factor, the size of its function, and the function with its band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...effects.curve import Curve
from ...support.arrays import Array
from ...support.display_units import ErrorUnit
from ...support.layout import order_ranges, run_name
from ...support.plainresult import PlainResult, plain_fields
from .group import PAIRS

#: Factors in words.
WORDS = {
    "place": "the place",
    "direction": "the direction",
    "direction_place": "the place, changing with the direction",
    "reversal_time": "the time since the last reversal or stop",
    "run_time": "the time in the run",
    "run": "the zero of the run",
    "run_place": "the place, changing with the run",
    "speed": "the speed",
    "speed_place": "the place, changing with the speed",
    "load": "the load",
    "load_sign": "the sign of the load",
    "load_place": "the place, changing with the load",
    "temperature": "the temperature",
    "temperature_place": "the place, changing with the temperature",
    "current": "the current",
    "current_place": "the place, changing with the current",
    "mount_place": "the place on the reference's mount",
    "step": "the step of the sensor",
    "frequency": "a line in time",
    "travel": "the travel in the run",
}
WORDS |= {f"{one}_{other}": f"{WORDS[one]}, changing with {WORDS[other]}" for one, other in PAIRS}

#: Orders that are listed, and decimals of those that are not whole.
LISTED, DECIMALS = 6, 2


@dataclass(frozen=True)
class FactorCurve:
    """A function of a factor with its 95 % band, arcsec.

    Attributes
    ----------
    at : ndarray, shape (g,)
        Values of the factor, in ``unit``.
    unit : str
    value, low, high : ndarray, shape (g,)
        Of a product with the place: of the amplitude of its orders; of a product of two factors: at
        the largest value of the first.
    """

    at: Array
    unit: str
    value: Array
    low: Array
    high: Array

    def to_dict(self) -> dict[str, Any]:
        """The entry ``curve``."""
        return plain_fields(self, "at unit value_arcsec=value low_arcsec=low high_arcsec=high")


@dataclass(frozen=True)
class Factor(PlainResult):
    """What measured minus simulated follows.

    Attributes
    ----------
    factor : str
        One of ``place``, ``direction``, ``speed`` ..., one of them with ``_place``: times a pattern
        of the angle, or two that act together, as ``direction_load``.
    shaft : str or None
        Whose place.
    orders : tuple of float or None
        Lines of the place, in cycles of a turn of the shaft.
    rms, low, high : float
        Of its function over the readings, arcsec, with its 95 % interval.
    share : float
        Of the variance of the readings, from 0 to 1.
    log_bayes_factor : float
        Natural logarithm, with the factor over without it.
    named_by : tuple of str
        Confirmed causes that are forms of this factor.
    not_distinguished_from : tuple of str
        Factors that are the same columns in these runs.
    curve : FactorCurve
    effects : list of Curve
        Its curves in a simulation; without parts that belong to one run only.
    jumps : tuple of (float, float)
        Where in a turn the function of the place jumps, degrees, and by how much, arcsec.
    events : tuple of (str, int)
        Labels of runs and their readings, from 0, at which something happened once.
    fitted : ndarray or None
        Its function at the readings of the account, arcsec.
    """

    factor: str
    shaft: str | None
    orders: tuple[float, ...] | None
    rms: float
    low: float
    high: float
    share: float
    log_bayes_factor: float
    named_by: tuple[str, ...]
    not_distinguished_from: tuple[str, ...]
    curve: FactorCurve = field(repr=False)
    effects: Sequence[Curve] = field(repr=False, default=())
    jumps: tuple[tuple[float, float], ...] = ()
    events: tuple[tuple[str, int], ...] = ()
    fitted: Array | None = field(repr=False, default=None)

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``factors``."""
        sizes = "rms_arcsec=rms low_arcsec=low high_arcsec=high share log_bayes_factor"
        return plain_fields(
            self, f"factor shaft orders {sizes} named_by not_distinguished_from curve"
        )

    @property
    def followed(self) -> str:
        """What is followed, in words: the factor, and those that are the same in these runs."""
        times = "the place, changing with "
        travelled = (self.factor, self.curve.unit) == ("reversal_time", "deg")
        first = "the travel since the last reversal" if travelled else WORDS[self.factor]
        words = [first, *(WORDS[other] for other in self.not_distinguished_from)]
        products = [word.removeprefix(times) for word in words if word.startswith(times)]
        single = [word for word in words if not word.startswith(times)]
        return " or ".join([*single, *([times + " or ".join(products)] if products else [])])

    @property
    def status(self) -> str:
        """What is known of it without a name: which files contain it."""
        if any(not effect.not_at_run_time for effect in self.effects):
            return "Cause not determined; the correction model contains it"
        also = "but the extended simulation does" if self.effects else "nor the extended simulation"
        return f"Cause not determined; the correction model does not contain it, {also}"

    def size(self, unit: ErrorUnit) -> str:
        """Where it is and how large, with its 95 % interval."""
        n, where = unit.number, []
        if self.orders:
            of = "" if self.shaft in (None, "output") else f" of the {self.shaft}"
            each = order_ranges([*{round(m, DECIMALS) for m in self.orders}]).split(", ")
            shown = ", ".join(each[:LISTED]) + " ..." * (len(each) > LISTED) + of.replace("_", " ")
            where.append(f"order{'s' * (len(self.orders) > 1)} {shown}")
        where += [f"a jump of {n(size)} {unit.name} at {at:.1f} deg" for at, size in self.jumps]
        for run in dict.fromkeys(run for run, _ in self.events):
            rows = [f"{row + 1}" for label, row in self.events if label == run]
            s = "s" * (len(rows) > 1)
            where.append(f"event{s} at reading{s} {', '.join(rows)} of {run_name(run)}")
        range_ = f"95 %: {n(self.low)} to" if self.low else "at most"
        return ", ".join([*where, f"{n(self.rms)} {unit.name} rms ({range_} {n(self.high)})"])

    def _brief(self) -> str:
        return f"{self.factor}, {self.rms:.3g} arcsec rms, {', '.join(self.named_by) or 'no name'}"
