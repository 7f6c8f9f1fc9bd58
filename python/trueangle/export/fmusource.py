"""The C source of a functional mock-up unit: the model in doubles, and FMI around it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..model.model import HarmonicModel
from .carithmetic import DOUBLE
from .codetext import code_file, code_parts, filled
from .cstep import c_search, c_state, wave_tables
from .fmudescription import Variable
from .runtimeterms import RunTimeTerms

__all__ = ["fmi_functions", "fmu_source"]

#: Turns that the last step of a search may leave.
_LEFT = 1e-17


def fmu_source(model: HarmonicModel, variables: Sequence[Variable], sensor: bool, head: str) -> str:
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
        f"signals.{name} = me->value[{by_name[name]}]{scale.get(name, '')};"
        for name in terms.signals
    ]
    instance = _part(
        "instance",
        count=len(variables),
        inputs=sum(v.causality == "input" for v in variables),
        output=next(v.reference for v in variables if v.causality == "output"),
        noise=by_name.get("noise_std", 0),
        seed=by_name.get("seed", 0),
        start=", ".join(DOUBLE.number(v.start) for v in variables),
        signals="\n".join(signals) or "\n",
    )
    text = "\n".join([*core, instance, ""])
    return f"{head}\n{_part('includes')}\n" + filled(text, n="m")


def fmi_functions(fmi: str, token: str) -> str:
    """All functions that version 2 or 3 of the standard wants of a library."""
    return f"{_part('created')}\n{filled(code_file(f'fmi{fmi}.c'), token=token)}"


def _part(name: str, **values: object) -> str:
    return filled(code_parts("fmu.c")[name], **values)


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
