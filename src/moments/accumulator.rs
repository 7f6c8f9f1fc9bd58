//! Moments of one run: constant memory, mergeable, one pass.

use super::accumulate::{Tally, accumulate, accumulate_stretches};
use super::expected::Expected;
use super::place::{Around, Frame};
use super::segment::{Segment, compensate};
use super::waiting::Waiting;
use crate::angle::Period;
use crate::error::Error;
use crate::readings::Readings;
use crate::{interrupt, memory, threads};

/// Readings per segment summed plainly before they join the compensated total: rounding
/// stays that of a few hundred additions, whatever the number of readings.
const BLOCK: usize = 256;

/// Readings below which threads cost more than they save.
const THREADED: usize = 1 << 17;

/// Bytes that the tables of the parts of one update may take together.
const PART_BYTES: usize = 4 << 20;

/// Bytes of a table beyond which an update does with one part.
const MOST_PART_BYTES: usize = 16 << 20;

/// Highest order of the base shaft: 400 MB of sums.
pub const MOST_ORDER: u32 = 1 << 16;

/// Segments per order: half an order turns by `pi / SEGMENTS_PER_ORDER / 2 < 1/4` within a
/// segment, where a Chebyshev series of 12 terms is exact to 3e-16.
const SEGMENTS_PER_ORDER: f64 = 6.5;

/// Fewest segments: low orders gain nothing from long ones.
const FEWEST_SEGMENTS: usize = 32;

/// Moments of one run of readings.
#[derive(Clone, Debug)]
pub struct Accumulator {
    pub(super) cycles: f64,
    pub(super) highest: u32,
    /// Turn of the base shaft.
    pub(super) base: Period,
    /// Turn of the errors.
    pub(super) period: Period,
    pub(super) centre: f64,
    /// Sums of the block under way, of all blocks before it, and what rounding took.
    pub(super) block: Vec<Segment>,
    pub(super) pending: usize,
    pub(super) total: Vec<Segment>,
    pub(super) carry: Vec<Segment>,
    pub(super) squares: (f64, f64),
    pub(super) count: usize,
}

/// Segments of the circle for orders up to `highest`, an even number.
pub fn segments(highest: u32) -> usize {
    let needed = (f64::from(highest) * SEGMENTS_PER_ORDER).ceil() as usize;
    needed.max(FEWEST_SEGMENTS).next_multiple_of(2)
}

/// Bytes of the tables of an accumulator for orders up to `highest`.
pub fn table_bytes(highest: u32) -> usize {
    3 * size_of::<Segment>() * segments(highest)
}

impl Accumulator {
    /// No readings yet; errors are wrapped around `centre`.
    pub fn new(period: Period, cycles: f64, highest: u32, centre: f64) -> Self {
        let empty = vec![Segment::EMPTY; segments(highest)];
        Self {
            cycles,
            highest,
            base: period.divided(cycles),
            period,
            centre,
            block: empty.clone(),
            pending: 0,
            total: empty.clone(),
            carry: empty,
            squares: (0.0, 0.0),
            count: 0,
        }
    }

    /// An error where orders up to `highest` are too many, or too many for the memory.
    pub fn room(highest: u32) -> Result<(), Error> {
        /// Tables of an accumulator, and of what an update makes beside it.
        const TABLES: usize = 6;
        if highest > MOST_ORDER {
            return Err(Error::Limit {
                what: "the highest order of moments, in cycles of their base shaft,".into(),
                most: f64::from(MOST_ORDER),
                got: f64::from(highest),
            });
        }
        memory::room(TABLES * size_of::<Segment>() * segments(highest) + 2 * PART_BYTES)
    }

    /// Turns of the base shaft per turn.
    pub fn cycles(&self) -> f64 {
        self.cycles
    }

    /// Highest order of the base shaft.
    pub fn highest(&self) -> u32 {
        self.highest
    }

