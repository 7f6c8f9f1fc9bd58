//! Readings that wait for others of their segment.
//!
//! A reading by itself moves all the moments of its segment through memory. Some dozen of
//! one segment leave them in registers: they wait in a row until it is full. Of a sweep
//! whole vectors of readings go to the same row, of angles in disorder one after the other.

use super::chunk::Chunk;
use super::expected::{Expected, Watch};
use super::row::{ONES, Row, RowWeights, TOGETHER};
use super::segment::{LANES, Segment};
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Readings per segment from which there are rows.
const READINGS: usize = 16;

/// Segments beyond which rows would leave the second cache: 2 MB of them.
pub const MOST_SEGMENTS: usize = 1024;

/// Readings of every segment that are not in its moments yet.
#[derive(Default)]
pub struct Waiting<'a> {
    rows: Vec<Row>,
    /// Of the same readings, where they are weighted.
    weights: Vec<RowWeights>,
    /// How many there are of each segment.
    lens: Vec<usize>,
    watch: Watch<'a>,
    /// Whether the extremes of every segment are noted.
    pub(super) notes: bool,
}

impl<'a> Waiting<'a> {
    /// Room for `readings` that come in any number of pieces; none where it does not pay that
    /// they wait.
    pub fn new(readings: usize, segments: usize, weighted: bool) -> Self {
        if segments > MOST_SEGMENTS || readings < READINGS * segments {
            return Self::default();
        }
        Self {
            rows: vec![Row::EMPTY; segments],
            weights: vec![ONES; if weighted { segments } else { 0 }],
            lens: vec![0; segments],
            ..Self::default()
        }
    }

    /// The same; the extremes of every segment are noted.
    pub fn noting(mut self) -> Self {
        self.notes = true;
        self
    }

    /// The same; readings are held against what is expected of them.
    pub(super) fn watching(mut self, expected: Option<&'a Expected>) -> Self {
        self.watch.expected = expected;
        self
    }

    /// How far the farthest reading is off what was expected of it; infinite where that was
    /// not looked for.
    pub(super) fn farthest(&self) -> f64 {
        if self.has_room() && self.watch.expected.is_some() {
            self.watch.farthest
        } else {
            f64::INFINITY
        }
    }

    /// Whether readings wait at all.
    pub(super) fn has_room(&self) -> bool {
        !self.rows.is_empty()
    }

    /// Takes the first `len` readings of a chunk in, and adds full rows to their segments.
    #[inline(always)]
    pub(super) fn take<L: Lanes, const WEIGHTED: bool>(
        &mut self,
        chunk: &Chunk,
        len: usize,
        table: &mut [Segment],
    ) {
        let mut rows = Rows {
            rows: &mut self.rows,
            weights: &mut self.weights,
            lens: &mut self.lens,
            table,
            watch: &mut self.watch,
            notes: self.notes,
        };
        for start in (0..len).step_by(LANES) {
            if start + LANES <= len && chunk.is_one_segment(start) {
                rows.put::<L, WEIGHTED, LANES>(chunk, start);
                continue;
            }
            for i in start..len.min(start + LANES) {
                rows.put::<L, WEIGHTED, 1>(chunk, i);
            }
        }
    }

    /// Adds all that still waits.
    pub fn finish(&mut self, table: &mut [Segment]) {
        self.finish_by(InstructionSet::best(), table);
    }

    pub(super) fn finish_by(&mut self, set: InstructionSet, table: &mut [Segment]) {
        let waiting = self;
        dispatch(set, Finish { waiting, table });
    }
}

/// The end of what waits.
struct Finish<'a, 'b> {
    waiting: &'a mut Waiting<'b>,
    table: &'a mut [Segment],
}

impl Kernel for Finish<'_, '_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Waiting {
            rows,
            weights,
            lens,
            watch,
            notes,
        } = self.waiting;
        let rows = rows.iter_mut().zip(lens).zip(self.table);
        for (i, ((row, len), moments)) in rows.enumerate() {
            if *len == 0 {
                continue;
            }
            if *notes {
                row.note(*len, moments);
            }
            let mut weights = weights.get(i).copied().unwrap_or(ONES);
            let full = row.add_some::<L>(*len, &mut weights, moments);
            watch.look::<L>(i, row, full, &weights);
            *len = 0;
        }
    }
}

/// The rows and the segments that they are of: slices, which the loop keeps in registers.
struct Rows<'a, 'b> {
    rows: &'a mut [Row],
    weights: &'a mut [RowWeights],
    lens: &'a mut [usize],
    table: &'a mut [Segment],
    watch: &'a mut Watch<'b>,
    notes: bool,
}

impl Rows<'_, '_> {
    /// Takes `LEN` readings of one segment in.
    #[inline(always)]
    fn put<L: Lanes, const WEIGHTED: bool, const LEN: usize>(&mut self, chunk: &Chunk, i: usize) {
        let segment = chunk.segment[i] as usize;
        let (row, at) = (&mut self.rows[segment], self.lens[segment]);
        chunk.put::<LEN>(i, row, at);
        if WEIGHTED {
            self.weights[segment][at..at + LEN].copy_from_slice(&chunk.weight[i..i + LEN]);
        }
        let len = at + LEN;
        self.lens[segment] = len;
        if len < TOGETHER {
            return;
        }
        let moments = &mut self.table[segment];
        if self.notes {
            row.note(TOGETHER, moments);
        }
        if WEIGHTED {
            let weights = &mut self.weights[segment];
            row.add::<L, true>(TOGETHER, weights, moments);
            self.watch.look::<L>(segment, row, TOGETHER, weights);
            weights.copy_within(TOGETHER.., 0);
        } else {
            row.add::<L, false>(TOGETHER, &ONES, moments);
            self.watch.look::<L>(segment, row, TOGETHER, &ONES);
        }
        row.keep_rest();
        self.lens[segment] = len - TOGETHER;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// There is room from some readings a segment on, and for so many segments; only readings that
    /// wait, and of which something is expected, are looked at.
    #[test]
    fn room_is_where_it_pays() {
        let expected = Expected::new(7, 0.0, &[], &[]);
        for (readings, segments, room) in [
            (READINGS * 7, 7, true),
            (READINGS * 7 - 1, 7, false),
            (READINGS * MOST_SEGMENTS, MOST_SEGMENTS, true),
            (READINGS * (MOST_SEGMENTS + 1), MOST_SEGMENTS + 1, false),
        ] {
            let waiting = Waiting::new(readings, segments, false);
            assert_eq!(waiting.has_room(), room, "{readings} {segments}");
            assert_eq!(waiting.farthest(), f64::INFINITY);
            let watched = waiting.watching(Some(&expected)).farthest();
            assert_eq!(watched, if room { 0.0 } else { f64::INFINITY });
        }
    }
}
