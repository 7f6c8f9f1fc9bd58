"""From a coasting shaft to a corrected loop, without a reference.

``python examples/spin_down.py [--samples 20000]``: a simulated rotor with cogging
coasts from 10 to 2 turns per second; its encoder is calibrated from the time stamps alone; a
position loop then runs on the corrected reading of the same joint.
"""

import argparse
import math

import numpy as np

import trueangle as ta
from trueangle.simulation import Harmonic, RunDesign, Simulation

ARCSEC = 1.0 / 3600.0
RATE = 1000.0  # readings per second

LINES = (
    Harmonic("output", 1, 300.0, 20.0),
    Harmonic("output", 2, 150.0, 60.0),
    Harmonic("output", 4, 50.0, 110.0),
)


def joint(samples: int) -> Simulation:
    """A rotor that coasts to a fifth of its speed while ``samples`` readings are taken."""
    coast = RunDesign(
        speed_deg_s=3600.0,
        speed_end_deg_s=720.0,
        turns=8.0 * samples / RATE / math.log(5.0),
        samples=samples,
        spacing="clock",
        cogging_deg_s2=30.0,
        cogging_order=6.0,
    )
    return Simulation(harmonics=LINES, sigma_arcsec=20.0, runs=(coast,))


def loop(sim: Simulation, model: ta.HarmonicModel | None, rng: np.random.Generator) -> float:
    """Error of the true angle, arcsec rms, when a loop follows a slow ramp."""
    correct = (lambda reading: reading) if model is None else model.compensator()
    true, off = 0.0, []
    for i in range(4000):
        target = 0.09 * i
        error = float(sim.pattern.value(np.array([math.radians(true)]))[0])
        reading = true + (error + 0.25 * sim.sigma_arcsec * rng.normal()) * ARCSEC
        true += 0.3 * (target - correct(reading))
        off.append(true - target)
    return float(np.std(off[200:])) / ARCSEC


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=20_000)
    args = parser.parse_args()
    sim = joint(args.samples)
    run = ta.simulate(sim, seed=11)[0]
    log = {"time_s": run.time, "indicated_deg": np.mod(run.indicated, 360.0)}
    found = ta.selfcal(log, orders=[line.order for line in LINES], loop="open")
    print(found.summary())
    error = sim.pattern.value(np.radians(run.reference))
    left = error - 3600.0 * found.model.error(run.reference)
    print(f"\npattern: {np.std(error):.1f} arcsec rms, left {np.std(left):.2f}")
    rng = np.random.default_rng(12)
    before, after = loop(sim, None, rng), loop(sim, found.model, rng)
    print(f"loop on the reading: true angle {before:.1f} arcsec rms off, corrected {after:.1f}")
