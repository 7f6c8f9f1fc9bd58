"""A control loop at 1 kHz that follows a target with a wrong and with a corrected encoder.

    python examples/control_loop.py [--seconds 5] [--rate 1000] [--real-time]

A simulated joint is calibrated first. Then the same loop (proportional control of a
velocity-driven joint) runs twice: on the indicated angle and on the corrected one. What
is printed is how far the *true* angle was from the target, and what a correction costs.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import trueangle as ta
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

#: The joint: output eccentricity, the motor's encoder, the tooth mesh; arcsec and degrees.
JOINT = Simulation(
    Joint(100.0, "circular_spline", "motor"),
    harmonics=(
        Harmonic("output", 1, 60.0, 30.0),
        Harmonic("motor", 1, 18.0, 46.5),
        Harmonic("wave_generator", 2, 33.4, 20.8),
    ),
    sigma_arcsec=1.0,
    runs=tuple(RunDesign(label=str(i), samples=800, direction=(-1) ** i) for i in range(3)),
)
GAIN = 40.0  # 1/s, of the position controller
SPEED = 20.0  # deg/s, of the target


def indicated(true: float) -> float:
    """The reading of the joint's encoder at a true angle, degrees."""
    return true + float(JOINT.pattern.value(np.array([np.radians(true)]))[0]) / 3600.0


def follow(
    step: Callable[[float], float], seconds: float, rate: float, real_time: bool
) -> tuple[float, float, int]:
    """Rms of true angle less target in arcsec, median ns per step, late cycles."""
    true, period = 0.0, 1.0 / rate
    count = int(seconds * rate)
    left = np.empty(count)
    spent, late = np.empty(count), 0
    start = time.perf_counter()
    for i in range(count):
        reading = indicated(true)
        begin = time.perf_counter_ns()
        angle = step(reading)
        spent[i] = time.perf_counter_ns() - begin
        target = SPEED * i * period
        left[i] = target - true
        true += (GAIN * (target - angle) + SPEED) * period
        if real_time:
            due = start + (i + 1) * period
            late += time.perf_counter() > due
            time.sleep(max(0.0, due - time.perf_counter()))
    settled = left[count // 5 :]
    return float(np.sqrt(np.mean(settled**2)) * 3600.0), float(np.median(spent)), late


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="cycles per second")
    parser.add_argument("--real-time", action="store_true", help="wait for the clock")
    args = parser.parse_args()

    fit = ta.fit(ta.simulate(JOINT, seed=0), gear_ratio=100)
    print(f"orders {', '.join(f'{m:g}' for m in fit.orders)}")
    step = fit.model.compensator()
    for name, function in (("indicated", float), ("corrected", step)):
        rms, ns, late = follow(function, args.seconds, args.rate, args.real_time)
        text = f"{name}: true angle {rms:6.2f} arcsec rms off the target, {ns:.0f} ns per reading"
        print(text + (f", {late} late cycles" if args.real_time else ""))


if __name__ == "__main__":
    main()
