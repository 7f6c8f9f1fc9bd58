//! The inner loop: every reading is added to the moments of its segment.
//!
//! A reading at `u` in its segment, `-1 <= u <= 1`, adds `w phi_j(u)` and `w y phi_j(u)`,
//! where `phi_j` is the product of the Chebyshev polynomials `T_1, T_2, T_4, T_8, T_16`
//! that the binary digits of `j` name. The products span the same polynomials as
//! `T_0, T_1, ...`, never exceed 1, and eight of them cost two vector multiplications.
//!
//! Readings wait for others of their segment, which are taken side by side in the lanes of
//! vectors, where the segments are few enough for that.

use super::chunk::{CHUNK, Chunk};
use super::place::{Around, Frame};
use super::segment::{LANES, Segment};
use super::waiting::Waiting;
use crate::readings::Readings;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Stretches of the angle, each with segments of its own.
struct Stretches<'a> {
    /// Where all but the last end, ascending.
    ends: &'a [f64],
    tallies: &'a mut [Tally],
}

/// What is counted of the readings of a stretch.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Weighted sum of squared errors.
    pub squares: f64,
    /// Readings of positive weight.
    pub count: usize,
}

/// One call of the inner loop.
struct Call<'a, 'b, 'c> {
    frame: &'a Frame,
    around: &'a Around,
    readings: Readings<'a>,
    table: &'b mut [Segment],
    waiting: &'b mut Waiting<'c>,
    squares: &'b mut f64,
    stretches: Option<Stretches<'b>>,
}

/// Adds readings to their segments, but those that are left `waiting`; returns the weighted sum
/// of the squared errors of all.
pub fn accumulate(
    frame: &Frame,
    around: &Around,
    readings: Readings<'_>,
    waiting: &mut Waiting,
    table: &mut [Segment],
) -> f64 {
    let mut squares = 0.0;
    let call = Call {
        frame,
        around,
        readings,
        table,
        waiting,
        squares: &mut squares,
        stretches: None,
    };
    dispatch(InstructionSet::best(), call);
    squares
}

/// Adds readings to the segments of the stretches of the angle that end at `ends`, whose
/// tables follow each other; one of `tallies` for each.
pub fn accumulate_stretches(
    frame: &Frame,
    around: &Around,
    readings: Readings<'_>,
    ends: &[f64],
    waiting: &mut Waiting,
    table: &mut [Segment],
    tallies: &mut [Tally],
) {
    let call = Call {
        frame,
        around,
        readings,
        table,
        waiting,
        squares: &mut 0.0,
        stretches: Some(Stretches { ends, tallies }),
    };
    dispatch(InstructionSet::best(), call);
}

impl Kernel for Call<'_, '_, '_> {
    /// The shapes of readings, each compiled on its own.
    #[inline(always)]
    fn run<L: Lanes>(self) {
        match (self.readings.reference, self.readings.weights) {
            (None, None) => run::<L, false, false>(self),
            (None, Some(_)) => run::<L, false, true>(self),
            (Some(_), None) => run::<L, true, false>(self),
            (Some(_), Some(_)) => run::<L, true, true>(self),
        }
    }
}

#[inline(always)]
fn run<L: Lanes, const DIFFERENCE: bool, const WEIGHTED: bool>(call: Call<'_, '_, '_>) {
    let Call {
        frame,
        around,
        readings,
        table,
        waiting,
        squares: sum,
        mut stretches,
    } = call;
    let mut chunk = Chunk::new();
    let mut squares = [0.0; LANES];
    let all = readings.angle.len();
    let together = waiting.has_room();
    let mut last = [[0.0; CHUNK]; 3];
    let reference = readings.reference.unwrap_or(readings.error);
    for start in (0..all).step_by(CHUNK) {
        let len = CHUNK.min(all - start);
        let [angle, error, other] = &mut last;
        let angle = load(readings.angle, start, angle);
        let error = load(readings.error, start, error);
        let reference = load(reference, start, other);
        if WEIGHTED && let Some(weights) = readings.weights {
            chunk.weight[..len].copy_from_slice(&weights[start..start + len]);
        }
        // What stands in for readings beyond the last does not count.
        chunk.weight[len..].fill(0.0);
        chunk.prepare::<DIFFERENCE>(frame, around, angle, error, reference, &mut squares);
        if let Some(stretches) = &mut stretches {
            stretches.tell_apart(&mut chunk, angle, len, table.len());
        }
        if together {
            waiting.take::<L, WEIGHTED>(&chunk, len, table);
        } else {
            chunk.add_all::<L>(len, table);
            if waiting.notes {
                chunk.note(len, table);
            }
        }
    }
    *sum = squares.iter().sum();
}

