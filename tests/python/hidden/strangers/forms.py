"""Effects that no cause of the library names, of any scale."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from .designs import Array, Generator, Run

Effect: TypeAlias = Callable[[list[Run], Generator], list[Array]]


@dataclass(frozen=True)
class Form:
    """An effect, designs that show it, and what is right and what is half right of it."""

    effect: Effect
    designs: tuple[str, ...]
    factors: frozenset[str]
    names: frozenset[str]
    arguable: frozenset[str]


FORMS: dict[str, Form] = {}


def form(
    designs: str, factors: str, names: str = "", arguable: str = ""
) -> Callable[[Effect], Effect]:
    """List a function among the forms; each argument holds names with blanks between them."""

    def put(effect: Effect) -> Effect:
        right, named, half = (frozenset(text.split()) for text in (factors, names, arguable))
        FORMS[effect.__name__] = Form(effect, tuple(designs.split()), right, named, half)
        return effect

    return put


def line(run: Run, order: float, phase: float) -> Array:
    """A line of the output."""
    return np.sin(order * run.angle * (np.pi / 180) + phase)


def any_phase(rng: Generator) -> float:
    return rng.uniform(0, 6.28)


@form("full9 one nine210", "load_place load_sign", "varying_line", "load_dependent_gear_error")
def load_tanh_place(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [np.tanh(run.torque / 1.6) * line(run, 5, phase) for run in runs]


@form("full9 one nine210", "speed")
def speed_deadzone(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.maximum(0, np.abs(run.velocity) - 12) for run in runs]


@form("full9 two one", "speed_place", "varying_line", "direction_dependent_pattern")
def speed_saturating_line7(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [run.velocity / (np.abs(run.velocity) + 9) * line(run, 7, phase) for run in runs]


@form("full9 five130 one", "current")
def current_squared(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.current**2 for run in runs]


@form("full9 one", "current")
def current_threshold(runs: list[Run], rng: Generator) -> list[Array]:
    return [(run.current > 1.1) * 1.0 for run in runs]


@form("full9 five130 onearc", "reversal_time direction", "", "backlash presliding_hysteresis")
def reversal_relax_in_time(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.direction * np.exp(-run.reversal_age / 2.2) for run in runs]


@form("five130 onearc nine210", "reversal_time")
def even_bump_after_reversal(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.exp(-run.since_reversal / 14.0) for run in runs]


@form("full9 two one", "run_time", "", "drift_within_run")
def event_rise_and_decay(runs: list[Run], rng: Generator) -> list[Array]:
    hit = rng.integers(len(runs))
    effects = []
    for number, run in enumerate(runs):
        since = (run.time / run.time[-1] - 0.37) / 0.1
        pulse = since * np.exp(1 - np.clip(since, 0, 50))
        effects.append(np.where(since > 0, pulse, 0) * (number == hit))
    return effects


@form("full9 two one", "place", "missing_order")
def sawtooth_wrap(runs: list[Run], rng: Generator) -> list[Array]:
    seam = rng.uniform(0, 360)
    return [((run.angle + seam) % 360) / 360 - 0.5 for run in runs]


@form("full9 five130", "temperature")
def temperature_threshold(runs: list[Run], rng: Generator) -> list[Array]:
    return [1 / (1 + np.exp(-(run.temperature - 26.5) / 0.7)) for run in runs]


@form("full9 one", "temperature_place", "varying_line", "thermal_drift")
def temperature_squared_line11(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [((run.temperature - 24) / 9) ** 2 * line(run, 11, phase) for run in runs]


@form("full9 two fivebare one", "direction_place", "direction_dependent_pattern", "local_defect")
def dent_one_direction(runs: list[Run], rng: Generator) -> list[Array]:
    place = rng.uniform(80, 280)
    return [
        (run.direction > 0) * np.exp(-0.5 * ((run.angle % 360 - place) / 13) ** 2) for run in runs
    ]


@form("full9 one nine210", "load_place", "", "torsional_compliance")
def compliant_sector(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.torque * ((run.angle % 360 > 95) & (run.angle % 360 < 160)) for run in runs]


@form("full9 one nine210", "load")
def load_even(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.torque**2 for run in runs]


@form("full9 fivebare nine210", "run_place", "varying_line", "non_integer_order")
def order3_new_every_run(runs: list[Run], rng: Generator) -> list[Array]:
    return [line(run, 3, any_phase(rng)) for run in runs]


@form("full9 fivebare twobare", "place", "missing_order", "local_defect")
def deadzone_of_place(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    waves = [line(run, 1, phase) for run in runs]
    return [np.sign(wave) * np.maximum(0, np.abs(wave) - 0.65) for wave in waves]


@form("sine5", "speed_place run_place place", "", "scale_error varying_line")
def follows_acceleration(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.acceleration for run in runs]


@form("full9 two one", "run_time run", "", "latency")
def late_stretch(runs: list[Run], rng: Generator) -> list[Array]:
    hit = rng.integers(len(runs))
    shares = [run.time / run.time[-1] for run in runs]
    return [
        run.velocity * ((share > 0.55) & (share < 0.68)) * (number == hit)
        for number, (run, share) in enumerate(zip(runs, shares, strict=True))
    ]


@form("full9 nine210 one", "speed direction", "", "latency backlash")
def stribeck_log(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.direction * np.exp(-np.abs(run.velocity) / 8) for run in runs]


@form("full9 one", "direction temperature", "", "backlash")
def play_by_temperature(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.direction * (run.temperature - 12) / 12 * (run.temperature > 20) for run in runs]


@form("full9 twobare", "place", "missing_order sidebands")
def square_wave_of_line20(runs: list[Run], rng: Generator) -> list[Array]:
    phase = any_phase(rng)
    return [np.sign(line(run, 20, phase)) for run in runs]


@form("full9 nine210", "load", "stiffening_compliance", "torsional_compliance")
def clipped_load(runs: list[Run], rng: Generator) -> list[Array]:
    return [np.clip(run.torque, -2, 2) for run in runs]


@form("full9 nine210", "speed direction", "", "latency")
def speed_root(runs: list[Run], rng: Generator) -> list[Array]:
    return [run.direction * np.sqrt(np.abs(run.velocity)) for run in runs]
