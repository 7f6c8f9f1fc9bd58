"""What numbers and covariances a model may hold, and whether its slope lets it be inverted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

import trueangle._core as _core

from ..errors import ArgumentError, NotInvertibleError
from ..joint.shafts import Shaft
from ..support.decoding import MAX_LINE_ORDERS, MAX_LINES, MAX_ORDER
from .records import MOST_TURNS, FitRecord

#: What a condition number may be below 1 by rounding.
ROUNDING = 1e-6

#: Samples per period of the highest order: the greatest of them is at most 0.5 % low.
_SAMPLES: Final = 32


def check_number(what: str, value: object, least: float, most: float) -> None:
    """Raise `ArgumentError` unless ``value`` is a finite number from ``least`` to ``most``."""
    number = isinstance(value, (int, float, np.integer, np.floating))
    if not (number and math.isfinite(value) and least <= value <= most):  # type: ignore[arg-type,operator]
        bounds = f"at least {least:g}" if math.isinf(most) else f"from {least:g} to {most:g}"
        raise ArgumentError(f"{what} must be a finite number, {bounds}, got {value!r}")


def check_invertible(slope: float) -> None:
    """Raise `NotInvertibleError` when ``|d error / d angle|`` may reach 1."""
    if slope >= 1.0:
        raise NotInvertibleError(
            f"|error'| may reach {slope:.3g}: from 1 on several true angles give one reading, "
            "which cannot be corrected. Check the gear ratio, use fewer or lower orders, or "
            "`argument='indicated'`",
            slope,
        )


def check_lines(shafts: Sequence[Shaft], period: float) -> None:
    """Raise `ArgumentError` for harmonics of which a file is not read back.

    Those of a model that must be invertible may be steep only where it does not take long to find
    the greatest slope; ``period`` is infinite for another one.
    """
    harmonics = sum(len(shaft.orders) for shaft in shafts)
    highest = max((s.cycles_per_turn * max(s.orders, default=0) for s in shafts), default=0.0)
    if highest > MAX_ORDER:
        raise ArgumentError(f"{highest:.6g} cycles per output turn are more than {MAX_ORDER:.0f}")
    if harmonics > MAX_LINES or harmonics * highest > MAX_LINE_ORDERS:
        raise ArgumentError(
            f"{harmonics} harmonics of up to {highest:.6g} cycles per turn are too many: "
            f"at most {MAX_LINES}, and {MAX_LINE_ORDERS:.0g} of their product"
        )
    # Highest order times number of harmonics up to which the greatest slope of a steep model is
    # looked for: a second of work.
    if harmonics * highest <= 3e5:
        return
    rates = (
        s.cycles_per_turn * order * math.hypot(cosine, sine)
        for s in shafts
        for order, cosine, sine in zip(s.orders, s.cosine, s.sine, strict=False)
    )
    bound = 2.0 * math.pi / period * sum(rates)
    if bound >= 1.0:
        raise ArgumentError(
            f"|error'| may reach {bound:.3g}, and {harmonics} harmonics of up to {highest:.6g} "
            "cycles per turn are too many to look for its greatest value; use fewer or lower orders"
        )


def check_fit(fit: FitRecord, period: float) -> None:
    """Raise `ArgumentError` for numbers that no fit of angles of this period has."""
    far = MOST_TURNS * period
    for what, value in zip(("start", "stop"), fit.span, strict=True):
        check_number(f"fit.span's {what}", value, -far, far)
    if fit.span[0] > fit.span[1]:
        raise ArgumentError(f"fit.span must not stop before it starts, got {fit.span!r}")
    if fit.residual is not None:
        check_number("fit.residual", fit.residual, 0.0, far)
    for what in ("samples", "runs", "ridge", "offset_spread"):
        check_number(f"fit.{what}", getattr(fit, what), 0.0, math.inf)
    for i, offset in enumerate(fit.offsets):
        check_number(f"fit.offsets[{i}]", offset, -far, far)


def checked_covariance(covariance: ArrayLike, harmonics: int) -> NDArray[np.float64]:
    """A read-only copy of the covariance of the constant and both parts of ``harmonics``."""
    matrix = np.array(covariance, dtype=np.float64)
    size = 1 + 2 * harmonics
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise ArgumentError(
            f"covariance must be {size} x {size} finite numbers "
            f"(constant, then A and B of every order), got shape {matrix.shape}"
        )
    matrix.flags.writeable = False
    return matrix


def greatest_slope(
    orders: Sequence[float], cosine: ArrayLike, sine: ArrayLike, period: float
) -> float:
    """``max |d error / d angle|`` of a series, by sampling it, not by adding amplitudes.

    Whole orders are sampled over a turn and raised by Bernstein's ``1 / cos(pi / 32)``,
    which a trigonometric polynomial cannot exceed between the samples. An order that is not
    whole comes to every phase against them sooner or later: its amplitude is added.

    Examples
    --------
    >>> greatest_slope([1, 3], [0.0, 0.0], [9 / 8 * 0.5, 0.5 / 8], 2 * math.pi) < 0.76
    True
    """
    m, a, b = (np.asarray(v, dtype=np.float64) for v in (orders, cosine, sine))
    whole = m == np.round(m)
    rate = 2.0 * math.pi / period
    aside = rate * float(np.hypot(a[~whole], b[~whole]) @ m[~whole])
    bound = rate * float(np.hypot(a[whole], b[whole]) @ m[whole])
    if not whole.any() or aside + bound < 0.5:
        return aside + bound
    lines = sorted(zip(m[whole].astype(int).tolist(), a[whole], b[whole], strict=True))
    series = _core.Series(
        period,
        0.0,
        [1.0],
        [[k for k, _, _ in lines]],
        [[float(v) for _, v, _ in lines]],
        [[float(v) for _, _, v in lines]],
        "indicated",
    )
    samples = _SAMPLES * lines[-1][0]
    slopes = np.asarray(series.slope(np.arange(samples) * (period / samples)))
    return aside + float(np.abs(slopes).max()) / math.cos(math.pi / _SAMPLES)
