"""CPU seconds of a diagnosis: of 10 000 readings with one cause, and of measured readings.

    python benches/diagnose.py [CASE ...] [--rounds 3] [--keep accounts.json]
    python benches/diagnose.py --against accounts.json   # the same accounts, to rounding?

Measured readings are looked for in `../shared/data` or in `$TRUEANGLE_DATA`, and are held
against an empty simulation of a direct drive, which is the slow case: nothing is known, and
not all of it has a name.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

import trueangle as ta
from trueangle.simulation import (
    ArgumentShift,
    Backlash,
    DriftWithinRun,
    FilterLag,
    Harmonic,
    HeteroscedasticNoise,
    Joint,
    Latency,
    LoadDependentGearError,
    LocalDefect,
    MissedCounts,
    MissingOrder,
    NonIntegerOrder,
    Outliers,
    PreslidingHysteresis,
    ReferenceLines,
    RunDesign,
    ScaleError,
    Sidebands,
    Simulation,
    StiffeningCompliance,
    ThermalDrift,
    TorsionalCompliance,
    ZeroSlip,
    simulate,
)

#: Where measured readings may be.
PLACES = [os.environ.get("TRUEANGLE_DATA", ""), "../shared/data", "../../shared/data"]
MEASURED = ("resolver_stepper", "resolver_two_clocks_fit", "servo_loop_simulated", "rm44_repeat")

LINES = (
    Harmonic("output", 1, 14.0, 243.0),
    Harmonic("output", 2, 6.0, 20.0),
    Harmonic("motor", 1, 12.0, 46.0),
    Harmonic("motor", 2, 10.0, 248.0),
    Harmonic("wave_generator", 2, 33.0, 115.0),
)

CAUSES = (
    MissingOrder("wave_generator", 1, 2.0, 40.0),
    Sidebands(102.0, (-1.0, 1.0), (2.0, 2.5), (30.0, 70.0)),
    NonIntegerOrder(21.4, 2.0),
    Backlash(3.0),
    PreslidingHysteresis(4.0, 3.0),
    Latency(30e-6),
    FilterLag(75.0),
    ThermalDrift(0.15),
    TorsionalCompliance(0.6),
    StiffeningCompliance(1.0, -0.025),
    LoadDependentGearError(((102.0, 0.5, 30.0),)),
    ZeroSlip(2.4),
    DriftWithinRun(0.0, 5.0),
    ScaleError(1e-5),
    ReferenceLines((1.0, 2.0), (2.0, 1.0), (10.0, 50.0)),
    ArgumentShift(-1.0),
    Outliers(0.01, 41.0),
    MissedCounts(20.0, 3, 150),
    HeteroscedasticNoise(0.6, 0.3),
    LocalDefect(77.0, 2.0, 8.0),
)

#: Runs of a design and readings in each: 10 000 in all.
RUNS, READINGS = 16, 625

#: Relative difference within which two accounts are one: rounding, through a search.
SAME = 1e-4


def designs(seed: int = 5) -> tuple[RunDesign, ...]:
    """There and back in each run, two speeds, loads and temperatures, three mounts."""
    rng = np.random.default_rng(seed)
    levels = [(v, load, t) for v in (5.0, 30.0) for load in (0.0, 5.0) for t in (20.0, 35.0)] * 2
    return tuple(
        RunDesign(
            direction=1 if k % 2 else -1,
            speed_deg_s=levels[place][0],
            samples=READINGS,
            start_deg=float(rng.uniform(0.0, 360.0)),
            turns=2.1,
            reversals=(0.5, 0.6, 0.7),
            gravity_Nm=levels[place][1],
            temperature_C=levels[place][2],
            mount_deg=(0.0, 130.0, 250.0)[k % 3],
        )
        for k, place in enumerate(rng.permutation(RUNS))
    )


def cases() -> dict[str, tuple[list[ta.CalibrationRun], Simulation]]:
    believed = Simulation(
        Joint(50.0, "circular_spline", "motor"), LINES, sigma_arcsec=1.5, runs=designs()
    )
    found = {"nothing": (simulate(believed, 5), believed)}
    for cause in CAUSES:
        found[cause.kind] = (simulate(believed.with_effects([cause]), 5), believed)
    root = Path(__file__).parent.parent
    empty = Simulation(Joint(1.0, "none", "output"))
    for name in MEASURED:
        paths = [root / place / f"{name}.csv" for place in PLACES if place]
        path = next((path for path in paths if path.exists()), None)
        if path is not None:
            found[name] = (ta.read_runs(path), empty)
    return found


def differences(one: object, other: object, at: str = "") -> list[str]:
    """Where two accounts are not the same."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        return [d for key in one for d in differences(one[key], other[key], f"{at}.{key}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return [d for k, (a, b) in pairs for d in differences(a, b, f"{at}[{k}]")]
    # Next to nothing is left of simulated readings without noise.
    floats = isinstance(one, float) and isinstance(other, float)
    if floats and abs(one - other) <= SAME * max(abs(one), abs(other), 1e-3):
        return []
    return [] if one == other else [f"{at}: {one!r} -> {other!r}"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", help="names of causes or of measured readings")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="write the accounts to this file")
    parser.add_argument("--against", type=Path, help="compare with accounts kept before")
    args = parser.parse_args()
    every = cases()
    before = json.loads(args.against.read_text()) if args.against else {}
    accounts = {}
    medians = {}
    status = 0
    for name in args.cases or every:
        runs, sim = every[name]
        seconds = []
        for _ in range(args.rounds):
            start = time.process_time()
            result = ta.diagnose(runs, sim)
            seconds.append(time.process_time() - start)
        accounts[name] = json.loads(result.to_json())
        medians[name] = statistics.median(seconds)
        named = ", ".join(finding.cause for finding in result.findings)
        spread = f"({min(seconds):.2f} .. {max(seconds):.2f})"
        print(f"{name:28s} {medians[name]:6.2f} s CPU {spread}  {named}", flush=True)
        if name in before:
            for line in differences(before[name], accounts[name])[:20]:
                print(f"    {line}")
                status = 1
    single = [medians[name] for name in medians if name not in MEASURED]
    if single:
        print(f"single causes: median {statistics.median(single):.2f} s, worst {max(single):.2f} s")
    if args.keep:
        args.keep.write_text(json.dumps(accounts))
    return status


if __name__ == "__main__":
    sys.exit(main())
