//! Carries a batch through a function of vectors.

use super::batch::{Batch, Real, Sample};
use crate::simd::{Kernel, Lanes, MOST_LANES};

/// A function of every sample.
pub trait Map {
    /// True when several vectors side by side are faster than one after the other, which
    /// hides the latency of long chains of operations.
    const SIDE_BY_SIDE: bool;

    /// Its values for `W` vectors. Implementations are `#[inline(always)]`.
    fn map<L: Lanes, const W: usize>(&self, x: [L; W]) -> [L; W];
}

/// A function over a batch. The last samples go through the same arithmetic in a padded
/// vector, so a result depends on its own sample only.
pub struct Sweep<'b, M, X, Y> {
    /// The function.
    pub map: M,
    /// What to apply it to.
    pub batch: Batch<'b, X, Y>,
}

impl<M: Map, X: Sample, Y: Real> Kernel for Sweep<'_, M, X, Y> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        // As many as the registers of the instruction set hold.
        match (M::SIDE_BY_SIDE, L::N) {
            (true, 8) => self.sweep::<L, 4>(),
            (true, _) => self.sweep::<L, 2>(),
            (false, _) => self.sweep::<L, 1>(),
        }
    }
}

impl<M: Map, X: Sample, Y: Real> Sweep<'_, M, X, Y> {
    #[inline(always)]
    fn sweep<L: Lanes, const W: usize>(mut self) {
        let (x, out, len) = (self.batch.input(), self.batch.output(), self.batch.len());
        let mut start = 0;
        while start + W * L::N <= len {
            // SAFETY: W * N samples from `start` lie within the batch.
            unsafe {
                let mut values = [L::splat(0.0); W];
                for w in 0..W {
                    values[w] = load(x.add(start + w * L::N), L::N);
                }
                let values = self.map.map(values);
                for w in 0..W {
                    store(values[w], out.add(start + w * L::N), L::N);
                }
            }
            start += W * L::N;
        }
        while start < len {
            let some = L::N.min(len - start);
            // SAFETY: `some` samples from `start` lie within the batch.
            unsafe {
                let [value] = self.map.map::<L, 1>([load(x.add(start), some)]);
                store(value, out.add(start), some);
            }
            start += some;
        }
    }
}

/// `some` samples; the other lanes are zero.
#[inline(always)]
unsafe fn load<L: Lanes, X: Sample>(x: *const X, some: usize) -> L {
    let mut values = [0.0; MOST_LANES];
    for i in 0..some {
        // SAFETY: the caller has `some` samples there.
        values[i] = unsafe { x.add(i).read() }.widen();
    }
    L::from_array(&values)
}

#[inline(always)]
unsafe fn store<L: Lanes, Y: Real>(value: L, out: *mut Y, some: usize) {
    let mut values = [0.0; MOST_LANES];
    value.to_array(&mut values);
    for i in 0..some {
        // SAFETY: the caller has `some` places there.
        unsafe { out.add(i).write(Y::narrow(values[i])) };
    }
}
