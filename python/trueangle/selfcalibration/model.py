"""The model of a calibration without a reference, its pattern over the angle, and its record."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

import trueangle._core as _core

from .._core import __version__
from ..errors import NotInvertibleError
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.records import FitRecord, Provenance
from ..runs.rawchannels import Channels
from ..support.angles import common_sign
from ..support.arrays import Array
from .recording import Recording
from .result import ARCSEC, Blind, HeldOutPattern, OrderEstimate, SelfCalibration, blind_words

ENCODER: Final = "the encoder"
RIPPLE: Final = "the speed ripple"


def reference_free_model(
    orders: Iterable[OrderEstimate],
    method: str,
    blind: Sequence[str],
    notes: Sequence[str],
    recordings: Sequence[Recording],
    *,
    readings: int,
    noise: float,
    period: float,
    motor: tuple[float, Sequence[OrderEstimate]] | None = None,
    span: tuple[float, float] | None = None,
    channels: Channels | None = None,
) -> HarmonicModel:
    """Whole orders of the output, and of a motor that turns ``motor[0]`` times as fast.

    The constant is zero by definition: no reading shows it.

    Raises
    ------
    NotInvertibleError
        The pattern is steeper than that of an encoder that follows its shaft.
    """
    factor = period / (2.0 * math.pi) / ARCSEC
    shafts = []
    variances = [0.0]
    groups = [("output", 1.0, sorted(orders, key=lambda o: o.order))]
    if motor is not None:
        groups.append(("motor", motor[0], sorted(motor[1], key=lambda o: o.order)))
    for name, cycles, members in groups:
        if not members:
            continue
        shafts.append(
            Shaft(
                name,
                cycles,
                tuple(round(o.order / cycles) for o in members),
                tuple(o.cosine * factor for o in members),
                tuple(o.sine * factor for o in members),
            )
        )
        for o in members:
            variances += [(o.std * factor) ** 2] * 2
    sources = dict.fromkeys(r.source for r in recordings if r.source is not None)
    fit = FitRecord(
        samples=readings,
        runs=len(recordings),
        span=(0.0, period) if span is None else span,
        residual=noise * period / (2.0 * math.pi),
        method=method,
        note=" ".join(f"{note[:1].upper()}{note[1:]}." for note in notes),
        calibrated_without_reference=True,
        blind=tuple(blind),
    )
    made_by = Provenance(tuple(sources), f"trueangle {__version__}")
    try:
        return HarmonicModel(
            tuple(shafts),
            0.0,
            period,
            covariance=np.diag(variances),
            fit=fit,
            provenance=made_by,
            indicated_sign=common_sign(r.indicated_sign for r in recordings)
            if channels is None
            else 1,
            channels=channels,
        )
    except NotInvertibleError as error:
        raise NotInvertibleError(
            f"the pattern is not that of an encoder: its slope reaches {error.slope:.3g}, and from "
            "1 on several angles give one reading. Does the shaft turn through these readings, "
            "and are unit and period right? `ta.check(...)` shows both",
            error.slope,
        ) from None


def reference_free_calibration(
    orders: Sequence[OrderEstimate],
    method: str,
    blind: Sequence[Blind],
    notes: Sequence[str],
    recordings: Sequence[Recording],
    *,
    readings: int,
    noise: float,
    period: float,
    turns: float,
    held_out: Mapping[str, HeldOutPattern],
    beside: Mapping[str, Any],
    sums: Sequence[OrderEstimate] = (),
    modelled: Iterable[OrderEstimate] | None = None,
    **of_model: Any,
) -> SelfCalibration:
    """The result of a method with the model of its ``orders``, or of those ``modelled`` alone.

    ``noise`` is in radians; ``of_model`` and errors are those of `reference_free_model`.
    """
    model = reference_free_model(
        orders if modelled is None else modelled,
        method,
        [f"{blind_words(b.orders)}: {b.because}" for b in blind],
        notes,
        recordings,
        readings=readings,
        noise=noise,
        period=period,
        **of_model,
    )
    return SelfCalibration(
        method=method,
        model=model,
        orders=tuple(orders),
        sums=tuple(sums),
        blind=tuple(blind),
        held_out=held_out,
        notes=tuple(notes),
        noise_arcsec=noise * ARCSEC,
        readings=readings,
        turns=turns,
        beside=beside,
    )


def pattern_model(orders: Sequence[float], coefficients: Array) -> HarmonicModel:
    """The pattern as a model in radians; its constant is zero, since nothing shows it."""
    whole = tuple(int(k) for k in orders)
    return HarmonicModel(
        (Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2])),)
        if whole
        else (),
        period=2.0 * math.pi,
    )


def pattern_steepness(orders: Sequence[float], coefficients: Array) -> float:
    """The greatest ``|d error / d angle|``."""
    whole = [int(k) for k in orders]
    parts = [list(coefficients[0::2])], [list(coefficients[1::2])]
    return _core.Series(2.0 * math.pi, 0.0, [1.0], [whole], *parts, "indicated").slope_bound


def pattern_series(orders: Sequence[float], coefficients: Array, theta: Array) -> Array:
    """Sum of the harmonics at ``theta``, by the compiled core where orders are whole."""
    if not len(orders):
        return np.zeros_like(theta)
    whole = tuple(int(k) for k in orders)
    shaft = Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2]))
    model = HarmonicModel((shaft,), period=2.0 * math.pi, argument="indicated")
    return np.asarray(model.error(theta))
