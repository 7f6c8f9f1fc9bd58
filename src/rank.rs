//! Which orders the readings cannot tell apart, in words.

use std::collections::HashSet;

use crate::design::Design;
use crate::error::Error;
use crate::lstsq::System;

/// Condition numbers below this need no search for dependent columns.
pub const SUSPICIOUS_CONDITION: f64 = 1e9;

/// Parts of a turn within which two angles count as one: finer than any encoder (2^-32),
/// coarser than the rounding of a hundred turns.
const SAME_ANGLE: f64 = 1e-12;

/// Shares of a dependent column below this are rounding, not partners.
const PARTNER: f64 = 1e-3;

/// Aliases share a pattern with one or two others (their cosines and sines); a column
/// made of more is a smooth function on a short arc.
const FEW_PARTNERS: usize = 4;

/// Harmonics that a message lists before it says "and more".
const LISTED: usize = 4;

/// A column that the columns before it can make.
struct Dependence {
    column: usize,
    partners: Vec<usize>,
    vanishes: bool,
}

/// An error that names the orders at fault, or none when every unknown is determined.
///
/// `bound` is what the condition number does not exceed, `rounding` is what the angles are known to,
/// in radians: it bounds how well a column is known. `angles` are those read, or none where only
/// their sums are left.
pub fn check<I: Iterator<Item = f64>>(
    design: &Design,
    system: &System,
    bound: f64,
    rounding: impl Fn() -> f64,
    angles: impl Fn() -> I,
) -> Result<(), Error> {
    if bound < SUSPICIOUS_CONDITION {
        return Ok(());
    }
    let condition = system.condition_number();
    if condition < SUSPICIOUS_CONDITION {
        return Ok(());
    }
    let found = dependences(design, system, rounding());
    let unknowns = system.unknowns();
    let hopeless = condition * f64::EPSILON * unknowns as f64 >= 1.0;
    if found.is_empty() && !hopeless {
        return Ok(());
    }
    let needed = 1 + design.columns();
    let distinct = distinct_angles(design, angles(), needed);
    let lost: Vec<_> = found.iter().map(|d| d.column).collect();
    let (orders, reason) = if (1..needed).contains(&distinct) {
        let orders = orders_of(design, &lost);
        let fewer = match (distinct - 1) / 2 {
            0 => String::new(),
            1 => "fit 1 order, or ".into(),
            most => format!("fit {most} or fewer of the orders, or "),
        };
        let reason = format!(
            "readings at {distinct} distinct angle{} cannot determine {}; \
             {fewer}measure at {needed} angles or more",
            if distinct == 1 { "" } else { "s" },
            name(design, &orders)
        );
        (orders, reason)
    } else if found.is_empty() || found.iter().any(|d| d.partners.len() > FEW_PARTNERS) {
        let all: Vec<_> = (0..design.columns()).collect();
        let orders = orders_of(design, if lost.is_empty() { &all } else { &lost });
        let reason = format!(
            "the angles read cover too little of a turn to determine {}; fit fewer orders, or \
             measure over more travel",
            name(design, &orders)
        );
        (orders, reason)
    } else {
        let involved: Vec<_> = found.iter().flat_map(Dependence::columns).collect();
        let mut causes: Vec<_> = found.iter().map(|d| d.describe(design)).collect();
        causes.dedup();
        causes.truncate(LISTED);
        let reason = format!(
            "{}; leave one of each out, or measure at more and unevenly spaced angles",
            causes.join(", ")
        );
        (orders_of(design, &involved), reason)
    };
    Err(Error::Rank {
        rank: unknowns - lost.len().max(1).min(unknowns),
        unknowns,
        orders,
        reason,
    })
}

impl Dependence {
    /// The column and its partners.
    fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.partners.iter().copied().chain([self.column])
    }

    fn describe(&self, design: &Design) -> String {
        let own = name(design, &orders_of(design, &[self.column]));
        let part = if self.column.is_multiple_of(2) {
            "cosine"
        } else {
            "sine"
        };
        if self.vanishes {
            format!("the {part} of {own} is zero at every angle read")
        } else if self.partners.is_empty() {
            format!("the {part} of {own} is the same at every angle of a run, like its zero")
        } else {
            let others = name(design, &orders_of(design, &self.partners));
            format!("{own} cannot be distinguished from {others} at these angles")
        }
    }
}

