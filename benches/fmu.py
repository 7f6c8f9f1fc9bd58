"""What a step of a unit costs beyond FMPy's own calls, which a unit without a series shows.

Run: python benches/fmu.py
"""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
import numpy as np

import trueangle as ta
from harness.interleaved import interleave
from trueangle import terms as T

STEPS, ROUNDS = 100, 1500
ARCSEC = np.pi / 648_000.0
SERIES = (
    ta.Shaft("output", 1, (1, 2, 5), (5e-3, 0.0, 2e-4), (0.0, 2e-3, 3e-4)),
    ta.Shaft("motor", 100.5, (1, 2), (1e-4, 0.0), (0.0, 5e-5)),
)
SPRINGS = (T.PreslidingHysteresis(30 * ARCSEC, 0.01, 0.3), T.Latency(1e-3))
#: Nothing but the calls: an inverse that is known at once.
BARE = ta.HarmonicModel((), argument="indicated", terms=(T.Backlash(1e-9),))
TERMS = {
    "harmonics": (),
    "play, latency": (T.Backlash(5 * ARCSEC), T.Latency(1e-3)),
    "play, springs, latency": (T.Backlash(5 * ARCSEC), *SPRINGS),
}


def stepping(model: ta.HarmonicModel, variant: str, folder: Path) -> Callable[[], None]:
    """Sets the input and steps, some thousand times."""
    path = folder / "joint.fmu"
    ta.export_model(model, "fmu", path, variant=variant)
    description = fmpy.read_model_description(str(path))
    unit = fmpy.instantiate_fmu(fmpy.extract(str(path)), description, "CoSimulation")
    into = "indicated" if variant == "correction" else "true_angle"
    at = [next(v.valueReference for v in description.modelVariables if v.name == into)]
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    angle = 0.0

    def steps() -> None:
        nonlocal angle
        for _ in range(STEPS):
            angle += 1e-3
            unit.setFloat64(at, [angle])
            unit.doStep(0.0, 1e-3)

    return steps


def main() -> None:
    """Print microseconds of a step beyond the calls, for each kind of model and variant."""
    with TemporaryDirectory() as place:
        ways = {"calls": stepping(BARE, "correction", Path(place))}
        for name, terms in TERMS.items():
            model = ta.HarmonicModel(SERIES, 0.01, terms=terms)
            for variant in ("correction", "sensor"):
                ways[f"{variant}, {name}"] = stepping(model, variant, Path(place))
        least = {name: 1e6 * t.least / STEPS for name, t in interleave(ways, ROUNDS).items()}
    bare = least.pop("calls")
    print(f"FMPy's own calls: {bare:.2f} us")
    for name, each in least.items():
        print(f"{name}: {each - bare:.2f} us more")


if __name__ == "__main__":
    main()
