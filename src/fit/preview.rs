//! A first fit of some thousand readings, which says about what the fit of all will say.
//!
//! All readings are held against it while they are summed. No residual of the fit of all is
//! greater than the farthest of them then, and what the two fits differ by: who looks for wild
//! readings mostly need not look at every reading once more.

use crate::design::Design;
use crate::lstsq::Estimate;
use crate::moments::accumulator::{Accumulator, segments};
use crate::moments::expected::Expected;
use crate::moments::normal;
use crate::moments::spectrum::Spectrum;
use crate::moments::waiting::MOST_SEGMENTS;
use crate::readings::Readings;

/// Readings from which a first fit costs less than a second look at all of them.
const WATCHED: usize = 1 << 18;

/// Readings of the first fit, in all and per unknown: coefficients are known to a fiftieth of
/// the noise, and their sum to less than all of it.
const READINGS: usize = 4096;
const READINGS_PER_UNKNOWN: usize = 64;

/// Steps from reading to reading differ, lest they meet the same places of a grid: by this
/// part of a step more each time, the golden one.
const UNEVEN: f64 = 0.618_033_988_749_894_9;

/// What some of the readings say.
pub struct Preview {
    estimate: Estimate,
    /// What is expected of the errors of each run.
    expected: Vec<Expected>,
}

/// A first fit, and how far the farthest of all readings is off it.
pub struct Watched {
    preview: Preview,
    farthest: f64,
}

impl Preview {
    /// A fit of whole `orders` of a shaft of `cycles` per turn to some of the readings; None
    /// where there are few of them, and where some do not determine the orders.
    pub fn of_runs(
        design: &Design,
        (cycles, orders): (f64, &[u32]),
        runs: &[Readings],
        centres: &[f64],
    ) -> Option<Self> {
        let all: usize = runs.iter().map(|run| run.angle.len()).sum();
        let highest = orders.iter().copied().max()?;
        if all < WATCHED || segments(highest) > MOST_SEGMENTS {
            return None;
        }
        let wanted = READINGS.max(READINGS_PER_UNKNOWN * (runs.len() + 2 * orders.len()));
        let spectrum = |(run, &centre): (&Readings, &f64)| {
            let some = run.pick(&places(run.angle.len(), all.div_ceil(wanted)));
            let mut sums = Accumulator::new(design.period(), cycles, highest, centre);
            sums.update(some.readings(), 1);
            Spectrum::new(&sums, highest)
        };
        let spectra: Vec<_> = runs.iter().zip(centres).map(spectrum).collect();
        let estimate = normal::system(&spectra, orders)?.solve(None)?;
        let expected =
            |zero: &f64| Expected::new(segments(highest), *zero, orders, &estimate.coefficients);
        let expected = estimate.offsets.iter().map(expected).collect();
        Some(Self { estimate, expected })
    }

    /// What is expected of the errors of each run, from its centre.
    pub fn expected(&self) -> &[Expected] {
        &self.expected
    }

    /// The farthest reading of all is so far off.
    pub fn watched(self, farthest: f64) -> Watched {
        Watched {
            preview: self,
            farthest,
        }
    }
}

impl Watched {
    /// What no residual exceeds, signs left away, that `found` leaves of a reading that counts.
    pub fn bound(&self, found: &Estimate) -> f64 {
        let Preview { estimate, expected } = &self.preview;
        let zeros = found.offsets.iter().zip(&estimate.offsets);
        let zero = zeros.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        let pairs = found.coefficients.chunks_exact(2);
        let pairs = pairs.zip(estimate.coefficients.chunks_exact(2));
        let series: f64 = pairs.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).sum();
        let missed = expected.iter().fold(0.0f64, |most, e| most.max(e.missed()));
        self.farthest + zero + series + missed
    }
}

/// One reading of every `step` of a run, each at another place of its step.
fn places(len: usize, step: usize) -> Vec<usize> {
    let place = |i: usize| i * step + ((i as f64 * UNEVEN).fract() * step as f64) as usize;
    (0..len / step).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_one_of_every_step_and_uneven() {
        for (len, step) in [(1000, 7), (1 << 18, 64), (5, 5), (3, 5)] {
            let found = places(len, step);
            assert_eq!(found.len(), len / step);
            assert!(found.iter().enumerate().all(|(i, at)| at / step == i));
        }
        let rests: std::collections::HashSet<_> =
            places(6400, 64).iter().map(|at| at % 64).collect();
        assert!(rests.len() > 32, "{} of 64", rests.len());
    }
}
