"""The paper's Figures 4 to 9, each next to what its 36 positions hide.

Run with ``python examples/paper/figures.py FOLDER``; writes one picture a figure. Joint a of
Equation 8; the right half shows a joint that reads the same at the 36 positions and whose
orders are those of its gear (ratio 100).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from trueangle.cli.demo import JOINT_A, POSITIONS, lifted, simulated_groups
from trueangle.plots.amplitudespectrum import OrderAxis
from trueangle.plots.palette import AFTER, BEFORE, MARKERS, MUTED, run_colour

Array = NDArray[np.float64]

#: Orders that 36 positions can show, and a segment of the turn in which gear orders are visible.
ORDERS = np.arange(1, 18)
STRETCH = np.linspace(40.0, 80.0, 4001)
TURN = np.linspace(0.0, 360.0, 14401)[:-1]

GEAR = lifted(JOINT_A)
GROUPS = simulated_groups(JOINT_A)
#: The first five groups make the model, the sixth verifies it.
FITTED, HELD = GROUPS[:5], GROUPS[5]
AT = HELD.reference


def harmonics(error: Array) -> NDArray[np.complex128]:
    """``A + iB`` of the orders 1 to 17 from 36 readings, by the paper's Equation 1."""
    x = np.exp(1j * np.radians(np.outer(ORDERS, AT)))
    return (2.0 / POSITIONS) * x @ error


def errors(group: int) -> Array:
    """Readings of a group in arcsec, its zero removed."""
    return np.asarray(3600.0 * GROUPS[group].centred_error)


#: Coefficients of every group of the model, and their mean at the orders the paper retains.
OF_GROUPS = np.array([harmonics(errors(k)) for k in range(len(FITTED))])
RETAINED = np.array(sorted(JOINT_A.lines))


def corrected(degrees: Array) -> Array:
    """The paper's model: the mean of the five groups at the retained orders."""
    mean = OF_GROUPS.mean(axis=0)[RETAINED - 1]
    x = np.radians(np.outer(np.atleast_1d(degrees), RETAINED))
    return np.asarray(np.cos(x) @ mean.real + np.sin(x) @ mean.imag)


def halves(left: str, right: str) -> tuple[Figure, Axes, Axes]:
    """A figure of the paper and, on the right, what it hides."""
    figure, (shown, hidden) = plt.subplots(1, 2, figsize=(10.0, 3.2), layout="constrained")
    shown.set_title(f"as the paper shows it: {left}", fontsize="medium")
    hidden.set_title(f"what it hides: {right}", fontsize="medium")
    for ax in (shown, hidden):
        ax.grid(True, color="#00000018")
        ax.set_axisbelow(True)
    return figure, shown, hidden


def figure4() -> Figure:
    """The original error of all groups."""
    figure, shown, hidden = halves("36 positions", "the error between them")
    for k in range(len(GROUPS)):
        style = {"linestyle": "none", "marker": MARKERS[k], "markersize": 3.5}
        shown.plot(AT, errors(k), color=run_colour(k), label=f"group {k + 1}", **style)
    shown.set_xticks(range(0, 361, 90))
    shown.set_ylim(-90, 130)
    shown.legend(ncols=3, fontsize="small", frameon=False, loc="upper center")
    stretch(hidden)
    return axes(figure, shown, hidden)


def stretch(ax: Axes) -> None:
    """Both joints over a segment, and the positions at which they agree."""
    ax.plot(STRETCH, GEAR.error(STRETCH), color=BEFORE, linewidth=0.8, label="gear orders")
    ax.plot(STRETCH, JOINT_A.error(STRETCH), color=AFTER, linewidth=1.4, label="as published")
    inside = (STRETCH[0] <= AT) & (STRETCH[-1] >= AT)
    ax.plot(AT[inside], JOINT_A.error(AT[inside]), "o", color="black", label="positions")
    ax.set_ylim(-90, 130)
    ax.legend(ncols=3, fontsize="small", frameon=False, loc="upper center")


def axes(figure: Figure, shown: Axes, hidden: Axes) -> Figure:
    """Labels of two panels over the angle."""
    for ax in (shown, hidden):
        ax.set_xlabel("output angle / deg")
        ax.set_ylabel("error / arcsec")
    return figure


def figure5() -> Figure:
    """Amplitude and phase of every order in five groups."""
    figure, shown, hidden = halves("amplitude in five groups", "which orders these are")
    for k, found in enumerate(OF_GROUPS):
        shown.plot(ORDERS, abs(found), marker=MARKERS[k], markersize=3.5, linewidth=0.7,
                   color=run_colour(k), label=f"group {k + 1}")  # fmt: skip
    shown.legend(ncols=2, fontsize="small", frameon=False)
    bars(hidden, dict.fromkeys(ORDERS.tolist(), 0.0) | amplitudes(GEAR.lines), BEFORE)
    shown.set_xlabel("order / cycles per output turn")
    shown.set_ylabel("amplitude / arcsec")
    return figure


