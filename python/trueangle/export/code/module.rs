// Parts of a module with tables (rust.py), each behind the line with its name.

//@ table
#[rustfmt::skip]
const @knots@: [@element@; @count@] = [
@rows@,
];

/// Subtract this, at an angle of the shaft (@cycles@ cycles per output turn).
#[inline]
pub fn @name@_correction(angle: u32) -> i32 {
    @call@
}

//@ correct
/// The true angle behind an indicated one.
#[inline]
pub fn correct(indicated: u32) -> u32 {
    correct_unwrapped(0, indicated) as u32
}

//@ place
/// The angle of a shaft that makes @cycles@ turns per output turn.
#[inline]
pub fn @name@_place(output: i64) -> u32 {
    let turns = ((output >> 32) as u64).wrapping_mul(@turns@);
    let angle = u64::from(output as u32).wrapping_mul(@fraction@);
    (turns.wrapping_add(angle) >> 32) as u32
}

//@ correct unwrapped
/// A reading with its whole turns, which end at 2^29 either way: no difference overflows.
fn reading(turns: i32, indicated: u32) -> i64 {
    (i64::from(turns.clamp(-(1 << 29), 1 << 29)) << 32) + i64::from(indicated)
}

/// The true angle with its whole turns, in 2^-32 turns, behind an indicated one.
#[inline]
pub fn correct_unwrapped(turns: i32, indicated: u32) -> i64 {
    let start = reading(turns, indicated) - (@zero@);
    let left = start;
    @steps@
    left
}

//@ self test
/// Readings and what `correct` makes of them.
#[rustfmt::skip]
pub const SELF_TEST: [(u32, u32); 8] = [
    @tests@
];

//@ self test with turns
/// Turns and readings, and the angle that `correct_unwrapped` makes of them.
#[rustfmt::skip]
pub const SELF_TEST: [(i32, u32, u32); 8] = [
    @tests@
];
