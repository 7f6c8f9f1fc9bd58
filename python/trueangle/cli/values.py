"""Values as they are typed: times, angles, arcs, turns, names, orders and shafts."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable, Mapping, Sequence

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean

#: Shafts that every joint may have.
SHAFTS = ("output", "motor", "wave_generator")

#: Seconds of a unit.
_SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "m": 60.0, "h": 3600.0}

_DURATION = r"(?P<number>[0-9.]+(?:[eE][+-]?[0-9]+)?) *(?P<unit>[a-zA-Z]*)"

#: Arcsec of a unit, the longer names first.
_ARCSEC = {"arcsec": 1.0, "arcmin": 60.0, "mrad": 648.0 / math.pi, "deg": 3600.0}


def seconds(text: str) -> float:
    """A time above zero, in seconds: ``10``, ``10s``, ``500ms``, ``2min``, ``1h``.

    Examples
    --------
    >>> seconds("2min"), seconds("10")
    (120.0, 10.0)
    """
    found = re.fullmatch(_DURATION, text.strip())
    try:
        value = float(found["number"]) * _SECONDS[found["unit"].lower()] if found else math.nan
    except (ValueError, KeyError):
        value = math.nan
    if not (value > 0.0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"a time above zero, as 10s, 2min or 1h, got {text!r}")
    return value


def track_periods(text: str) -> int | tuple[int, ...]:
    """Periods of one track, or of two: ``7``, ``32,31``."""
    try:
        found = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"a whole number, or two of them as 32,31, got {text!r}"
        ) from None
    return found if len(found) > 1 else found[0]


def turns(text: str) -> float:
    """``1turn``, ``5turns`` or ``0.5``."""
    number = text.strip().removesuffix("s").removesuffix("turn").strip()
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"turns above zero, as 1turn, got {text!r}")
    return value


def arc(text: str) -> tuple[float, float]:
    """``START:STOP`` in degrees."""
    start, colon, stop = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return float(start), float(stop)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an arc: START:STOP in degrees, such as 0:270"
        ) from None


def angle(text: str) -> float:
    """An angle in arcsec; ``arcsec``, ``arcmin``, ``deg`` or ``mrad`` may follow."""
    for unit, arcsec in _ARCSEC.items():
        if text.endswith(unit):
            number, scale = text.removesuffix(unit), arcsec
            break
    else:
        number, scale = text, 1.0
    try:
        return float(number) * scale
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an angle: a number and {', '.join(_ARCSEC)}, such as 2arcsec"
        ) from None


def names(text: str) -> list[str]:
    """``A,B`` as a list."""
    return [name.strip() for name in text.split(",") if name.strip()]


def parse_orders(text: str, option: str = "--orders") -> tuple[float, ...]:
    """Orders of a list such as ``1-17,100,202``, ascending and without repeats.

    Raises
    ------
    ArgumentError
        Something else: names ``option``.

    Examples
    --------
    >>> parse_orders("1-4,8,7.3")
    (1, 2, 3, 4, 7.3, 8)
    """
    from ..joint.shafts import limited_orders  # takes numpy, which a help does without

    found: list[float] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        try:
            if dash:
                low, high = int(first), int(last)
                if low > high:
                    raise ValueError
                found += limited_orders(range(low, high + 1), f"{option} {part.strip()}")
            else:
                found.append(float(first))
        except ArgumentError:
            raise
        except ValueError:
            where = f" in {text!r}" if part.strip() != text else ""
            raise ArgumentError(
                f"{option} must look like 1-17 or 1,4,8, got {part.strip()!r}{where}"
            ) from None
    if not all(0.0 < k < 1e6 for k in found):
        raise ArgumentError(f"{option} must be positive and below a million, got {text!r}")
    whole = (int(k) if float(k).is_integer() else k for k in sorted(set(found)))
    return tuple(limited_orders(whole, f"{option} {text!r:.60}"))


def orders_by_shaft(
    text: str, further: Iterable[str] = ()
) -> str | Sequence[float] | Mapping[str, Sequence[float]]:
    """``auto``, ``1-17``, ``1,4,8`` or ``output:1-3;motor:1,2`` as orders.

    ``further`` names shafts in addition to those of `SHAFTS`.

    Raises
    ------
    ArgumentError
        A list that is none, a shaft that is named twice or is none.

    Examples
    --------
    >>> orders_by_shaft("output:1-3;motor:2")
    {'output': (1, 2, 3), 'motor': (2,)}
    """
    if text == "auto":
        return text
    if ":" not in text:
        return parse_orders(text)
    known = [*SHAFTS, *further]
    by_shaft: dict[str, Sequence[float]] = {}
    for part in text.split(";"):
        name, _, orders = part.partition(":")
        shaft = name.strip()
        if shaft not in known:
            raise ArgumentError(
                f"--orders: there is no shaft {shaft!r}; the shafts are "
                f"{', '.join(known)}"
                + (did_you_mean(shaft, known) or f"; add --shaft {shaft}=CYCLES")
            )
        if shaft in by_shaft:
            raise ArgumentError(f"--orders names shaft {shaft!r} twice: {text!r}")
        by_shaft[shaft] = parse_orders(orders)
    return by_shaft


def declared_shafts(given: Sequence[str] | None) -> dict[str, float]:
    """Shafts of ``NAME=CYCLES``.

    Raises
    ------
    ArgumentError
        Something else, cycles that are not positive, a name twice.
    """
    found: dict[str, float] = {}
    for text in given or ():
        name, _, cycles = (part.strip() for part in text.partition("="))
        try:
            value = float(cycles)
        except ValueError:
            value = math.nan
        if not name or not 0.0 < value < 1e6 or name in found:
            raise ArgumentError(
                f"--shaft must look like worm=144, a name once and its turns per output turn, "
                f"got {text!r}"
            )
        found[name] = value
    return found
