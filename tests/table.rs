//! Tables of a correction: their ends, their signs, and what an exporter must keep.

use trueangle::table::*;

#[test]
fn knots_are_met_and_the_last_segment_comes_back() {
    let knots = [7, -100, 250, 3, 7];
    for (i, &knot) in knots[..4].iter().enumerate() {
        assert_eq!(linear_i32(&knots, 2, (i as u32) << 30), knot);
    }
    assert_eq!(linear_i32(&knots, 2, u32::MAX), 7);
    let short = knots.map(|k| k as i16);
    assert_eq!(linear_i16(&short, 2, 4, 1 << 30), -100 * 16);
    assert_eq!(linear_i16(&short, 2, 0, u32::MAX), 7);
}

#[test]
fn halves_are_rounded_up_on_both_sides_of_zero() {
    assert_eq!(linear_i32(&[0, 1, 0], 1, 1 << 30), 1);
    assert_eq!(linear_i32(&[0, -1, 0], 1, 1 << 30), 0);
    assert_eq!(linear_i16(&[0, 1, 0], 1, 0, 1 << 30), 1);
    assert_eq!(linear_i16(&[0, -1, 0], 1, 0, 1 << 30), 0);
}

#[test]
fn the_largest_knots_do_not_overflow() {
    let short = [32700, -67, 32700, -67, 32700];
    let wide = [(1 << 30) - 1, 1 - (1 << 30), (1 << 30) - 1];
    let cubic = [
        [1 << 27, -(1 << 27)],
        [-(1 << 27), 1 << 27],
        [1 << 27, -(1 << 27)],
    ];
    for step in 0..=4096u32 {
        let angle = (step << 20).wrapping_sub(1);
        assert!(linear_i16(&short, 2, 15, angle).abs() <= 32700 << 15);
        assert!(linear_i32(&wide, 1, angle).abs() <= 1 << 30);
        assert!(cubic_i32(&cubic, 1, angle).abs() <= 1 << 28);
    }
}

#[test]
fn a_cubic_meets_values_and_slopes() {
    let knots = [[1000, 400], [1500, -200], [1000, 400]];
    assert_eq!(cubic_i32(&knots, 1, 0), 1000);
    assert_eq!(cubic_i32(&knots, 1, 1 << 31), 1500);
    // 1/64 of the segment further: a 64th of the slope, and of the bend what is left of it
    let near = cubic_i32(&knots, 1, 1 << 25) - 1000;
    assert!((6..=7).contains(&near), "{near}");
    let shifted = knots.map(|[y, m]| [y as i16 / 4, m as i16 / 4]);
    assert_eq!(
        cubic_i16(&shifted, 1, 2, 1 << 25),
        cubic_i32(&knots, 1, 1 << 25)
    );
}

#[test]
fn floats_are_radians() {
    assert_eq!(linear_f32(&[0.0, 0.5, 0.0], 1, 1 << 30), 0.25);
    assert_eq!(
        cubic_f32(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], 1, 1 << 30),
        0.5
    );
}

/// Lines and polynomials of Hermite as they are defined, in double precision, for all number types.
#[test]
fn between_knots_stand_lines_and_polynomials_of_hermite() {
    const ROUNDING: f64 = 3e-7;
    // Values and slopes per segment that differ in size and sign.
    let knots: Vec<[i32; 2]> = (0..=8i32)
        .map(|i| [9000 - 137 * i * i + 3100 * (i % 3), 700 * (i % 4) - 900])
        .collect();
    let (values, short): (Vec<i32>, Vec<[i16; 2]>) = knots
        .iter()
        .map(|&[y, m]| (y, [y as i16, m as i16]))
        .unzip();
    let floats: Vec<[f32; 2]> = knots.iter().map(|&[y, m]| [y as f32, m as f32]).collect();
    let float_values: Vec<f32> = values.iter().map(|&y| y as f32).collect();
    let short_values: Vec<i16> = values.iter().map(|&y| y as i16).collect();
    for step in 0..4000u32 {
        let angle = step.wrapping_mul(2_654_435_761);
        let place = f64::from(angle) / f64::from(1u32 << 29);
        let (i, t) = (place as usize, place.fract());
        let [[y0, m0], [y1, m1]] = [knots[i], knots[i + 1]].map(|knot| knot.map(f64::from));
        let line = y0 + t * (y1 - y0);
        let curve =
            (2.0 * t - 3.0) * t * t * (y0 - y1) + y0 + t * (1.0 - t) * ((1.0 - t) * m0 - t * m1);
        assert!((f64::from(linear_i32(&values, 3, angle)) - line).abs() <= 0.5 + 1e-3);
        let shifted = f64::from(linear_i16(&short_values, 3, 4, angle)) / 16.0;
        // The place within a segment has 16 bits.
        assert!((shifted - line).abs() <= 0.5 / 16.0 + (y1 - y0).abs() / 65_536.0);
        let single = f64::from(linear_f32(&float_values, 3, angle));
        assert!(
            (single - line).abs() <= ROUNDING * 2e4,
            "{angle}: {single} {line}"
        );
        // Three products of a cubic are rounded, each by half a unit at most.
        assert!((f64::from(cubic_i32(&knots, 3, angle)) - curve).abs() <= 2.0);
        let shifted = f64::from(cubic_i16(&short, 3, 4, angle)) / 16.0;
        assert!((shifted - curve).abs() <= 2.0 / 16.0);
        let single = f64::from(cubic_f32(&floats, 3, angle));
        assert!(
            (single - curve).abs() <= 2.0 * ROUNDING * 2e4,
            "{angle}: {single} {curve}"
        );
    }
}

/// Every segment of every size: its first reading meets its knot, its last stays inside.
#[test]
fn no_reading_of_any_size_leaves_its_segment() {
    for bits in 1..=12u32 {
        let count = 1u32 << bits;
        // Any knots will do; these differ from each other and change sign.
        let knot = |i: u32| (i.wrapping_mul(2_654_435_761) >> 12) as i32 - (1 << 19);
        let wide: Vec<i32> = (0..=count).map(knot).collect();
        let short: Vec<i16> = wide.iter().map(|&y| (y >> 5) as i16).collect();
        let float: Vec<f32> = wide.iter().map(|&y| y as f32).collect();
        let flat: Vec<[i32; 2]> = wide.iter().map(|&y| [y, 0]).collect();
        for i in 0..count {
            let (first, last) = (i << (32 - bits), (i << (32 - bits)) + (u32::MAX >> bits));
            let (here, next) = (wide[i as usize], wide[i as usize + 1]);
            let inside = here.min(next)..=here.max(next);
            assert_eq!(linear_i32(&wide, bits, first), here, "{bits} bits, {i}");
            assert_eq!(cubic_i32(&flat, bits, first), here, "{bits} bits, {i}");
            assert_eq!(linear_f32(&float, bits, first), here as f32);
            assert_eq!(
                linear_i16(&short, bits, 0, first),
                i32::from(short[i as usize])
            );
            assert!(
                inside.contains(&linear_i32(&wide, bits, last)),
                "{bits} bits, {i}"
            );
            // Three products of a cubic are rounded, each by half a unit at most.
            let off = cubic_i32(&flat, bits, last) - next;
            assert!(off.abs() <= 2, "{bits} bits, {i}: {off}");
        }
    }
}
