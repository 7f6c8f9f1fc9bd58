//! Control charts on coefficients of which neither mean nor variance is known beforehand.
//!
//! Each value is standardized by those before it, so that what comes out is standard normal and
//! independent where nothing changes (Hawkins 1987, self-starting cumulative sums).

/// Degrees of freedom before the first value that can be standardized.
const FEWEST: f64 = 2.0;

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

/// Standardizes each value by those before it, of known relative variances, since the last step.
///
/// A step starts another mean; scatter and correlation are those of all values about the mean of
/// their own level.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scale {
    /// Values less means.
    freedom: f64,
    /// Values since the last step.
    held: f64,
    /// Sum of their inverse variances.
    weight: f64,
    mean: f64,
    squares: f64,
    last: Value,
    products: f64,
    lagged: f64,
}

/// A value with its variance, but for a factor common to all.
#[derive(Clone, Copy, Debug, Default)]
pub struct Value {
    /// A coefficient of a window.
    pub value: f64,
    /// From the places of its readings.
    pub variance: f64,
}

impl Value {
    /// How far it is from a mean, in its deviations.
    fn apart(self, mean: f64) -> f64 {
        (self.value - mean) / self.variance.sqrt()
    }
}

impl Scale {
    /// Degrees of freedom of the scatter.
    pub fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Values since the last step.
    pub fn held(&self) -> f64 {
        self.held
    }

    /// Sum of their inverse variances.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Standard deviation of a value of their mean weight.
    pub fn std(&self) -> f64 {
        (self.factor() * self.held / self.weight).sqrt()
    }

    /// Variance of their mean.
    pub fn spread(&self) -> f64 {
        self.factor() / self.weight
    }

    /// The factor that all variances have in common.
    pub fn factor(&self) -> f64 {
        self.squares / self.freedom.max(1.0)
    }

    /// Takes a value in; what it is in standard deviations, 0 while too few are known.
    pub fn add(&mut self, value: Value) -> f64 {
        let correlation = self.correlation();
        let standard = if self.freedom >= FEWEST && self.squares > 0.0 {
            let before = self.last.apart(self.mean);
            let left = value.apart(self.mean) - correlation * before;
            let share = (1.0 - correlation * correlation).sqrt();
            let own = 1.0 + 1.0 / (self.weight * value.variance);
            normal_of_student(left / (share * (self.factor() * own).sqrt()), self.freedom)
        } else {
            0.0
        };
        self.take(value);
        standard
    }

    /// Takes a value in.
    pub fn take(&mut self, value: Value) {
        if self.held > 0.0 {
            self.count_neighbours(value, self.last, 1.0);
            self.freedom += 1.0;
        }
        self.held += 1.0;
        self.weight += value.variance.recip();
        let before = self.mean;
        self.mean += (value.value - before) / (self.weight * value.variance);
        self.squares += value.apart(before) * value.apart(self.mean);
        self.last = value;
    }

    /// As it was before its last values, and as it is where these came after a step. `values` are
    /// the last ones, the newest first, and one that stays.
    pub fn split(&self, values: &[Value]) -> (Self, Self) {
        let mut before = *self;
        for pair in values.windows(2) {
            before.undo(pair[0], pair[1]);
        }
        let mut after = Self {
            held: 0.0,
            weight: 0.0,
            mean: 0.0,
            ..before
        };
        for &value in values[..values.len() - 1].iter().rev() {
            after.take(value);
        }
        // They were picked for being far off: until others follow they count as one.
        after.weight /= after.held;
        after.held = 1.0;
        (before, after)
    }

    /// Takes its last value out, which came after another one of its level.
    fn undo(&mut self, value: Value, before: Value) {
        self.freedom -= 1.0;
        self.held -= 1.0;
        self.weight -= value.variance.recip();
        let after = self.mean;
        self.mean -= (value.value - after) / (self.weight * value.variance);
        self.squares -= value.apart(self.mean) * value.apart(after);
        self.squares = self.squares.max(0.0);
        self.count_neighbours(value, before, -1.0);
        self.last = before;
    }

    /// Counts a value and the one before it among the neighbours, about the mean before it.
    fn count_neighbours(&mut self, value: Value, before: Value, sign: f64) {
        let before = before.apart(self.mean);
        self.products += sign * value.apart(self.mean) * before;
        self.lagged += sign * before * before;
    }

    /// By which the variance of a mean is greater than that of independent values.
    pub fn inflation(&self) -> f64 {
        let correlation = self.correlation();
        (1.0 + correlation) / (1.0 - correlation)
    }

    /// That of neighbours where it is found, else 0.
    fn correlation(&self) -> f64 {
        if self.freedom < 9.0 || self.lagged <= 0.0 {
            return 0.0;
        }
        let found = self.products / self.lagged;
        if found * (self.freedom + 1.0).sqrt() < FOUND {
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
        let value = |value| Value {
            value,
            variance: 0.5,
        };
        assert!((0..9).all(|_| scale.add(value(2.0)) == 0.0));
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
            let z = scale.add(Value {
                value,
                variance: 0.5,
            });
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