def amplitudes(lines: object) -> dict[float, float]:
    """Amplitude by order."""
    return {float(k): size for k, (size, _) in dict(lines).items()}  # type: ignore[call-overload]


def bars(ax: Axes, sizes: dict[float, float], colour: str) -> None:
    """Amplitudes on an axis of orders with breaks."""
    orders = sorted(sizes)
    axis = OrderAxis.of(orders)
    ax.bar(axis.places(orders), [sizes[k] for k in orders], axis.width(orders), color=colour)
    axis.draw(ax)
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel("amplitude / arcsec")


def figure6() -> Figure:
    """Mean amplitude against order."""
    figure, shown, hidden = halves("orders 1 to 17", "every order that reads the same")
    bars(shown, dict(zip(ORDERS.tolist(), abs(OF_GROUPS.mean(axis=0)), strict=True)), AFTER)
    for order in RETAINED:
        alike = [m for m in range(1, 405) if m % POSITIONS in (order, POSITIONS - order)]
        hidden.plot(alike, [order] * len(alike), ".", color=MUTED, markersize=4.0)
    gear = dict(zip(JOINT_A.lines, GEAR.lines, strict=True))
    hidden.plot(list(gear.values()), list(gear), "D", color=BEFORE, label="of this gear")
    hidden.set_xlabel("order / cycles per output turn")
    hidden.set_ylabel("seen as order")
    hidden.set_ylim(0.0, 21.0)
    hidden.legend(fontsize="small", frameon=False, loc="upper center")
    return figure


def figure7() -> Figure:
    """Range of the phases over the groups."""
    figure, shown, hidden = halves("phases that repeat", "gear orders repeat as well")
    read = simulated_groups(GEAR)
    of_gear = np.array([harmonics(3600.0 * run.centred_error) for run in read[:5]])
    for ax, found, colour in ((shown, OF_GROUPS, AFTER), (hidden, of_gear, BEFORE)):
        around = np.angle(found / found.mean(axis=0), deg=True)
        ax.bar(ORDERS, np.ptp(around, axis=0), color=colour)
        ax.set_xticks(ORDERS[::4])
        ax.set_xlabel("order / cycles per output turn")
        ax.set_ylabel("range of the phase / deg")
    return figure


def figure8() -> Figure:
    """The model and the readings it was made of."""
    figure, shown, hidden = halves("model and readings", "the model and a joint of gear orders")
    for k in range(len(FITTED)):
        shown.plot(AT, errors(k), MARKERS[k], color=run_colour(k), markersize=3.0)
    shown.plot(TURN, corrected(TURN), color="black", linewidth=0.9)
    shown.set_xticks(range(0, 361, 90))
    hidden.plot(STRETCH, GEAR.error(STRETCH), color=BEFORE, linewidth=0.8, label="true error")
    hidden.plot(STRETCH, corrected(STRETCH), color="black", linewidth=1.2, label="model")
    hidden.set_ylim(-90, 130)
    hidden.legend(ncols=2, fontsize="small", frameon=False, loc="upper center")
    return axes(figure, shown, hidden)


def figure9() -> Figure:
    """The sixth group before and after its compensation."""
    left = errors(5) - corrected(AT)
    between = GEAR.error(TURN) - corrected(TURN)
    before = errors(5)
    gained = 100.0 * (1.0 - np.ptp(left) / np.ptp(before))
    lost = 100.0 * (np.ptp(between) / np.ptp(GEAR.error(TURN)) - 1.0)
    figure, shown, hidden = halves(
        f"{gained:.0f} % less at 36 positions", f"{lost:+.0f} % everywhere else"
    )
    shown.plot(AT, before, "s-", color=BEFORE, markersize=3.0, linewidth=0.7, label="before")
    shown.plot(AT, left, "o-", color=AFTER, markersize=3.0, linewidth=0.7, label="after")
    hidden.plot(TURN, GEAR.error(TURN), color=BEFORE, linewidth=0.4, label="before")
    hidden.plot(TURN, between, color=AFTER, linewidth=0.4, label="after")
    for ax in (shown, hidden):
        ax.set_xticks(range(0, 361, 90))
        ax.legend(ncols=2, fontsize="small", frameon=False, loc="upper center")
    low, high = hidden.get_ylim()
    for ax in (shown, hidden):
        ax.set_ylim(low, high + 0.25 * (high - low))
    return axes(figure, shown, hidden)


#: The paper's figures by number.
FIGURES: dict[int, Callable[[], Figure]] = {
    4: figure4,
    5: figure5,
    6: figure6,
    7: figure7,
    8: figure8,
    9: figure9,
}


def main() -> None:
    """Write every figure into the folder that is named, or the present one."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(exist_ok=True)
    for number, draw in FIGURES.items():
        figure = draw()
        figure.savefig(folder / f"figure{number}.svg")
        plt.close(figure)
        print(folder / f"figure{number}.svg")


if __name__ == "__main__":
    main()
