"""What every hidden effect has in common: a size, a signal, and parameters to find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from .designs import Scene
from .joint import Joint

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Source:
    """A hidden effect; the shape is fixed by its fields, the strength by ``size``."""

    cause: ClassVar[str]
    #: True where the effect sits in the reference and not in the joint.
    of_reference: ClassVar[bool] = False
    #: The signal's rms grows about like size**exponent.
    exponent: ClassVar[float] = 1.0

    size: float = 1.0
    seed: int = 0

    def signals(self, joint: Joint, scenes: Sequence[Scene]) -> list[Array]:
        """What the effect adds to the error of every scene, arcsec."""
        return [self.signal(joint, scene, i) for i, scene in enumerate(scenes)]

    def signal(self, joint: Joint, scene: Scene, run: int) -> Array:
        """The same for one scene."""
        raise NotImplementedError

    def noise_factors(self, scenes: Sequence[Scene]) -> list[Array]:
        """What multiplies the standard deviation of the noise."""
        return [np.ones(scene.theta.size) for scene in scenes]

    def adapt(self, joint: Joint) -> Joint:
        """The joint in which the effect has its size; most leave it alone."""
        return joint

    def parameters(self) -> dict[str, float]:
        """True values of parameters whose meaning the library shares."""
        return {}

    def chance(self, run: int) -> np.random.Generator:
        """Random numbers of one run, the same at every call."""
        return np.random.default_rng([self.seed, run])

    def sized(self, joint: Joint, scenes: Sequence[Scene], rms: float) -> Self:
        """The same shape with the strength that gives a signal of ``rms`` arcsec."""
        source = self
        for _ in range(6):
            found = spread(source.signals(source.adapt(joint), scenes))
            source = replace(source, size=source.size * (rms / found) ** (1.0 / self.exponent))
        return source


def spread(signals: Sequence[Array]) -> float:
    """Standard deviation of a signal over all readings; a common constant is no error."""
    return float(np.concatenate(list(signals)).std())
