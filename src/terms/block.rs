//! Readings that are worked on together, and the room for it.
//!
//! Passes go over slices whose length is a multiple of the lanes: a block of readings, or
//! a single one. Every reading has the same arithmetic in both, so that batches and steps
//! agree to the last bit.

use super::signals::{Columns, Signal, Signals};
use crate::simd::MOST_LANES;

/// Readings of a block with room for a whole vector from its last one on: what is computed
/// of them stays in the first-level cache.
pub(super) const BLOCK: usize = 128 + MOST_LANES;

/// So many readings, or a few more, to fill vectors.
#[inline]
pub(super) fn padded<const N: usize>(len: usize) -> usize {
    if N == 1 {
        1
    } else {
        len.next_multiple_of(MOST_LANES)
    }
}

/// Signals of a block; NaN where one is not given.
pub(super) struct Given<const N: usize> {
    values: [[f64; N]; Signal::COUNT],
    /// The reading that is the first one now.
    pub first: usize,
}

impl Given<1> {
    /// Those of one reading.
    pub fn one(signals: &Signals) -> Self {
        Self {
            values: Signal::ALL.map(|signal| [signals.get(signal).unwrap_or(f64::NAN)]),
            first: 0,
        }
    }
}

impl<const N: usize> Given<N> {
    fn new() -> Self {
        Self {
            values: [[f64::NAN; N]; Signal::COUNT],
            first: 0,
        }
    }

    /// Takes over readings `start..start + len` of the columns.
    pub fn load(&mut self, columns: &Columns<'_>, start: usize, len: usize) {
        self.first = 0;
        for signal in Signal::ALL {
            let own = &mut self.values[signal as usize];
            match columns.get(signal) {
                Some([all]) => own.fill(*all),
                Some(values) => own[..len].copy_from_slice(&values[start..start + len]),
                None => {}
            }
        }
    }

    /// Signals of reading `i`.
    pub fn at(&self, i: usize) -> Signals {
        Signals::of(self.values.map(|values| values[i]))
    }

    /// The values of a signal, from the first reading on.
    #[inline(always)]
    pub fn of(&self, signal: Signal) -> &[f64] {
        &self.values[signal as usize][self.first..]
    }
}

/// Some readings and what becomes of them.
pub(super) struct Block<const N: usize> {
    pub signals: Given<N>,
    /// The angles given.
    pub x: [f64; N],
    /// The results.
    pub out: [f64; N],
    /// What the series and the terms that depend on the angle are to add up to.
    pub goal: [f64; N],
    /// The way during the delay.
    pub delayed: [f64; N],
    /// Of travel.
    pub direction: [f64; N],
    /// Errors of friction.
    pub friction: [f64; N],
    /// Angles if the joint went on, and if it turned.
    pub onward: [f64; N],
    pub turned: [f64; N],
    pub work: Work<N>,
}

impl<const N: usize> Block<N> {
    /// Most readings.
    pub const MOST: usize = if N == 1 { 1 } else { N - MOST_LANES };

    pub fn new() -> Self {
        let row = [0.0; N];
        Self {
            signals: Given::new(),
            x: row,
            out: row,
            goal: row,
            delayed: row,
            direction: row,
            friction: row,
            onward: row,
            turned: row,
            work: Work::new(),
        }
    }
}

impl Block<1> {
    /// A block of one reading.
    pub fn one(x: f64, signals: &Signals) -> Self {
        let mut block = Self::new();
        block.x = [x];
        block.signals = Given::one(signals);
        block
    }
}

/// Room for what is computed of a block on the way; passes take the [`Rows`] they need.
pub(super) struct Work<const N: usize>([[f64; N]; 14]);

/// The first readings of it: rows of one length, so that loops over them are vectors.
pub(super) struct Rows<'a> {
    /// Error of the terms, its slope, and a bound of how much that changes.
    pub error: &'a mut [f64],
    pub slope: &'a mut [f64],
    pub bend: &'a mut [f64],
    /// Of the term at hand.
    pub factor: &'a mut [f64],
    pub value: &'a mut [f64],
    pub rise: &'a mut [f64],
    pub waves: [&'a mut [f64]; 4],
    /// Of the search for the angle.
    pub goal: &'a mut [f64],
    pub probe: &'a mut [f64],
    pub last: &'a mut [f64],
    pub open: &'a mut [f64],
}

impl<const N: usize> Work<N> {
    pub fn new() -> Self {
        Self([[0.0; N]; 14])
    }

    /// Rows of `n` readings.
    #[inline(always)]
    pub fn rows(&mut self, n: usize) -> Rows<'_> {
        let [
            error,
            slope,
            bend,
            factor,
            value,
            rise,
            a,
            b,
            c,
            d,
            goal,
            probe,
            last,
            open,
        ] = self.0.each_mut().map(|row| &mut row[..n]);
        Rows {
            error,
            slope,
            bend,
            factor,
            value,
            rise,
            waves: [a, b, c, d],
            goal,
            probe,
            last,
            open,
        }
    }
}
