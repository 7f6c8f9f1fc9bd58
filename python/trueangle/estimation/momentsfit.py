"""What is found from sums over readings, and the sums of one run."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.shafts import Shaft, ShaftOrders
from ..model.model import Argument, HarmonicModel
from ..support.plainresult import ShownResult


class Spectrum(NamedTuple):
    """Sums over the readings of one run from which any orders can be fitted.

    Order ``k`` counts cycles of the base shaft, ``cycles`` per output turn; ``y`` is the
    error counted from ``centre``.
    """

    weight: NDArray[np.complex128]
    """``Σ w e^(ikx)`` for ``k`` from 0 to twice the highest order."""
    error: NDArray[np.complex128]
    """``Σ w y e^(ikx)`` for ``k`` from 0 to the highest order."""
    squares: float
    """``Σ w y²``."""
    samples: int
    """Readings of positive weight."""
    centre: float
    """The angle that ``y`` is counted from."""
    cycles: float
    """Turns of the base shaft per output turn."""


@dataclass(frozen=True)
class MomentsFit(ShownResult):
    """What `Moments.solve` found; angles in the unit of the moments' period."""

    shafts: tuple[Shaft, ...]
    constant: float
    """Circular mean of the zeros of the runs."""
    offsets: dict[Hashable, float]
    """Zero of each run."""
    offset_std: dict[Hashable, float]
    covariance: NDArray[np.float64]
    """Of ``[constant, A, B of each order of each shaft in turn]``."""
    residual_variance: float
    degrees_of_freedom: float
    condition_number: float
    period: float
    method: str
    """``"moments"`` (normal equations) or ``"qr"`` (factors of segments)."""

    @classmethod
    def of(
        cls,
        found: _core.Solution,
        wanted: Sequence[ShaftOrders],
        runs: Sequence[Hashable],
        period: float,
    ) -> MomentsFit:
        """What the core found, by shafts and runs."""
        pairs = zip(wanted, found.cosine, found.sine, strict=True)
        return cls(
            shafts=tuple(
                Shaft(s.name, s.cycles_per_turn, s.orders, tuple(a), tuple(b)) for s, a, b in pairs
            ),
            constant=found.constant,
            offsets=dict(zip(runs, found.offsets.tolist(), strict=True)),
            offset_std=dict(zip(runs, np.asarray(found.offset_std).tolist(), strict=True)),
            covariance=found.covariance,
            residual_variance=found.residual_variance,
            degrees_of_freedom=found.degrees_of_freedom,
            condition_number=found.condition_number,
            period=period,
            method=found.method,
        )

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of each shaft in turn."""
        return tuple(k for shaft in self.shafts for k in shaft.orders)

    @property
    def cosine(self) -> NDArray[np.float64]:
        """``A`` of each order."""
        return np.array([a for shaft in self.shafts for a in shaft.cosine])

    @property
    def sine(self) -> NDArray[np.float64]:
        """``B`` of each order."""
        return np.array([b for shaft in self.shafts for b in shaft.sine])

    @property
    def amplitudes(self) -> NDArray[np.float64]:
        """``C = hypot(A, B)`` of each order."""
        return np.hypot(self.cosine, self.sine)

    @property
    def phases(self) -> NDArray[np.float64]:
        """``phi = atan2(A, B)`` of each order, in radians."""
        return np.arctan2(self.cosine, self.sine)

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard errors of ``[constant, A, B ...]``."""
        return np.sqrt(np.diag(self.covariance))

    def model(self, argument: Argument = "reference") -> HarmonicModel:
        """The fitted series as a model that corrects."""
        return HarmonicModel(
            self.shafts,
            self.constant,
            self.period,
            argument,
            covariance=self.covariance,
            condition_number=self.condition_number,
        )
