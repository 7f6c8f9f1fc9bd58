"""The demonstration: a simulated joint with one effect that its simulation lacks."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike

from ..simulation import Backlash, Effect, Harmonic, Joint, RunDesign, Simulation, simulate
from .composition import Report, report

#: Runs of the demonstration: a turn out and a turn back, two speeds, repeated.
_RUNS = tuple(
    RunDesign(
        label=f"{way}-{pace}-{repeat}",
        direction=direction,
        speed_deg_s=speed,
        samples=300,
        spacing="jittered",
        turns=2.0,
        reversals=(0.5,),
    )
    for repeat in (1, 2)
    for way, direction in (("forward", 1), ("backward", -1))
    for pace, speed in (("slow", 5.0), ("fast", 30.0))
)


def demo_simulation() -> Simulation:
    """A strain wave joint of ratio 100 as it is assumed to be."""
    return Simulation(
        Joint(100.0, "circular_spline", "motor"),
        harmonics=(
            Harmonic("output", 1, 14.1, 243.75),
            Harmonic("motor", 1, 18.0, 46.5),
            Harmonic("motor", 2, 19.6, 247.9),
            Harmonic("wave_generator", 2, 33.4, 20.8),
        ),
        sigma_arcsec=3.0,
        runs=_RUNS,
    )


def demo_report(
    path: str | PathLike[str] | None = None,
    *,
    hidden: Effect | None = None,
    seed: int = 0,
) -> Report:
    """Measure a simulated joint that has one more effect than its simulation; report it.

    Parameters
    ----------
    path : path, optional
        Where to write the page.
    hidden : Effect, optional
        The effect that the simulation does not know; by default backlash of 8 arcsec.
    seed : int

    Returns
    -------
    Report
    """
    believed = demo_simulation()
    true = replace(believed, effects=(Backlash(8.0) if hidden is None else hidden,))
    return report(
        simulate(true, seed=seed),
        path,
        simulation=believed,
        title="Demonstration: a simulated joint with one hidden effect",
    )
