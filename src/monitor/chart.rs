//! Control charts on coefficients of which neither mean nor variance is known beforehand.
//!
//! Each value is standardized by those before it, so that what comes out is standard normal and
//! independent where nothing changes (Hawkins 1987, self-starting cumulative sums).

/// Values before the first that can be standardized.
const FEWEST: f64 = 3.0;

/// Correlation of neighbours, in its standard errors, from which on it is taken out.
const FOUND: f64 = 2.0;

/// A two-sided tabular cumulative sum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cusum {
    /// Upper and lower sum.
    pub sums: [f64; 2],
}

impl Cusum {
    /// Takes a value in; the larger sum.
    pub fn add(&mut self, value: f64, allowance: f64) -> f64 {
        for (sum, signed) in self.sums.iter_mut().zip([value, -value]) {
            *sum = (*sum + signed - allowance).max(0.0);
        }
        self.sums[0].max(self.sums[1])
    }
}

/// Standardizes each value by those before it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scale {
    count: f64,
    mean: f64,
    squares: f64,
    last: f64,
    products: f64,
    lagged: f64,
}

impl Scale {
    /// Values so far.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Their standard deviation.
    pub fn std(&self) -> f64 {
        (self.squares / (self.count - 1.0).max(1.0)).sqrt()
    }

    /// Takes a value in; what it is in standard deviations, 0 while too few are known.
    pub fn add(&mut self, value: f64) -> f64 {
        let correlation = self.correlation();
        let standard = if self.count >= FEWEST && self.squares > 0.0 {
            let apart = value - self.mean;
            let before = self.last - self.mean;
            let left = apart - correlation * before;
            let share = (1.0 - correlation * correlation).sqrt();
            let t = left / (share * self.std() * (1.0 + 1.0 / self.count).sqrt());
            normal_of_student(t, self.count - 1.0)
        } else {
            0.0
        };
        self.take(value);
        standard
    }

    /// Takes a value in.
    pub fn take(&mut self, value: f64) {
        let before = self.last - self.mean;
        let apart = value - self.mean;
        if self.count > 0.0 {
            self.products += apart * before;
            self.lagged += before * before;
        }
        self.count += 1.0;
        self.mean += apart / self.count;
        self.squares += apart * (value - self.mean);
        self.last = value;
    }

    /// The part of these values without the last of them, which have this mean and these squares
    /// about it: how many, their mean, and their squares about that.
    pub fn without(&self, count: f64, mean: f64, squares: f64) -> (f64, f64, f64) {
        let before = self.count - count;
        let own = (self.count * self.mean - count * mean) / before;
        let between = (own - mean).powi(2) * before * count / self.count;
        (before, own, (self.squares - squares - between).max(0.0))
    }

    /// By which the variance of a mean is greater than that of independent values.
    pub fn inflation(&self) -> f64 {
        let correlation = self.correlation();
        (1.0 + correlation) / (1.0 - correlation)
    }

    /// That of neighbours where it is found, else 0.
    fn correlation(&self) -> f64 {
        if self.count < 10.0 || self.lagged <= 0.0 {
            return 0.0;
        }
        let found = self.products / self.lagged;
        if found * self.count.sqrt() < FOUND {
            return 0.0;
        }
        found.min(0.95)
    }
}

/// The normal number as rare as Student's t (Wallace 1959): its 97.5 % quantile to 0.03 with two
/// degrees of freedom, the fewest there are here, and to 0.02 with more.
pub fn normal_of_student(t: f64, freedom: f64) -> f64 {
    let size = (freedom * (t * t / freedom).ln_1p()).sqrt();
    size.copysign(t) * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recursion worked by hand: a sum falls by the allowance and by what lies on the other side.
    #[test]
    fn sums_are_those_of_the_table() {
        let mut chart = Cusum::default();
        let found: Vec<f64> = [1.0, 2.0, -3.0, 0.5].map(|z| chart.add(z, 0.5)).to_vec();
        assert_eq!(found, [0.5, 2.0, 2.5, 1.5]);
        assert_eq!(chart.sums, [0.0, 1.5]);
    }

    /// Student's 97.5 % quantiles become the normal one.
    #[test]
    fn quantiles_become_normal() {
        for (t, freedom) in [(4.303, 2.0), (3.182, 3.0), (2.228, 10.0), (1.984, 100.0)] {
            let z = normal_of_student(t, freedom);
            assert!(
                (z - 1.96).abs() < if freedom > 2.0 { 0.02 } else { 0.03 },
                "{freedom}: {z}"
            );
        }
    }

    /// A constant is never far off, and correlation is taken out.
    #[test]
    fn values_are_standardized_by_those_before() {
        let mut scale = Scale::default();
        assert!((0..9).all(|_| scale.add(2.0) == 0.0));
        assert_eq!(scale.mean(), 2.0);
        let mut scale = Scale::default();
        let (mut state, mut value, mut sum, mut square) = (9u64, 0.0f64, 0.0, 0.0);
        for i in 0..20_000 {
            let mut noise = -6.0;
            for _ in 0..12 {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                noise += (state >> 11) as f64 / (1u64 << 53) as f64;
            }
            value = 0.8 * value + noise;
            let z = scale.add(value);
            if i >= 100 {
                sum += z;
                square += z * z;
            }
        }
        let n = 19_900.0;
        assert!((sum / n).abs() < 0.03, "{}", sum / n);
        assert!((square / n - 1.0).abs() < 0.05, "{}", square / n);
    }
}
