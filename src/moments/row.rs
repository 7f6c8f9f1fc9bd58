//! Readings of one segment, added to its moments side by side: a reading to a lane.

use super::segment::{LANES, Segment};
use crate::simd::Lanes;

/// Readings that are added together: the sums over the lanes at the end cost as much as
/// some thirty.
pub(super) const TOGETHER: usize = 128;

/// As many, and the last of those that come by vectors.
pub(super) const ROOM: usize = TOGETHER + LANES;

/// Which sums a pass takes.
const WEIGHTS: u8 = 1;
const ERRORS: u8 = 2;

/// Readings of one segment.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Row {
    pub(super) place: [f64; ROOM],
    pub(super) error: [f64; ROOM],
}

/// Weights of the readings of a row.
pub(super) type RowWeights = [f64; ROOM];

/// Those of readings that have none.
pub(super) const ONES: RowWeights = [1.0; ROOM];

impl Row {
    pub(super) const EMPTY: Self = Self {
        place: [0.0; ROOM],
        error: [0.0; ROOM],
    };

    /// Moves what is beyond the full row to its start.
    #[inline(always)]
    pub(super) fn keep_rest(&mut self) {
        self.place.copy_within(TOGETHER.., 0);
        self.error.copy_within(TOGETHER.., 0);
    }

    /// Notes the extremes of the first `len` readings.
    #[inline(always)]
    pub(super) fn note(&self, len: usize, moments: &mut Segment) {
        let mut found = [[f64::NEG_INFINITY; 4]; LANES];
        let pairs = self.place[..len].iter().zip(&self.error[..len]);
        for (i, (&u, &y)) in pairs.enumerate() {
            for (mine, other) in found[i % LANES].iter_mut().zip([u, -u, y, -y]) {
                *mine = if other > *mine { other } else { *mine };
            }
        }
        found
            .into_iter()
            .for_each(|extremes| moments.widen(extremes));
    }

    /// Adds the first `len` readings to the moments of their segment; returns how many they
    /// are with those that fill the last vector, which have no weight.
    #[inline(always)]
    pub(super) fn add_some<L: Lanes>(
        &mut self,
        len: usize,
        weights: &mut RowWeights,
        moments: &mut Segment,
    ) -> usize {
        // What fills the last vector does not count.
        let full = len.next_multiple_of(L::N);
        for column in [&mut self.place, &mut self.error, &mut *weights] {
            column[len..full].fill(0.0);
        }
        self.add::<L, true>(full, weights, moments);
        full
    }

    /// Places and errors of the readings from the `i`-th, one to a lane.
    #[inline(always)]
    pub(super) fn lanes<L: Lanes>(&self, i: usize) -> (L, L) {
        (lanes(&self.place, i), lanes(&self.error, i))
    }

    /// Adds the first `len` readings, whole vectors of them.
    #[inline(always)]
    pub(super) fn add<L: Lanes, const WEIGHTED: bool>(
        &self,
        len: usize,
        weights: &RowWeights,
        moments: &mut Segment,
    ) {
        // As many sums at a time as there are registers for.
        if L::N == LANES {
            self.pass::<L, WEIGHTED, 0, { WEIGHTS | ERRORS }>(len, weights, moments);
            self.pass::<L, WEIGHTED, 1, { WEIGHTS | ERRORS }>(len, weights, moments);
        } else {
            self.pass::<L, WEIGHTED, 0, WEIGHTS>(len, weights, moments);
            self.pass::<L, WEIGHTED, 0, ERRORS>(len, weights, moments);
            self.pass::<L, WEIGHTED, 1, WEIGHTS>(len, weights, moments);
            self.pass::<L, WEIGHTED, 1, ERRORS>(len, weights, moments);
        }
    }

    /// The moments `4 HALF .. 4 HALF + 4`, and those above by 8 and 16.
    #[inline(always)]
    fn pass<L: Lanes, const WEIGHTED: bool, const HALF: usize, const SUMS: u8>(
        &self,
        len: usize,
        weights: &RowWeights,
        moments: &mut Segment,
    ) {
        let mut weight = [[L::splat(0.0); 4]; 3];
        let mut error = [[L::splat(0.0); 4]; 2];
        for i in (0..len).step_by(L::N) {
            let (t1, y) = self.lanes::<L>(i);
            let t2 = doubled(t1);
            let t4 = doubled(t2);
            let t8 = doubled(t4);
            let mut first = L::splat(1.0);
            if WEIGHTED {
                first = lanes::<L>(weights, i);
            }
            if HALF == 1 {
                first = first * t4;
            }
            let second = first * t1;
            let low = [first, second, first * t2, second * t2];
            if SUMS & WEIGHTS != 0 {
                let t16 = doubled(t8);
                for k in 0..4 {
                    weight[0][k] = weight[0][k] + low[k];
                    weight[1][k] = low[k].mul_add(t8, weight[1][k]);
                    weight[2][k] = low[k].mul_add(t16, weight[2][k]);
                }
            }
            if SUMS & ERRORS != 0 {
                let high = t8 * y;
                for k in 0..4 {
                    error[0][k] = low[k].mul_add(y, error[0][k]);
                    if HALF == 0 {
                        error[1][k] = low[k].mul_add(high, error[1][k]);
                    }
                }
            }
        }
        let first = 4 * HALF;
        if SUMS & WEIGHTS != 0 {
            add_totals(&mut moments.weight[first..], weight[0]);
            add_totals(&mut moments.weight[LANES + first..], weight[1]);
            add_totals(&mut moments.weight[2 * LANES + first..], weight[2]);
        }
        if SUMS & ERRORS != 0 {
            add_totals(&mut moments.error[first..], error[0]);
            if HALF == 0 {
                add_totals(&mut moments.error[LANES..], error[1]);
            }
        }
    }
}

/// `T_2n` from `T_n`. A function, as a closure is compiled for the baseline processor.
#[inline(always)]
fn doubled<L: Lanes>(t: L) -> L {
    (t + t).mul_add(t, L::splat(-1.0))
}

/// Adds the sums over the lanes of four vectors to the first four moments.
#[inline(always)]
fn add_totals<L: Lanes>(moments: &mut [f64], sums: [L; 4]) {
    let totals = L::totals(sums);
    for k in 0..4 {
        moments[k] += totals[k];
    }
}

/// Values from the `i`-th, one to a lane.
#[inline(always)]
fn lanes<L: Lanes>(values: &[f64; ROOM], i: usize) -> L {
    let mut array = [0.0; LANES];
    array[..L::N].copy_from_slice(&values[i..i + L::N]);
    L::from_array(&array)
}
