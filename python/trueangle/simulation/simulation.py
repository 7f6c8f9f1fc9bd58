"""The simulation of a joint: lines, effects, noise and the runs that measure it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..effects import KINDS, Effect, MissingOrder, ReferenceLines
from ..errors import ArgumentError
from ..joint.joint import Joint
from ..joint.pattern import Harmonic, JointPattern, Pattern
from ..joint.signals import Signals, join_runs
from ..runs.run import CalibrationRun, as_runs
from ..support.angles import ARCSEC_PER_DEG
from ..support.argumentkinds import all_of_type, of_type, told_kinds
from ..support.arrays import Array
from ..support.distributions import random_numbers
from ..support.layout import counted
from ..support.plainresult import ShownResult
from .designs import RunDesign
from .simulationtext import StatedSimulation, simulation_text, write_simulation

#: What must be given, for messages.
SIMULATION = "a trueangle.Simulation (trueangle.load_simulation reads one)"
LINE, DESIGN = "a trueangle.simulation.Harmonic", "a trueangle.simulation.RunDesign"
EFFECT = "an effect of a simulation, in arcsec and degrees"


@told_kinds
@dataclass(frozen=True)
class Simulation(ShownResult):
    """The assumed model of a joint, and how it is measured.

    ::

        ε = p(θ) + Σ_e ε_e + n

    with the true angle theta as the argument of every line.

    Parameters
    ----------
    joint : Joint
    harmonics : tuple of Harmonic
        Lines of the pattern p.
    effects : tuple of Effect
        Anything of `trueangle.effects.KINDS`.
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
        put = object.__setattr__
        of_type("joint", self.joint, Joint, "a trueangle.simulation.Joint")
        put(self, "harmonics", all_of_type("harmonics", self.harmonics, Harmonic, LINE))
        put(self, "effects", _effects(self.effects))
        put(self, "runs", all_of_type("runs", self.runs, RunDesign, DESIGN))
        if not 0.0 <= self.sigma_arcsec < float("inf"):
            raise ArgumentError(f"sigma_arcsec must not be negative, got {self.sigma_arcsec!r}")
        for part in (*self.harmonics, *self.effects):  # some effects are of one shaft as well
            self.joint.output_order(getattr(part, "shaft", "output"), 1.0)

    @property
    def pattern(self) -> Pattern:
        """The lines as one function of the output angle."""
        return Pattern.of(self.harmonics, self.joint)

    @property
    def surroundings(self) -> JointPattern:
        """What effects are given of the assumed model, in addition to the readings."""
        return JointPattern(self.joint, self.pattern)

    @property
    def whole_surroundings(self) -> JointPattern:
        """The same with further lines in the pattern: a delay moves those as well."""
        further = (e for e in self.effects if isinstance(e, MissingOrder))
        lines = [Harmonic(e.shaft, e.order, e.amplitude_arcsec, e.phase_deg) for e in further]
        return JointPattern(self.joint, Pattern.of([*self.harmonics, *lines], self.joint))

    def _brief(self) -> str:
        return (
            f"gear {self.joint.gear_ratio:g}, {counted(self.harmonics, 'line')}, "
            f"{counted(self.effects, 'effect')}, {counted(self.runs, 'run')}, noise "
            f"{self.sigma_arcsec:g} arcsec"
        )

    def summary(self) -> str:
        """The assumed model as a simulation file has it, and the names of the runs."""
        named = ", ".join(design.label or str(i) for i, design in enumerate(self.runs, 1))
        told = f"\n# {counted(self.runs, 'run')}" + (f": {named}" if named else "")
        return simulation_text(self._stated._replace(source=None, runs=())) + told

    def with_effects(self, effects: Iterable[Effect]) -> Simulation:
        """The simulation with further effects.

        Raises
        ------
        KindError
            Something that is no effect, such as a term of a correction model.
        """
        return replace(self, effects=(*self.effects, *_effects(effects)))

    def predict(self, runs: CalibrationRun | Iterable[CalibrationRun] | Signals) -> Array:
        """Expected error at every reading of ``runs`` one after the other, arcsec.

        Random effects (zeros, drifts, outliers) count as their mean, zero.
        """
        signals = runs if isinstance(runs, Signals) else join_runs(as_runs(runs))
        around = self.whole_surroundings
        error = self.pattern.value(signals.theta)
        for effect in self.effects:
            error = error + effect.expected(signals, around)
        return error

    def save(self, path: str | Path) -> None:
        """Write the simulation as TOML (`trueangle.simulation.simulationtext.write_simulation`)."""
        write_simulation(self._stated, path)

    def text(self) -> str:
        """What `save` writes."""
        return simulation_text(self._stated)

    @property
    def _stated(self) -> StatedSimulation:
        return StatedSimulation(*(getattr(self, entry.name) for entry in fields(self)))