impl Stretches<'_> {
    /// Moves readings to the segments of their stretches, of `places` in all.
    #[inline(always)]
    fn tell_apart(&mut self, chunk: &mut Chunk, angle: &[f64; CHUNK], len: usize, places: usize) {
        let segments = (places / self.tallies.len()) as u32;
        let mut stretch = [0; CHUNK];
        // One end for all readings, not all ends for one: the loop that fits vectors.
        for &end in self.ends {
            for i in 0..CHUNK {
                stretch[i] += u32::from(angle[i] > end);
            }
        }
        for (segment, stretch) in chunk.segment.iter_mut().zip(&stretch) {
            *segment += segments * stretch;
        }
        let readings = chunk.weight.iter().zip(&chunk.error).zip(&stretch);
        for ((weight, error), stretch) in readings.take(len) {
            let tally = &mut self.tallies[*stretch as usize];
            tally.squares += weight * error * error;
            tally.count += usize::from(*weight > 0.0);
        }
    }
}

/// `CHUNK` values from `start`, in `room` where there are fewer, the last repeated.
#[inline(always)]
fn load<'a>(values: &'a [f64], start: usize, room: &'a mut [f64; CHUNK]) -> &'a [f64; CHUNK] {
    if let Some(full) = values[start..].first_chunk() {
        return full;
    }
    let rest = &values[start..];
    room[..rest.len()].copy_from_slice(rest);
    room[rest.len()..].fill(rest[rest.len() - 1]);
    room
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Period;

    /// Of sums of 1000 terms up to 1.
    const ROUNDING: f64 = 1e-12;

    fn sets() -> impl Iterator<Item = InstructionSet> {
        use InstructionSet::{Avx2, Avx512, Portable};
        [Avx512, Avx2, Portable]
            .into_iter()
            .filter(|set| set.is_available())
    }

    /// The weighted squares and the moments of some readings.
    fn sums(
        set: InstructionSet,
        frame: &Frame,
        around: &Around,
        readings: Readings,
    ) -> (f64, Vec<Segment>) {
        let (mut squares, mut table) = (0.0, vec![Segment::EMPTY; 34]);
        let weighted = readings.weights.is_some();
        let mut waiting = Waiting::new(readings.angle.len(), table.len(), weighted);
        let call = Call {
            frame,
            around,
            readings,
            table: &mut table,
            waiting: &mut waiting,
            squares: &mut squares,
            stretches: None,
        };
        dispatch(set, call);
        waiting.finish_by(set, &mut table);
        (squares, table)
    }

    /// Rows that fill several times give the sums of readings added one by one: of few at a
    /// time none waits.
    #[test]
    fn waiting_gives_the_sums_of_single_readings() {
        let period = Period::new(360.0).unwrap();
        let (frame, around) = (Frame::new(period, 34), Around::new(period, 0.5));
        // Long stretches in one segment, then disorder.
        let angle: Vec<f64> = (0..20_011)
            .map(|i| if i < 9000 { 0.02 } else { 137.5 } * f64::from(i))
            .collect();
        let error: Vec<f64> = angle.iter().map(|x| (0.1 * x).sin()).collect();
        let weights: Vec<f64> = angle.iter().map(|x| 2.0 + (3.0 * x).cos()).collect();
        for set in sets() {
            for weights in [None, Some(&weights[..])] {
                let readings = Readings {
                    angle: &angle,
                    error: &error,
                    reference: None,
                    weights,
                };
                let mut single = vec![Segment::EMPTY; 34];
                for start in (0..angle.len()).step_by(100) {
                    let few = readings.part(start, angle.len().min(start + 100));
                    let found = sums(set, &frame, &around, few).1;
                    for (a, b) in single.iter_mut().zip(found) {
                        a.values_mut().zip(b.values()).for_each(|(a, b)| *a += b);
                    }
                }
                let (_, table) = sums(set, &frame, &around, readings);
                for (a, b) in table.iter().zip(&single) {
                    for (a, b) in a.values().zip(b.values()) {
                        assert!((a - b).abs() < 10.0 * ROUNDING, "{set:?}: {a} {b}");
                    }
                }
            }
        }
    }

    /// Readings in order of angle, of which many follow each other in a segment, give the
    /// sums of the same readings in disorder, with every set of instructions.
    #[test]
    fn readings_side_by_side_give_the_sums_of_single_ones() {
        let period = Period::new(360.0).unwrap();
        let (frame, around) = (Frame::new(period, 34), Around::new(period, 0.0));
        let of = |order: &dyn Fn(usize) -> usize, set| {
            let angle: Vec<f64> = (0..1009).map(|i| 0.1 * order(i) as f64 - 50.0).collect();
            let error: Vec<f64> = angle.iter().map(|x| (0.1 * x).sin()).collect();
            let weights: Vec<f64> = angle.iter().map(|x| 2.0 + (3.0 * x).cos()).collect();
            let readings = Readings {
                angle: &angle,
                error: &error,
                reference: None,
                weights: Some(&weights),
            };
            sums(set, &frame, &around, readings).1
        };
        for set in sets() {
            // 397 and the prime 1009: neighbours are far apart.
            let (sweep, disorder) = (of(&|i| i, set), of(&|i| i * 397 % 1009, set));
            for (a, b) in sweep.iter().zip(&disorder) {
                for (a, b) in a.values().zip(b.values()) {
                    assert!((a - b).abs() < ROUNDING, "{set:?}: {a} {b}");
                }
            }
        }
    }

    /// Every set of instructions and every shape of readings gives the same sums.
    #[test]
    fn instruction_sets_agree() {
        let sets: Vec<_> = sets().collect();
        let period = Period::new(360.0).unwrap();
        let frame = Frame::new(period, 34);
        let around = Around::new(period, 2.0);
        let angle: Vec<f64> = (0..1003)
            .map(|i| 700.0 * (f64::from(i) * 0.618).sin())
            .collect();
        let error: Vec<f64> = angle.iter().map(|x| 1.5 + (0.1 * x).sin()).collect();
        let indicated: Vec<f64> = angle
            .iter()
            .zip(&error)
            .map(|(x, e)| x + e - 720.0)
            .collect();
        let ones = vec![1.0; angle.len()];
        let sums = |set, readings| sums(set, &frame, &around, readings);
        let plain = Readings {
            angle: &angle,
            error: &error,
            reference: None,
            weights: None,
        };
        let (squares, table) = sums(sets[0], plain);
        for set in sets {
            for (error, reference) in [(&error, None), (&indicated, Some(&angle[..]))] {
                for weights in [None, Some(&ones[..])] {
                    let readings = Readings {
                        angle: &angle,
                        error,
                        reference,
                        weights,
                    };
                    let found = sums(set, readings);
                    assert!((found.0 - squares).abs() < ROUNDING, "{set:?}");
                    for (a, b) in found.1.iter().zip(&table) {
                        for (a, b) in a.values().zip(b.values()) {
                            assert!((a - b).abs() < ROUNDING, "{set:?}: {a} {b}");
                        }
                    }
                }
            }
        }
    }
}
