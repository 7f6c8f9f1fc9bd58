//! Golden sections: where a function with one peak is greatest.

/// Place and value of the maximum in a span, by so many steps.
pub fn golden(
    mut function: impl FnMut(f64) -> f64,
    (low, high): (f64, f64),
    steps: usize,
) -> (f64, f64) {
    let share = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (low, high);
    let (mut c, mut d) = (b - share * (b - a), a + share * (b - a));
    let (mut at_c, mut at_d) = (function(c), function(d));
    for _ in 0..steps {
        if at_c > at_d {
            (b, d, at_d) = (d, c, at_c);
            c = b - share * (b - a);
            at_c = function(c);
        } else {
            (a, c, at_c) = (c, d, at_d);
            d = a + share * (b - a);
            at_d = function(d);
        }
    }
    if at_c > at_d { (c, at_c) } else { (d, at_d) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_found_to_the_last_section() {
        let mut asked = 0;
        let peak = |x: f64| {
            asked += 1;
            -(x - 0.3).powi(2)
        };
        let (place, value) = golden(peak, (-1.0, 1.0), 14);
        assert!((place - 0.3).abs() < 2.0 * 0.618_f64.powi(14));
        assert!((value + (place - 0.3).powi(2)).abs() < 1e-15);
        assert_eq!(asked, 16);
    }
}
