"""Lists of orders on the command line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from ..errors import ArgumentError
from ..joint.shafts import counted_orders
from ..support.suggestions import did_you_mean

__all__ = ["SHAFTS", "declared_shafts", "orders_by_shaft", "parse_orders"]

#: Shafts that every joint may have.
SHAFTS = ("output", "motor", "wave_generator")


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
    found: list[float] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        try:
            if dash:
                low, high = int(first), int(last)
                if low > high:
                    raise ValueError
                found += counted_orders(range(low, high + 1), f"{option} {part.strip()}")
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
    return tuple(counted_orders(whole, f"{option} {text!r:.60}"))


def orders_by_shaft(
    text: str, further: Iterable[str] = ()
) -> str | Sequence[float] | Mapping[str, Sequence[float]]:
    """``auto``, ``1-17``, ``1,4,8`` or ``output:1-3;motor:1,2`` as orders.

    ``further`` names shafts beside those of `SHAFTS`.

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
                f"--orders: there is no shaft {shaft!r}{did_you_mean(shaft, known)}; "
                f"the shafts are {', '.join(known)}"
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
