"""The C source of a functional mock-up unit: the model in doubles, and FMI around it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..model.model import HarmonicModel
from .carithmetic import DOUBLE
from .cstep import c_search, c_state, wave_tables
from .fmudescription import Variable
from .runtimeterms import RunTimeTerms

__all__ = ["fmu_source"]

#: Turns that the last step of a search may leave.
_LEFT = 1e-17

_PATTERN = """\
/* The series, its slope where asked for, and the x with x + sign (zero + series(x)) = y. */
static double m_series(double x, double *slope)
{
    double sum = 0.0, rise = 0.0;
    int i;
@sum@
    if (slope) {
        *slope = rise;
    }
    return sum;
}

static double m_solved(double y, double sign, double x)
{
    double low = y - sign * @zero@ - @size@, high = y - sign * @zero@ + @size@;
    int i;
    for (i = 0; i < 200; i++) {
        double slope, next;
        const double off = x + sign * (@zero@ + m_series(x, &slope)) - y;
        if (off > 0.0) {
            high = x;
        } else {
            low = x;
        }
        next = x - off / (1.0 + sign * slope);
        if (!(next >= low && next <= high)) {
            next = 0.5 * (low + high);
        }
        /* A step of Newton's leaves half the curvature times its square. */
        if (fabs(next - x) <= @near@ + 2e-16 * (1.0 + fabs(x))) {
            return next;
        }
        x = next;
    }
    return x;
}

static inline double m_pattern(double place)
{
    return m_solved(place, 1.0, place - @zero@);
}

static inline double m_pattern_from(double place, double near)
{
    return m_solved(place, 1.0, near);
}
"""

_CORRECT = """\
/* The true angle behind the next reading, in turns. */
static double m_output(m_state *state, double reading, const m_signals *signals)
{
    const double start = @start@;
    return m_seen(state, reading, start - m_level(signals), signals)@late@;
}
"""

_SENSE = """\
/* What the encoder says at the next true angle, in turns. */
static double m_output(m_state *state, double theta, const m_signals *signals)
{
    const double seen = theta@early@;
    double y;
@travel@
    y = seen + m_level(signals) + m_error(seen, signals, @direction@);
    return @reading@;
}
"""

_SENSED_TRAVEL = """\
    const double away = seen - state->farthest;
    if (state->known && fabs(away) > 0.5) {
        const double turns = nearbyint(away);
        state->farthest += turns;
@moved@    }
    {
        const double way = @way@;
        const int8_t sign = (int8_t)((way > 0.0) - (way < 0.0));
        m_advance(state, sign ? sign : @held@, seen);
    }"""

_INSTANCE = """\
/* -- the instance ----------------------------------------------------------------------- */

enum { VARIABLES = @count@, INPUTS = @inputs@, OUTPUT = @output@, NOISE = @noise@, SEED = @seed@ };

typedef struct {
    m_state state;
    uint64_t random;
    double value[VARIABLES]; /* by value reference; 0 is the time */
    double spare;            /* the second of a pair of normal numbers */
    int has_spare, stale, begun;
} Instance;

static void reset(Instance *me)
{
    static const double start[VARIABLES] = {@start@};
    memset(me, 0, sizeof *me);
    memcpy(me->value, start, sizeof start);
    me->stale = 1;
}

/* A normal number: xorshift64*, and Box and Muller's pair. */
static double normal(Instance *me)
{
    double u[2], size;
    int i;
    if (me->has_spare) {
        me->has_spare = 0;
        return me->spare;
    }
    if (!me->random) {
        me->random = UINT64_C(0x9E3779B97F4A7C15) * (1u + (uint64_t)fabs(me->value[SEED]));
    }
    for (i = 0; i < 2; i++) {
        me->random ^= me->random >> 12;
        me->random ^= me->random << 25;
        me->random ^= me->random >> 27;
        u[i] = (double)((me->random * UINT64_C(0x2545F4914F6CDD1D)) >> 11) * 0x1p-53;
    }
    size = sqrt(-2.0 * log(1.0 - u[0]));
    me->spare = size * sin(6.283185307179586 * u[1]);
    me->has_spare = 1;
    return size * cos(6.283185307179586 * u[1]);
}

/* One reading: the state moves on and the output is of the inputs as they are. */
static void step(Instance *me)
{
    const double turn = 6.283185307179586;
    m_signals signals;
    memset(&signals, 0, sizeof signals);
@signals@
    me->value[OUTPUT] = turn * m_output(&me->state, me->value[1] / turn, &signals);
    if (NOISE && me->value[NOISE] > 0.0) {
        me->value[OUTPUT] += me->value[NOISE] * normal(me);
    }
    me->stale = 0;
    me->begun = 1;
}

