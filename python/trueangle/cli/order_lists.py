"""Lists of orders on the command line."""

from __future__ import annotations

from ..errors import ArgumentError

__all__ = ["parse_orders"]


def parse_orders(text: str) -> tuple[float, ...]:
    """Orders of a list such as ``1-17,100,202``, ascending and without repeats.

    Examples
    --------
    >>> parse_orders("1-4,8,7.3")
    (1, 2, 3, 4, 7.3, 8)
    """
    found: set[float] = set()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        try:
            if dash:
                low, high = int(first), int(last)
                if low > high:
                    raise ValueError
                found.update(float(k) for k in range(low, high + 1))
            else:
                found.add(float(first))
        except ValueError:
            raise ArgumentError(
                f"orders must look like 1-17 or 1,4,8, got {part.strip()!r} in {text!r}"
            ) from None
    if not all(0.0 < k < 1e6 for k in found):
        raise ArgumentError(f"orders must be positive and below a million, got {text!r}")
    return tuple(int(k) if k.is_integer() else k for k in sorted(found))
