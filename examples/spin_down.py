"""From a coasting shaft to a corrected loop, without a reference.

``python examples/spin_down.py [--seconds 20]``: a rotor with cogging coasts from 10 to 2
turns per second; its encoder is calibrated from the time stamps alone; a position loop then
runs on the corrected reading.
"""

import argparse

import numpy as np

import trueangle as ta

ARCSEC = 1.0 / 3600.0
#: Amplitude in arcsec and phase in radians of the encoder's error, by order.
LINES = {1: (300.0, 0.3), 2: (150.0, 1.0), 4: (50.0, 2.0)}
NOISE = 20.0


def error(theta: np.ndarray) -> np.ndarray:
    """The encoder's error in degrees at the true angle in degrees."""
    x = np.radians(theta)
    return sum(c * ARCSEC * np.sin(k * x + phi) for k, (c, phi) in LINES.items())


def coast(seconds: float, rate: float = 1000.0) -> tuple[np.ndarray, np.ndarray]:
    """Time and true angle in degrees of a free rotor: viscous friction and cogging."""
    decay, cogging, h = np.log(5.0) / seconds, 0.8, 1.0 / (4.0 * rate)
    n = round(seconds * rate)
    angle = np.empty(n)
    x, v = 0.0, 2.0 * np.pi * 10.0
    for i in range(n):
        angle[i] = x
        for _ in range(4):  # leapfrog: half a step of speed, a step of place, half a step
            v += 0.5 * h * (cogging * np.cos(x) - decay * v)
            x += h * v
            v += 0.5 * h * (cogging * np.cos(x) - decay * v)
    return np.arange(n) / rate, np.degrees(angle)


def loop(step: ta.HarmonicModel | None, rng: np.random.Generator) -> float:
    """Error of the true angle, arcsec rms, when a loop follows a slow ramp."""
    correct = (lambda reading: reading) if step is None else step.compensator()
    true, off = 0.0, []
    for i in range(4000):
        target = 0.09 * i
        reading = true + float(error(np.array(true))) + NOISE * ARCSEC * rng.normal() / 4.0
        true += 0.3 * (target - correct(reading))
        off.append(true - target)
    tail = np.array(off[200:])
    return float(np.std(tail)) / ARCSEC


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    args = parser.parse_args()
    rng = np.random.default_rng(11)
    time, theta = coast(args.seconds)
    reading = theta + error(theta) + NOISE * ARCSEC * rng.normal(size=time.size)
    log = {"time_s": time, "indicated_deg": np.mod(reading, 360.0)}
    found = ta.selfcal(log, orders=LINES, loop="open")
    print(found.summary())
    left = error(theta) - found.model.error(theta)
    whole, rest = np.std(error(theta)) / ARCSEC, np.std(left) / ARCSEC
    print(f"\npattern: {whole:.1f} arcsec rms, left {rest:.2f}")
    before, after = loop(None, rng), loop(found.model, rng)
    print(f"loop on the reading: true angle {before:.1f} arcsec rms off, corrected {after:.1f}")
