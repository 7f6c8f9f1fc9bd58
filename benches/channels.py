"""What the angle of two channels costs against the arc tangent alone: logs and single readings.

Run: python benches/channels.py
"""

import math
from timeit import Timer

import numpy as np

import trueangle as ta

READINGS = 10_000_000


def least(ways: dict[str, Timer], number: int, rounds: int) -> dict[str, float]:
    """Nanoseconds of the fastest round; the ways take turns, so that they share what disturbs."""
    times = dict.fromkeys(ways, math.inf)
    for _ in range(rounds):
        for name, way in ways.items():
            times[name] = min(times[name], way.timeit(number) / number * 1e9)
    return times


def main() -> None:
    """Print the ratios of an ellipse, and of one with harmonics that the model corrects."""
    ellipse = ta.Channels(offset_sine=0.1, offset_cosine=-0.05, gain_ratio=1.03, phase_deg=1.5)
    curve = ellipse.replace(harmonics=((-3, 0.02, 0.01, 1e-4), (2, 0.01, 0.0, 1e-4)))
    phase = np.random.default_rng(0).uniform(-math.pi, math.pi, READINGS)
    sine, cosine = map(np.ascontiguousarray, ellipse.curve(phase))
    of_arrays = {"arc tangent": Timer(lambda: np.arctan2(sine, cosine))}
    given = {"s": float(sine[7]), "c": float(cosine[7])}
    of_one = {"arc tangent": Timer("f(s, c)", globals={"f": math.atan2, **given})}
    for name, channels in {"ellipse": ellipse, "with harmonics": curve}.items():
        orders = channels.error_harmonics()
        shafts = [ta.Shaft("output", 1.0, *orders)] if orders[0] else []
        step = ta.HarmonicModel(shafts, channels=channels).compensator()
        of_arrays[name] = Timer(lambda channels=channels: channels.correct(sine, cosine))
        of_one[name] = Timer("f(s, c)", globals={"f": step, **given})
    for what, times in {
        f"{READINGS} readings, over numpy.arctan2": least(of_arrays, 1, 9),
        "one step, over math.atan2": least(of_one, 2000, 500),
    }.items():
        base = times["arc tangent"]
        row = ", ".join(f"{name} {t:.4g} ns ({t / base:.2f})" for name, t in times.items())
        print(f"{what}: {row}")


if __name__ == "__main__":
    main()
