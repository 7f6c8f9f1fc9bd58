"""`selfcal`: calibrate without a reference, by the method that the columns allow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from ..errors import ArgumentError, NoModelError
from ..joint.shafts import MOST_ORDERS, limited_orders
from ..runs.source import OtherReadingOptions
from ..selfcalibration import METHODS
from ..support.angles import check_period
from ..support.argumentkinds import told_kinds
from ..support.blas import one_blas_thread
from ..support.suggestions import check_choice
from .channels import channel_patterns
from .dual import dual
from .heads import head_patterns
from .loop import check_loop
from .recording import Recording, as_recordings
from .result import SelfCalibration
from .shifts import shift_patterns
from .spindown import spin_down


@told_kinds
@one_blas_thread()
def selfcal(
    logs: Any,
    *,
    method: str = "auto",
    orders: str | Sequence[float] = "auto",
    loop: str = "unknown",
    loop_bandwidth: float | None = None,
    gear_ratio: float | None = None,
    fit_ratio: bool = False,
    ripple: str | Sequence[float] = "auto",
    head_angles: Sequence[float] | None = None,
    period: float | None = None,
    **reading: Unpack[OtherReadingOptions],
) -> SelfCalibration:
    """Calibrate a joint without a reference: from time stamps, heads, shifts or a motor.

    ::

        r_i = S(t_i) c + H(θ_i) a + (ω_m/ω_i)² H(θ_i) b + n_i,
        θ_i = r_i - H(θ_i) a

    Parameters
    ----------
    logs : path, table, CalibrationRun, or iterable of them
        Files, folders, patterns and tables in memory as `trueangle.read_runs` takes them, or
        runs. Columns ``time_s``, ``indicated_deg`` (or ``_rad``, ``_turn``, ``_count``), ``run``,
        ``head1_deg`` ..., ``shift_deg``, ``motor_deg``, ``current_A``, ``sine``, ``cosine``.
    method : {"auto", "spin-down", "heads", "shifts", "dual", "channels"}
        ``"auto"`` looks at the columns.
    orders : "auto" or sequence of int
        By default those that are significant.
    loop : {"open", "closed", "unknown"}
        Whether the speed was held by a loop closed on this encoder.
    loop_bandwidth : float, optional
        Of that loop, in hertz: orders that pass below twice that are refused.
    gear_ratio : float, optional
        Motor turns per output turn, for ``"dual"``: a count of teeth, which stays.
    fit_ratio : bool
        For ``"dual"``: estimate the ratio jointly with orders 1 and 2 of the output (as is done
        where no ratio is given); what was given, or a whole number, stays unless it is more
        than four standard errors off.
    ripple : {"auto", "none"} or sequence of int
        Orders at which the speed may ripple. ``"auto"``: all, weighed by the evidence;
        ``"none"``: the motion is known to be smooth.
    head_angles : sequence of float, optional
        Where the heads are, in degrees, when their readings were set to one zero.
    period : float, optional
        One turn in the unit of the model (360), and of angles whose columns name none.
    **reading
        ``signals``, ``by``, ``counts_per_turn``, ``counts_per_turn_reference``, ``topic``,
        ``periods_per_turn``, as in `trueangle.read_runs`.

    Returns
    -------
    SelfCalibration
        ``.model``, ``.orders``, ``.sums``, ``.blind``, ``.held_out``, ``.notes``, ``.summary()``.

    Raises
    ------
    FileError, ArgumentError
        Columns that are missing or wrong.
    NoModelError
        A log from which nothing can be determined; states what to record.

    Notes
    -----
    Reaches the Cramer-Rao limit of white noise where motion is smooth; standard errors
    include the loss by the drift of the motion, which is fitted jointly. Never identifiable: the
    zero; `SelfCalibration.blind` lists the others. A million readings, 30 orders: about a second.

    References
    ----------
    X.-D. Lu, CIRP Annals 59 (2010) 529, for spindles that coast.

    Examples
    --------
    >>> t = np.arange(20_000) / 1000.0
    >>> theta = 2.0 * np.pi * 120.0 * (1.0 - np.exp(-t / 12.0))
    >>> noise = np.random.default_rng(0).normal(size=t.size) * 1e-4
    >>> log = {"time_s": t, "indicated_rad": theta + 1e-3 * np.sin(2.0 * theta) + noise}
    >>> found = ta.selfcal(log, orders=[1, 2, 3], loop="open")
    >>> round(found.orders[1].amplitude)
    206
    """
    turn = 360.0 if period is None else check_period(period)
    check_loop(loop, loop_bandwidth)
    check_choice("method", method, ("auto", *METHODS))
    wanted = _orders(orders)
    recordings = as_recordings(logs, {**reading, "period": period})
    chosen = _method(recordings) if method == "auto" else method
    if fit_ratio and chosen != "dual":
        raise ArgumentError(f"fit_ratio needs the motor's angle (method 'dual'), not {chosen!r}")
    if chosen == "channels":
        return channel_patterns(
            recordings, wanted, loop=loop, bandwidth=loop_bandwidth, period=turn
        )
    if chosen == "heads":
        return head_patterns(recordings, wanted, angles=head_angles, period=turn)
    if chosen == "shifts":
        return shift_patterns(recordings, wanted, period=turn)
    if chosen == "dual":
        return dual(recordings, wanted, gear_ratio=gear_ratio, fit_ratio=fit_ratio, period=turn)
    return spin_down(
        recordings,
        wanted,
        loop=loop,
        bandwidth=loop_bandwidth,
        ripple=_ripple(ripple),
        period=turn,
    )


def _method(recordings: Sequence[Recording]) -> str:
    """The method that the columns allow."""
    first = recordings[0]
    if first.motor is not None and (first.indicated is not None or first.reference is not None):
        return "dual"
    if len(first.heads) >= 2:
        return "heads"
    if first.shift is not None and first.reference is not None and first.indicated is not None:
        return "shifts"
    if first.indicated is not None and first.time is not None:
        return "spin-down"
    if first.sine is not None and first.cosine is not None:
        return "channels"
    raise NoModelError(
        f"{first.named}: these columns do not allow a calibration without a reference. "
        "Record one of: time_s of a turning shaft; several heads (head1_deg, head2_deg); the "
        "motor's angle (motor_deg); two encoders at several shifts (shift_deg)"
    )


def _orders(orders: Any) -> str | tuple[float, ...]:
    if isinstance(orders, str):
        if orders == "auto":
            return orders
        raise ArgumentError(f"orders must be 'auto' or whole numbers from 1, got {orders!r}")
    try:
        found = sorted({float(k) for k in limited_orders(orders)})
    except ArgumentError:
        raise
    except (TypeError, ValueError):
        found = []
    if not found or not all(1.0 <= k <= MOST_ORDERS and k.is_integer() for k in found):
        raise ArgumentError(f"orders must be 'auto' or whole numbers from 1, got {orders!r}")
    return tuple(found)


def _ripple(ripple: Any) -> str | tuple[float, ...]:
    if isinstance(ripple, str):
        if ripple in ("auto", "none"):
            return ripple
        raise ArgumentError(f"ripple must be 'auto', 'none' or orders, got {ripple!r}")
    found = _orders(ripple)
    assert not isinstance(found, str)
    return found
