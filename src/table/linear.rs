//! Linear interpolation in tables of `2^bits + 1` knots.

/// Correction in 2^-32 turns, of knots in units of `2^shift` of that, `shift <= 15`.
///
/// Neighbouring knots may differ by 32767 at most, and none may exceed 32700: the sum then
/// stays within 32 bits.
#[inline]
pub fn linear_i16(knots: &[i16], bits: u32, shift: u32, angle: u32) -> i32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = ((angle << bits) >> 16) as i32;
    let low = i32::from(knots[i]);
    let step = i32::from(knots[i + 1]) - low;
    let sum = low * 65536 + step * t;
    (sum + (1 << (15 - shift))) >> (16 - shift)
}

/// Correction in 2^-32 turns, of knots in the same unit, less than a quarter of a turn.
#[inline]
pub fn linear_i32(knots: &[i32], bits: u32, angle: u32) -> i32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = i64::from((angle << bits) >> 1);
    let step = i64::from(knots[i + 1] - knots[i]);
    knots[i] + ((step * t + (1 << 30)) >> 31) as i32
}

/// Correction in radians, of knots in radians.
#[inline]
pub fn linear_f32(knots: &[f32], bits: u32, angle: u32) -> f32 {
    let i = (angle >> (32 - bits)) as usize;
    let t = ((angle << bits) >> 8) as f32 * (1.0 / 16_777_216.0);
    knots[i] + (knots[i + 1] - knots[i]) * t
}
