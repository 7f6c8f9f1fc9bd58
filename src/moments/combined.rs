//! Moments of two runs made one, scaled, taken away, and as plain numbers.

use super::accumulator::Accumulator;
use super::segment::{Segment, compensate};

impl Accumulator {
    /// Forgets all readings.
    pub(super) fn clear(&mut self) {
        for table in [&mut self.block, &mut self.total, &mut self.carry] {
            table.fill(Segment::EMPTY);
        }
        self.pending = 0;
        self.squares = (0.0, 0.0);
        self.count = 0;
    }

    /// Every reading so many times as heavy.
    pub fn scale(&mut self, factor: f64) {
        self.flush();
        for table in [&mut self.total, &mut self.carry] {
            let moments = table.iter_mut().flat_map(Segment::values_mut);
            moments.for_each(|value| *value *= factor);
        }
        self.squares = (self.squares.0 * factor, self.squares.1 * factor);
    }

    /// Takes away readings that were added before; extremes stay as they are.
    pub fn subtract(&mut self, other: &Self) {
        let mut opposite = other.clone();
        opposite.scale(-1.0);
        let left = self.count.saturating_sub(other.count);
        self.merge(&opposite);
        self.count = left;
    }

    /// Adds the moments of other readings of the same run, taken over the same segments.
    pub fn merge(&mut self, other: &Self) {
        let shift = self.period.wrap(other.centre - self.centre);
        let mut moved = other.clone();
        moved.flush();
        if shift != 0.0 {
            let (weight, error) = moved.sums();
            let squares = shift * (2.0 * error + shift * weight);
            compensate(&mut moved.squares.0, &mut moved.squares.1, squares);
            for table in [&mut moved.total, &mut moved.carry] {
                table.iter_mut().for_each(|s| *s = s.shifted(shift));
            }
        }
        self.absorb(moved);
        self.count += other.count;
    }

    /// Adds another's sums, its centre being the same.
    pub(super) fn absorb(&mut self, mut other: Self) {
        other.flush();
        self.add_to_total(&other.total);
        self.add_to_total(&other.carry);
        compensate(&mut self.squares.0, &mut self.squares.1, other.squares.0);
        compensate(&mut self.squares.0, &mut self.squares.1, other.squares.1);
    }

    /// All sums as plain numbers, for storage; `restore` takes them back.
    pub fn store(&self) -> Vec<f64> {
        let mut sums = self.clone();
        sums.flush();
        let mut numbers = vec![
            self.centre,
            self.count as f64,
            self.squares.0,
            self.squares.1,
        ];
        for table in [&sums.total, &sums.carry] {
            numbers.extend(table.iter().flat_map(Segment::values));
        }
        numbers.extend(sums.total.iter().flat_map(|segment| segment.extremes));
        numbers
    }

    /// An accumulator over the same orders with the sums of another; None when the
    /// numbers are not its own.
    pub fn restore(&self, numbers: &[f64]) -> Option<Self> {
        let (head, values) = numbers.split_first_chunk::<4>()?;
        let mut sums = self.clone();
        sums.clear();
        sums.centre = head[0];
        sums.count = head[1] as usize;
        sums.squares = (head[2], head[3]);
        let extremes = values.len().checked_sub(4 * sums.total.len())?;
        let (values, extremes) = values.split_at(extremes);
        let places = sums.total.iter_mut().chain(&mut sums.carry);
        let mut places: Vec<_> = places.flat_map(Segment::values_mut).collect();
        if places.len() != values.len() {
            return None;
        }
        for (place, value) in places.iter_mut().zip(values) {
            **place = *value;
        }
        for (segment, extremes) in sums.total.iter_mut().zip(extremes.as_chunks().0) {
            segment.extremes = *extremes;
        }
        Some(sums)
    }
}
