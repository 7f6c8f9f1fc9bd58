"""Effects of speed: the delay of a reading, and the filter of a tracking loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from .term import Term

__all__ = ["FilterLag", "Latency"]


@dataclass(frozen=True)
class Latency(Term):
    r"""The indicated angle is a time :math:`\tau` old.

    .. math:: \mathrm{indicated}(t) = \theta(t - \tau) + \varepsilon(\theta(t - \tau))

    so :math:`\varphi = \theta - v\tau` is solved for and :math:`v\tau` added. Exact at
    constant velocity; an acceleration a leaves :math:`a\tau^2/2`.

    Parameters
    ----------
    delay_s : float
        :math:`\tau` in seconds; negative where the reference is the later one.
    """

    delay_s: float

    kind: ClassVar[str] = "latency"
    signals: ClassVar[tuple[str, ...]] = ("velocity",)

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(table["delay_s"])


@dataclass(frozen=True)
class FilterLag(Term):
    r"""The harmonics behind a first-order low-pass that has no ramp error.

    At v turns per second a line of output order m is multiplied by
    :math:`1/(1 + j\,m v/f_c)`. Exact at constant velocity; after a change of velocity
    the filter itself needs about :math:`1/(2\pi f_c)` to follow.

    Parameters
    ----------
    cutoff_hz : float
        :math:`f_c > 0`.
    """

    cutoff_hz: float

    kind: ClassVar[str] = "filter_lag"
    signals: ClassVar[tuple[str, ...]] = ("velocity",)

    def check(self) -> None:
        if self.cutoff_hz <= 0.0:
            raise self._out_of_range("cutoff_hz", "positive")

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(table["cutoff_hz"])
