//! Triangles of the stretches of a run, taken side by side: what is left out in turn.

use super::reduction::{READINGS_PER_FACTOR, triangle};
use crate::design::Design;
use crate::interrupt;
use crate::lstsq::Triangle;
use crate::moments::accumulator::{Accumulator, table_bytes};
use crate::moments::factor;
use crate::moments::place::Frame;
use crate::readings::Readings;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};
use crate::threads;

/// Readings sorted into stretches at a time.
const CHUNK: usize = 512;

/// Readings of a segment that are added to its moments together: side by side, which takes a
/// third of the time of one by one.
const TOGETHER: usize = 256;

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
        let (frame, segments) = (empty().frame(), empty().segments());
        let enough = READINGS_PER_FACTOR * segments;
        let room = count * table_bytes(highest) <= MOST_BYTES;
        if room && run.angle.len() >= count * enough {
            let len = run.angle.len();
            let parts = threads::map_parts(PARTS, threads, |i| {
                let part = run.part(len * i / PARTS, len * (i + 1) / PARTS);
                let mut sums: Vec<_> = (0..count).map(|_| (empty(), 0.0)).collect();
                sorted(&part, ends, &frame, segments, |fold, readings| {
                    let (moments, weight) = &mut sums[fold];
                    moments.update(readings, 1);
                    *weight += total(&readings);
                });
                sums
            });
            // Work that is called off is called off before here.
            let parts: Vec<_> = parts.collect();
            let fold = |fold: usize| {
                let mut moments = empty();
                let mut weight = 0.0;
                for part in &parts {
                    moments.merge(&part[fold].0);
                    weight += part[fold].1;
                }
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
    let inside = |x: f64| before(x, ends) == fold;
    let pick = |values: &[f64]| -> Vec<f64> {
        let pairs = run.angle.iter().zip(values);
        pairs
            .filter(|(x, _)| inside(**x))
            .map(|(_, v)| *v)
            .collect()
    };
    let (angle, error) = (pick(run.angle), pick(run.error));
    let (reference, weights) = (run.reference.map(pick), run.weights.map(pick));
    let readings = Readings {
        angle: &angle,
        error: &error,
        reference: reference.as_deref(),
        weights: weights.as_deref(),
    };
    triangle(design, &readings, centre, threads)
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

fn total(readings: &Readings) -> f64 {
    readings
        .weights
        .map_or(readings.angle.len() as f64, |weights| weights.iter().sum())
}

/// Columns of one segment of a stretch that wait to be added together.
#[derive(Default)]
struct Waiting {
    angle: Vec<f64>,
    error: Vec<f64>,
    reference: Vec<f64>,
    weights: Vec<f64>,
}

impl Waiting {
    fn hand_over(&mut self, like: &Readings, fold: usize, add: &mut impl FnMut(usize, Readings)) {
        if self.angle.is_empty() {
            return;
        }
        let readings = Readings {
            angle: &self.angle,
            error: &self.error,
            reference: like.reference.map(|_| self.reference.as_slice()),
            weights: like.weights.map(|_| self.weights.as_slice()),
        };
        add(fold, readings);
        for column in [
            &mut self.angle,
            &mut self.error,
            &mut self.reference,
            &mut self.weights,
        ] {
            column.clear();
        }
    }
}

/// Finds the stretch and the segment of some readings.
struct Places<'a> {
    angle: &'a [f64],
    ends: &'a [f64],
    frame: &'a Frame,
    segments: usize,
    places: &'a mut [u64; CHUNK],
}

impl Kernel for Places<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let len = self.angle.len();
        let mut angle = [0.0; CHUNK];
        angle[..len].copy_from_slice(self.angle);
        // One end for all readings, not all ends for one: the loop that fits vectors.
        let mut fold = [0; CHUNK];
        for &end in self.ends {
            for i in 0..CHUNK {
                fold[i] += u64::from(angle[i] > end);
            }
        }
        for i in 0..CHUNK {
            let (segment, _) = self.frame.place(angle[i]);
            self.places[i] = fold[i] * self.segments as u64 + u64::from(segment);
        }
    }
}

/// Hands the readings to `add`, some of one segment of one stretch at a time.
fn sorted(
    run: &Readings,
    ends: &[f64],
    frame: &Frame,
    segments: usize,
    mut add: impl FnMut(usize, Readings),
) {
    let count = (ends.len() + 1) * segments;
    let mut waiting: Vec<_> = (0..count).map(|_| Waiting::default()).collect();
    let mut places = [0; CHUNK];
    for start in (0..run.angle.len()).step_by(CHUNK) {
        interrupt::point();
        let part = run.part(start, run.angle.len().min(start + CHUNK));
        let call = Places {
            angle: part.angle,
            ends,
            frame,
            segments,
            places: &mut places,
        };
        dispatch(InstructionSet::best(), call);
        for (i, &place) in places[..part.angle.len()].iter().enumerate() {
            let place = place as usize;
            let columns = &mut waiting[place];
            columns.angle.push(part.angle[i]);
            columns.error.push(part.error[i]);
            if let Some(reference) = part.reference {
                columns.reference.push(reference[i]);
            }
            if let Some(weights) = part.weights {
                columns.weights.push(weights[i]);
            }
            if columns.angle.len() == TOGETHER {
                columns.hand_over(run, place / segments, &mut add);
            }
        }
    }
    for (place, columns) in waiting.iter_mut().enumerate() {
        columns.hand_over(run, place / segments, &mut add);
    }
}