    /// Highest order that the segments hold to a part in 1e10 of the errors: half a segment
    /// turns it by 1.4 at most, where the series of 12 terms ends at 6e-11.
    pub fn reach(&self) -> u32 {
        const MOST_TURN: f64 = 1.4;
        let reach = MOST_TURN / std::f64::consts::PI * self.total.len() as f64;
        self.highest.max(reach as u32)
    }

    /// Greatest and least angle and error of each segment that has readings whose extremes were
    /// noted, in this order; the angle is in `-base / 2 .. base / 2`.
    pub fn extremes(&self) -> Vec<[f64; 4]> {
        let half = 0.5 * self.base.value() / self.total.len() as f64;
        let segments = self.total.iter().zip(&self.block).enumerate();
        let noted = segments.filter_map(|(i, (total, block))| {
            let mut all = *total;
            all.widen(block.extremes);
            let [u, minus_u, y, minus_y] = all.extremes;
            let middle = (2 * i + 1) as f64 - self.total.len() as f64;
            let angle = |u: f64| (middle + u) * half;
            let found = [
                angle(u),
                angle(-minus_u),
                y + self.centre,
                self.centre - minus_y,
            ];
            (u > f64::NEG_INFINITY).then_some(found)
        });
        noted.collect()
    }

    /// The angle that errors are wrapped around and counted from.
    pub fn centre(&self) -> f64 {
        self.centre
    }

    /// Readings of positive weight.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Weighted sum of the squared errors from the centre.
    pub fn squares(&self) -> f64 {
        self.squares.0 + self.squares.1
    }

    /// Adds readings; the result does not depend on `threads`.
    pub fn update(&mut self, readings: Readings<'_>, threads: usize) {
        self.take(readings, threads, None);
    }

    /// The same; returns how far the farthest of them that counts is off what is expected of
    /// its error, from the centre: infinite where they are too few, or the segments too many.
    pub fn update_watched(
        &mut self,
        readings: Readings<'_>,
        threads: usize,
        expected: &Expected,
    ) -> f64 {
        self.take(readings, threads, Some(expected))
    }

    fn take(&mut self, readings: Readings<'_>, threads: usize, expected: Option<&Expected>) -> f64 {
        let len = readings.angle.len();
        if len < THREADED {
            let farthest = self.add(readings, expected);
            self.count += readings.count();
            return farthest;
        }
        let table = size_of::<Segment>() * self.total.len();
        let least = if table > MOST_PART_BYTES { 1 } else { 4 };
        let parts = (PART_BYTES / table)
            .clamp(least, 16)
            .min(len.div_ceil(THREADED));
        let bounds: Vec<_> = (0..=parts).map(|i| len * i / parts).collect();
        let empty = {
            let mut part = self.clone();
            part.clear();
            part
        };
        let sums = threads::map_parts(parts, threads, |i| {
            let mut part = empty.clone();
            let farthest = part.add(readings.part(bounds[i], bounds[i + 1]), expected);
            (part, farthest)
        });
        // Work that is called off is called off before here: nothing is added by halves.
        let sums: Vec<_> = sums.collect();
        let mut farthest = 0.0f64;
        for (part, own) in sums {
            self.absorb(part);
            farthest = farthest.max(own);
        }
        self.count += readings.count();
        farthest
    }

    /// Adds readings that come in pieces; `settle` adds what still waits at their end.
    pub fn update_piece(&mut self, readings: Readings<'_>, waiting: &mut Waiting) {
        self.add_piece(readings, waiting);
        self.count += readings.count();
    }

    /// Adds what waits of pieces.
    pub fn settle(&mut self, waiting: &mut Waiting) {
        waiting.finish(&mut self.block);
    }

    /// Adds readings; returns how far the farthest is off what is expected.
    fn add(&mut self, readings: Readings<'_>, expected: Option<&Expected>) -> f64 {
        let waiting = self.waiting(readings.angle.len(), readings.weights.is_some());
        let mut waiting = waiting.watching(expected);
        self.add_piece(readings, &mut waiting);
        self.settle(&mut waiting);
        waiting.farthest()
    }

