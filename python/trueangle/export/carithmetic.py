"""What angles and errors are in C: whole numbers with floats, or doubles."""

from __future__ import annotations

from dataclasses import dataclass

from .table import TURN

__all__ = ["DOUBLE", "FIXED", "RATIO_WAVES", "Arithmetic"]


@dataclass(frozen=True)
class Arithmetic:
    """What angles and errors are.

    Attributes
    ----------
    angle, real : str
        Types.
    suffix : str
        Of a number of the type ``real``.
    near : str
        Condition under which a search ends.
    one : float
        A turn.
    helpers, decay, waves : str
        Functions of its own: turns and sines, exponentials, sums of lines.
    from_near : str
        Ending of the name of an inverse of the series that starts at an angle nearby.
    """

    angle: str
    real: str
    suffix: str
    near: str
    one: float
    helpers: str
    decay: str
    waves: str
    from_near: str = ""

    def number(self, value: float) -> str:
        """A constant of the type ``real``."""
        text = f"{value:.9g}" if self.suffix else f"{value:.17g}"
        text += "" if any(c in text for c in ".en") else ".0"
        return f"{text}{self.suffix}" if value >= 0.0 else f"({text}{self.suffix})"

    def place(self, turns: float) -> str:
        """A constant angle."""
        if self.one == 1.0:
            return self.number(turns)
        whole = round(turns * self.one)
        return f"INT64_C({whole})" if whole >= 0 else f"(-INT64_C({-whole}))"


_FLOAT_HELPERS = """\
/* The sine of 2^-32 turns: a polynomial over the quarters beside the zero. */
static inline float @n@_sine(uint32_t phase)
{
    const uint32_t folded = ((phase + UINT32_C(0x40000000)) & UINT32_C(0x80000000))
        ? UINT32_C(0x80000000) - phase : phase;
    const float t = (float)(int32_t)folded * 1.46291808e-9f;
    const float s = t * t;
    return t + t * s * (-0.166666667f + s * (8.33333333e-3f + s * (-1.98412698e-4f
        + s * (2.75573192e-6f + s * -2.50521084e-8f))));
}
"""

_FLOAT_DECAY = """\
/* exp(-way) of a way that is not negative. */
static inline float @n@_decay(float way)
{
    int16_t n;
    float rest, value;
    if (!(way < 80.0f)) {
        return 0.0f;
    }
    n = (int16_t)(way * 1.44269504f + 0.5f);
    rest = ((float)n * 0.693145752f - way) + (float)n * 1.42860677e-6f;
    value = 1.0f + rest * (1.0f + rest * (0.5f + rest * (0.166666667f + rest * (4.16666667e-2f
        + rest * (8.33333333e-3f + rest * (1.38888889e-3f + rest * 1.98412698e-4f))))));
    for (; n >= 16; n = (int16_t)(n - 16)) {
        value *= 1.52587891e-5f;
    }
    return value / (float)(UINT32_C(1) << n);
}
"""

_FLOAT_TURNS = """\
static inline float @n@_turns(int64_t angle)
{
    return (float)angle * 2.32830644e-10f;
}

/* Turns as an angle; what is no number or beyond a million turns is held there. */
static inline int64_t @n@_angle(float turns)
{
    const float held = turns > -1e6f ? (turns < 1e6f ? turns : 1e6f) : -1e6f;
    const float units = held * 4294967296.0f;
    return (int64_t)(units < 0.0f ? units - 0.5f : units + 0.5f);
}
"""

_FLOAT_WAVES = """\
/* Lines C sin(m x + phase): orders, phases and sizes. */
static inline float @n@_waves(int64_t x, const uint32_t *orders, const uint32_t *phases,
    const float *sizes, uint16_t count)
{
    float sum = 0.0f;
    uint16_t i;
    for (i = 0; i < count; i++) {
        sum += TRUEANGLE_F32(sizes + i)
            * @n@_sine((uint32_t)x * TRUEANGLE_U32(orders + i) + TRUEANGLE_U32(phases + i));
    }
    return sum;
}
"""

_DOUBLE_HELPERS = """\
/* The sine of turns. */
static inline double @n@_sine(double phase)
{
    return sin(6.283185307179586 * (phase - floor(phase)));
}
"""

_DOUBLE_DECAY = """\
static inline double @n@_decay(double way)
{
    return exp(-way);
}
"""

_DOUBLE_TURNS = """\
static inline double @n@_turns(double angle)
{
    return angle;
}

static inline double @n@_angle(double turns)
{
    return turns;
}

/* A place of a shaft that makes so many turns per turn. */
static inline double @n@_place(double x, double cycles)
{
    const double turn = floor(x);
    return turn * (cycles - floor(cycles)) + (x - turn) * cycles;
}
"""

_DOUBLE_WAVES = """\
/* Lines C sin(m x + phase): orders, phases and sizes. */
static inline double @n@_waves(double x, const double *orders, const double *phases,
    const double *sizes, uint16_t count)
{
    double sum = 0.0;
    uint16_t i;
    for (i = 0; i < count; i++) {
        sum += sizes[i] * @n@_sine(@n@_place(x, orders[i]) + phases[i]);
    }
    return sum;
}
"""

RATIO_WAVES = """\
/* Lines of orders that are no whole numbers. */
static inline float @n@_ratios(int64_t x, const uint64_t *orders, const uint32_t *phases,
    const float *sizes, uint16_t count)
{
    float sum = 0.0f;
    uint16_t i;
    for (i = 0; i < count; i++) {
        const uint64_t place = (uint64_t)(x >> 32) * orders[2 * i]
            + (uint64_t)(uint32_t)x * orders[2 * i + 1];
        sum += TRUEANGLE_F32(sizes + i)
            * @n@_sine((uint32_t)(place >> 32) + TRUEANGLE_U32(phases + i));
    }
    return sum;
}
"""

FIXED = Arithmetic(
    "int64_t",
    "float",
    "f",
    "off <= 1 && off >= -1",
    TURN,
    _FLOAT_TURNS + "\n" + _FLOAT_HELPERS,
    _FLOAT_DECAY,
    _FLOAT_WAVES,
)
DOUBLE = Arithmetic(
    "double",
    "double",
    "",
    "fabs(off) <= 1e-13 + 4e-16 * fabs(goal)",
    1.0,
    _DOUBLE_TURNS + "\n" + _DOUBLE_HELPERS,
    _DOUBLE_DECAY,
    _DOUBLE_WAVES,
    "_from",
)
