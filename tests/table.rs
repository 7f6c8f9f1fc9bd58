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
