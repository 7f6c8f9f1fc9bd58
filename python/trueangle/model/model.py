"""The harmonic model of an angle error: evaluate it, correct by it, save it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import trueangle._core as _core

from ..errors import ArgumentError
from ..support.angles import arcsec, unit_name
from ..support.argumentkinds import of_type, told_kinds
from ..support.display_units import error_unit, sine_of_rms
from ..support.layout import counted, laid_out, wrapped_lines
from ..support.plainresult import result_picture
from .corrector import Corrector, ExchangeableStep, Step, exchangeable_step
from .errormodel import Argument, ErrorModel
from .validity import check_invertible
from .writing import save_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Argument", "HarmonicModel", "Step", "check_invertible"]

#: Lines that a summary lists before it states how many more there are.
_LISTED = 40

#: Names that one line lists, and their letters.
_NAMED, _LETTERS = 4, 24


@told_kinds
@dataclass(frozen=True, eq=False, repr=False)
class HarmonicModel(ErrorModel):
    """Angle error as a constant, harmonics of one or more shafts and terms; immutable.

    ::

        ε(x) = C₀ + Σ_s Σ_k A_sk cos(k f_s x) + B_sk sin(k f_s x)

    with ``x`` counted in turns of ``2 pi``; error = indicated - reference. ``terms`` add
    what follows travel, velocity, temperature and torque (`trueangle.terms`).

    Parameters
    ----------
    shafts : iterable of Shaft
    constant : float
        ``C_0``.
    period : float
        One turn in the unit of every angle, amplitude and of the constant.
    argument : {"reference", "indicated"}
        Which angle ``x`` is: the true one, then correcting solves
        ``theta + error(theta) = indicated``, or the joint's own reading.
    covariance : array_like, optional
        Of ``[C_0, A, B of each order of each shaft in turn]``.
    condition_number : float, optional
        Of the design matrix of the fit.
    fit : FitRecord, optional
    provenance : Provenance, optional
    terms : iterable of Term, optional
    indicated_sign : {1, -1}
        -1 where the sensor counts the other way: the indicated angle is minus what it reads.
        `error`, `correct`, `corrector` and `compensator` take and give indicated angles all the
        same; `trueangle.correct` and `trueangle.export_model` take what the sensor reads.
    channels : Channels, optional
        By which the indicated angle is made of a sine and a cosine channel: `compensator` then
        takes both.

    Raises
    ------
    ArgumentError
        Numbers that are not finite, orders that are not increasing, and the like.
    NotInvertibleError
        ``argument="reference"`` and ``|d error / d angle|`` may reach 1.

    Examples
    --------
    >>> from trueangle import Shaft
    >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> round(model.error(90.0), 12)
    0.5
    >>> round(model.correct(90.5), 9)
    90.0
    """

    # -- one sample after another --------------------------------------------------

    def corrector(self) -> Corrector:
        """`correct` that carries its state from batch to batch and step to step.

        For the batches of a long log, and for joints whose reversal error depends on
        travel before; see `trueangle.model.corrector.Corrector`.
        """
        return Corrector(self)

    def compensator(self) -> ExchangeableStep[HarmonicModel]:
        """``step(indicated) -> corrected`` for one sample at a time.

        The cheapest call there is: an object of the compiled core, no allocation
        but the result, the same number as `correct` of a float or an array of doubles or
        integers, to the last bit. It does not warn about the span.

        With terms it is ``step(indicated, velocity=, temperature=, torque=, direction=, current=)``
        and keeps the state of travel; `corrector` gives the same step and a ``reset``. Signals
        that the model does not need are ignored, as by `correct`. A step can be pickled.

        With `channels` it is ``step(sine, cosine)``, the arc tangent and its correction in one
        call; the angle lies within half a period of the channels about zero. Of two tracks it is
        ``step(sine, cosine, sine2, cosine2)``, and the angle lies within half a turn. Such a step
        has no ``swap``.

        ``step.swap(model)`` corrects by another model from the next step on, in every thread that
        holds the step: a step in another thread ends with the model it began with. Both have the
        same period and ``indicated_sign``, and terms or none. What is known about the travel stays
        where the terms of the other model can hold it, else it begins again. The new model is made
        ready first (some tenths of a millisecond), by the thread that swaps.

        Examples
        --------
        >>> from trueangle import Shaft
        >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
        >>> step = model.compensator()
        >>> round(step(90.5), 9)
        90.0
        >>> step.swap(model.replace(constant=0.25))
        >>> round(step(90.75), 9)
        90.0
        """
        if self.channels is not None:
            decoded: ExchangeableStep[HarmonicModel] = _channel_step(self)
            return decoded
        core = self._prepared()
        swap = partial(_swap, core, self)
        step: ExchangeableStep[HarmonicModel] = (
            exchangeable_step(core.step, swap) if self.terms else core.step_with(swap)
        )
        return step

    def _prepared(self) -> Any:
        """What corrects one sample at a time, in the core."""
        return self._core_corrector() if self.terms else _core.Compensator(self._series)

    # -- description --------------------------------------------------------------

    def __repr__(self) -> str:
        return _line(self)

    def summary(self) -> str:
        """The harmonics by shaft and order, in arcseconds, and what is known about the fit."""
        return _summary(self)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """The error over the angle with its 95 % band (`trueangle.plots.model_error`).

        Needs ``trueangle[plot]``.

        Parameters
        ----------
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        axes: Axes = result_picture(self, ax, **options)
        return axes

    def replace(self, **changes: Any) -> HarmonicModel:
        """A copy with some fields changed, checked again."""
        return replace(self, **changes)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model file (JSON): complete or not at all.

        Floats are written so that they read back bit for bit.
        """
        save_model(self, path)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, ({entry.name: getattr(self, entry.name) for entry in fields(self)},)


def _rebuild(values: dict[str, Any]) -> HarmonicModel:
    return HarmonicModel(**values)


def _swap(core: Any, first: HarmonicModel, model: HarmonicModel) -> None:
    """Let ``core``, made for the ``first`` model, correct by another one."""
    of_type("model", model, HarmonicModel, "a HarmonicModel")
    for name in ("period", "indicated_sign"):
        own, other = getattr(first, name), getattr(model, name)
        if own != other:
            raise ArgumentError(f"swap: model has the {name} {other:g}, and the step {own:g}")
    if bool(model.terms) != bool(first.terms):
        has = "terms, and the step none" if model.terms else "no terms, and the step some"
        raise ArgumentError(f"swap: model has {has}: take its own compensator()")
    core.swap(model._core_corrector() if model.terms else model._series)


def _line(model: ErrorModel) -> str:
    """What the model is, in one line of a screen."""
    lines = len(model.orders)
    parts = [
        f"{lines} {'order' if lines == 1 else 'orders'}"
        + (f" of {_names([shaft.name for shaft in model.shafts])}" if model.shafts else ""),
        f"period {model.period:g}",
        f"argument {model.argument}",
        *(["reversed sensor"] if model.indicated_sign < 0 else []),
    ]
    if model.terms:
        parts.append(f"with {_names([term.kind for term in model.terms])}")
    return f"<HarmonicModel: {', '.join(parts)}>"


def _summary(model: ErrorModel) -> str:
    """The harmonics by shaft and order, in arcseconds, and what is known about the fit."""
    period, unit = model.period, unit_name(model.period)
    rms = math.sqrt(0.5 * float(model.amplitudes @ model.amplitudes))
    shown = error_unit("auto", sine_of_rms(arcsec(rms, period)))
    lines = [
        *wrapped_lines(_line(model)[1:-1], 2),
        f"constant {model.constant:.6g} {unit}, {arcsec(model.constant, period):.6g} arcsec",
        f"{'shaft':16s} {'order':>10s} {f'amplitude, {shown.name}':>18s} {'phase, deg':>11s}",
    ]
    rows = [
        f"{shaft.name:16.16s} {k:10d} {shown.number(arcsec(c, period)):>18} "
        f"{math.degrees(p) % 360.0:11.2f}"
        for shaft in model.shafts
        for k, c, p in zip(shaft.orders, shaft.amplitudes, shaft.phases, strict=True)
    ]
    lines += rows[:_LISTED]
    if len(rows) > _LISTED:
        lines.append(f"... and {len(rows) - _LISTED} more")
    if model.fit is not None:
        start, stop = model.fit.span
        lines.append(
            f"fitted to {counted(model.fit.samples, 'reading')} of "
            f"{counted(model.fit.runs, 'run')} "
            f"between {start:.6g} and {stop:.6g} {unit}"
        )
    return laid_out(lines)


def _names(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(name[:_LETTERS] for name in names[:_NAMED]) + more


class DecodedStep:
    """The angle of two channels, then a correction that follows signals and travel."""

    def __init__(self, decode: Any, correct: Any, channels: int = 2) -> None:
        self._decode, self._correct, self._channels = decode, correct, channels

    def __call__(self, *readings: Any, **named: Any) -> Any:
        """The true angle of the channels; signals follow them."""
        n = self._channels
        return self._correct(self._decode(*readings[:n]), *readings[n:], **named)


def _channel_step(model: ErrorModel) -> Any:
    """``step(sine, cosine) -> corrected``; with signals where terms of the model need some.

    The arc tangent and the harmonics are one call of the core; terms are a second one. It keeps its
    model: there is no ``swap``.
    """
    assert model.channels is not None
    constants = model.channels.constants
    if model.channels.second is not None:
        core = model._core_corrector() if model.terms else _core.Compensator(model._series)
        return DecodedStep(model.channels.angle_of, core.step, len(model.channels.roles))
    if model.terms:
        step: Any = DecodedStep(_core.Decoder(constants).step, model._core_corrector().step)
    else:
        series = model._series if model.shafts or model.constant else None
        step = _core.Decoder(constants, series).step
    return step
