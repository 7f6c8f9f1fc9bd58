"""The cases of a seed, and readings of a case with a simulation that lacks what is hidden."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import numpy as np

from trueangle import CalibrationRun
from trueangle.simulation import Harmonic, Joint, Simulation

from .causes import CAUSES
from .designs import DESIGNS, Array, Generator, Run
from .forms import FORMS
from .noise import NOISE

#: Periods a turn of the output, of each shaft of the joint believed.
SHAFTS = {"output": 1, "wave_generator": 51, "motor": 50}

#: A strong cause and one of a fifth of it.
PAIRS = (
    ("backlash", "missing_order_motor2", "full9"),
    ("latency", "thermal_drift", "full9"),
    ("torsional_compliance", "backlash", "nine210"),
    ("missing_order_out3", "latency", "one"),
    ("thermal_drift", "torsional_compliance", "full9"),
    ("zero_slip", "backlash", "full9"),
    ("direction_dependent_pattern", "missing_order_out3", "full9"),
    ("current_coupling", "time_periodic", "full9"),
    ("missing_order_out3", "missed_counts", "full9"),
    ("local_defect", "torsional_compliance", "one"),
)

#: Noise without an effect, and the designs it is read in.
NOTHING = {
    "ar95": "one five130",
    "pink": "full9 two one",
    "walkwhite": "nine210 onearc",
    "walk": "two full9",
    "out": "five130",
    "burst": "full9",
    "quant": "twobare one",
    "ar8": "fivebare nine210",
    "cubic": "onearc",
    "white": "one two",
}


@dataclass(frozen=True)
class Case:
    """What is hidden, of which rms over that of the noise, in which design and noise.

    ``group`` is form, usual (1 to 3), small (0.3), large (8), pair or nothing.
    """

    index: int
    group: str
    design: str
    parts: tuple[tuple[str, float], ...]
    noise: str = "white"

    def __str__(self) -> str:
        hidden = " + ".join(f"{size:g} {name}" for name, size in self.parts) or "nothing"
        return f"{self.group} {self.index}: {hidden}, {self.design}, {self.noise}"


def cases() -> list[Case]:
    """The 144 cases; a seed gives each other random numbers."""
    found: list[Case] = []
    index = count()

    def add(group: str, design: str, *parts: tuple[str, float], noise: str = "white") -> None:
        found.append(Case(next(index), group, design, parts, noise))

    for name, form in FORMS.items():
        for j, design in enumerate(form.designs):
            noise = ("white", "ar4", "t6")[j % 3]
            add("form", design, (name, (3.0, 2.0, 5.0)[j % 3]), noise=noise)
    for i, (name, hidden) in enumerate(CAUSES.items()):
        first, last = hidden.designs[0], hidden.designs[-1]
        add("usual", first, (name, (1.0, 2.0, 3.0)[i % 3]))
        if i % 3 == 0:
            add("small", last, (name, 0.3))
        if i % 3 == 1:
            add("large", last, (name, 8.0), noise=("white", "ar4")[i % 2])
        if i % 3 == 2 and len(hidden.designs) > 1:
            add("usual", hidden.designs[1], (name, 2.0), noise="t6")
    for strong, weak, design in PAIRS:
        add("pair", design, (strong, 3.0), (weak, 0.6))
    for noise, designs in NOTHING.items():
        for design in designs.split():
            add("nothing", design, noise=noise)
    return found


def readings(case: Case, seed: int) -> tuple[list[CalibrationRun], Simulation]:
    """Runs of a case, and the simulation that lacks what is hidden in them."""
    rng = np.random.default_rng([seed, case.index, 0])
    design, columns = DESIGNS[case.design]
    runs = design(rng)
    sigma = float(rng.uniform(0.6, 5.0))
    lines = [Harmonic("output", 1, float(rng.uniform(15, 70)), float(rng.uniform(0, 360)))]
    if rng.random() < 0.4:
        lines.append(Harmonic("output", 2, float(rng.uniform(6, 20)), float(rng.uniform(0, 360))))
    errors, scales = hidden_errors(case, runs, sigma, rng)
    lines += gear_lines(scales, sigma)
    measured = []
    for number, (run, hidden) in enumerate(zip(runs, errors, strict=True)):
        error = hidden + sigma * NOISE[case.noise](run.count, rng)
        for known in lines:
            error = error + line_read(known, run, "filter_lag" in scales)
        # A zero that all runs share.
        indicated = run.angle + (error + 137.0) / 3600
        if case.noise == "quant":
            step = 3 * sigma / 3600
            indicated = np.round(indicated / step) * step
        measured.append(logged(run, indicated, columns, f"run{number}"))
    joint = Joint(50.0, "circular_spline", "motor")
    return measured, Simulation(joint, harmonics=tuple(lines), sigma_arcsec=sigma)


def hidden_errors(
    case: Case, runs: list[Run], sigma: float, rng: Generator
) -> tuple[list[Array], dict[str, float]]:
    """What the parts of a case add to each run, arcsec, and the scale of each part."""
    errors: list[Array] = [np.zeros(run.count) for run in runs]
    scales: dict[str, float] = {}
    for name, size in case.parts:
        effects = (FORMS[name] if name in FORMS else CAUSES[name]).effect(runs, rng)
        together = np.concatenate(effects)
        rms = np.sqrt(np.mean((together - together.mean()) ** 2))
        sign = 1 if name == "filter_lag" else rng.choice([-1, 1])
        scales[name] = float(size * sigma / rms * sign)
        errors = [
            error + scales[name] * effect for error, effect in zip(errors, effects, strict=True)
        ]
    return errors, scales


def gear_lines(scales: dict[str, float], sigma: float) -> list[Harmonic]:
    """Lines of the gear that are known, where a hidden cause acts on them."""
    if "wrong_gear_ratio" in scales:
        size = 30 * scales["wrong_gear_ratio"]
        return [gear_line("wave_generator", 2, size, 1.0), gear_line("motor", 1, 0.6 * size, 2.0)]
    if "filter_lag" in scales:
        return [gear_line("wave_generator", 2, scales["filter_lag"], 1.0)]
    if "sidebands" in scales or "load_dependent_gear_error" in scales:
        return [gear_line("wave_generator", 2, 6 * sigma, 1.0)]
    return []


def gear_line(shaft: str, order: int, size: float, phase: float) -> Harmonic:
    """A known line, whose sign goes into its phase."""
    degrees = float(np.degrees(phase) + (180 if size < 0 else 0))
    return Harmonic(shaft, order, float(abs(size)), degrees)


def line_read(known: Harmonic, run: Run, filtered: bool) -> Array:
    """A known line as it is read; the filter has all lines, and hides those of the gear itself."""
    order = known.order * SHAFTS[known.shaft]
    passed: complex | Array = 1.0
    if filtered and known.shaft == "output":
        passed = 1 / (1 + 1j * np.abs(run.velocity) / 360 * order / 7.0)
    phase = np.radians(known.phase_deg) + np.angle(passed) * run.direction
    wave = np.sin(order * np.radians(run.angle) + phase)
    return known.amplitude_arcsec * np.abs(passed) * wave


def logged(run: Run, indicated: Array, columns: frozenset[str], label: str) -> CalibrationRun:
    """The run with the columns that its log has."""
    found = {
        name: np.full(run.count, float(run.mount)) if name == "mount" else getattr(run, name)
        for name in ("time", "velocity", "torque", "temperature", "mount")
        if name in columns
    }
    signals = {"current": run.current} if "current" in columns else {}
    return CalibrationRun(run.angle, indicated, period=360.0, label=label, signals=signals, **found)
