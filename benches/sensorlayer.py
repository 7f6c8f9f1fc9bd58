"""What a sensor layer costs in many environments, against as many angles in one batch.

Run: python benches/sensorlayer.py
"""

from time import perf_counter

import mujoco
import numpy as np

import trueangle as ta
from trueangle import terms as T
from trueangle.simulators.mujoco import SensorLayer

JOINTS, ENVIRONMENTS, ROUNDS = 7, 4096, 60
ARCSEC = np.pi / 648_000.0
SERIES = ta.Shaft("output", 1, [1, 2, 3], [1e-4, 0.0, 2e-5], [0.0, 3e-5, 1e-5])
SPRINGS = (T.PreslidingHysteresis(30 * ARCSEC, 0.01, 0.3), T.Latency(1e-3))
TERMS = {
    "harmonics": (),
    "latency": (T.Latency(1e-3),),
    "play": (T.Backlash(5 * ARCSEC),),
    "play, latency": (T.Backlash(5 * ARCSEC), T.Latency(1e-3)),
    "play, springs, latency": (T.Backlash(5 * ARCSEC), *SPRINGS),
}


class Batch:
    """Angles and velocities of all environments."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.qpos = rng.uniform(-3.0, 3.0, (ENVIRONMENTS, JOINTS))
        self.qvel = rng.normal(0.0, 1.0, (ENVIRONMENTS, JOINTS))


def arm() -> mujoco.MjModel:
    """Joints one on the other."""
    bodies = "".join(f"<body><joint name='q{j}'/><geom size='.1'/>" for j in range(JOINTS))
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{bodies}{'</body>' * JOINTS}</worldbody></mujoco>"
    )


def main() -> None:
    """Print milliseconds of both, and their ratio, for each kind of model."""
    mj, batch = arm(), Batch(np.random.default_rng(0))
    flat = batch.qpos.ravel().copy()
    for name, terms in TERMS.items():
        model = ta.HarmonicModel([SERIES], terms=terms)
        layer = SensorLayer(mj, {f"q{j}": model for j in range(JOINTS)})
        given = {"velocity": batch.qvel.ravel().copy()} if model.uses_signals else {}
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(ROUNDS):
            batch.qpos += 0.01
            begun = perf_counter()
            layer.read(batch)
            between = perf_counter()
            model.error(flat, **given)
            times[0].append(between - begun)
            times[1].append(perf_counter() - between)
        read, whole = (1e3 * min(each) for each in times)
        print(f"{name}: {read:.2f} ms, {read / whole:.2f} times {whole:.2f} ms of one batch")


if __name__ == "__main__":
    main()