@told_kinds
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
        In degrees, with time, velocity, torque, temperature and mount; with the signals
        that joint and runs have in addition: ``head1`` ..., ``motor``, ``shift``, ``current``.

    Raises
    ------
    KindError
        What is given is no simulation, or a run that is no design of one.
    ArgumentError
        No run is designed; numbers so large that readings are not finite.

    Examples
    --------
    >>> from trueangle.simulation import Harmonic, RunDesign, Simulation, simulate
    >>> sim = Simulation(harmonics=(Harmonic("output", 1, 3600.0, 90.0),))
    >>> run = simulate(sim, runs=[RunDesign(samples=4, spacing="uniform")])[0]
    >>> run.error.round(6) + 0.0
    array([ 1.,  0., -1.,  0.])
    """
    of_type("sim", sim, Simulation, SIMULATION)
    rng = random_numbers(seed)
    designs = sim.runs if runs is None else all_of_type("runs", runs, RunDesign, DESIGN)
    if not designs:
        raise ArgumentError("the simulation designs no run: add a [[run]] table for each")
    around = sim.whole_surroundings
    ideal = [_measured(sim, design, j, rng) for j, design in enumerate(designs)]
    signals = join_runs(ideal)
    error = sim.pattern.value(signals.theta)
    endless = [] if np.isfinite(error).all() else ["its harmonics"]
    spread = np.full(len(signals), sim.sigma_arcsec)
    reference = np.zeros(len(signals))
    turned = np.repeat([d.shift_deg is not None for d in designs], [len(run) for run in ideal])
    for effect in sim.effects:
        found = effect.signal(signals, around, rng)
        if not np.isfinite(found).all():
            endless.append(f"the effect {effect.kind}")
        error = error + found
        if isinstance(effect, ReferenceLines):
            reference = reference + np.where(turned, found, 0.0)
        factor = effect.noise_factor(signals, around)
        if factor is not None:
            spread = spread * factor
    error = (error + spread * rng.standard_normal(len(signals))) / ARCSEC_PER_DEG
    # Where the reference is an encoder turned for the run, its error is in its own readings.
    reference /= ARCSEC_PER_DEG
    theta = np.concatenate([run.reference for run in ideal])
    own = theta + (error - reference)
    recorded = _written(sim, own)
    if not (np.isfinite(recorded).all() and np.isfinite(reference).all()):
        _refuse_endless(sim, " and ".join(endless) or "what is added to the angles")
    beside = _beside(sim, designs, signals, own, spread, rng)
    runs_made = []
    for run, (a, b) in zip(ideal, signals.run_bounds(), strict=True):
        read = {name: values[a:b] for name, values in beside.items()}
        runs_made.append(
            replace(
                run,
                reference=run.reference - reference[a:b],
                indicated=recorded[a:b],
                signals={**run.signals, **{k: v for k, v in read.items() if not np.isnan(v).any()}},
            )
        )
    return runs_made


def simulate_along(
    sim: Simulation,
    runs: Iterable[CalibrationRun],
    seed: int | np.random.Generator = 0,
    correlation: float = 0.0,
) -> list[CalibrationRun]:
    """Measure a simulated joint along the motion of runs that there are.

    Parameters
    ----------
    sim : Simulation
        Its own runs are not looked at.
    runs : iterable of CalibrationRun
    seed : int or numpy.random.Generator
    correlation : float
        Of the noise, from one reading to the next: ``n_t = ρ n_{t-1} + e_t`` within a run,
        of the simulation's standard deviation.

    Returns
    -------
    list of CalibrationRun
        With the same references and signals, and other indicated angles.

    Raises
    ------
    ArgumentError
        No run, or a correlation that is none.

    Examples
    --------
    >>> from trueangle.simulation import Harmonic, RunDesign, Simulation
    >>> sim = Simulation(harmonics=(Harmonic("output", 1, 3600.0, 90.0),))
    >>> ideal = simulate(Simulation(), runs=[RunDesign(samples=4, spacing="uniform")])
    >>> simulate_along(sim, ideal)[0].error.round(6) + 0.0
    array([ 1.,  0., -1.,  0.])
    """
    given = as_runs(runs)
    if not 0.0 <= correlation < 1.0:
        raise ArgumentError(f"correlation must be from 0 to below 1, got {correlation!r}")
    rng = random_numbers(seed)
    signals, around = join_runs(given), sim.whole_surroundings
    error, noise = sim.pattern.value(signals.theta), rng.standard_normal(len(signals))
    for start, stop in signals.run_bounds() if correlation else ():
        for k in range(start + 1, stop):
            noise[k] = correlation * noise[k - 1] + np.sqrt(1.0 - correlation**2) * noise[k]
    for effect in sim.effects:
        error = error + effect.signal(signals, around, rng)
        noise = noise * (1.0 if (f := effect.noise_factor(signals, around)) is None else f)
    own = signals.degrees + (error + sim.sigma_arcsec * noise) / ARCSEC_PER_DEG
    read = _written(sim, own)
    return [
        replace(run, indicated=read[a:b] * (run.period / 360.0))
        for run, (a, b) in zip(given, signals.run_bounds(), strict=True)
    ]


def _effects(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """The effects, checked: terms of a correction model have similar names, and other units."""
    return all_of_type("effects", effects, Effect, EFFECT, _meant)


def _meant(value: object) -> str:
    """Which effect to use instead of what was given."""
    effect = KINDS.get(getattr(value, "kind", ""))
    if effect is None:
        return ""
    return f"the effect of kind '{effect.kind}' is trueangle.simulation.{effect.__name__}"


def _measured(
    sim: Simulation, design: RunDesign, j: int, rng: np.random.Generator
) -> CalibrationRun:
    """What a run would measure of an ideal joint."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return design.measure(rng, str(j + 1), sim.pattern)
    except ArgumentError as cause:
        if "finite" in str(cause):
            _refuse_endless(sim, f"run {j + 1}")
        raise


