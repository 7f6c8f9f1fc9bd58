//! Bins of a turn folded to a quarter of it, and their harmonics.

use std::f64::consts::PI;

/// Values of the bins folded to a quarter of the turn: bins that mirror each other on an axis have
/// cosines and sines of one size, so that a fourth of them do.
pub struct Folded {
    quarter: usize,
    /// Of even orders for cosines and for sines, of odd ones likewise: three powers of each.
    planes: Vec<f64>,
}

impl Folded {
    /// Of the three powers of so many bins.
    pub fn new(count: usize, value: impl Fn(usize) -> [f64; 3]) -> Self {
        let quarter = count / 4;
        let mut planes = vec![0.0; 12 * quarter];
        for bin in 0..quarter {
            let here = value(bin);
            let across = value(count / 2 - 1 - bin);
            let opposite = value(count / 2 + bin);
            let below = value(count - 1 - bin);
            for power in 0..3 {
                let (right, left) = (here[power] + below[power], across[power] + opposite[power]);
                let (up, down) = (here[power] - below[power], across[power] - opposite[power]);
                let folded = [right + left, up - down, right - left, up + down];
                for (kind, sum) in folded.into_iter().enumerate() {
                    planes[(3 * kind + power) * quarter + bin] = sum;
                }
            }
        }
        Self { quarter, planes }
    }

    /// The values of all bins together.
    pub fn total(&self) -> f64 {
        self.planes[..self.quarter].iter().sum()
    }

    fn plane(&self, kind: usize, power: usize) -> &[f64] {
        let start = (3 * kind + power) * self.quarter;
        &self.planes[start..start + self.quarter]
    }

    /// Sums of the values times cosine and sine of an order, to second order within a bin.
    pub fn sums(&self, rows: &Rows, order: u32) -> (f64, f64) {
        let turn = f64::from(order) * 0.5 * PI / self.quarter as f64;
        let half = -0.5 * turn * turn;
        let kind = 2 * (order as usize & 1);
        let part = |trig: &[f64], kind: usize, power: usize| dot(trig, self.plane(kind, power));
        let (cosine, sine) = (&rows.cosine, &rows.sine);
        (
            part(cosine, kind, 0) + half * part(cosine, kind, 2) - turn * part(sine, kind + 1, 1),
            part(sine, kind + 1, 0) + half * part(sine, kind + 1, 2) + turn * part(cosine, kind, 1),
        )
    }
}

/// Cosine and sine of an order at the middles of the bins of the first quarter.
pub struct Rows {
    cosine: Vec<f64>,
    sine: Vec<f64>,
}

impl Rows {
    /// Room for so many bins of a quarter.
    pub fn new(quarter: usize) -> Self {
        Self {
            cosine: vec![0.0; quarter],
            sine: vec![0.0; quarter],
        }
    }

    /// From the cosines at multiples of half a bin.
    pub fn fill(&mut self, cosines: &[f64], order: u32) {
        let (mask, order) = (cosines.len() - 1, order as usize);
        let mut at = order;
        for (cosine, sine) in self.cosine.iter_mut().zip(&mut self.sine) {
            *cosine = cosines[at & mask];
            *sine = cosines[at.wrapping_sub(cosines.len() / 4) & mask];
            at += 2 * order;
        }
    }
}

/// Lanes in which products are summed: neighbours do not wait for each other.
const LANES: usize = 4;

/// The sum of products.
#[inline]
pub fn dot(one: &[f64], other: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (ones, others) = (one.chunks_exact(LANES), other.chunks_exact(LANES));
    let rest = ones.remainder().iter().zip(others.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in ones.zip(others) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
