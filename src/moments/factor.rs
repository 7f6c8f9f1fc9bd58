//! Triangular factors of the segments: the accuracy of QR from one pass.
//!
//! Within a segment every harmonic is a polynomial `c` of degree 11, and the readings see
//! it only through `|R c|`, `R` the triangular factor of the segment's 12 x 12 Gram
//! matrix. That matrix is well-conditioned however short the arc is on which readings
//! were taken: the twelve rows `R c` of each segment feed one QR whose design is never squared.

use std::f64::consts::PI;

use super::accumulator::Accumulator;
use super::segment::{ERROR_TERMS, Segment};
use crate::chebyshev::jacobi_anger;
use crate::lstsq::{Reduction, System, Triangle};

/// Pivots below this part of the greatest diagonal element are rounding: the readings
/// of the segment cannot see the polynomial.
const NO_PIVOT: f64 = 1e-14;

/// Segments reduced at a time.
const BATCH: usize = 24;

type Square = [[f64; ERROR_TERMS]; ERROR_TERMS];

/// The system of some orders, one accumulator per run.
pub fn system(runs: &[&Accumulator], orders: &[u32]) -> System {
    let mut system = System {
        runs: Vec::with_capacity(runs.len()),
        shared: Triangle::new(2 * orders.len() + 1),
    };
    for run in runs {
        let (pivot, rest) = reduce(run, orders).eliminate();
        system.runs.push(pivot);
        system.shared.merge(&rest);
    }
    system
}

/// The triangle of `[1, harmonics | error]` over one run.
pub fn reduce(run: &Accumulator, orders: &[u32]) -> Triangle {
    let columns = 2 * orders.len() + 2;
    let moments = run.moments();
    let half_width = PI / moments.len() as f64;
    let series: Vec<_> = orders
        .iter()
        .map(|&k| jacobi_anger(f64::from(k) * half_width))
        .collect();
    let mut reduction = Reduction::default();
    let mut rows = Vec::with_capacity(BATCH * ERROR_TERMS * columns);
    let mut left_over = run.squares();
    for (s, segment) in moments.iter().enumerate() {
        if segment.weight[0] <= 0.0 {
            continue;
        }
        let (factor, targets) = factorise(segment);
        let polynomials = polynomials(orders, &series, s, moments.len());
        for (j, target) in targets.iter().enumerate() {
            rows.push(factor[j][0]);
            for c in &polynomials {
                rows.push((j..ERROR_TERMS).map(|i| factor[j][i] * c[i]).sum());
            }
            rows.push(*target);
            left_over -= target * target;
        }
        if rows.len() >= BATCH * ERROR_TERMS * columns {
            reduction.push(Triangle::of_rows(columns, &rows));
            rows.clear();
        }
    }
    // What no polynomial explains is left in every solution.
    rows.resize(rows.len() + columns - 1, 0.0);
    rows.push(left_over.max(0.0).sqrt());
    let last = Triangle::of_rows(columns, &rows);
    match reduction.finish() {
        Some(triangle) => triangle.merged(&last),
        None => last,
    }
}

/// Chebyshev coefficients of the cosine and sine of every order in segment `s`.
fn polynomials(
    orders: &[u32],
    series: &[[f64; ERROR_TERMS]],
    s: usize,
    segments: usize,
) -> Vec<[f64; ERROR_TERMS]> {
    let mut polynomials = Vec::with_capacity(2 * orders.len());
    for (&k, series) in orders.iter().zip(series) {
        // The centre of the segment is at (2 s + 1 - segments) half widths of pi / segments:
        // whole turns of k times it are taken out exactly.
        let half_widths = (2 * s + 1 + segments) as u64 * u64::from(k) % (2 * segments) as u64;
        let (sine, cosine) = (PI * half_widths as f64 / segments as f64).sin_cos();
        // exp(i k centre) i^j: a quarter turn per term.
        let turned = |first: [f64; 4]| std::array::from_fn(|j| series[j] * first[j % 4]);
        polynomials.push(turned([cosine, -sine, -cosine, sine]));
        polynomials.push(turned([sine, cosine, -sine, -cosine]));
    }
    polynomials
}

/// Upper triangle `R` with `R' R` the Gram matrix of the segment, and `R'^-1` of its
/// right-hand side; rows of polynomials that the readings cannot see are zero.
fn factorise(segment: &Segment) -> (Square, [f64; ERROR_TERMS]) {
    let m = &segment.weight;
    // T_i T_j = (T_(i+j) + T_|i-j|) / 2
    let product = |i: usize, j: usize| 0.5 * (m[i + j] + m[i.abs_diff(j)]);
    let mut rest: Square = std::array::from_fn(|i| std::array::from_fn(|j| product(i, j)));
    let mut targets = segment.error;
    let least = NO_PIVOT * m[0];
    for k in 0..ERROR_TERMS {
        if rest[k][k] <= least {
            rest[k] = [0.0; ERROR_TERMS];
            targets[k] = 0.0;
            continue;
        }
        let pivot = rest[k][k].sqrt();
        rest[k][..k].fill(0.0);
        rest[k][k..].iter_mut().for_each(|value| *value /= pivot);
        targets[k] /= pivot;
        let row = rest[k];
        for i in k + 1..ERROR_TERMS {
            for j in i..ERROR_TERMS {
                rest[i][j] -= row[i] * row[j];
            }
            targets[i] -= row[i] * targets[k];
        }
    }
    (rest, targets)
}
