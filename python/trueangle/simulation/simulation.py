"""The simulation of a joint: lines, effects, noise and the runs that measure it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..effects import Effect
from ..errors import ArgumentError
from ..joint.joint import Joint
from ..joint.pattern import Harmonic, Pattern, Surroundings
from ..joint.signals import Signals, join_runs
from ..runs import CalibrationRun, as_runs
from .designs import RunDesign

__all__ = ["Simulation", "simulate"]

Array = NDArray[np.float64]

ARCSEC_PER_DEG = 3600.0


@dataclass(frozen=True)
class Simulation:
    r"""What is believed of a joint, and how it is measured.

    .. math:: \varepsilon = p(\theta) + \sum_e \varepsilon_e + n

    with the true angle theta as the argument of every line.

    Parameters
    ----------
    joint : Joint
    harmonics : tuple of Harmonic
        Lines of the pattern p.
    effects : tuple of Effect
        Anything of `trueangle.effects.EFFECTS`.
    sigma_arcsec : float
        White noise of one reading.
    runs : tuple of RunDesign
    source : str, optional
        The file it was read from.

    Examples
    --------
    >>> from trueangle.simulation import Backlash, Harmonic, Joint, RunDesign, Simulation
    >>> sim = Simulation(
    ...     Joint(100.0, "circular_spline", "motor"),
    ...     harmonics=(Harmonic("wave_generator", 2, 33.0),),
    ...     effects=(Backlash(3.0),),
    ...     runs=(RunDesign(reversals=(0.5,)),),
    ... )
    >>> sim.pattern.orders
    array([202.])
    """

    joint: Joint = field(default_factory=Joint)
    harmonics: tuple[Harmonic, ...] = ()
    effects: tuple[Effect, ...] = ()
    sigma_arcsec: float = 0.0
    runs: tuple[RunDesign, ...] = ()
    source: str | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.sigma_arcsec < float("inf"):
            raise ArgumentError(f"sigma_arcsec must not be negative, got {self.sigma_arcsec!r}")
        for line in self.harmonics:
            self.joint.output_order(line.shaft, line.order)

    @property
    def pattern(self) -> Pattern:
        """The lines as one function of the output angle."""
        return Pattern.of(self.harmonics, self.joint)

    @property
    def surroundings(self) -> Surroundings:
        """What effects are given beyond the readings."""
        return Surroundings(self.joint, self.pattern)

    def with_effects(self, effects: Iterable[Effect]) -> Simulation:
        """The simulation with further effects."""
        return replace(self, effects=(*self.effects, *effects))

    def predict(self, runs: CalibrationRun | Iterable[CalibrationRun] | Signals) -> Array:
        """Expected error at every reading of ``runs`` one after the other, arcsec.

        Random effects (zeros, drifts, outliers) count as their mean, zero.
        """
        signals = runs if isinstance(runs, Signals) else join_runs(as_runs(runs))
        around = self.surroundings
        error = around.pattern.value(signals.theta)
        for effect in self.effects:
            error = error + effect.expected(signals, around)
        return error

    def save(self, path: str | Path) -> None:
        """Write the simulation as TOML (`trueangle.simulation.simulationtext.write`)."""
        from .simulationtext import write

        write(self, path)


def simulate(
    sim: Simulation, seed: int | np.random.Generator = 0, runs: Iterable[RunDesign] | None = None
) -> list[CalibrationRun]:
    """Measure a simulated joint.

    Parameters
    ----------
    sim : Simulation
    seed : int or numpy.random.Generator
        Equal seeds give equal runs on every machine.
    runs : iterable of RunDesign, optional
        Instead of the simulation's own.

    Returns
    -------
    list of CalibrationRun
        In degrees, with time, velocity, torque, temperature and mount.

    Raises
    ------
    ArgumentError
        No run is designed.

    Examples
    --------
    >>> from trueangle.simulation import Harmonic, RunDesign, Simulation, simulate
    >>> sim = Simulation(harmonics=(Harmonic("output", 1, 3600.0, 90.0),))
    >>> run = simulate(sim, runs=[RunDesign(samples=4, spacing="uniform")])[0]
    >>> run.error.round(6) + 0.0
    array([ 1.,  0., -1.,  0.])
    """
    rng = np.random.default_rng(seed)
    designs = tuple(sim.runs if runs is None else runs)
    if not designs:
        raise ArgumentError("the simulation designs no run: add a [[run]] table or pass runs=")
    ideal = [design.measure(rng, str(j + 1)) for j, design in enumerate(designs)]
    signals = join_runs(ideal)
    around = sim.surroundings
    error = around.pattern.value(signals.theta)
    spread = np.full(len(signals), sim.sigma_arcsec)
    for effect in sim.effects:
        error = error + effect.signal(signals, around, rng)
        factor = effect.noise_factor(signals, around)
        if factor is not None:
            spread = spread * factor
    error = (error + spread * rng.standard_normal(len(signals))) / ARCSEC_PER_DEG
    cuts = np.cumsum([len(run) for run in ideal])[:-1]
    return [
        replace(run, indicated=run.reference + part)
        for run, part in zip(ideal, np.split(error, cuts), strict=True)
    ]
