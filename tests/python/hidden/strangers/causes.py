"""Effects that a cause of the library names, of any scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .designs import Array, Generator, Run
from .forms import Effect, any_phase, line


@dataclass(frozen=True)
class Hidden:
    """An effect, designs that show it, its name, and companions that are right as well."""

    effect: Effect
    designs: tuple[str, ...]
    name: str
    companions: frozenset[str]


CAUSES: dict[str, Hidden] = {}

#: The one correction of the stranger's truth. `channel_skew` below has output order 2, in a joint
#: whose sensor is on the motor behind a gear of 50: the library's skewed channels have order 100
#: there, and v (1 - cos 2θ) is a delay and a line that varies with the speed, together. Both,
#: confirmed together, count as the cause.
SAME_FUNCTION = {"channel_skew": frozenset({"latency", "varying_line"})}


def cause(designs: str, companions: str = "", name: str = "") -> Callable[[Effect], Effect]:
    """List a function among the causes, under the name it has unless another is given."""

    def put(effect: Effect) -> Effect:
        key = effect.__name__
        with_it = frozenset(companions.split())
        CAUSES[key] = Hidden(effect, tuple(designs.split()), name or key, with_it)
        return effect

    return put


@cause("full9 fivebare twobare nine210", name="missing_order")
def missing_order_out3(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [line(run, 3, phase) for run in runs]


@cause("full9 two one", name="missing_order")
def missing_order_motor2(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [line(run, 100, phase) for run in runs]


@cause("full9 one", "missing_order")
def sidebands(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [line(run, 102, 1.0) * np.cos(np.radians(run.angle) + phase) for run in runs]


@cause("full9 two")
def non_integer_order(runs: list[Run], rng: Generator) -> list[Array]:
    return [line(run, 6.37, any_phase(rng)) for run in runs]


@cause("full9 five130 one")
def backlash(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.direction for run in runs]


@cause("five130 onearc nine210", "backlash")
def presliding_hysteresis(runs: list[Run], rng: Generator) -> list[Array]:
    return [
        run.direction
        * np.where(
            run.since_reversal > 1e5,
            1 - np.exp(-run.travelled / 9.0),
            1 - 2 * np.exp(-run.since_reversal / 9.0),
        )
        for run in runs
    ]


@cause("full9 two five130 one")
def latency(runs: list[Run], rng: Generator) -> list[Array]:
    return [-run.velocity for run in runs]


@cause("full9 one", "varying_line")
def filter_lag(runs: list[Run], rng: Generator) -> list[Array]:
    effects = []
    for run in runs:
        hertz = np.abs(run.velocity) / 360 * 102
        change = 1 / (1 + 1j * hertz / 7.0) - 1
        shift = np.angle(change) * run.direction
        effects.append(np.abs(change) * line(run, 102, 1.0 + shift))
    return effects


@cause("full9 one five130")
def thermal_drift(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.temperature - 20 for run in runs]


@cause("full9 nine210 one")
def torsional_compliance(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.torque for run in runs]


@cause("full9 nine210", "torsional_compliance")
def stiffening_compliance(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.torque - 0.003 * run.torque**3 for run in runs]


@cause("full9 one", "missing_order")
def load_dependent_gear_error(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.torque * line(run, 102, 1.0) for run in runs]


@cause("full9 fivebare nine210")
def zero_slip(runs: list[Run], rng: Generator) -> list[Array]:
    return [0 * run.angle + rng.normal() for run in runs]


@cause("full9 two one")
def drift_within_run(runs: list[Run], rng: Generator) -> list[Array]:
    return [
        rng.choice([-1, 1]) * rng.uniform(0.6, 1.4) * (1 - np.exp(-run.time / run.time[-1] / 0.3))
        for run in runs
    ]


@cause("full9 one two")
def scale_error(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.angle / 360 for run in runs]


@cause("mount6")
def reference_error(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [np.sin(2 * np.radians(run.angle - run.mount) + phase) for run in runs]


@cause("full9 two")
def outliers(runs: list[Run], rng: Generator) -> list[Array]:
    return [
        (rng.random(run.count) < 0.02)
        * rng.choice([-1, 1], run.count)
        * rng.uniform(0.7, 1.3, run.count)
        for run in runs
    ]


@cause("full9 two")
def missed_counts(runs: list[Run], rng: Generator) -> list[Array]:
    hit = rng.integers(len(runs))
    return [
        (run.time / run.time[-1] > 0.45) * 1.0 * (number == hit) for number, run in enumerate(runs)
    ]


@cause("full9 one nine210")
def local_defect(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.exp(-0.5 * ((run.angle % 360 - 121.0) / 4) ** 2) for run in runs]


@cause("full9 fivebare one", "backlash")
def direction_dependent_pattern(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [run.direction * line(run, 2, phase) for run in runs]


@cause("full9 two one")
def time_periodic(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.sin(2 * np.pi * 0.83 * run.time + any_phase(rng)) for run in runs]


@cause("full9 one", "missing_order")
def varying_line(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [np.abs(run.velocity) * line(run, 5, phase) for run in runs]


@cause("full9 two")
def channel_skew(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.velocity * (1 - np.cos(2 * np.radians(run.angle))) for run in runs]


@cause("full9 five130 one")
def current_coupling(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.current for run in runs]


@cause("one")
def torque_hysteresis(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.sign(np.gradient(run.torque)) for run in runs]


@cause("full9 one")
def clock_drift(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.velocity * run.time for run in runs]


@cause("full9")
def heteroscedastic_noise(runs: list[Run], rng: Generator) -> list[Array]:
    return [rng.normal(size=run.count) * (np.cos(np.radians(run.angle - 70)) > 0) for run in runs]


@cause("full9", "missing_order")
def wrong_gear_ratio(runs: list[Run], rng: Generator) -> list[Array]:
    """Lines of a gear of 51 to 1 less those of the 50 to 1 that is believed."""
    return [
        30
        * (
            (line(run, 104, 1.0) + 0.6 * line(run, 51, 2.0))
            - line(run, 102, 1.0)
            - 0.6 * line(run, 50, 2.0)
        )
        for run in runs
    ]
