//! Readings of an encoder that counts: one mean error per count says all of them.
//!
//! Where the argument takes whole numbers only, readings at one count have the same
//! harmonics. Their summed weight, their mean error and what scatters about it are
//! sufficient: the fit that follows sees as many rows as there are counts, exactly.

use crate::angle::Period;
use crate::circle::whole_number;
use crate::readings::Readings;
use crate::simd::{InstructionSet, Kernel, Lanes, ROUNDER, dispatch};
use crate::threads;

/// Counts per turn up to which the sums stay in the cache of a core: 17 bits, 2 MiB.
const MOST_COUNTS: f64 = (1u32 << 17) as f64;

/// Readings per count from which a table of counts pays.
const READINGS_PER_COUNT: usize = 8;

/// Most tables that are filled side by side.
const MOST_PARTS: usize = 4;

/// Readings worked on at a time, and sums of squares side by side.
const CHUNK: usize = 256;
const LANES: usize = 8;

/// References where errors are given, and weights where there are none.
static ZEROS: [f64; CHUNK] = [0.0; CHUNK];
static ONES: [f64; CHUNK] = [1.0; CHUNK];

/// Whole numbers beyond this cannot be distinguished after rounding.
const FARTHEST: f64 = (1u64 << 50) as f64;

/// One mean error per count that was read.
pub struct Counts {
    angle: Vec<f64>,
    /// From the centre.
    error: Vec<f64>,
    weight: Vec<f64>,
    /// Weighted sum of the squares about the mean of each count.
    pub scatter: f64,
}

impl Counts {
    /// The readings of all runs by counts; None unless every argument is a whole number,
    /// a turn has few enough of them and there are many readings of each.
    pub fn of_runs(
        runs: &[Readings],
        centres: &[f64],
        period: Period,
        threads: usize,
    ) -> Option<Vec<Self>> {
        let turn = period.value();
        let pays = |run: &Readings| run.angle.len() >= READINGS_PER_COUNT * turn as usize;
        if turn.fract() != 0.0 || turn > MOST_COUNTS || !runs.iter().all(pays) {
            return None;
        }
        let each = runs.iter().zip(centres);
        each.map(|(run, &centre)| Self::of_run(run, centre, turn, threads))
            .collect()
    }

    fn of_run(run: &Readings, centre: f64, turn: f64, threads: usize) -> Option<Self> {
        let (len, counts) = (run.angle.len(), turn as usize);
        let parts = (len / (READINGS_PER_COUNT * counts)).clamp(1, MOST_PARTS);
        let tables = threads::map_parts(parts, threads, |i| {
            let part = run.part(len * i / parts, len * (i + 1) / parts);
            Table::of_readings(part, centre, turn)
        });
        let mut whole = Table::new(counts);
        for table in tables {
            whole.merge(&table?);
        }
        Some(whole.means())
    }

    /// As readings; errors are counted from `centre` on.
    pub fn readings(&self) -> Readings<'_> {
        Readings {
            angle: &self.angle,
            error: &self.error,
            reference: None,
            weights: Some(&self.weight),
        }
    }
}

/// Sums of one count.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    error: f64,
}

struct Table {
    sums: Vec<Sums>,
    squares: f64,
}

impl Table {
    fn new(counts: usize) -> Self {
        Self {
            sums: vec![Sums::default(); counts],
            squares: 0.0,
        }
    }

    /// None where an argument is not a whole number.
    fn of_readings(readings: Readings<'_>, centre: f64, turn: f64) -> Option<Self> {
        let mut table = Self::new(turn as usize);
        let mut whole = true;
        for start in (0..readings.angle.len()).step_by(CHUNK) {
            let end = readings.angle.len().min(start + CHUNK);
            let call = Call {
                readings: readings.part(start, end),
                centre,
                turn,
                table: &mut table,
                whole: &mut whole,
            };
            dispatch(InstructionSet::best(), call);
            if !whole {
                return None;
            }
        }
        Some(table)
    }

    fn merge(&mut self, other: &Self) {
        for (own, sums) in self.sums.iter_mut().zip(&other.sums) {
            own.weight += sums.weight;
            own.error += sums.error;
        }
        self.squares += other.squares;
    }

    fn means(&self) -> Counts {
        let mut means = Counts {
            angle: Vec::new(),
            error: Vec::new(),
            weight: Vec::new(),
            scatter: self.squares,
        };
        for (count, sums) in self.sums.iter().enumerate() {
            if sums.weight == 0.0 {
                continue;
            }
            let mean = sums.error / sums.weight;
            means.angle.push(count as f64);
            means.error.push(mean);
            means.weight.push(sums.weight);
            means.scatter -= mean * sums.error;
        }
        if means.scatter < 0.0 {
            means.scatter = 0.0;
        }
        means
    }
}

/// A chunk of readings on their way into a table.
struct Call<'a, 'b> {
    readings: Readings<'a>,
    centre: f64,
    turn: f64,
    table: &'b mut Table,
    whole: &'b mut bool,
}

impl Kernel for Call<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            readings,
            centre,
            turn,
            table,
            whole,
        } = self;
        let len = readings.angle.len();
        let per_count = 1.0 / turn;
        let mut all = true;
        let mut counts = [0u32; CHUNK];
        for (count, &x) in counts.iter_mut().zip(readings.angle) {
            all &= (whole_number(x) == x) & (x.abs() < FARTHEST);
            // Products of turns and counts are whole numbers, so they are exact.
            let rest = x - turn * whole_number(x * per_count);
            let place = if rest < 0.0 { rest + turn } else { rest };
            // The low bits of a rounded double are the whole number itself.
            *count = (place + ROUNDER).to_bits() as u32;
        }
        *whole &= all;
        if !all {
            return;
        }
        let indicated = &readings.error[..len];
        let reference = &readings.reference.unwrap_or(&ZEROS)[..len];
        let weight = &readings.weights.unwrap_or(&ONES)[..len];
        let (mut error, mut squares) = ([0.0; CHUNK], [0.0; CHUNK]);
        for i in 0..len {
            let (difference, carry) = crate::angle::two_sum(indicated[i], -reference[i]);
            let turns = whole_number((difference - centre) * per_count);
            let rest = (difference - turn * turns) - centre + carry;
            error[i] = weight[i] * rest;
            squares[i] = error[i] * rest;
        }
        let mut lanes = [0.0; LANES];
        for block in squares.chunks_exact(LANES) {
            for (sum, square) in lanes.iter_mut().zip(block) {
                *sum += square;
            }
        }
        for i in 0..len {
            let sums = &mut table.sums[counts[i] as usize];
            sums.weight += weight[i];
            sums.error += error[i];
        }
        table.squares += lanes.iter().sum::<f64>();
    }
}
