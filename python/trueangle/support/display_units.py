"""Units that errors are shown in, and numbers rounded to digits or to their uncertainty.

Results keep errors in arcsec, or in the unit of their period; a summary chooses one unit for
all that it prints, so that its numbers can be compared.
"""

from __future__ import annotations

import math
import re
from typing import Final, NamedTuple, TypeAlias

from ..errors import ArgumentError
from .suggestions import check_choice

#: Units that can be requested by name; a number gives the counts of a turn.
ERROR_UNITS: Final = ("auto", "arcsec", "deg", "mrad", "count")

ErrorsIn: TypeAlias = str | float

#: Size of errors in arcsec from which on a summary is in degrees: one of them.
LARGE: Final = 3600.0

#: Digits of an uncertainty (GUM 7.2.6), and of a number that has none.
_UNCERTAIN_DIGITS: Final = 2
_DIGITS: Final = 4

#: A size in a sentence.
_SIZE: Final = r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?) arcsec\b"


ARCSEC_PER_DEG: Final = 3600.0
ARCSEC_PER_TURN: Final = 360.0 * ARCSEC_PER_DEG

#: Units by the suffix of a column name. Counts have no fixed period.
UNIT_PERIODS: Final = {"deg": 360.0, "rad": 2.0 * math.pi, "turn": 1.0}


class ErrorUnit(NamedTuple):
    """A unit, and its number in one second of arc.

    Examples
    --------
    >>> degrees = error_unit("auto", largest=7228.0)
    >>> degrees.text(7228.0, 3.1)
    '2.00778 +- 0.00086 deg'
    >>> error_unit("arcsec").pair(180.0583, 0.1561)
    ('180.06', '0.16')
    """

    name: str
    per_arcsec: float

    def number(self, arcsec: float, std: float | None = None) -> str:
        """An error to the digits that its standard deviation leaves; without one, to four."""
        return self.pair(arcsec, std)[0]

    def pair(self, arcsec: float, std: float | None) -> tuple[str, str]:
        """The number and its standard deviation (two digits), with equal decimals."""
        value = arcsec * self.per_arcsec
        spread = math.nan if std is None else std * self.per_arcsec
        if not (math.isfinite(spread) and spread > 0.0):
            return significant_digits(value, _DIGITS), "-"
        decimals = _decimals(spread, _UNCERTAIN_DIGITS)
        return _fixed(value, decimals), _fixed(spread, decimals)

    def text(self, arcsec: float, std: float | None = None) -> str:
        """The number, its standard deviation where there is one, and the unit."""
        value, spread = self.pair(arcsec, std)
        return f"{value} {self.name}" if spread == "-" else f"{value} +- {spread} {self.name}"

    def decimals(self, arcsec: float, digits: int = _UNCERTAIN_DIGITS) -> int:
        """Decimals that show ``digits`` digits of an error; none where it is zero or unknown.

        Examples
        --------
        >>> error_unit("deg").decimals(36.0), error_unit("arcsec").decimals(36.0)
        (3, 0)
        """
        value = arcsec * self.per_arcsec
        return _decimals(value, digits) if value and math.isfinite(value) else 0

    def spoken(self, sentence: str) -> str:
        """A sentence with its sizes, written in arcsec, in this unit and to as many digits.

        Examples
        --------
        >>> error_unit("deg").spoken("strongest at order 4, about 26000 arcsec")
        'strongest at order 4, about 7.2 deg'
        """
        if self.name == "arcsec":
            return sentence
        return re.sub(_SIZE, lambda found: f"{self._converted(found[1])} {self.name}", sentence)

    def _converted(self, number: str) -> str:
        written = number.partition("e")[0].replace(".", "").lstrip("-0").rstrip("0")
        digits = max(len(written), _UNCERTAIN_DIGITS)
        return significant_digits(float(number) * self.per_arcsec, digits)


