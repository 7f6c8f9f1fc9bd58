//! Axes taken off columns, run by run: the kernel of what run effects take.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use super::products::Table;
use crate::interrupt;
use crate::simd::{Kernel, Lanes};

/// Readings of which axes are taken off at a time: they stay in the first cache.
const CHUNK: usize = 256;

/// Columns less axes of such sizes: in every run for every column of every axis.
pub(super) struct TakenOff<'a> {
    pub(super) bounds: &'a [(usize, usize)],
    pub(super) axes: Table<'a>,
    pub(super) sizes: &'a [f64],
    pub(super) columns: (&'a mut [f64], usize),
}

impl Kernel for TakenOff<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let ((axes, width), (columns, count)) = (self.axes, self.columns);
        let n = self.bounds.last().map_or(0, |&(_, stop)| stop);
        for run in 0..self.bounds.len() {
            interrupt::point();
            let (first, last) = self.bounds[run];
            for start in (first..last).step_by(CHUNK) {
                let some = CHUNK.min(last - start);
                for k in 0..count {
                    let out = &mut columns[k * n + start..][..some];
                    for j in 0..width {
                        let size = self.sizes[(run * count + k) * width + j];
                        let axis = &axes[j * n + start..][..some];
                        for i in 0..some {
                            out[i] -= size * axis[i];
                        }
                    }
                }
            }
        }
    }
}
