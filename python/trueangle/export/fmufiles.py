"""Files of a functional mock-up unit: the model in C with FMI around it, and its descriptions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from ..model.model import HarmonicModel
from .carithmetic import DOUBLE
from .codetext import code_file, code_parts, filled_code
from .cstep import c_search, c_state, wave_tables
from .runtimeterms import RunTimeTerms

#: Of the library and of its functions.
IDENTIFIER = "trueangle_model"

#: Turns that the last step of a search may leave.
_LEFT = 1e-17


class FmuVariable(NamedTuple):
    """One variable; its place in the list is its value reference."""

    name: str
    reference: int
    causality: str
    variability: str
    unit: str
    start: float
    description: str


def variables_of(model: HarmonicModel, sensor: bool, noise_std: float = 0.0) -> list[FmuVariable]:
    """The time, inputs, parameters and the output last."""
    true = "true angle of the joint"
    said = "angle that its encoder indicates"
    first, last = (("true_angle", true), ("indicated", said))[:: 1 if sensor else -1]
    rows = [
        ("time", "independent", "continuous", "s", 0.0, "time"),
        (first[0], "input", "continuous", "rad", 0.0, first[1]),
        ("velocity", "input", "continuous", "rad/s", 0.0, "velocity of the joint"),
        ("torque", "input", "continuous", "N.m", 0.0, "torque at the output"),
        ("temperature", "input", "continuous", "K", 293.15, "temperature of the joint"),
    ]
    if "current" in model.signals:
        rows.append(("current", "input", "continuous", "A", 0.0, "current of the motor"))
    if sensor:
        rows += [
            (
                "noise_std",
                "parameter",
                "tunable",
                "rad",
                noise_std,
                "standard deviation of white noise",
            ),
            ("seed", "parameter", "fixed", "", 1.0, "of the noise"),
        ]
    rows.append((last[0], "output", "continuous", "rad", 0.0, last[1]))
    return [FmuVariable(name, i, *rest) for i, (name, *rest) in enumerate(rows)]  # type: ignore[arg-type]


def fmu_source(
    model: HarmonicModel, variables: Sequence[FmuVariable], sensor: bool, head: str
) -> str:
    """What the unit's library is compiled from, but for the functions of FMI."""
    terms = RunTimeTerms.of(model, model.terms, "auto")
    at_indicated = model.argument == "indicated"
    zero = DOUBLE.number(model.constant / model.period)
    core = [
        c_state(terms, DOUBLE),
        c_search(terms, DOUBLE, model.constant / model.period, at_indicated, _pattern(terms, zero)),
    ]
    if sensor:
        core.append(_sense(terms, zero, at_indicated))
    else:
        start = f"reading - {zero} - m_series(reading, 0)" if at_indicated else "reading"
        late = f" + signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
        core.append(_part("correct", start=start, late=late))
    by_name = {variable.name: variable.reference for variable in variables}
    scale = {"velocity": " / turn", "temperature": " - 273.15"}
    signals = [
        f"known += signals.{name} = me->value[{by_name[name]}]{scale.get(name, '')};"
        for name in terms.signals
    ]
    instance = _part(
        "instance",
        count=len(variables),
        output=next(v.reference for v in variables if v.causality == "output"),
        noise=by_name.get("noise_std", 0),
        seed=by_name.get("seed", 0),
        start=", ".join(DOUBLE.number(v.start) for v in variables),
        signals="\n".join(signals),
    )
    text = "\n".join([*core, instance, ""])
    return f"{head}\n{_part('includes')}\n" + filled_code(text, n="m")


def fmi_functions(fmi: str, token: str) -> str:
    """All functions that version 2 or 3 of the standard wants of a library."""
    return f"{_part('created')}\n{filled_code(code_file(f'fmi{fmi}.c'), token=token)}"


def _part(name: str, **values: object) -> str:
    return filled_code(code_parts("fmu.c")[name], **values)


def _pattern(terms: RunTimeTerms, zero: str) -> str:
    """The series and its inverse."""
    series = terms.series
    table, loop = "", "(void)i;"
    if series.orders:
        table = wave_tables("m_series0", series, DOUBLE, False)
        loop = _part("sum", count=len(series.orders))
    pairs = zip(series.orders, series.amplitudes, strict=True)
    bend = sum((2.0 * math.pi * m) ** 2 * c for m, c in pairs)
    near = math.sqrt(_LEFT * max(1.0 - series.slope, 0.0) / max(bend, 1.0))
    size = DOUBLE.number(sum(series.amplitudes) * (1.0 + 1e-9) + 1e-12)
    series_text = _part("series", sum=loop, zero=zero, near=DOUBLE.number(near), size=size)
    return f"{table}\n{series_text}"


def _sense(terms: RunTimeTerms, zero: str, at_indicated: bool) -> str:
    """What an encoder says: the pattern and the terms, and the travel that they follow."""
    held = "state->stretch.direction" if terms.springs else "state->direction"
    travel, direction = "(void)state;", "0"
    if terms.travels:
        by_angle = "state->known ? seen - state->farthest : 0.0"
        travel = _part(
            "sensed travel",
            moved="state->stretch.place += turns;" if terms.springs else "",
            way=by_angle if terms.way == "angle" else "signals->velocity",
            held=held,
        )
        direction = held
    if terms.springs:
        direction += ", 0, m_wound(&state->stretch, state->farthest)"
    early = f" - signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
    reading = f"y + {zero} + m_series(seen, 0)"
    if at_indicated:
        reading = f"m_solved(y, -1.0, y + {zero})"
    return _part("sense", early=early, travel=travel, direction=direction, reading=reading)


def model_description(
    variables: Sequence[FmuVariable], fmi: str, sensor: bool, token: str, about: str, tool: str
) -> str:
    """modelDescription.xml of FMI 3.0 or 2.0."""
    # Of version 2 the time is no variable, and unknowns are counted from 1.
    listed = variables if fmi == "3" else variables[1:]
    return filled_code(
        code_file(f"fmi{fmi}.xml"),
        identifier=IDENTIFIER,
        name=quoteattr(f"trueangle {'sensor' if sensor else 'correction'}"),
        token=token,
        variables="\n".join(_element(v, fmi) for v in listed),
        output=variables[-1].reference,
        tool=quoteattr(tool),
        about=quoteattr(about),
    )


def build_description() -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    return filled_code(code_file("fmibuild.xml"), identifier=IDENTIFIER)


def _element(v: FmuVariable, fmi: str) -> str:
    """One variable of modelDescription.xml."""
    start = "" if v.causality in ("independent", "output") else f' start="{v.start!r}"'
    unit = f' unit="{v.unit}"' if v.unit else ""
    told = (
        f'name="{v.name}" valueReference="{v.reference}" causality="{v.causality}" '
        f'variability="{v.variability}" description="{v.description}"'
    )
    if fmi == "3":
        return f"<Float64 {told}{unit}{start}/>"
    return f"<ScalarVariable {told}><Real{unit}{start}/></ScalarVariable>"