/* The output of inputs that are not a reading yet: the state stays. */
static void look(Instance *me)
{
    if (me->stale) {
        Instance copy = *me;
        step(&copy);
        me->value[OUTPUT] = copy.value[OUTPUT];
        me->stale = 0;
    }
}

static int get(Instance *me, const unsigned *references, size_t count, double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        if (references[i] >= VARIABLES) {
            return 3;
        }
        if (references[i] == OUTPUT) {
            look(me);
        }
        values[i] = me->value[references[i]];
    }
    return 0;
}

static int set(Instance *me, const unsigned *references, size_t count, const double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        if (references[i] >= VARIABLES || references[i] == OUTPUT) {
            return 3;
        }
        me->value[references[i]] = values[i];
        me->stale = 1;
    }
    return 0;
}
"""


def fmu_source(
    model: HarmonicModel, variables: Sequence[Variable], sensor: bool, functions: str, head: str
) -> str:
    """One file that compiles to the unit's library."""
    terms = RunTimeTerms.of(model, model.terms, "auto")
    at_indicated = model.argument == "indicated"
    zero = DOUBLE.number(model.constant / model.period)
    core = [
        c_state(terms).replace("@angle@", "double").replace("@real@", "double"),
        c_search(terms, DOUBLE, model.constant / model.period, at_indicated, _pattern(terms, zero)),
    ]
    if sensor:
        core.append(_sense(terms, zero, at_indicated))
    else:
        start = f"reading - {zero} - m_series(reading, 0)" if at_indicated else "reading"
        late = f" + signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
        core.append(_CORRECT.replace("@start@", start).replace("@late@", late))
    by_name = {variable.name: variable.reference for variable in variables}
    scale = {"velocity": " / turn", "temperature": " - 273.15"}
    signals = [
        f"    signals.{name} = me->value[{by_name[name]}]{scale.get(name, '')};"
        for name in terms.signals
    ]
    instance = (
        _INSTANCE.replace("@count@", str(len(variables)))
        .replace("@inputs@", str(sum(v.causality == "input" for v in variables)))
        .replace("@output@", str(next(v.reference for v in variables if v.causality == "output")))
        .replace("@noise@", str(by_name.get("noise_std", 0)))
        .replace("@seed@", str(by_name.get("seed", 0)))
        .replace("@start@", ", ".join(DOUBLE.number(v.start) for v in variables))
        .replace("@signals@", "\n".join(signals))
    )
    text = "\n".join([*core, instance, functions])
    return f"{head}\n{_INCLUDES}\n" + text.replace("@n@", "m")


_INCLUDES = """\
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif
"""


def _pattern(terms: RunTimeTerms, zero: str) -> str:
    """The series and its inverse."""
    series = terms.series
    size = sum(series.amplitudes)
    table, loop = "", "    (void)i;"
    if series.orders:
        table = wave_tables("m_series0", series, DOUBLE, False)
        loop = f"""\
    for (i = 0; i < {len(series.orders)}; i++) {{
        const double phase = m_place(x, m_series0_orders[i]) + m_series0_phases[i];
        const double turned = 6.283185307179586 * (phase - floor(phase));
        sum += m_series0_sizes[i] * sin(turned);
        if (slope) {{
            rise += 6.283185307179586 * m_series0_orders[i] * m_series0_sizes[i] * cos(turned);
        }}
    }}"""
    text = _PATTERN.replace("@sum@", loop).replace("@zero@", zero)
    pairs = zip(series.orders, series.amplitudes, strict=True)
    bend = sum((2.0 * math.pi * m) ** 2 * c for m, c in pairs)
    near = math.sqrt(_LEFT * max(1.0 - series.slope, 0.0) / max(bend, 1.0))
    text = text.replace("@near@", DOUBLE.number(near))
    return table + "\n" + text.replace("@size@", DOUBLE.number(size * (1.0 + 1e-9) + 1e-12))


def _sense(terms: RunTimeTerms, zero: str, at_indicated: bool) -> str:
    """What an encoder says: the pattern and the terms, and the travel that they follow."""
    held = "state->stretch.direction" if terms.springs else "state->direction"
    travel, direction = "    (void)state;", "0"
    if terms.travels:
        moved = "        state->stretch.place += turns;\n" if terms.springs else ""
        way = "signals->velocity"
        if terms.way == "angle":
            way = "state->known ? seen - state->farthest : 0.0"
        travel = (
            _SENSED_TRAVEL.replace("@moved@", moved).replace("@way@", way).replace("@held@", held)
        )
        direction = held
    if terms.springs:
        direction += ", 0, m_wound(&state->stretch, state->farthest)"
    early = f" - signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
    reading = f"y + {zero} + m_series(seen, 0)"
    if at_indicated:
        reading = f"m_solved(y, -1.0, y + {zero})"
    return (
        _SENSE.replace("@early@", early)
        .replace("@travel@", travel)
        .replace("@direction@", direction)
        .replace("@reading@", reading)
    )
