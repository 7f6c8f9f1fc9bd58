"""The Rust of travel: springs of friction, the play, and what a state keeps of them."""

from __future__ import annotations

from .runtimeterms import RunTimeTerms

__all__ = ["rust_advance", "rust_number", "rust_seen_angle", "rust_springs"]


def rust_number(value: float) -> str:
    """A constant of type f32."""
    text = f"{value:.9g}"
    text += "" if any(c in text for c in ".e") else ".0"
    return text if value >= 0.0 else f"({text})"


def rust_springs(terms: RunTimeTerms) -> str:
    """Error of the springs on a stretch, and the stretch that begins."""
    wound = [
        f"        sum += {rust_number(s.amplitude)}\n            * (d - (d - self.wound[{i}]) "
        f"* decay(way * {rust_number(1.0 / s.length)}));\n"
        for i, s in enumerate(terms.springs)
    ]
    begun = [
        "        if self.direction == 0 {\n"
        f"            {rust_number(s.start)} * f32::from(direction)\n"
        f"        }} else {{\n            d - (d - self.wound[{i}]) * decay(way * "
        f"{rust_number(1.0 / s.length)})\n        }},\n"
        for i, s in enumerate(terms.springs)
    ]
    return f"""\
impl Stretch {{
    fn way(&self, x: i64) -> f32 {{
        let gone = (x - self.place) * i64::from(self.direction);
        if self.placed && gone > 0 {{ to_turns(gone) }} else {{ 0.0 }}
    }}

    /// Error of the springs at x.
    fn wound(&self, x: i64) -> f32 {{
        let (d, way) = (f32::from(self.direction), self.way(x));
        let mut sum = 0.0_f32;
{"".join(wound)}        sum
    }}

    /// The stretch that begins at the farthest angle.
    fn next(&self, direction: i8, place: i64, placed: bool) -> Self {{
        let (d, way) = (f32::from(self.direction), self.way(place));
        let wound = [
{"".join(begun)}        ];
        Self {{ place, wound, direction, placed }}
    }}
}}
"""


def rust_advance(spring: bool) -> str:
    """Moving on."""
    held = "state.stretch.direction" if spring else "state.direction"
    begin = (
        "state.stretch = state.stretch.next(direction, state.farthest, state.known);"
        if spring
        else "state.direction = direction;"
    )
    return f"""\
/// Moves on to x: coming back without having turned is noise and counts as no way.
fn advance(state: &mut State, direction: i8, x: i64) {{
    let (beyond, fresh) = ((x - state.farthest) * i64::from(direction), !state.known);
    if direction != {held} {{
        if fresh || (direction == -{held} && beyond < 0) {{
            (state.farthest, state.known) = (x, true);
        }}
        {begin}
    }}
    if fresh || beyond > 0 {{
        (state.farthest, state.known) = (x, true);
    }}
}}
"""


def rust_seen_angle(terms: RunTimeTerms, zero: int) -> str:
    """The angle that the encoder saw at a reading, which moves the state on."""
    if not terms.travels:
        return """\
/// The angle that the encoder saw.
fn seen(_: &mut State, _reading: i64, goal: i64, signals: &Signals) -> i64 {
    find(goal, signals, 0)
}
"""
    spring = bool(terms.springs)
    held = "state.stretch.direction" if spring else "state.direction"
    moved = "        state.stretch.place += turns;\n" if spring else ""
    align = f"""\
fn seen(state: &mut State, reading: i64, goal: i64, signals: &Signals) -> i64 {{
    const HALF: i64 = 1 << 31;
    let away = reading - ({zero}) - state.farthest;
    if state.known && away.abs() > HALF {{
        let turns = (away + HALF) & !0xFFFF_FFFF;
        state.farthest += turns;
{moved}    }}
"""
    ahead = (
        f"let ahead = if direction == {held} {{ state.stretch }} else {{\n"
        "    state.stretch.next(direction, state.farthest, state.known)\n};\n"
        if spring
        else ""
    )

    def indented(width: int) -> str:
        return "".join(f"{' ' * width}{line}\n" for line in ahead.splitlines())

    given = ", Some(&ahead), 0.0" if spring else ""
    if terms.way == "angle":
        fresh = "        let ahead = state.stretch;\n" if spring else ""
        return f"""\
/// The angle that the encoder saw; the joint has moved where it leaves the band of the play.
{align}    if !state.known {{
{fresh}        let x = find(goal, signals, 0{given});
        advance(state, 0, x);
        return x;
    }}
    let first: i8 = if {held} < 0 {{ -1 }} else {{ 1 }};
    for direction in [first, -first] {{
{indented(8)}        let x = find(goal, signals, direction{given});
        if (x - state.farthest) * i64::from(direction) >= 0 {{
            advance(state, direction, x);
            return x;
        }}
    }}
    state.farthest
}}
"""
    signal = f"signals.{terms.way}"
    nothing = "0" if terms.way == "direction" else "0.0"
    behind = (
        """\
    if state.known && (x - state.farthest) * i64::from(direction) <= 0 {
        // It did not go on: the springs are what they were or, while turning, go on.
        x = if direction == -state.stretch.direction {
            find(goal, signals, direction, Some(&state.stretch), 0.0)
        } else {
            let held = state.stretch.wound(state.farthest);
            find(goal, signals, direction, None, held)
        };
    }
"""
        if spring
        else ""
    )
    return f"""\
/// The angle that the encoder saw, travelling as the {terms.way} says.
{align}    let sign = i8::from({signal} > {nothing}) - i8::from({signal} < {nothing});
    let direction = if sign != 0 {{ sign }} else {{ {held} }};
{indented(4)}    let {"mut " if spring else ""}x = find(goal, signals, direction{given});
{behind}    advance(state, direction, x);
    x
}}
"""
