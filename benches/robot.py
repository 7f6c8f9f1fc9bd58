"""What joints together cost against each alone: `Robot.compensator` and `Robot.correct`.

Run: python benches/robot.py
"""

from time import perf_counter
from timeit import repeat

import numpy as np

import trueangle as ta

JOINTS, ROWS = 6, 1_000_000


def model(seed: int) -> ta.HarmonicModel:
    """Eight orders of the output and two of a motor."""
    rng = np.random.default_rng(seed)
    output = rng.normal(0.0, 0.01, (2, 8)).tolist()
    motor = rng.normal(0.0, 1e-4, (2, 2)).tolist()
    shafts = [
        ta.Shaft("output", 1.0, list(range(1, 9)), *output),
        ta.Shaft("motor", 100.0, [1, 2], *motor),
    ]
    return ta.HarmonicModel(shafts, period=360.0)


def call(code: str, **names: object) -> float:
    """Nanoseconds of a call: the least of many short rounds, which nothing else interrupts."""
    return min(repeat(code, globals=names, number=2000, repeat=500)) / 2000 * 1e9


def once(work: object, rounds: int = 15) -> float:
    """Milliseconds of the fastest round."""
    times = []
    for _ in range(rounds):
        begun = perf_counter()
        work()  # type: ignore[operator]
        times.append(perf_counter() - begun)
    return min(times) * 1e3


def main() -> None:
    """Print both ratios."""
    robot = ta.Robot({f"q{j}": model(j) for j in range(JOINTS)})
    x, out = np.arange(JOINTS) * 50.0, np.empty(JOINTS)
    alone = call("step(12.3)", step=robot["q0"].compensator())
    print(f"one joint: {alone:.1f} ns")
    for code in ("step(x)", "step(x, out)"):
        together = call(code, step=robot.compensator(), x=x, out=out)
        print(f"{JOINTS} joints, {code}: {together:.1f} ns, {together / alone:.2f} times one")
    positions = np.random.default_rng(0).uniform(0.0, 360.0, (ROWS, JOINTS))
    single = once(lambda: [m.correct(positions[:, j]) for j, m in enumerate(robot.values())])
    together = once(lambda: robot.correct(positions))
    print(f"({ROWS}, {JOINTS}): {together:.1f} ms, {together / single:.2f} times single calls")


if __name__ == "__main__":
    main()
