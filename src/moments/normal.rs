//! Normal equations from spectra: for well-conditioned problems.

use super::spectrum::Spectrum;
use crate::lstsq::{Pivot, System, Triangle};

/// The system of some orders, one spectrum per run; None when it is too ill-conditioned
/// to be solved this way.
pub fn system(runs: &[Spectrum], orders: &[u32]) -> Option<System> {
    let columns = 2 * orders.len();
    let size = columns + 1;
    let mut gram = vec![0.0; size * size];
    let mut pivots = Vec::with_capacity(runs.len());
    for run in runs {
        let norm = run.weight[0].re.sqrt();
        let mut coupling = Vec::with_capacity(size);
        for &k in orders {
            let sum = run.weight[k as usize] / norm;
            coupling.extend([sum.re, sum.im]);
        }
        let target = run.error[0].re / norm;
        add_products(&mut gram, run, orders);
        coupling.push(target);
        subtract_square(&mut gram, &coupling);
        coupling.pop();
        pivots.push(Pivot {
            norm,
            coupling,
            target,
        });
    }
    Some(System {
        runs: pivots,
        shared: Triangle::from_gram(size, gram)?,
    })
}

/// Adds `sum of w a b` of all columns `a, b`: products of sines and cosines are sines
/// and cosines of sums and differences of the orders. Lower half, column by column.
fn add_products(gram: &mut [f64], run: &Spectrum, orders: &[u32]) {
    let size = 2 * orders.len() + 1;
    for (column, &j) in orders.iter().enumerate() {
        let (cosine, sine) = gram[2 * column * size..][..2 * size].split_at_mut(size);
        for (row, &k) in orders.iter().enumerate().skip(column) {
            let plus = run.weight[(j + k) as usize];
            let minus = run.weight[j.abs_diff(k) as usize];
            // sin((k - j) x), whichever is the greater.
            let turned = if k >= j { minus.im } else { -minus.im };
            cosine[2 * row] += 0.5 * (minus.re + plus.re);
            cosine[2 * row + 1] += 0.5 * (plus.im + turned);
            sine[2 * row] += 0.5 * (plus.im - turned);
            sine[2 * row + 1] += 0.5 * (minus.re - plus.re);
        }
        cosine[size - 1] += run.error[j as usize].re;
        sine[size - 1] += run.error[j as usize].im;
    }
    gram[size * size - 1] += run.squares;
}

fn subtract_square(gram: &mut [f64], vector: &[f64]) {
    for (column, a) in gram.chunks_exact_mut(vector.len()).zip(vector) {
        for (value, b) in column.iter_mut().zip(vector) {
            *value -= a * b;
        }
    }
}
