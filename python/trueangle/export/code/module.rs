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

//@ decode
/// The angle of two channels in 2^-32 turns; 0 where both are at their middle or not finite.
#[rustfmt::skip]
pub fn @decode@(sine: f64, cosine: f64) -> u32 {
    const PI: f64 = core::f64::consts::PI;
    const C: [f64; 11] = [
        1.0, -0.3333333333332844, 0.1999999999885511,
        -0.14285714180976467, 0.11111106180455946, -0.09090773074808414,
        0.07689953496306857, -0.06640233930429408, 0.056883492268090106,
        -0.04348052215716463, 0.021135373157693246
    ];
    let x = (cosine - (@offset_cosine@)) * @per_cosine@;
    let y = (sine - (@offset_sine@)) * @per_sine@ - x * (@slope@);
    let (along, across) = (if x < 0.0 { -x } else { x }, if y < 0.0 { -y } else { y });
    let steep = across > along;
    let (most, least) = if steep { (across, along) } else { (along, across) };
    // Above the tangent of an eighth of a turn's half the argument is turned by pi / 4.
    let turned = least > 0.41421356237309515 * most;
    let t = if turned { (least - most) / (least + most) } else { least / most };
    let w = t * t;
    let w2 = w * w;
    let w4 = w2 * w2;
    let low = (C[0] + C[1] * w) + (C[2] + C[3] * w) * w2;
    let middle = (C[4] + C[5] * w) + (C[6] + C[7] * w) * w2;
    let high = (C[8] + C[9] * w) + C[10] * w2;
    let octant = (low + (middle + high * w4) * w4) * t + if turned { 0.25 * PI } else { 0.0 };
    let quadrant = if steep { 0.5 * PI - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    let angle = (if y < 0.0 { -half } else { half }) * (@factor@);
    // A conversion of what is not a number gives 0.
    (angle + if angle < 0.0 { -0.5 } else { 0.5 }) as i64 as u32
}

//@ tracks
/// The angle of two tracks in 2^-32 turns over a whole turn: the second one chooses the period of the
/// first.
pub fn @decode@(sine: f64, cosine: f64, sine2: f64, cosine2: f64) -> u32 {
    let fine = i64::from(@one@(sine, cosine) as i32);
    let coarse = i64::from(@two@(sine2, cosine2) as i32);
    let steps = ((coarse - fine) * @product@ + @lift@) as u64;
    let period = (steps >> 32) % @first@ * @inverse@ % @first@;
    (fine as u32).wrapping_add((((period << 32) + @half@) / @first@) as u32)
}