    /// Room for as many readings to wait for others of their segment.
    pub fn waiting(&self, readings: usize, weighted: bool) -> Waiting<'static> {
        Waiting::new(readings, self.block.len(), weighted)
    }

    /// Adds readings block by block, but those that are left waiting.
    fn add_piece(&mut self, readings: Readings<'_>, waiting: &mut Waiting) {
        let frame = Frame::new(self.base, self.block.len());
        let around = Around::new(self.period, self.centre);
        let full = BLOCK * self.block.len();
        let mut start = 0;
        while start < readings.angle.len() {
            let end = readings.angle.len().min(start + full - self.pending);
            let part = readings.part(start, end);
            let squares = accumulate(&frame, &around, part, waiting, &mut self.block);
            compensate(&mut self.squares.0, &mut self.squares.1, squares);
            self.pending += end - start;
            start = end;
            if self.pending == full {
                self.flush();
            }
        }
    }

    /// Adds readings to the sums of the stretches of the angle that end at `ends`, one more
    /// than ends; all are over the same segments.
    pub fn update_stretches(stretches: &mut [Self], ends: &[f64], readings: Readings<'_>) {
        let Some(Self {
            base,
            period,
            centre,
            ..
        }) = stretches.first()
        else {
            return;
        };
        let segments = stretches[0].total.len();
        let frame = Frame::new(*base, segments);
        let around = Around::new(*period, *centre);
        let mut table = vec![Segment::EMPTY; segments * stretches.len()];
        let len = readings.angle.len();
        let mut waiting = Waiting::new(len, table.len(), readings.weights.is_some());
        for start in (0..len).step_by(BLOCK * table.len()) {
            interrupt::point();
            let part = readings.part(start, len.min(start + BLOCK * table.len()));
            let mut tallies = vec![Tally::default(); stretches.len()];
            accumulate_stretches(
                &frame,
                &around,
                part,
                ends,
                &mut waiting,
                &mut table,
                &mut tallies,
            );
            waiting.finish(&mut table);
            let tables = table.chunks_exact_mut(segments);
            for ((sums, table), tally) in stretches.iter_mut().zip(tables).zip(tallies) {
                sums.add_to_total(table);
                compensate(&mut sums.squares.0, &mut sums.squares.1, tally.squares);
                sums.count += tally.count;
                table.fill(Segment::EMPTY);
            }
        }
    }

    /// Adds the block under way to the total.
    pub(super) fn flush(&mut self) {
        let mut block = std::mem::take(&mut self.block);
        self.add_to_total(&block);
        block.fill(Segment::EMPTY);
        self.block = block;
        self.pending = 0;
    }

    pub(super) fn add_to_total(&mut self, moments: &[Segment]) {
        let sums = self.total.iter_mut().zip(&mut self.carry);
        for ((total, carry), moments) in sums.zip(moments) {
            total.add(carry, moments);
        }
    }

    /// Sum of the weights.
    pub fn weight(&self) -> f64 {
        self.sums().0
    }

    /// Sums of the weights and of the weighted errors.
    pub(super) fn sums(&self) -> (f64, f64) {
        let moments = self.moments();
        let weight = moments.iter().map(|s| s.weight[0]).sum();
        let error = moments.iter().map(|s| s.error[0]).sum();
        (weight, error)
    }

    /// The moments of every segment over Chebyshev polynomials.
    pub fn moments(&self) -> Vec<Segment> {
        let sums = self.total.iter().zip(&self.carry).zip(&self.block);
        let moments = |((total, carry), block): ((&Segment, &Segment), &Segment)| {
            let (mut moments, mut carry) = (*total, *carry);
            moments.add(&mut carry, block);
            let values = moments.values_mut().zip(carry.values());
            values.for_each(|(value, carry)| *value += carry);
            moments.chebyshev()
        };
        sums.map(moments).collect()
    }
}
