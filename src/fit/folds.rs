//! Triangles of the stretches of a run, taken side by side: what is left out in turn.

use super::reduction::{READINGS_PER_FACTOR, triangle};
use crate::design::Design;
use crate::lstsq::Triangle;
use crate::moments::accumulator::{Accumulator, segments, table_bytes};
use crate::moments::factor;
use crate::readings::Readings;
use crate::threads;

/// Bytes of all moments of a part beyond which the stretches are taken one after the other.
const MOST_BYTES: usize = 16 << 20;

/// Parts that threads share; the sums do not depend on their number.
const PARTS: usize = 8;

/// What the readings of one stretch say.
pub struct Fold {
    /// Of their rows `[1, harmonics | error]`.
    pub triangle: Triangle,
    /// Sum of their weights.
    pub weight: f64,
}

/// The triangles of `[1, harmonics | error]` over the stretches of the angle that end at
/// `ends` (ascending; the last goes on), errors counted from `centre`.
pub fn folds(
    design: &Design,
    run: &Readings,
    ends: &[f64],
    centre: f64,
    threads: usize,
) -> Vec<Fold> {
    let count = ends.len() + 1;
    if let Some((cycles, orders)) = design.common_turn() {
        let highest = orders.iter().copied().max().unwrap_or(0);
        let empty = || Accumulator::new(design.period(), cycles, highest, centre);
        let enough = READINGS_PER_FACTOR * segments(highest);
        let room = count * table_bytes(highest) <= MOST_BYTES;
        if room && run.angle.len() >= count * enough {
            let len = run.angle.len();
            let parts = threads::map_parts(PARTS, threads, |i| {
                let part = run.part(len * i / PARTS, len * (i + 1) / PARTS);
                let mut sums: Vec<_> = (0..count).map(|_| empty()).collect();
                Accumulator::update_stretches(&mut sums, ends, part);
                sums
            });
            // Work that is called off is called off before here.
            let parts: Vec<_> = parts.collect();
            let fold = |fold: usize| {
                let mut moments = empty();
                for part in &parts {
                    moments.merge(&part[fold]);
                }
                let weight = moments.weight();
                let triangle = if moments.count() >= enough {
                    factor::reduce(&moments, &orders)
                } else {
                    gathered(design, run, ends, fold, centre, threads)
                };
                Fold { triangle, weight }
            };
            return (0..count).map(fold).collect();
        }
    }
    let fold = |fold| Fold {
        triangle: gathered(design, run, ends, fold, centre, threads),
        weight: weight_of(run, ends, fold),
    };
    (0..count).map(fold).collect()
}

/// The triangle of one stretch, of its readings laid side by side.
fn gathered(
    design: &Design,
    run: &Readings,
    ends: &[f64],
    fold: usize,
    centre: f64,
    threads: usize,
) -> Triangle {
    let places = run.angle.iter().enumerate();
    let places = places.filter(|(_, x)| before(**x, ends) == fold);
    let inside = run.pick(&places.map(|(i, _)| i).collect::<Vec<_>>());
    triangle(design, &inside.readings(), centre, threads)
}

/// Sum of the weights of one stretch.
fn weight_of(run: &Readings, ends: &[f64], fold: usize) -> f64 {
    let inside = run.angle.iter().enumerate();
    let inside = inside.filter(|(_, x)| before(**x, ends) == fold);
    inside.map(|(i, _)| run.weight(i)).sum()
}

/// Number of ends before `x`.
fn before(x: f64, ends: &[f64]) -> usize {
    ends.iter().filter(|end| x > **end).count()
}
