//! Rows of the design matrix: the harmonics of an angle, without coefficients.

use crate::angle::Period;
use crate::error::Error;
use crate::memory;
use crate::series::{Rotation, check_frequencies};

/// Most orders of one fit: its triangle takes half a gigabyte and its solution minutes.
pub const MOST_ORDERS: usize = 4096;

/// The orders of one shaft.
#[derive(Clone, Debug, PartialEq)]
pub struct Frequencies {
    /// Turns of the shaft per output turn; any positive real.
    pub cycles: f64,
    /// Orders from 1, strictly increasing.
    pub orders: Vec<u32>,
}

/// The harmonics to fit: columns `cos, sin` of each order of each shaft in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    period: Period,
    shafts: Vec<Frequencies>,
}

impl Design {
    /// Checks cycles and orders; a design without orders fits zeros alone.
    pub fn new(period: f64, shafts: Vec<Frequencies>) -> Result<Self, Error> {
        let period = Period::new(period)?;
        for (index, shaft) in shafts.iter().enumerate() {
            check_frequencies(index, shaft.cycles, &shaft.orders)?;
        }
        Ok(Self { period, shafts })
    }

    /// An error where the harmonics are too many to be fitted together, or too many for the
    /// memory.
    pub fn room(&self) -> Result<(), Error> {
        /// Triangles, and rows above and below them, that live at the same time.
        const TRIANGLES: usize = 8;
        const ROWS: usize = 1024;
        if self.columns() > 2 * MOST_ORDERS {
            return Err(Error::Limit {
                what: "the number of orders fitted together".into(),
                most: MOST_ORDERS as f64,
                got: self.columns() as f64 / 2.0,
            });
        }
        let columns = self.columns() + 2;
        memory::room(size_of::<f64>() * columns * (TRIANGLES * columns + ROWS))
    }

    /// One turn of the angles.
    pub fn period(&self) -> Period {
        self.period
    }

    /// The shafts in the order given.
    pub fn shafts(&self) -> &[Frequencies] {
        &self.shafts
    }

    /// `2 n`: a cosine and a sine per order.
    pub fn columns(&self) -> usize {
        2 * self.shafts.iter().map(|s| s.orders.len()).sum::<usize>()
    }

    /// `(shaft, order)` of every pair of columns.
    pub fn harmonics(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        let of_shaft = |(index, shaft): (usize, &Frequencies)| {
            let orders = shaft.orders.clone();
            orders.into_iter().map(move |order| (index, order))
        };
        self.shafts.iter().enumerate().flat_map(of_shaft)
    }

    /// Cycles per output turn of a harmonic.
    pub fn frequency(&self, (shaft, order): (usize, u32)) -> f64 {
        self.shafts[shaft].cycles * f64::from(order)
    }

    /// True when every harmonic repeats after one turn.
    pub fn is_periodic(&self) -> bool {
        self.harmonics()
            .all(|harmonic| self.frequency(harmonic).fract() == 0.0)
    }

    /// The slowest shaft of which every harmonic is a whole order: its cycles per turn,
    /// and the order of each harmonic in turn. None when the shafts share no such turn.
    pub fn common_turn(&self) -> Option<(f64, Vec<u32>)> {
        /// Turns of the first shaft after which the others must be back at their start.
        const MOST_TURNS: u32 = 1024;
        let used = || self.shafts.iter().filter(|shaft| !shaft.orders.is_empty());
        let first = used().next()?.cycles;
        let turns = if self.is_periodic() {
            return self.whole_orders(1.0).map(|orders| (1.0, orders));
        } else {
            let whole =
                |turns: &u32| used().all(|s| (s.cycles / first * f64::from(*turns)).fract() == 0.0);
            (1..=MOST_TURNS).find(whole)?
        };
        let base = first / f64::from(turns);
        self.whole_orders(base).map(|orders| (base, orders))
    }

    /// The harmonics as orders of a shaft of `base` cycles; None when they are not whole.
    pub fn whole_orders(&self, base: f64) -> Option<Vec<u32>> {
        let order = |harmonic| {
            let order = self.frequency(harmonic) / base;
            let whole = order.round();
            let close = (order - whole).abs() <= 4.0 * f64::EPSILON * order;
            (close && whole <= f64::from(u32::MAX)).then_some(whole as u32)
        };
        self.harmonics().map(order).collect()
    }

    /// Appends `scale * cos, scale * sin` of every harmonic at angle `x`.
    #[inline(always)]
    pub fn extend_row(&self, row: &mut Vec<f64>, x: f64, scale: f64) {
        for shaft in &self.shafts {
            let mut rotation = Rotation::new(self.period.phase(x, shaft.cycles));
            for &order in &shaft.orders {
                let (sine, cosine) = rotation.advance(order);
                row.extend([scale * cosine, scale * sine]);
            }
        }
    }
}