/// The harmonics of some columns, each once, in order.
fn orders_of(design: &Design, columns: &[usize]) -> Vec<(usize, u32)> {
    let harmonics: Vec<_> = design.harmonics().collect();
    let mut orders: Vec<_> = columns.iter().map(|column| harmonics[column / 2]).collect();
    orders.sort_unstable();
    orders.dedup();
    orders
}

/// Columns of the shared triangle that the ones before them make to within the
/// rounding of the angles.
fn dependences(design: &Design, system: &System, step: f64) -> Vec<Dependence> {
    let weight: f64 = system.runs.iter().map(|run| run.norm * run.norm).sum();
    let scale = weight.sqrt();
    let harmonics: Vec<_> = design.harmonics().collect();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut made: Vec<Vec<f64>> = Vec::new();
    let mut kept = Vec::new();
    let mut found = Vec::new();
    for (column, mut rest) in system.shared.design_columns().into_iter().enumerate() {
        let mut shares = vec![0.0; basis.len()];
        // Twice is enough (Kahan and Parlett): the second pass removes what rounding left.
        for _ in 0..2 {
            for (unit, share) in basis.iter().zip(&mut shares) {
                let part = dot(unit, &rest);
                *share += part;
                rest.iter_mut().zip(unit).for_each(|(r, u)| *r -= part * u);
            }
        }
        let length = dot(&rest, &rest).sqrt();
        let rounding = system.unknowns() as f64 * f64::EPSILON
            + step * design.frequency(harmonics[column / 2]);
        if length > rounding * scale {
            rest.iter_mut().for_each(|r| *r /= length);
            shares.push(length);
            basis.push(rest);
            made.push(shares);
            kept.push(column);
            continue;
        }
        let raw = system.runs.iter().map(|run| run.coupling[column].powi(2));
        let size = (dot(&shares, &shares) + raw.sum::<f64>()).sqrt();
        back_substitute(&made, &mut shares);
        let partners = kept.iter().zip(&shares);
        found.push(Dependence {
            column,
            partners: partners
                .filter(|(_, share)| share.abs() > PARTNER)
                .map(|(&kept, _)| kept)
                .collect(),
            vanishes: size <= rounding * scale,
        });
    }
    found
}

