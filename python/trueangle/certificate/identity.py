"""identity.toml: what only the laboratory knows about a calibration."""

from __future__ import annotations

import datetime
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, Final

from ..errors import ArgumentError, FileError
from ..support.angles import ARCSEC_PER_DEG
from ..support.argumentkinds import told_kinds
from ..support.decoding import shown_value
from ..support.files import read_whole
from ..support.suggestions import check_choice, did_you_mean
from .budget import DISTRIBUTIONS, Contribution
from .conformity import RULES, Specification
from .language import LANGUAGES

#: Contributions at most.
_MOST_CONTRIBUTIONS: Final = 200

#: Entries of ``[certificate]`` that are text, with the words a certificate uses for them.
ENTRIES: Final[Mapping[str, str]] = {
    "number": "Certificate number",
    "item": "Item",
    "serial": "Serial number",
    "manufacturer": "Manufacturer",
    "customer": "Customer",
    "laboratory": "Laboratory",
    "operator": "Operator",
    "date": "Date of calibration",
    "procedure": "Procedure",
    "reference": "Reference",
    "reference_certificate": "Certificate of the reference",
    "place": "Place",
    "address": "Address of the laboratory",
}
_REQUIRED: Final = ("number", "item")

#: What a certificate is whole without.
_OPTIONAL: Final = ("address", "specification", "logo")

#: Names of a tolerance limit, and how many arcsec one of each is.
_LIMITS: Final[Mapping[str, float]] = {"limit_arcsec": 1.0, "limit_deg": ARCSEC_PER_DEG}

#: Kinds of pictures that the typesetter takes.
_LOGOS: Final = (".png", ".jpg", ".jpeg", ".svg")

_KEYS: Final = ("name", "type", "distribution", "half_width_arcsec", "standard_arcsec",
                "degrees_of_freedom")  # fmt: skip


