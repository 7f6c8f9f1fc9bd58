"""A running joint against its model: sums in constant memory, charts, alarms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

import trueangle._core as _core

from ..errors import ArgumentError
from ..joint.joint import Joint
from ..support.angles import arcsec
from ..support.argumentkinds import of_type, told_kinds
from ..support.distributions import two_sided_quantile
from ..support.layout import counted
from ..support.plainresult import Angle, ShownResult, plain_row
from ..support.runlength import chart_limit
from .model import HarmonicModel


@dataclass(frozen=True)
class WatchedOrder:
    """One order of a window, less the model's: sizes in the unit of the model's period."""

    order: float
    amplitude: Angle
    phase_deg: float
    statistic: float


@dataclass(frozen=True)
class WatchedWindow(ShownResult):
    """One window of readings.

    Attributes
    ----------
    window : int
        Counted from 1.
    angle : float
        Of the reading that ended it.
    time : float or None
        Of the same, in seconds.
    readings : int
    orders : tuple of WatchedOrder
        What the window has beyond the model.
    statistic, limit : float
        The largest sum of all charts, and what it stays below.
    alarm : bool
    because : str
        Which orders moved by how much and since when, and what makes such orders.
    """

    window: int
    angle: float
    time: float | None
    readings: int
    orders: tuple[WatchedOrder, ...]
    statistic: float
    limit: float
    alarm: bool
    because: str

    def plain(self, scale: float) -> dict[str, Any]:
        """As plain values; sizes times ``scale`` are arcsec."""
        found = plain_row(self, scale)
        return {{"time": "time_s"}.get(k, k): v for k, v in found.items() if k != "readings"}


#: Highest order that is watched: a window's sums grow with it.
HIGHEST: Final = 4096


@told_kinds
class Monitor(ShownResult):
    """Watches the error of a running joint in constant memory.

    Errors are known where a second encoder, an index pulse or a reference switch gives some. Each
    window of travel is fitted by least squares to the orders of the model,

    ::

        e_j - ε(x_j) = z_w + Σ_k a_kw cos k x_j + b_kw sin k x_j,

    each coefficient is standardized by the windows before it since its last step (self-starting,
    Hawkins 1987; the correlation of neighbours that is found is taken out), and a two-sided
    cumulative sum

    ::

        C± <- max(0, C± ± z - δ/2)

    alarms above the h that gives the run length to all charts together. The zero, which
    remounting and temperature move, has a chart of its steps. The first eight windows are the
    baseline: their mean is compared with the model itself.

    Parameters
    ----------
    model : HarmonicModel
        Its orders are watched; shafts turn a whole number of times per turn of the output.
    every : float
        Turns of travel of a window. One whose places do not separate the orders goes on.
    shift : float
        That is looked for, in standard deviations of a window's coefficient.
    run_length : float
        Windows until a false alarm of any chart, on average.

    Raises
    ------
    ArgumentError
        A model without whole orders, or numbers that are not positive.

    Notes
    -----
    About the cost of `Moments.update` a reading, for any number of orders, and 3
    microseconds a window of eight orders, however many readings it had. 64 kB at most for orders
    up to 32. It adapts to nothing without an alarm; an alarm restarts the charts of its order from
    the level after the step, so that a step is reported once.

    Examples
    --------
    >>> import trueangle as ta
    >>> model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.05])], period=360.0)
    >>> watch = Monitor(model)
    >>> rng = np.random.default_rng(0)
    >>> angle = np.arange(0.0, 200 * 360.0, 3.0)
    >>> error = model.error(angle) + rng.normal(0.0, 0.002, angle.size)
    >>> error[12000:] += 0.001 * np.cos(np.radians(angle[12000:]))
    >>> [alarm.because for alarm in watch.update(angle, error)][0][:13]
    'order 1 moved'
    """

    #: Windows of the baseline: their mean is compared with the model, later windows with them.
    baseline: Final = _core.Monitor.BASELINE

    def __init__(
        self,
        model: HarmonicModel,
        *,
        every: float = 1.0,
        shift: float = 1.0,
        run_length: float = 465.0,
    ) -> None:
        of_type("model", model, HarmonicModel, "a trueangle.HarmonicModel")
        for name, value in (("every", every), ("shift", shift)):
            if not 0.0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive, got {value!r}")
        if not 2.0 < run_length < math.inf:
            raise ArgumentError(f"run_length must be above 2 windows, got {run_length!r}")
        orders, cosine, sine = _lines(model)
        self.model, self.every, self.shift = model, float(every), float(shift)
        self.run_length = float(run_length)
        self._orders = orders
        # By which the run length of all charts is raised: what standardizing by a few windows, and
        # correlation that is found late, take from it.
        charts = 1.25 * (2 * len(orders) + 1)  # that of the zero's steps included
        allowance = 0.5 * self.shift
        self.limit = chart_limit(allowance, self.run_length * charts)
        self._step = step = two_sided_quantile(1.0 / (self.run_length * charts))
        known = [0.0] * (2 * len(orders))
        if model.covariance is not None:
            known = _variances(model, orders)
        # Share of the model's largest line that the sums of a window may lack of it, at one spacing
        # of the readings in every window: within a bin the model is represented to second order.
        rounding = 1e-4 * float(np.hypot(cosine, sine).max())
        known = [variance + rounding**2 for variance in known]
        limits = (allowance, self.limit, step, step)
        self._core = _core.Monitor(model.period, orders, cosine, sine, known, self.every, limits)

    @property
    def windows(self) -> int:
        """Windows so far."""
        return self._core.windows

    @property
    def nbytes(self) -> int:
        """Bytes of the sums and charts."""
        return self._core.bytes

    @property
    def state(self) -> dict[str, Any]:
        """Windows so far, and mean, standard deviation and sums of the charts of each order.

        Means since the last step and deviations are those of cosine and sine beyond the model's,
        in its unit.
        """
        rows = np.array(self._core.state).reshape(-1, 2, 4)
        return {
            "windows": self.windows,
            "limit": self.limit,
            "orders": [
                {
                    "order": order,
                    "mean": row[:, 0].tolist(),
                    "std": row[:, 1].tolist(),
                    "upper": row[:, 2].tolist(),
                    "lower": row[:, 3].tolist(),
                }
                for order, row in zip(self._orders, rows, strict=True)
            ],
        }

    @told_kinds
    def update(
        self, angle: ArrayLike, error: ArrayLike, *, time: ArrayLike | None = None, **signals: Any
    ) -> list[WatchedWindow]:
        """Take in further readings; the alarms that they raised.

        Parameters
        ----------
        angle, error : float or array_like
            Of one shape, in the order they were taken: angle that the error is a function of, and
            indicated less reference, with any zero. What is not finite is omitted.
        time : float or array_like, optional
            Seconds.
        **signals
            Ignored: models with terms are watched by their lines.

        Returns
        -------
        list of WatchedWindow
            Those that alarm.

        Raises
        ------
        ArgumentError
            Shapes that differ.
        """
        return self._fed(angle, error, time, alarms=True)

    def windows_of(
        self, angle: ArrayLike, error: ArrayLike, time: ArrayLike | None = None
    ) -> list[WatchedWindow]:
        """As `update`, but every window that ended."""
        return self._fed(angle, error, time, alarms=False)

    def _fed(
        self, angle: ArrayLike, error: ArrayLike, time: ArrayLike | None, *, alarms: bool
    ) -> list[WatchedWindow]:
        x, e = _flat(angle), _flat(error)
        seconds = None if time is None else _flat(time)
        for name, values in (("error", e), ("time", seconds)):
            if values is not None and values.size != x.size:
                raise ArgumentError(f"{name} has {values.size} values, angle has {x.size}")
        return [
            self._window(
                closed,
                float(x[closed.reading]),
                None if seconds is None else float(seconds[closed.reading]),
            )
            for closed in self._core.update(x, e, alarms)
        ]

    def _window(self, closed: Any, angle: float, time: float | None) -> WatchedWindow:
        pairs = np.array(closed.coefficients[1:]).reshape(-1, 2).tolist()
        sums = np.array(closed.statistics[1:]).reshape(-1, 2).max(axis=1).tolist()
        # The step of the zero, on the scale of the sums.
        zero = closed.statistics[0] * self.limit / self._step
        return WatchedWindow(
            int(closed.window),
            angle,
            time,
            round(closed.readings),
            tuple(
                WatchedOrder(
                    float(order), math.hypot(a, b), math.degrees(math.atan2(a, b)) % 360.0, top
                )
                for order, (a, b), top in zip(self._orders, pairs, sums, strict=True)
            ),
            max([zero, *sums]),
            self.limit,
            bool(closed.moved or closed.unlike),
            self._because(closed),
        )

    def _because(self, closed: Any) -> str:
        """Orders that moved, by how much and since when, and what makes such orders."""
        scale = arcsec(1.0, self.model.period)
        names = ["the zero", *(f"order {order}" for order in self._orders)]
        told, unlike = [], sorted(closed.unlike, key=lambda row: -row[1])[:3]
        for at, size, std, since in closed.moved:
            when = f"for the last {int(since)} windows" if since > 1 else "in this window"
            when = when if at else "from the window before"
            told.append(f"{names[at]} moved by {_size(scale * size, scale * std)} {when}")
        for at, size, std, _ in unlike:
            error = _size(scale * size, scale * std)
            told.append(f"{names[at]} differs from the model by {error} since the start")
        at = next((row[0] for row in (*closed.moved, *unlike) if row[0]), 0)
        if at:
            cause = Joint().explanations(float(self._orders[at - 1]))[0]
            told[-1] += f": {cause}" if len(told) == 1 else f"; {names[at]} may be: {cause}"
        return "; ".join(told)

    def _brief(self) -> str:
        return f"{counted(self._orders, 'order')}, {counted(self.windows, 'window')}"


def _size(size: float, std: float) -> str:
    """An error in arcsec and its standard deviation, both rounded."""
    return f"{float(f'{size:.3g}'):g} arcsec (+- {float(f'{std:.2g}'):g} arcsec)"


def _flat(values: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def _lines(model: HarmonicModel) -> tuple[list[int], list[float], list[float]]:
    """Whole orders of a turn with their coefficients, those of several shafts together."""
    found: dict[float, complex] = {}
    for shaft in model.shafts:
        for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
            order = k * shaft.cycles_per_turn
            found[order] = found.get(order, 0.0) + complex(a, b)
    if not found:
        raise ArgumentError("model has no orders to watch: fit one with orders")
    odd = [order for order in found if order != round(order)]
    if odd:
        raise ArgumentError(
            f"model: order {odd[0]:g} is not periodic in one output turn and cannot be watched "
            "turn by turn; watch a model without it"
        )
    highest = max(found)
    if highest > HIGHEST:
        raise ArgumentError(f"model: order {highest:g} is above {HIGHEST}, the highest watched")
    orders = sorted(found)
    values = [found[order] for order in orders]
    return [round(k) for k in orders], [z.real for z in values], [z.imag for z in values]


def _variances(model: HarmonicModel, orders: Sequence[int]) -> list[float]:
    """Of the model's cosine and sine of each order."""
    diagonal = np.diag(model.covariance if model.covariance is not None else np.zeros((1, 1)))
    found = dict.fromkeys(orders, (0.0, 0.0))
    places = ((s, k) for s in model.shafts for k in s.orders)
    for i, (shaft, k) in enumerate(places):
        order = round(k * shaft.cycles_per_turn)
        a, b = found[order]
        found[order] = a + float(diagonal[1 + 2 * i]), b + float(diagonal[2 + 2 * i])
    return [value for order in orders for value in found[order]]
