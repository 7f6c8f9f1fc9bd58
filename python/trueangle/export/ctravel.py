"""The C of travel: springs of friction, the play, and what a state keeps of them."""

from __future__ import annotations

from .carithmetic import FIXED, Arithmetic
from .runtimeterms import RunTimeTerms

__all__ = ["c_advance", "c_seen_angle", "c_springs"]


def c_springs(terms: RunTimeTerms, arithmetic: Arithmetic) -> str:
    """Error of the springs on a stretch, and the stretch that begins."""
    number = arithmetic.number
    rows = ["/* Error of the springs at x on a stretch of travel. */",
            "static inline @real@ @n@_wound(const @n@_stretch *s, @angle@ x)", "{",
            "    const @real@ d = (@real@)s->direction;",
            "    const @angle@ gone = s->placed ? (x - s->place) * s->direction : 0;",
            "    const @real@ way = gone > 0 ? @n@_turns(gone) : 0.0f;",
            "    @real@ sum = 0.0f;"]  # fmt: skip
    rows += [
        f"    sum += {number(s.amplitude)} * (d - (d - s->wound[{i}])"
        f" * @n@_decay(way * {number(1.0 / s.length)}));"
        for i, s in enumerate(terms.springs)
    ]
    rows += ["    return sum;", "}", ""]
    rows += ["/* The stretch that begins at the farthest angle. */",
             "static inline @n@_stretch @n@_begun(const @n@_state *state, int8_t direction)", "{",
             "    const @n@_stretch *s = &state->stretch;",
             "    const @real@ old = (@real@)s->direction;",
             "    const @angle@ far = state->farthest - s->place;",
        "    const @angle@ gone = s->placed ? far * s->direction : 0;",
             "    const @real@ way = gone > 0 ? @n@_turns(gone) : 0.0f;",
             "    @n@_stretch next;",
             "    next.place = state->farthest;",
             "    next.placed = (int8_t)state->known;",
             "    next.direction = direction;"]  # fmt: skip
    rows += [
        f"    next.wound[{i}] = s->direction == 0 ? {number(s.start)} * (@real@)direction\n"
        f"        : old - (old - s->wound[{i}]) * @n@_decay(way * {number(1.0 / s.length)});"
        for i, s in enumerate(terms.springs)
    ]
    return "\n".join([*rows, "    return next;", "}", ""])


def c_advance(terms: RunTimeTerms) -> str:
    """Moving on."""
    held = "state->stretch.direction" if terms.springs else "state->direction"
    begin = (
        "state->stretch = @n@_begun(state, direction);"
        if terms.springs
        else "state->direction = direction;"
    )
    return f"""\
/* Moves on to x: coming back without having turned is noise and counts as no way. */
static inline void @n@_advance(@n@_state *state, int8_t direction, @angle@ x)
{{
    const @angle@ beyond = (x - state->farthest) * direction;
    const uint8_t fresh = !state->known;
    if (direction != {held}) {{
        if (fresh || (direction == -{held} && beyond < 0)) {{
            state->farthest = x;
            state->known = 1;
        }}
        {begin}
    }}
    if (fresh || beyond > 0) {{
        state->farthest = x;
        state->known = 1;
    }}
}}
"""


def c_seen_angle(terms: RunTimeTerms, arithmetic: Arithmetic, zero: float) -> str:
    """The angle that the encoder saw at a reading, which moves the state on."""
    head = (
        "static inline @angle@ @n@_seen(@n@_state *state, @angle@ reading, @angle@ goal,\n"
        "    const @n@_signals *signals)\n{\n"
    )
    if not terms.travels:
        return (
            f"/* The angle that the encoder saw. */\n{head}"
            "    (void)state;\n    (void)reading;\n"
            "    return @n@_find(goal, signals, 0);\n}\n"
        )
    held = "state->stretch.direction" if terms.springs else "state->direction"
    spring = bool(terms.springs)
    if arithmetic is FIXED:
        align = f"""\
    const int64_t away = reading - {arithmetic.place(zero)} - state->farthest;
    if (state->known && (away > INT64_C(2147483648) || away < -INT64_C(2147483648))) {{
        const int64_t turns = (away + INT64_C(2147483648)) & ~INT64_C(4294967295);
        state->farthest += turns;
        @moved@
    }}
"""
    else:
        align = f"""\
    const double away = reading - {arithmetic.number(zero)} - state->farthest;
    if (state->known && fabs(away) > 0.5) {{
        const double turns = nearbyint(away);
        state->farthest += turns;
        @moved@
    }}
"""
    align = align.replace("@moved@", "state->stretch.place += turns;" if spring else "")
    align = align.replace("        \n", "")
    ahead = (
        f"        const @n@_stretch ahead = direction == {held}\n"
        "            ? state->stretch : @n@_begun(state, direction);\n"
        if spring
        else ""
    )
    given = ", &ahead, 0.0f" if spring else ""
    if terms.way == "angle":
        first = "        const @n@_stretch ahead = state->stretch;\n" if spring else ""
        return f"""\
/* The angle that the encoder saw; the joint has moved where it leaves the band of the play. */
{head}{align}    if (!state->known) {{
{first}        const @angle@ x = @n@_find(goal, signals, 0{given});
        @n@_advance(state, 0, x);
        return x;
    }} else {{
        const int8_t first = {held} < 0 ? -1 : 1;
        uint8_t side;
        for (side = 0; side < 2; side++) {{
            const int8_t direction = (int8_t)(side ? -first : first);
    {ahead.replace(chr(10) + "    ", chr(10) + "        ").rstrip(" ")}\
            const @angle@ x = @n@_find(goal, signals, direction{given});
            if ((x - state->farthest) * direction >= 0) {{
                @n@_advance(state, direction, x);
                return x;
            }}
        }}
    }}
    return state->farthest;
}}
"""
    signal = f"signals->{terms.way}"
    behind = (
        """\
        if (state->known && !((x - state->farthest) * direction > 0)) {
            /* It did not go on: the springs are what they were or, while turning, go on. */
            x = direction == -state->stretch.direction
                ? @n@_find(goal, signals, direction, &state->stretch, 0.0f)
                : @n@_find(goal, signals, direction, 0,
                    @n@_wound(&state->stretch, state->farthest));
        }
"""
        if spring
        else ""
    )
    return f"""\
/* The angle that the encoder saw, travelling as the {terms.way} says. */
{head}{align}    {{
        const int8_t sign = (int8_t)(({signal} > 0) - ({signal} < 0));
        const int8_t direction = sign ? sign : {held};
{ahead}        @angle@ x = @n@_find(goal, signals, direction{given});
{behind}        @n@_advance(state, direction, x);
        return x;
    }}
}}
"""
