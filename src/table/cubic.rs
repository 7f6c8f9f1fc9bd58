//! Cubic Hermite interpolation in tables of `2^bits + 1` knots: value and slope per segment.

/// `a * t / 2^31`, rounded.
#[inline]
fn scaled(a: i32, t: i32) -> i32 {
    ((i64::from(a) * i64::from(t) + (1 << 30)) >> 31) as i32
}

/// Between two knots at `t / 2^31` of the way.
#[inline]
fn between(low: [i32; 2], high: [i32; 2], t: i32) -> i32 {
    let step = high[0] - low[0];
    let third = low[1] + high[1] - 2 * step;
    let second = step - low[1] - third;
    low[0] + scaled(scaled(scaled(third, t) + second, t) + low[1], t)
}

/// Correction in 2^-32 turns, of knots in units of `2^shift` of that.
///
/// Shifted, values and slopes stay within a 32nd of a turn.
#[inline]
pub fn cubic_i16(knots: &[[i16; 2]], bits: u32, shift: u32, angle: u32) -> i32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = ((angle << bits) >> 1) as i32;
    let wide = |knot: [i16; 2]| [i32::from(knot[0]) << shift, i32::from(knot[1]) << shift];
    between(wide(knots[i]), wide(knots[i + 1]), t)
}

/// Correction in 2^-32 turns, of values and slopes in the same unit.
///
/// Both stay within a 32nd of a turn: the coefficients then fit 32 bits.
#[inline]
pub fn cubic_i32(knots: &[[i32; 2]], bits: u32, angle: u32) -> i32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = ((angle << bits) >> 1) as i32;
    between(knots[i], knots[i + 1], t)
}

/// Correction in radians, of values and slopes in radians.
#[inline]
pub fn cubic_f32(knots: &[[f32; 2]], bits: u32, angle: u32) -> f32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = ((angle << bits) >> 8) as f32 * (1.0 / 16_777_216.0);
    let ([y0, m0], [y1, m1]) = (knots[i], knots[i + 1]);
    let step = y1 - y0;
    let third = m0 + m1 - 2.0 * step;
    let second = step - m0 - third;
    y0 + t * (m0 + t * (second + t * third))
}