def _refuse_endless(sim: Simulation, what: str) -> NoReturn:
    place = f"{sim.source}: " if sim.source else ""
    raise ArgumentError(
        f"{place}simulated readings are not finite: numbers of {what} are too large; make them "
        "smaller"
    )


def _written(sim: Simulation, degrees: Array) -> Array:
    """Readings as they are recorded: rounded, where an effect rounds them."""
    for effect in sim.effects:
        degrees = effect.written(degrees)
    return degrees


def _beside(
    sim: Simulation,
    designs: tuple[RunDesign, ...],
    signals: Signals,
    own: Array,
    spread: Array,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """What heads and the motor's own encoder read, degrees; not a number where not recorded.

    ``own`` is what the joint's own head reads. A further head reads lines and effects at its own
    place, and of random effects the mean.
    """
    found = {}
    for i, head in enumerate(sim.joint.heads, 1):
        if head.angle_deg % 360.0 == 0.0:
            found[f"head{i}"] = _written(sim, own + head.angle_deg)
            continue
        there = replace(signals, theta=signals.theta + np.radians(head.angle_deg))
        noise = spread * rng.standard_normal(len(signals))
        read = there.degrees + (sim.predict(there) + noise) / ARCSEC_PER_DEG
        found[f"head{i}"] = _written(sim, read)
    sigma = [np.nan if d.motor_sigma_arcsec is None else d.motor_sigma_arcsec for d in designs]
    if not np.isnan(sigma).all():
        noise = np.array(sigma)[signals.run] * rng.standard_normal(len(signals))
        found["motor"] = signals.degrees * sim.joint.gear_ratio + noise / ARCSEC_PER_DEG
    return found