def error_unit(
    asked: ErrorsIn = "auto", largest: float = 0.0, period: float | None = None
) -> ErrorUnit:
    """The requested unit; by default arcsec, or degrees where errors are that large.

    Parameters
    ----------
    asked : str or float
        One of `ERROR_UNITS`, or the counts of a turn.
    largest : float
        How large the errors are, arcsec; it decides ``"auto"``. Of readings it is `sine_of_rms`:
        then all results of the same readings are in one unit, and no outlier decides.
    period : float, optional
        Of the readings: the counts of a turn where they are in counts.

    Raises
    ------
    ArgumentError
        Another word; counts where the counts of a turn are unknown.

    Examples
    --------
    >>> error_unit(65536).text(1296000.0 / 65536)
    '1.000 count'
    """
    if not isinstance(asked, str):
        if not (math.isfinite(asked) and asked > 0.0):
            raise ArgumentError(f"errors_in: counts per turn must be positive, got {asked!r}")
        return ErrorUnit("count", asked / ARCSEC_PER_TURN)
    if asked == "auto":
        asked = "deg" if largest >= LARGE else "arcsec"
    if asked == "count":
        if period is None or period in UNIT_PERIODS.values():
            raise ArgumentError(
                "errors in counts need the counts of a turn: give `counts_per_turn=N`, "
                "or `errors_in=N` for a summary"
            )
        return ErrorUnit("count", period / ARCSEC_PER_TURN)
    turns = {"arcsec": ARCSEC_PER_TURN, "deg": 360.0, "mrad": 2000.0 * math.pi}
    if asked not in turns:
        check_choice("errors_in", asked, ERROR_UNITS)
    return ErrorUnit(asked, turns[asked] / ARCSEC_PER_TURN)


def sine_of_rms(rms: float) -> float:
    """Amplitude of the sine that has this rms, ``√2 rms``; 0 if unknown.

    Examples
    --------
    >>> round(sine_of_rms(100.0), 1), sine_of_rms(math.nan)
    (141.4, 0.0)
    """
    return math.sqrt(2.0) * rms if math.isfinite(rms) else 0.0


def rms_text(rms: float, period: float) -> str:
    """An rms in the unit of ``period``, in the unit that suits it.

    Examples
    --------
    >>> rms_text(0.01, 360.0)
    '36.00 arcsec rms'
    """
    size = rms * (ARCSEC_PER_TURN / period)
    return f"{error_unit('auto', sine_of_rms(size), period).text(size)} rms"


def rounded_phase(phase_deg: float, std_deg: float | None) -> tuple[str, str]:
    """A phase in [0, 360) deg and its standard deviation, to the digits that it leaves.

    Examples
    --------
    >>> rounded_phase(-0.001, 0.14), rounded_phase(-95.72, 0.7514)
    (('0.00', '0.14'), ('264.28', '0.75'))
    """
    spread = math.nan if std_deg is None else min(std_deg, 180.0)
    known = spread > 0.0
    decimals = _decimals(spread, _UNCERTAIN_DIGITS) if known else 2
    shown = _fixed(round(phase_deg % 360.0, decimals) % 360.0, decimals)
    return shown, _fixed(spread, decimals) if known else "-"


def significant_digits(value: float, digits: int = _DIGITS) -> str:
    """``value`` with ``digits`` significant digits, written without an exponent.

    Examples
    --------
    >>> [significant_digits(value) for value in (0.012345, 123456.0, 0.0, 9.9996)]
    ['0.01235', '123456', '0', '10.00']
    """
    if not math.isfinite(value):
        return "-"
    return _fixed(value, _decimals(value, digits)) if value else "0"


def brief_number(value: float) -> str:
    """``value`` with two significant digits, or all before the point: for sentences.

    Examples
    --------
    >>> brief_number(0.301), brief_number(7.25), brief_number(103.6)
    ('0.3', '7.2', '104')
    """
    return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.0f}"


def _decimals(value: float, digits: int) -> int:
    """Decimals that show ``digits`` significant digits of the rounded value."""
    exponent = int(f"{abs(value):.{digits - 1}e}".partition("e")[2])
    # Decimals are kept this far; beyond it a double has none.
    return min(max(0, digits - 1 - exponent), 12)


def _fixed(value: float, decimals: int) -> str:
    if not math.isfinite(value):
        return "-"
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if not float(text) else text
