//! Moments of the readings in one segment of the circle.

use crate::angle::two_sum;

/// Elements of the widest vector register.
pub const LANES: usize = 8;

/// Moments of the weights: products of two polynomials of degree 11 need up to 22.
pub const WEIGHT_TERMS: usize = 24;

/// Moments of the errors: polynomials up to degree 11.
pub const ERROR_TERMS: usize = 12;

/// `sum of w phi_j` and `sum of w y phi_j`, as defined in the kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Segment {
    /// Moments of the weights.
    pub weight: [f64; WEIGHT_TERMS],
    /// Moments of the weighted errors.
    pub error: [f64; ERROR_TERMS],
    /// Greatest place and error with their opposites' greatest, `u, -u, y, -y`, where they are
    /// noted: exact, in what is otherwise padding.
    pub extremes: [f64; 4],
}

impl Segment {
    /// No readings.
    pub const EMPTY: Self = Self {
        weight: [0.0; WEIGHT_TERMS],
        error: [0.0; ERROR_TERMS],
        extremes: [f64::NEG_INFINITY; 4],
    };

    /// All moments.
    pub fn values(&self) -> impl Iterator<Item = &f64> {
        self.weight.iter().chain(&self.error)
    }

    /// All moments, to be changed.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.weight.iter_mut().chain(&mut self.error)
    }

    /// The moments if every error had been greater by `shift`.
    pub fn shifted(mut self, shift: f64) -> Self {
        for (error, weight) in self.error.iter_mut().zip(&self.weight) {
            *error += shift * weight;
        }
        self.extremes[2] += shift;
        self.extremes[3] -= shift;
        self
    }

    /// Takes in other extremes.
    #[inline(always)]
    pub fn widen(&mut self, others: [f64; 4]) {
        for (mine, other) in self.extremes.iter_mut().zip(others) {
            *mine = if other > *mine { other } else { *mine };
        }
    }

    /// Moments over the Chebyshev polynomials themselves.
    pub fn chebyshev(&self) -> Self {
        let mut moments = *self;
        unfold(&mut moments.weight);
        unfold(&mut moments.error);
        moments
    }
}

/// Moments over products of Chebyshev polynomials to moments over `T_0, T_1, ...`.
///
/// From `2 T_a T_b = T_(a+b) + T_|a-b|`: once the moments of `T_a T_p` are known for
/// `a < p`, a power of two, `T_(p+a) = 2 T_a T_p - T_(p-a)`. Every element moves by
/// whole multiples of others, at most `j` of them: nothing is lost but a few ulp.
fn unfold<const TERMS: usize>(moments: &mut [f64; TERMS]) {
    // The moment at p + a is of phi_a T_p; with the blocks of the powers below it has become
    // one of T_a T_p.
    let mut power = 2;
    while power < TERMS {
        for block in moments.chunks_mut(2 * power) {
            let (low, high) = block.split_at_mut(power.min(block.len()));
            for a in 1..high.len() {
                high[a] = 2.0 * high[a] - low[power - a];
            }
        }
        power *= 2;
    }
}

/// Coefficients of `T_0, T_1, ...` to those of the products: what [`unfold`] does to moments,
/// transposed and the other way round.
pub(super) fn fold(coefficients: &mut [f64]) {
    if coefficients.len() <= 1 {
        return;
    }
    let power = coefficients.len().next_power_of_two() / 2;
    let (low, high) = coefficients.split_at_mut(power);
    for a in 1..high.len() {
        low[power - a] -= high[a];
        high[a] *= 2.0;
    }
    fold(low);
    fold(high);
}

/// Adds `value` to `sum`; what rounding takes goes to `carry`.
pub fn compensate(sum: &mut f64, carry: &mut f64, value: f64) {
    let (total, lost) = two_sum(*sum, value);
    *sum = total;
    *carry += lost;
}

impl Segment {
    /// Adds moments; what rounding takes goes to `carry`.
    pub fn add(&mut self, carry: &mut Self, moments: &Self) {
        add_all(&mut self.weight, &mut carry.weight, &moments.weight);
        add_all(&mut self.error, &mut carry.error, &moments.error);
        self.widen(moments.extremes);
    }
}

/// Arrays, not one iterator over both: the loop that fits vectors.
fn add_all<const TERMS: usize>(
    sums: &mut [f64; TERMS],
    carries: &mut [f64; TERMS],
    values: &[f64; TERMS],
) {
    for i in 0..TERMS {
        compensate(&mut sums[i], &mut carries[i], values[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfolding_gives_chebyshev_polynomials() {
        /// A few ulp of numbers up to 24 that are added.
        const ROUNDING: f64 = 1e-14;
        let acosine: f64 = 0.83;
        let t = |j: usize| (j as f64 * acosine).cos();
        let product = |j: usize| -> f64 {
            let bits = (0..5).filter(|bit| j >> bit & 1 == 1);
            bits.map(|bit| t(1 << bit)).product()
        };
        let mut moments: [f64; WEIGHT_TERMS] = std::array::from_fn(product);
        unfold(&mut moments);
        for (j, moment) in moments.iter().enumerate() {
            assert!((moment - t(j)).abs() < ROUNDING, "T_{j}: {moment}");
        }
    }
}