@dataclass(frozen=True)
class Identity:
    """Who calibrated what, where and with which reference; empty text is "not stated".

    Attributes
    ----------
    number, item, serial, manufacturer, customer, laboratory, operator, date, procedure,
    reference, reference_certificate, place, address : str
        The address may have several lines.
    temperature_C : float or None
        Where it is not stated, that of the readings is, if it was recorded.
    contributions : tuple of Contribution
        Type B, in arcsec, each with sensitivity 1 at every position.
    specification : Specification or None
        What conformity is stated with.
    language : str
        Of the pages: one of `LANGUAGES`.
    logo : path or None
        Picture (PNG, JPEG or SVG) for the head of the first page; an identity file names it
        relative to itself.
    """

    number: str
    item: str
    serial: str = ""
    manufacturer: str = ""
    customer: str = ""
    laboratory: str = ""
    operator: str = ""
    date: str = ""
    procedure: str = ""
    reference: str = ""
    reference_certificate: str = ""
    place: str = ""
    temperature_C: float | None = None
    contributions: tuple[Contribution, ...] = ()
    address: str = ""
    specification: Specification | None = None
    language: str = "en"
    logo: str | None = None

    def __post_init__(self) -> None:
        check_choice("language", self.language, LANGUAGES)

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Names of the entries without a value."""
        return tuple(
            entry.name
            for entry in fields(self)
            if entry.name not in _OPTIONAL and getattr(self, entry.name) in ("", None)
        )


@told_kinds
def load_identity(path: str | PathLike[str]) -> Identity:
    """Read an identity file.

    Raises
    ------
    FileError
        Not TOML, an unknown entry, a value of the wrong kind; names the entry.
    OSError
        Nothing of this name, no permission.
    """
    # Largest identity file that is read; a real one has a few dozen lines.
    data = read_whole(path, 1 << 20, "an identity file")
    try:
        table = tomllib.loads(data.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as reason:
        raise FileError(path, f"not valid TOML: {reason}") from None
    except ValueError:  # whole numbers of thousands of digits
        raise FileError(path, "holds a number or date that cannot be read") from None
    try:
        found = _identity_from(table)
        if found.logo is None:
            return found
        logo = Path(path).parent / found.logo
        if logo.suffix.lower() not in _LOGOS or not logo.is_file():
            raise ArgumentError(
                f"[certificate] logo must name a picture in this file's folder "
                f"({', '.join(_LOGOS)}), got {found.logo!r}"
            )
        return replace(found, logo=str(logo))
    except ArgumentError as reason:
        raise FileError(path, str(reason)) from None


def _identity_from(table: Mapping[str, Any]) -> Identity:
    """Identity of a decoded file.

    Raises
    ------
    ArgumentError
        Names the entry at fault.
    """
    _known(table, ("certificate", "contribution", "specification"), "the file")
    said = table.get("certificate")
    if not isinstance(said, Mapping):
        raise ArgumentError("needs a table [certificate] with at least number and item")
    _known(said, (*ENTRIES, "temperature_C", "language", "logo"), "[certificate]")
    values: dict[str, Any] = {name: _text(name, said[name]) for name in ENTRIES if name in said}
    for name in _REQUIRED:
        if not values.get(name):
            raise ArgumentError(f"[certificate] needs {name}")
    if "language" in said:
        values["language"] = check_choice("[certificate] language", said["language"], LANGUAGES)
    if "logo" in said:
        values["logo"] = _text("logo", said["logo"])
    if "temperature_C" in said:
        values["temperature_C"] = _number("[certificate] temperature_C", said["temperature_C"])
    listed = table.get("contribution", [])
    if not isinstance(listed, list) or len(listed) > _MOST_CONTRIBUTIONS:
        raise ArgumentError(
            f"contributions must be tables [[contribution]], at most {_MOST_CONTRIBUTIONS}"
        )
    contributions = tuple(_contribution(i, entry) for i, entry in enumerate(listed, start=1))
    specification = _specification(table.get("specification"))
    return Identity(**values, contributions=contributions, specification=specification)


def _specification(entry: object) -> Specification | None:
    where = "[specification]"
    if entry is None:
        return None
    if not isinstance(entry, Mapping):
        raise ArgumentError(f"{where} must be a table")
    _known(entry, (*_LIMITS, "decision_rule"), where)
    named = [name for name in _LIMITS if name in entry]
    if len(named) != 1:
        raise ArgumentError(f"{where}: give either {' or '.join(_LIMITS)}")
    if "decision_rule" not in entry:
        raise ArgumentError(
            f'{where} needs decision_rule, agreed with the customer: "simple" or "guard_band"'
        )
    limit = _number(f"{where} {named[0]}", entry[named[0]]) * _LIMITS[named[0]]
    if not limit > 0.0:
        raise ArgumentError(f"{where}: {named[0]} must be positive, got {entry[named[0]]!r}")
    rule = check_choice(f"{where} decision_rule", entry["decision_rule"], RULES)
    return Specification(limit, rule)


def _contribution(position: int, entry: object) -> Contribution:
    where = f"[[contribution]] {position}"
    if not isinstance(entry, Mapping):
        raise ArgumentError(f"{where} must be a table")
    _known(entry, _KEYS, where)
    name = _text(f"{where} name", entry.get("name", ""))
    if not name:
        raise ArgumentError(f"{where} needs a name")
    where = f"{where} ({name})"
    kind = entry.get("type", "B")
    if kind != "B":
        raise ArgumentError(
            f'{where}: type must be "B", got {kind!r}: what the readings show (type A) is '
            "evaluated from them"
        )
    if ("half_width_arcsec" in entry) == ("standard_arcsec" in entry):
        raise ArgumentError(f"{where}: give either half_width_arcsec or standard_arcsec")
    if "half_width_arcsec" in entry and "distribution" not in entry:
        raise ArgumentError(
            f"{where}: half_width_arcsec needs a distribution, one of {', '.join(DISTRIBUTIONS)}"
        )
    distribution = entry.get("distribution", "normal")
    check_choice(f"{where}: distribution", distribution, DISTRIBUTIONS)
    if "standard_arcsec" in entry:
        standard = _number(f"{where} standard_arcsec", entry["standard_arcsec"])
    else:
        half = _number(f"{where} half_width_arcsec", entry["half_width_arcsec"])
        standard = half / DISTRIBUTIONS[str(distribution)]
    freedom = entry.get("degrees_of_freedom", math.inf)
    if freedom != math.inf:
        freedom = _number(f"{where} degrees_of_freedom", freedom)
    return Contribution(name, standard, "B", str(distribution), freedom)


def _known(table: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in names:
            raise ArgumentError(
                f"{where} has an unknown entry {key!r}; it may have "
                f"{', '.join(names)}{did_you_mean(key, names)}"
            )


def _text(name: str, value: object) -> str:
    if isinstance(value, datetime.date):
        return value.isoformat()
    if not isinstance(value, str):
        raise ArgumentError(f"{name} must be text in quotation marks, got {shown_value(value)}")
    return value.strip()


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ArgumentError(f"{name} must be a number, got {shown_value(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ArgumentError(f"{name} must be a finite number, got {value!r}")
    return number
