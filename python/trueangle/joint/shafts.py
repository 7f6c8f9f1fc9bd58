"""The shafts of a joint: turns per output turn, their harmonics, their orders."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Final, NamedTuple, TypeVar

import numpy as np

from ..errors import ArgumentError
from ..joint import FIXED_MEMBERS as FIXED_MEMBERS
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.suggestions import check_choice

T = TypeVar("T")

#: Orders that are looked at together, at most: the core's limit of one fit.
MOST_ORDERS: Final = 4096

#: Turns of the wave generator against the output member, less those of the motor.
_WAVE_GENERATOR = {"circular_spline": 1.0, "flexspline": -1.0}


@told_kinds
@dataclass(frozen=True)
class Shaft:
    """Harmonics of one shaft: order ``k`` is the output order ``k * cycles_per_turn``.

    Parameters
    ----------
    name : str
        ``"output"``, ``"motor"``, ``"wave_generator"`` or another name.
    cycles_per_turn : float
        Turns of the shaft per output turn; any positive real.
    orders : iterable of int
        Whole numbers from 1, increasing.
    cosine, sine : iterable of float
        ``A_k`` and ``B_k``, in the unit of the model's period.
    """

    name: str
    cycles_per_turn: float
    orders: tuple[int, ...]
    cosine: tuple[float, ...]
    sine: tuple[float, ...]

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "cycles_per_turn", float(self.cycles_per_turn))
        put(self, "orders", tuple(int(k) for k in self.orders))
        put(self, "cosine", tuple(float(a) for a in self.cosine))
        put(self, "sine", tuple(float(b) for b in self.sine))

    @property
    def amplitudes(self) -> Array:
        """``C_k = hypot(A_k, B_k)``."""
        return np.hypot(self.cosine, self.sine)

    @property
    def phases(self) -> Array:
        """``phi_k = atan2(A_k, B_k)`` in radians: the term is ``C sin(k x + phi)``."""
        return np.arctan2(self.cosine, self.sine)


class ShaftOrders(NamedTuple):
    """Orders of one shaft."""

    name: str
    cycles_per_turn: float
    orders: tuple[int, ...]


def shaft_cycles(
    gear_ratio: float | None, fixed_member: str = "circular_spline"
) -> dict[str, float]:
    """Turns per output turn of the shafts that a gear ratio makes known.

    The output turns once, the motor ``gear_ratio`` times, the wave generator against the
    output member ``gear_ratio + 1`` times when the circular spline is fixed and
    ``gear_ratio - 1`` times when the flexspline is. ``gear_ratio`` is motor turns per
    output turn in either case, negative where the motor turns the other way: cycles are counts
    and have no sign.

    Examples
    --------
    >>> shaft_cycles(100.0)
    {'output': 1.0, 'motor': 100.0, 'wave_generator': 101.0}
    """
    check_choice("fixed_member", fixed_member, FIXED_MEMBERS)
    cycles = {"output": 1.0}
    if gear_ratio is not None:
        if not 0.0 < abs(gear_ratio) < float("inf"):
            raise ArgumentError(
                "gear_ratio must be motor turns per output turn, finite and not 0, got "
                f"{gear_ratio!r}"
            )
        cycles["motor"] = abs(float(gear_ratio))
        if fixed_member != "none":
            generator = cycles["motor"] + _WAVE_GENERATOR[fixed_member]
            if generator <= 0.0:
                raise ArgumentError(
                    "gear_ratio must be above 1 where the flexspline is fixed (the wave generator "
                    f"turns gear_ratio - 1 times), got {gear_ratio!r}"
                )
            cycles["wave_generator"] = generator
    return cycles


def limited_orders(orders: Iterable[T], what: str = "orders") -> list[T]:
    """Orders as a list, at most `MOST_ORDERS` of them; more are refused before they are made.

    Examples
    --------
    >>> limited_orders(range(1, 4))
    [1, 2, 3]
    >>> limited_orders(range(1, 10**9))
    Traceback (most recent call last):
    ...
    trueangle.errors.ArgumentError: orders are too many: 4096 at a time, at most
    """
    found = list(islice(orders, MOST_ORDERS + 1))
    if len(found) > MOST_ORDERS:
        raise ArgumentError(f"{what} are too many: {MOST_ORDERS} at a time, at most")
    return found


def resolve_orders(
    orders: Iterable[float] | Mapping[str, Iterable[float]],
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
) -> list[ShaftOrders]:
    """Shafts and their sorted orders; plain orders belong to the output.

    Raises
    ------
    ArgumentError
        A shaft of unknown speed, an order that is not a whole number from 1.
    """
    cycles = shaft_cycles(gear_ratio, fixed_member)
    if shafts:
        cycles |= shafts
    by_shaft = orders if isinstance(orders, Mapping) else {"output": orders}
    wanted = []
    for name, asked in by_shaft.items():
        if not isinstance(asked, Iterable):
            raise ArgumentError(
                f"orders of shaft {name!r} must be a list such as range(1, 18), got {asked!r}"
            )
        if name not in cycles:
            raise ArgumentError(
                f"how fast shaft {name!r} turns is not known: give `gear_ratio=`, or its "
                f"cycles per output turn as `shafts={{{name!r}: CYCLES}}`"
            )
        checked = {_order(k, name) for k in limited_orders(asked, f"orders of shaft {name!r}")}
        if checked:
            wanted.append(ShaftOrders(name, float(cycles[name]), tuple(sorted(checked))))
    return wanted


def _order(order: object, shaft: str) -> int:
    if type(order) is int and 1 <= order < 2**31:
        return order
    try:
        whole = int(order)  # type: ignore[call-overload]
        if whole == order and 1 <= whole < 2**31:
            return int(whole)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ArgumentError(f"orders of shaft {shaft!r} must be whole numbers from 1, got {order!r}")
