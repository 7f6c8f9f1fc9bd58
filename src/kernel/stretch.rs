//! A stretch of angles, and how many of a batch lie outside it.

use super::batch::{Batch, Real, Sample};
use crate::circle::whole_number;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Part of a turn by which an angle may be beyond the ends: rounding is no excursion.
const SLACK: f64 = 1e-9;

/// Angles `start` to `stop`, in any turn or, where the error does not repeat, as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    centre: f64,
    half: f64,
    /// One turn and its reciprocal; 0 where turns do not matter.
    turn: f64,
    per_turn: f64,
}

impl Stretch {
    /// `period` is one turn of the angles; `repeats` tells whether turns look the same.
    pub fn new(start: f64, stop: f64, period: f64, repeats: bool) -> Self {
        Self {
            centre: 0.5 * (start + stop),
            half: 0.5 * (stop - start) + SLACK * period,
            turn: if repeats { period } else { 0.0 },
            per_turn: if repeats { 1.0 / period } else { 0.0 },
        }
    }

    /// How many results of a batch lie outside; what is not a number does not count.
    pub fn outside<X: Sample, Y: Real>(
        &self,
        set: InstructionSet,
        batch: Batch<'_, X, Y>,
    ) -> usize {
        let mut count = 0;
        dispatch(
            set,
            Look {
                stretch: *self,
                batch,
                count: &mut count,
            },
        );
        count
    }
}

struct Look<'b, 'c, X, Y> {
    stretch: Stretch,
    batch: Batch<'b, X, Y>,
    count: &'c mut usize,
}

impl<X: Sample, Y: Real> Kernel for Look<'_, '_, X, Y> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let Stretch {
            centre,
            half,
            turn,
            per_turn,
        } = self.stretch;
        let (out, len) = (self.batch.output(), self.batch.len());
        let mut count = 0u64;
        for i in 0..len {
            // SAFETY: i < len, and the results have been written.
            let away = unsafe { out.add(i).read() }.widen() - centre;
            let rest = away - turn * whole_number(away * per_turn);
            count += u64::from(rest.abs() > half);
        }
        *self.count += count as usize;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outside(stretch: Stretch, angles: &[f64]) -> usize {
        let mut angles = angles.to_vec();
        stretch.outside(InstructionSet::best(), Batch::in_place(&mut angles))
    }

    #[test]
    fn ends_belong_to_the_stretch_in_every_turn() {
        let stretch = Stretch::new(300.0, 490.0, 360.0, true);
        let inside = [
            300.0,
            490.0,
            359.0,
            0.0,
            130.0,
            -60.0,
            720.0 + 129.0,
            f64::NAN,
        ];
        assert_eq!(outside(stretch, &inside), 0);
        for angle in [299.9, 130.1, 200.0, -61.0, 720.0 + 131.0] {
            assert_eq!(outside(stretch, &[angle]), 1, "{angle}");
        }
        assert_eq!(outside(stretch, &[131.0; 1003]), 1003);
    }

    #[test]
    fn turns_count_where_the_error_does_not_repeat() {
        let stretch = Stretch::new(-10.0, 800.0, 360.0, false);
        assert_eq!(outside(stretch, &[-10.0, 0.0, 500.0, 800.0]), 0);
        assert_eq!(outside(stretch, &[-11.0, 801.0, 5000.0, -4000.0]), 4);
    }

    #[test]
    fn rounding_is_no_excursion() {
        for period in [1.0, 360.0, 65536.0] {
            let stretch = Stretch::new(0.1 * period, 0.4 * period, period, true);
            for (away, count) in [(0.5e-9, 0), (1.5e-9, 2)] {
                let ends = [(0.1 - away) * period, (0.4 + away) * period];
                assert_eq!(outside(stretch, &ends), count, "{period}");
            }
        }
    }
}
