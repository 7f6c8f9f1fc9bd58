"""Stated errors and p values of every method in ordinary designs: noise that remembers, couplings.

Pulls are (value - truth) / stated error; of n of them with rms 1 the rms scatters by 1 / sqrt(2 n),
of cosine and sine of some orders in one log by a little more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal, stats

import trueangle as ta
from selfcalibration.rotor import ARCSEC, coast, encoder

SEED = 4_410_000
LINES = {1: (30.0, 0.4), 3: (12.0, 2.0), 5: (6.0, 1.0)}
THEIRS = {1: (70.0, 1.3), 3: (30.0, 0.5), 5: (12.0, 1.0)}

Log = dict[str, np.ndarray]


def noise(rng: np.random.Generator, size: int, memory: float) -> np.ndarray:
    """Of unit variance, each reading ``memory`` of the one before."""
    shocks = rng.normal(size=size + 300)
    return signal.lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], shocks)[300:]


def heads(rng: np.random.Generator, memory: float) -> Log:
    theta = np.sort(rng.uniform(0.0, 6.0 * np.pi, 301))
    table = {}
    for i, place in enumerate(np.radians([0.0, 100.0, 210.0])):
        reading = theta + place + encoder(theta + place, LINES)
        reading += 2.0 * ARCSEC * noise(rng, theta.size, memory)
        table[f"head{i + 1}_rad"] = np.mod(reading, 2.0 * np.pi)
    return table


def shifts(rng: np.random.Generator, memory: float, coupling: float = 0.0, count: int = 4) -> Log:
    shifted = np.array([0.0, 84.0, 201.0, 290.0])[:count]
    parts: list[np.ndarray] = []
    for j, shift in enumerate(np.radians(shifted)):
        size = 60 + 7 * j
        theta = 2.0 * np.pi * (np.arange(size) + rng.uniform()) / size
        a = theta + encoder(theta, LINES) + 2.0 * ARCSEC * noise(rng, size, memory)
        for k in (1, 2):
            turned = rng.normal() * np.cos(k * theta) + rng.normal() * np.sin(k * theta)
            a += coupling * ARCSEC * turned
        b = theta + shift + encoder(theta + shift, THEIRS)
        parts.append(np.column_stack([np.full(size, j), np.mod([a, b], 2.0 * np.pi).T]))
    run, a, b = np.concatenate(parts).T
    return {"run": run, "indicated_rad": a, "reference_rad": b}


def geared(rng: np.random.Generator, memory: float) -> Log:
    theta = np.linspace(0.3, 6.0 * np.pi + 0.3, 600)
    output = theta + encoder(theta, LINES) + 2.0 * ARCSEC * noise(rng, theta.size, memory)
    return {
        "time_s": np.arange(theta.size) / 1000.0,
        "indicated_rad": np.mod(output, 2.0 * np.pi),
        "motor_rad": 7.3 * theta,
    }


def coasting(
    rng: np.random.Generator, memory: float, wander: float = 0.0, size: float = 20.0
) -> Log:
    t, theta = coast(8.0, 2.5, 6.0, 200.0, wander=wander, rng=rng, steps=1)
    reading = theta + encoder(theta, LINES) + size * ARCSEC * noise(rng, t.size, memory)
    return {"time_s": t, "indicated_rad": np.mod(reading, 2.0 * np.pi)}


OPEN = {"loop": "open", "ripple": "none"}
GEAR = {"gear_ratio": 7.3}
SHIFTS = {"method": "shifts"}

#: Log, options, seeds, bounds of the rms of pulls. Before: 1.5 and 0.6 (heads), 0.75 (shifts,
#: white), 2.2 (that remember), 1.4 and 7.7 (that couple), 0.6 (geared), 1.6 and 0.6 (coasting).
DESIGNS: dict[str, tuple[Callable[[np.random.Generator], Log], dict, int]] = {
    "heads": (lambda rng: heads(rng, 0.0), {}, 24),
    "heads that remember": (lambda rng: heads(rng, 0.8), {}, 24),
    "heads that alternate": (lambda rng: heads(rng, -0.5), {}, 24),
    "shifts": (lambda rng: shifts(rng, 0.0), SHIFTS, 20),
    "shifts that remember": (lambda rng: shifts(rng, 0.6), SHIFTS, 20),
    "shifts that couple": (lambda rng: shifts(rng, 0.0, 10.0), SHIFTS, 20),
    "shifts that do both": (lambda rng: shifts(rng, 0.6, 10.0), SHIFTS, 20),
    "three that couple": (lambda rng: shifts(rng, 0.0, 10.0, 3), SHIFTS, 20),
    "geared": (lambda rng: geared(rng, 0.0), GEAR, 20),
    "geared that alternate": (lambda rng: geared(rng, -0.5), GEAR, 20),
    "geared that remember": (lambda rng: geared(rng, 0.8), GEAR, 20),
    "coasting": (lambda rng: coasting(rng, 0.0), OPEN, 20),
    "coasting, remembers": (lambda rng: coasting(rng, 0.7), OPEN, 20),
    "coasting, alternates": (lambda rng: coasting(rng, -0.5), OPEN, 20),
    "coasting, wanders": (lambda rng: coasting(rng, 0.0, 0.2, 5.0), OPEN, 20),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_errors_and_chances_are_what_seeds_scatter(name: str) -> None:
    make, options, count = DESIGNS[name]
    first = SEED + 1000 * list(DESIGNS).index(name)
    print("seeds", first, "to", first + count - 1)
    pulls, chances = [], []
    for seed in range(first, first + count):
        found = ta.selfcal(make(np.random.default_rng(seed)), orders=[1, 3, 5], **options)
        given = {o.order: o for o in found.orders}
        for k, (size, phase) in LINES.items():
            o = given[float(k)]
            pulls.append((o.cosine - size * np.sin(phase)) / o.std)
            pulls.append((o.sine - size * np.cos(phase)) / o.std)
        chances.append(next(test.p for test in found.held_out.values()))
    rms, mean = np.sqrt(np.mean(np.square(pulls))), np.mean(pulls)
    p = stats.kstest(chances, "uniform").pvalue
    print(f"rms {rms:.2f}, mean {mean:.2f}, p of p {p:.3g}")
    assert 0.78 < rms < 1.28
    assert abs(mean) < 4.5 / np.sqrt(len(pulls))
    assert p > 1e-3


def test_noise_that_remembers_passes_for_no_coupling() -> None:
    """It widens order 1 over order 3 by its own spectrum: the power of both at 70 readings a turn.

    ``S(w) = (1 - r²) / |1 - r exp(-iw)|²``, the root of the ratio. Couplings that white noise takes
    for likely would widen order 1 by half as much again.
    """
    first, memory = SEED + 50_000, 0.6
    print("seeds", first, "to", first + 9)
    widths = []
    for seed in range(first, first + 10):
        logs = [shifts(np.random.default_rng(seed), kept) for kept in (0.0, memory)]
        found = [ta.selfcal(log, orders=[1, 3, 5], **SHIFTS).orders for log in logs]
        white, slow = ([o.std for o in orders if o.order in (1.0, 3.0)] for orders in found)
        widths.append(np.log(slow[0] / slow[1]) - np.log(white[0] / white[1]))
    power = [1.0 / abs(1.0 - memory * np.exp(-2j * np.pi * k / 70.0)) ** 2 for k in (1, 3)]
    assert np.mean(widths) == pytest.approx(0.5 * np.log(power[0] / power[1]), abs=0.15)
