"""Known lines of a joint: explanations of an order by its gear, harmonics and shafts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from ..joint import FIXED_MEMBERS
from ..support.argumentkinds import told_kinds
from ..support.suggestions import check_choice
from .shafts import shaft_cycles

#: Gear ratios of common strain wave gears, tried where none is declared.
COMMON_RATIOS: Final = (30, 50, 80, 100, 120, 160)

#: Low orders wanted by default: what 36 positions determine in addition to the constant.
HIGHEST_LOW_ORDER: Final = 17


class Explanation(NamedTuple):
    """One physical reading of an order: which line of the joint it may be.

    Attributes
    ----------
    order : int or float
        The order per output turn that the line has.
    name : str
        The line in a few words.
    gear_ratio : float or None
        The ratio for which this holds; None for lines of the output side.
    assumed : bool
        True when the ratio was not declared but is one of `COMMON_RATIOS`.
    """

    order: float
    name: str
    gear_ratio: float | None = None
    assumed: bool = False

    def __str__(self) -> str:
        ratio = f", if the gear ratio is {self.gear_ratio:g}" if self.assumed else ""
        return f"{self.order:g} ({self.name}{ratio})"


_OUTPUT_SIDE: Final = {
    1: "eccentricity of the output side, gravity load or the reference's mount; offset of a "
    "sensor's signals",
    2: "sensor displaced or tilted from the axis, ellipticity, gain or quadrature error of its "
    "signals, or the coupling of the reference",
    3: "second harmonic in the signals of a sensor of one period a turn",
    4: "interpolation error: third or fifth harmonic in the signals of a sensor of one period "
    "a turn",
}


def gear_orders(gear_ratio: float, fixed_member: str = "circular_spline") -> dict[float, str]:
    """Orders per output turn that a gear of this ratio is known to make, with names.

    ``{i, i+1, 2i, 2i+1, 2i+2, 3i, 4i}`` for i motor turns per output turn with the
    circular spline fixed; ``i-1, 2i-1, 2i-2`` in place of the sums when the flexspline
    is fixed; ``{i, 2i, 3i, 4i}`` for any other gear (``"none"``).

    Examples
    --------
    >>> list(gear_orders(100))
    [100, 101, 200, 201, 202, 300, 400]
    >>> gear_orders(100)[202]
    'tooth mesh with the circular spline'
    """
    i = shaft_cycles(gear_ratio, "none")["motor"]
    check_choice("fixed_member", fixed_member, FIXED_MEMBERS)
    if fixed_member == "none":
        if i == 1.0:
            return {}
        names = ("once", "twice", "three times", "four times")
        return {_whole((n + 1) * i): f"{name} per motor turn" for n, name in enumerate(names)}
    # Circular spline fixed: the flexspline goes round with the output, the wave
    # generator turns i + 1 times against it; flexspline fixed: i - 1 times. One tooth
    # of difference per lobe makes 2i the teeth of the output member.
    if fixed_member == "circular_spline":
        sign, output, fixed = 1.0, "flexspline", "circular spline"
    else:
        sign, output, fixed = -1.0, "circular spline", "flexspline"
    motor = "of the motor's encoder"
    return {
        _whole(i): f"once per motor turn: eccentricity or offset {motor}, or wave generator",
        _whole(i + sign): f"wave generator against the {output}, once per turn",
        _whole(2 * i): f"twice per motor turn: tilt, gain or quadrature error {motor}, "
        f"or tooth mesh with the {output}",
        _whole(2 * i + sign): "side band between the two tooth meshes",
        _whole(2 * i + 2 * sign): f"tooth mesh with the {fixed}",
        _whole(3 * i): f"three times per motor turn: waveform {motor}, or wave generator",
        _whole(4 * i): f"four times per motor turn: interpolation error {motor}, or wave generator",
    }


@told_kinds
def wanted_orders(
    gear_ratio: float | None,
    fixed_member: str = "circular_spline",
    highest: int = HIGHEST_LOW_ORDER,
) -> tuple[float, ...]:
    """Orders 1 to ``highest`` and the known orders of the gear.

    Examples
    --------
    >>> wanted_orders(100)[-8:]
    (17, 100, 101, 200, 201, 202, 300, 400)
    """
    low = [float(k) for k in range(1, highest + 1)]
    gear = [] if gear_ratio is None else [float(m) for m in gear_orders(gear_ratio, fixed_member)]
    both = sorted({*low, *gear})
    return tuple(int(m) if m.is_integer() else m for m in both)


def explain_order(
    order: float,
    aliases: Iterable[float] = (),
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
) -> tuple[Explanation, ...]:
    """Known lines of the joint that ``order`` or one of its ``aliases`` may be.

    Without ``gear_ratio`` the common ratios are tried and each explanation states for
    which ratio it holds.

    Examples
    --------
    >>> [str(e) for e in explain_order(14, [22, 50, 202], gear_ratio=100)]
    ['202 (tooth mesh with the circular spline)']
    """
    members = {float(order), *(float(m) for m in aliases)}
    found = [Explanation(m, _OUTPUT_SIDE[m]) for m in sorted(_OUTPUT_SIDE) if m == float(order)]
    ratios = COMMON_RATIOS if gear_ratio is None else (gear_ratio,)
    for ratio in ratios:
        for m, name in gear_orders(ratio, fixed_member).items():
            if float(m) in members:
                found.append(Explanation(m, name, float(ratio), gear_ratio is None))
    return tuple(found)


def explain_as_harmonic(order: float, amplitudes: Mapping[float, float]) -> tuple[Explanation, ...]:
    """The larger line that ``order`` is a multiple of: what is not sinusoidal has harmonics.

    ``amplitudes`` are those of every retained order, in any unit. Order 1 is omitted: all are
    multiples of it.

    Examples
    --------
    >>> [str(e) for e in explain_as_harmonic(12, {1: 9.0, 4: 80.0, 12: 2.0})]
    ['12 (harmonic 3 of order 4, whose waveform is not a sine)']
    """
    own = amplitudes.get(order, math.inf)
    for base in sorted(amplitudes, key=lambda k: -amplitudes[k]):
        times = order / base
        # Highest multiple of a line that is put down to it.
        whole = abs(times - round(times)) < 1e-9 and 2 <= round(times) <= 8
        # A line larger than its multiple by this factor explains that one too.
        if base > 1 and whole and amplitudes[base] >= 3.0 * own:
            name = f"harmonic {round(times)} of order {base:g}, whose waveform is not a sine"
            return (Explanation(order, name),)
    return ()


def explain_by_shafts(order: float, shafts: Mapping[str, float]) -> tuple[Explanation, ...]:
    """Declared shafts (name and cycles per output turn) that ``order`` is a harmonic of.

    Examples
    --------
    >>> [str(e) for e in explain_by_shafts(288, {"worm": 144.0})]
    ['288 (twice per turn of the worm)']
    """
    found = []
    for name, cycles in shafts.items():
        times = order / cycles
        if abs(times - round(times)) < 1e-9 and 1 <= round(times) <= len(_TIMES):
            found.append(Explanation(order, f"{_TIMES[round(times) - 1]} per turn of the {name}"))
    return tuple(found)


_TIMES: Final = ("once", "twice", "three times", "four times")


def _whole(order: float) -> float:
    """An order as an int where it is one."""
    return round(order) if abs(order - round(order)) < 1e-9 else order