/// Shares of the kept columns from shares of their orthogonal basis.
fn back_substitute(made: &[Vec<f64>], shares: &mut [f64]) {
    for j in (0..shares.len()).rev() {
        shares[j] /= made[j][j];
        let share = shares[j];
        for i in 0..j {
            shares[i] -= share * made[j][i];
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Distinct angles, modulo a turn where the harmonics repeat; stops at `enough`.
fn distinct_angles(design: &Design, angles: impl Iterator<Item = f64>, enough: usize) -> usize {
    let period = design.period();
    let periodic = design.is_periodic();
    let mut seen = HashSet::new();
    for angle in angles {
        let turn = if periodic {
            period.phase(angle, 1.0).0
        } else {
            angle / period.value()
        };
        let mut place = (turn / SAME_ANGLE).round() as i64;
        if periodic {
            place = place.rem_euclid((1.0 / SAME_ANGLE) as i64);
        }
        seen.insert(place);
        if seen.len() >= enough {
            break;
        }
    }
    seen.len()
}

/// "order 3", "orders 3, 5 of shaft 1 and ...".
fn name(design: &Design, orders: &[(usize, u32)]) -> String {
    let mut parts = Vec::new();
    for shaft in 0..design.shafts().len() {
        let own: Vec<_> = orders
            .iter()
            .filter(|o| o.0 == shaft)
            .map(|o| o.1)
            .collect();
        if own.is_empty() {
            continue;
        }
        let plural = if own.len() == 1 { "order" } else { "orders" };
        let mut text: Vec<_> = own.iter().take(LISTED).map(u32::to_string).collect();
        if own.len() > LISTED {
            text.push(format!("... {}", own[own.len() - 1]));
        }
        let mut part = format!("{plural} {}", text.join(", "));
        if design.shafts().len() > 1 {
            part += &format!(" of shaft {shaft}");
        }
        parts.push(part);
    }
    parts.join(" and ")
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::design::Frequencies;
    use crate::lstsq::Triangle;

    fn design(orders: Vec<u32>) -> Design {
        let cycles = 1.0;
        Design::new(360.0, vec![Frequencies { cycles, orders }]).unwrap()
    }

    /// What is left is as many unknowns as the singular values of the rows say.
    #[test]
    fn the_rank_is_that_of_the_rows() {
        /// Of rows of numbers up to 1: dependent columns leave rounding.
        const ROUNDING: f64 = 1e-9;
        let cases: [(usize, Vec<u32>, &[u32]); 5] = [
            (36, vec![1, 18], &[18]),
            (36, vec![16, 20], &[16, 20]),
            (36, vec![1, 36], &[36]),
            (10, (1..8).collect(), &[5, 6, 7]),
            (36, vec![1, 2, 5], &[]),
        ];
        for (positions, orders, fault) in cases {
            let design = design(orders.clone());
            let angles: Vec<f64> = (0..3 * positions)
                .map(|i| 360.0 / positions as f64 * i as f64)
                .collect();
            let (mut rows, mut plain) = (Vec::new(), Vec::<f64>::new());
            for &x in &angles {
                let mut row = vec![1.0];
                design.extend_row(&mut row, x, 1.0);
                plain.extend(&row);
                rows.extend(row.iter().chain(&[0.0]));
            }
            let columns = 1 + design.columns();
            let (pivot, shared) = Triangle::of_rows(columns + 1, &rows).eliminate();
            let runs = vec![pivot];
            let system = System { runs, shared };
            let wanted = DMatrix::from_row_slice(angles.len(), columns, &plain).rank(ROUNDING);
            let found = check(
                &design,
                &system,
                f64::INFINITY,
                || 1e-14,
                || angles.iter().copied(),
            );
            match found {
                Ok(()) => assert_eq!((wanted, fault.len()), (columns, 0), "{orders:?}"),
                Err(Error::Rank {
                    rank,
                    unknowns,
                    orders,
                    ..
                }) => {
                    assert_eq!((rank, unknowns), (wanted, columns), "{orders:?}");
                    let named: Vec<_> = fault.iter().map(|&order| (0, order)).collect();
                    assert_eq!(orders, named);
                }
                Err(other) => panic!("{other}"),
            }
        }
    }

    /// Ones with minus ones above them: no column is near the others, all together are by
    /// `2^(1 - n)`. Refused is what leaves no digit, and named are all.
    #[test]
    fn a_hopeless_system_is_refused_without_a_column_at_fault() {
        for (orders, is_refused) in [(12, false), (15, false), (30, true)] {
            let n = 2 * orders as usize;
            let row = |i: usize, j: usize| match i.cmp(&j) {
                std::cmp::Ordering::Less if j < n => -1.0,
                std::cmp::Ordering::Equal => 1.0,
                _ => 0.0,
            };
            let rows: Vec<f64> = (0..n * (n + 1))
                .map(|k| row(k / (n + 1), k % (n + 1)))
                .collect();
            let shared = Triangle::of_rows(n + 1, &rows);
            let runs = Vec::new();
            let system = System { runs, shared };
            let design = design((1..=orders).collect());
            let look = |bound| check(&design, &system, bound, || 0.0, || [].into_iter());
            assert_eq!(look(1e8), Ok(()));
            match look(f64::INFINITY) {
                Ok(()) => assert!(!is_refused, "{orders}"),
                Err(Error::Rank {
                    rank,
                    unknowns,
                    orders: named,
                    reason,
                }) => {
                    assert!(is_refused, "{reason}");
                    assert_eq!((rank, unknowns, named.len()), (n - 1, n, orders as usize));
                    assert!(reason.contains("too little of a turn"));
                }
                Err(other) => panic!("{other}"),
            }
        }
    }

    #[test]
    fn back_substitution_solves_the_triangle() {
        let made = [vec![2.0], vec![-1.0, 4.0], vec![3.0, 0.5, -0.25]];
        let wanted = DVector::from_vec(vec![1.5, -2.0, 7.0]);
        let triangle = DMatrix::from_fn(3, 3, |i, j| made[j].get(i).copied().unwrap_or(0.0));
        let mut shares = (&triangle * &wanted).as_slice().to_vec();
        back_substitute(&made, &mut shares);
        // Every number is exact.
        assert_eq!(shares, wanted.as_slice());
    }
}
