"""One reading of two channels at a time, corrected by a model."""

from __future__ import annotations

from typing import Any

from .. import _core
from .errormodel import ErrorModel


class DecodedStep:
    """The angle of two channels, then a correction that follows signals and travel."""

    def __init__(self, decode: Any, correct: Any) -> None:
        self._decode, self._correct = decode, correct

    def __call__(self, sine: float, cosine: float, /, *signals: Any, **named: Any) -> Any:
        """The true angle of two channels."""
        return self._correct(self._decode(sine, cosine), *signals, **named)


def channel_step(model: ErrorModel) -> Any:
    """``step(sine, cosine) -> corrected``; with signals where terms of the model need some.

    The arc tangent and the harmonics are one call of the core; terms are a second one. It keeps its
    model: there is no ``swap``.
    """
    assert model.channels is not None
    constants = model.channels.constants
    if model.terms:
        step: Any = DecodedStep(_core.Decoder(constants).step, model._core_corrector().step)
    else:
        series = model._series if model.shafts or model.constant else None
        step = _core.Decoder(constants, series).step
    return step
