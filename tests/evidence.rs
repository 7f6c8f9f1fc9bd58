//! The evidence of models of all readings against dense covariances.

use nalgebra::{Cholesky, DMatrix, DVector};
use trueangle::Error;
use trueangle::evidence::{
    CORRELATION_TIMES, Factor, Model, Noise, NoisePrior, Prior, Readings, Rows, Run, Search,
    Solved, State, TERMS, VARIANCES, decays,
};

/// Of some hundred products of order 1 times the condition of the covariance.
const SAME: f64 = 1e-10;

/// Numbers from 0 to 1 without a generator: the golden rotation.
fn even(i: usize, seed: usize) -> f64 {
    (0.618_033_988_749_895 * i as f64 + 0.414_213_562_373_095 * seed as f64 + 0.1).fract()
}

/// About normal: the sum of twelve scattered numbers.
fn normal(i: usize, seed: usize) -> f64 {
    let hash = |k: usize| {
        let mut x = (i * 1_000_003 + k * 7919 + seed * 104_729 + 17) as u64;
        for _ in 0..3 {
            x ^= x >> 33;
            x = x.wrapping_mul(0xff51_afd7_ed55_8ccd);
        }
        (x >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(hash).sum::<f64>() - 6.0
}

/// Irregular times with gaps and readings that share a time.
fn times(n: usize, seed: usize) -> Vec<f64> {
    let mut t = 3.0;
    (0..n)
        .map(|i| {
            t += match i % 17 {
                5 => 0.0,
                9 => 150.0,
                _ => 0.2 + 1.6 * even(i, seed),
            };
            t
        })
        .collect()
}

fn dense(noise: &Noise, time: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(time.len(), time.len(), |i, k| {
        let apart = (time[i] - time[k]).abs();
        let white = if i == k { noise.white } else { 0.0 };
        let terms = noise.terms.iter().zip(CORRELATION_TIMES);
        white
            + terms
                .map(|(a, length)| a * (-apart / length).exp())
                .sum::<f64>()
    })
}

fn noises() -> [Noise; 4] {
    [
        Noise::of([0.7, 0.2, 0.5, 0.1, 0.9, 2.0]),
        Noise::of([1.3, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Noise::of([0.05, 0.0, 4.0, 0.0, 0.0, 0.3]),
        Noise::of([0.02, 1.0, 0.0, 0.0, 0.0, 30.0]),
    ]
}

fn rows_of(x: &DMatrix<f64>) -> Rows {
    let mut rows = Rows::zeros(x.nrows(), x.ncols());
    for i in 0..x.nrows() {
        for c in 0..x.ncols() {
            rows.row_mut(i)[c] = x[(i, c)];
        }
    }
    rows
}

fn matrix(rows: &Rows) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows.columns(), |i, c| rows.row(i)[c])
}

#[test]
fn whitened_columns_are_those_of_the_dense_factor() {
    for (n, width) in [(1, 3), (2, 1), (150, 9)] {
        let time = times(n, n);
        let x = DMatrix::from_fn(n, width, normal);
        for noise in noises() {
            let found = Cholesky::new(dense(&noise, &time)).unwrap();
            let decays = decays(&time);
            let factor = Factor::new(noise, &decays);
            let log_root = found.l().diagonal().map(f64::ln).sum();
            assert!((factor.log_root - log_root).abs() < SAME * n as f64);
            let mut rows = rows_of(&x);
            factor.whiten(0, &mut rows, &mut State::new(x.ncols()));
            let white = found.l().solve_lower_triangular(&x).unwrap();
            assert!((matrix(&rows) - &white).amax() < SAME * white.amax().max(1.0));
            factor.back(0, &mut rows, &mut State::new(x.ncols()));
            let solved = found.solve(&x);
            assert!((matrix(&rows) - &solved).amax() < SAME * solved.amax().max(1.0));
        }
    }
}

/// Nothing overflows, and what is singular is held at the rounding of the total.
#[test]
fn extreme_noises_stay_finite() {
    let time: Vec<f64> = (0..400)
        .map(|i| 1e6 * f64::from(i % 2) + f64::from(i))
        .scan(0.0, |t, step| {
            *t += step;
            Some(*t)
        })
        .collect();
    let same = vec![5.0; 400];
    for time in [time, same] {
        let decays = decays(&time);
        for scale in [1e-200, 1.0, 1e200] {
            for white in [0.0, 1e-30, 1.0] {
                let noise = Noise {
                    white: scale * white,
                    terms: [scale; TERMS],
                };
                let factor = Factor::new(noise, &decays);
                let mut rows = rows_of(&DMatrix::from_element(400, 2, scale.sqrt()));
                factor.whiten(0, &mut rows, &mut State::new(2));
                assert!(factor.log_root.is_finite());
                assert!(matrix(&rows).iter().all(|x| x.is_finite()));
            }
        }
    }
}

#[derive(Clone)]
struct Case {
    theta: Vec<f64>,
    error: Vec<f64>,
    time: Vec<f64>,
}

/// Runs of different lengths, one of a single reading and one longer than a chunk.
fn cases(lengths: &[usize]) -> Vec<Case> {
    lengths
        .iter()
        .enumerate()
        .map(|(r, &n)| {
            let theta: Vec<f64> = (0..n).map(|i| 6.0 * even(i, r)).collect();
            let wave = |(i, x): (usize, &f64)| {
                5.0 * (x + 0.3).cos() + 2.0 * (3.0 * x).sin() + normal(i, r) + 40.0 * r as f64
            };
            let error = theta.iter().enumerate().map(wave).collect();
            Case {
                theta,
                error,
                time: times(n, r),
            }
        })
        .collect()
}

fn readings(cases: &[Case], orders: &[u32]) -> Readings {
    let run = |case: &Case| Run::new(&case.theta, &case.error, Some(&case.time)).unwrap();
    Readings::new(cases.iter().map(run).collect(), orders.to_vec()).unwrap()
}

fn in_steps(time: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = time.windows(2).map(|p| p[1] - p[0]).collect();
    steps.sort_by(f64::total_cmp);
    let n = steps.len();
    let step = if n == 0 {
        1.0
    } else {
        0.5 * (steps[n / 2] + steps[(n - 1) / 2])
    };
    time.iter().map(|t| t / step).collect()
}

fn harmonics(theta: &[f64], orders: &[u32]) -> DMatrix<f64> {
    DMatrix::from_fn(theta.len(), 2 * orders.len(), |i, c| {
        let angle = f64::from(orders[c / 2]) * theta[i];
        if c % 2 == 0 { angle.cos() } else { angle.sin() }
    })
}

const LENGTHS: [usize; 4] = [90, 1, 300, 40];
const ORDERS: [u32; 4] = [1, 2, 3, 17];

#[test]
fn grams_are_those_of_the_dense_inverse() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    for noise in noises() {
        for (case, gram) in cases.iter().zip(readings.grams(noise)) {
            let n = case.theta.len();
            let covariance = Cholesky::new(dense(&noise, &in_steps(&case.time))).unwrap();
            let x = harmonics(&case.theta, &ORDERS);
            let y = DVector::from_column_slice(&case.error);
            let ones = DVector::from_element(n, 1.0);
            let own = covariance.solve(&ones);
            let information = ones.dot(&own);
            let projected =
                |c: &DMatrix<f64>| covariance.solve(c) - &own * (own.transpose() * c) / information;
            let y = DMatrix::from_column_slice(n, 1, y.as_slice());
            let expected = [
                (&gram.sums.products, x.tr_mul(&projected(&x))),
                (&gram.sums.moments, x.tr_mul(&projected(&y))),
                (&gram.sums.squares, y.tr_mul(&projected(&y))),
            ];
            for (found, wanted) in expected {
                assert!((found - &wanted).amax() <= SAME * (1.0 + wanted.amax()) * 10.0);
            }
            assert!((gram.information / information - 1.0).abs() < SAME);
            let log_root: f64 = covariance.l().diagonal().map(f64::ln).sum();
            let constant = 0.5 * (n as f64 - 1.0) * std::f64::consts::TAU.ln();
            let scale = -log_root - 0.5 * information.ln() - constant;
            assert!((gram.sums.log_scale - scale).abs() < SAME * n as f64);
        }
    }
}

#[test]
fn readings_that_cannot_be_used_are_refused() {
    let new =
        |theta: &[f64], error: &[f64], time: Option<&[f64]>| Run::new(theta, error, time).err();
    assert_eq!(new(&[], &[], None), Some(Error::NoReadings));
    assert!(matches!(
        new(&[1.0], &[1.0, 2.0], None),
        Some(Error::Length { .. })
    ));
    assert!(matches!(
        new(&[f64::NAN], &[1.0], None),
        Some(Error::NotFinite { .. })
    ));
    let time = |time: &[f64]| new(&[1.0; 3], &[1.0; 3], Some(time));
    let wrong = |index, got, previous| {
        Some(Error::Time {
            index,
            got,
            previous,
        })
    };
    assert_eq!(time(&[1.0, 3.0, 2.0]), wrong(2, 2.0, 3.0));
    assert_eq!(time(&[4.0; 3]), wrong(1, 4.0, 4.0));
    assert_eq!(time(&[4.0, 4.0, 5.0]), None);
    assert_eq!(
        Readings::new(Vec::new(), vec![1]).err(),
        Some(Error::NoReadings)
    );
    let run = Run::new(&[1.0], &[2.0], None).unwrap();
    let orders = |orders: &[u32]| Readings::new(vec![run.clone()], orders.to_vec()).err();
    assert!(matches!(orders(&[0]), Some(Error::Orders { .. })));
    assert!(matches!(orders(&[2, 2]), Some(Error::Orders { .. })));
    assert_eq!(orders(&[1, 7]), None);
}

/// All readings in one: their covariance without coefficients that all runs share, and the columns
/// of the zeros.
fn joined(
    cases: &[Case],
    noise: &Noise,
    orders: &[u32],
    omega: &[f64],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = cases.iter().map(|case| case.theta.len()).sum();
    let (mut covariance, mut zeros) = (DMatrix::zeros(n, n), DMatrix::zeros(n, cases.len()));
    let mut start = 0;
    for (r, case) in cases.iter().enumerate() {
        let own = case.theta.len();
        let x = harmonics(&case.theta, orders);
        let each = DVector::from_fn(x.ncols(), |i, _| omega[i / 2]);
        let effects = DMatrix::from_diagonal(&each);
        let part = dense(noise, &in_steps(&case.time)) + &x * effects * x.transpose();
        covariance
            .view_mut((start, start), (own, own))
            .copy_from(&part);
        zeros.view_mut((start, r), (own, 1)).fill(1.0);
        start += own;
    }
    (covariance, zeros)
}

/// Log density of the readings with flat priors of their zeros, and `V^-1 y` without these.
fn density(
    covariance: DMatrix<f64>,
    zeros: &DMatrix<f64>,
    y: &DMatrix<f64>,
) -> (f64, DMatrix<f64>) {
    let found = Cholesky::new(covariance).unwrap();
    let own = found.solve(zeros);
    let inner = Cholesky::new(zeros.tr_mul(&own)).unwrap();
    let solved = found.solve(y) - &own * inner.solve(&own.tr_mul(y));
    let log = |found: &Cholesky<f64, nalgebra::Dyn>| found.l().diagonal().map(f64::ln).sum();
    let free = (y.nrows() - zeros.ncols()) as f64;
    let square = y.column(0).dot(&solved.column(0));
    let constant = free * std::f64::consts::TAU.ln();
    (
        -log(&found) - log(&inner) - 0.5 * (square + constant),
        solved,
    )
}

fn models() -> [Model; 4] {
    let of = |tau: [f64; 4], omega: [f64; 4]| Model {
        widths: vec![2; 4],
        tau: tau.to_vec(),
        omega: omega.to_vec(),
    };
    [
        of([30.0, 0.0, 2.0, 0.0], [0.0; 4]),
        of([30.0, 0.0, 2.0, 0.1], [0.5, 0.0, 0.0, 0.2]),
        // A line bound to time: it differs from run to run, and runs share nothing of it.
        of([50.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0]),
        of([0.0; 4], [0.0; 4]),
    ]
}

/// Errors of all runs, and the columns of all readings.
fn whole(cases: &[Case]) -> (DMatrix<f64>, DMatrix<f64>) {
    let error: Vec<f64> = cases.iter().flat_map(|case| case.error.clone()).collect();
    let theta: Vec<f64> = cases.iter().flat_map(|case| case.theta.clone()).collect();
    let y = DMatrix::from_column_slice(error.len(), 1, &error);
    (y, harmonics(&theta, &ORDERS))
}

#[test]
fn evidence_and_posterior_are_those_of_the_dense_covariance() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    let (y, x) = whole(&cases);
    for noise in noises() {
        let grams = readings.grams(noise);
        for model in models() {
            let (own, zeros) = joined(&cases, &noise, &ORDERS, &model.omega);
            let prior = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| model.tau[i / 2]));
            let all = own + &x * &prior * x.transpose();
            let (wanted, solved) = density(all.clone(), &zeros, &y);
            let found = model.posterior(&grams).unwrap();
            let near = SAME * wanted.abs();
            assert!(
                (found.log_evidence - wanted).abs() < near,
                "{}",
                found.log_evidence - wanted
            );
            let mean = &prior * x.tr_mul(&solved);
            // `T - T X' V^-1 X T`.
            let (_, solved) = density(all, &zeros, &(&x * &prior));
            let covariance = &prior - &prior * x.tr_mul(&solved);
            for (i, &c) in found.columns.iter().enumerate() {
                let apart = found.mean[(i, 0)] - mean[c];
                assert!(apart.abs() < 10.0 * SAME, "{apart:e}");
                for (k, &d) in found.columns.iter().enumerate() {
                    let apart = found.covariance()[(k, i)] - covariance[(d, c)];
                    assert!(apart.abs() < SAME * prior[(c, c)], "{apart:e}");
                }
            }
            let active = model
                .active()
                .iter()
                .map(|&k| model.widths[k])
                .sum::<usize>();
            assert_eq!(found.columns.len(), active);
        }
    }
}

#[test]
fn sums_of_runs_add_up() {
    let readings = readings(&cases(&LENGTHS), &ORDERS);
    let grams = readings.grams(noises()[0]);
    let mut total = grams[0].sums.clone();
    for gram in &grams[1..] {
        total.merge(&gram.sums);
    }
    let all = models()[0].sums(&grams);
    assert!((all.products - total.products).amax() < SAME);
    assert!((all.moments - total.moments).amax() < SAME);
    assert!((all.squares - total.squares).amax() < SAME * 1e2);
    assert!((all.log_scale - total.log_scale).abs() < SAME);
}

/// Gradient by differences of the evidence, information from dense covariances.
#[test]
fn gradient_and_information_are_those_of_the_dense_covariance() {
    let cases = cases(&LENGTHS);
    let readings = readings(&cases, &ORDERS);
    let (y, x) = whole(&cases);
    for noise in [noises()[0], noises()[2]] {
        for model in models() {
            let grams = readings.grams(noise);
            let posterior = model.posterior(&grams).unwrap();
            let found = readings
                .information(noise, &model, &grams, &posterior)
                .unwrap();
            let evidence = |variances: [f64; VARIANCES]| {
                let grams = readings.grams(Noise::of(variances));
                model.posterior(&grams).unwrap().log_evidence
            };
            // Richardson's differences: their error is of the fourth power of the step.
            for j in 0..VARIANCES {
                let moved = |step: f64| {
                    let mut variances = noise.variances();
                    variances[j] *= step.exp();
                    evidence(variances)
                };
                let slope = |step: f64| (moved(step) - moved(-step)) / (2.0 * step);
                let wanted = (4.0 * slope(1e-3) - slope(2e-3)) / 3.0;
                let near = 1e-7 * (1.0 + wanted.abs());
                assert!(
                    (found.gradient[j] - wanted).abs() < near,
                    "{j}: {} {wanted}",
                    found.gradient[j]
                );
            }
            let (own, zeros) = joined(&cases, &noise, &ORDERS, &model.omega);
            let prior = DMatrix::from_diagonal(&DVector::from_fn(8, |i, _| model.tau[i / 2]));
            let all = own + &x * &prior * x.transpose();
            let (_, solved) = density(all.clone(), &zeros, &y);
            let unit = |j: usize| {
                let mut variances = [0.0; VARIANCES];
                variances[j] = noise.variances()[j];
                let (own, _) = joined(&cases, &Noise::of(variances), &ORDERS, &[0.0; 4]);
                own * &solved
            };
            let v = DMatrix::from_columns(
                &(0..VARIANCES)
                    .map(|j| unit(j).column(0).into_owned())
                    .collect::<Vec<_>>(),
            );
            let (_, left) = density(all, &zeros, &v);
            let wanted = 0.5 * v.tr_mul(&left);
            assert!((&found.average - &wanted).amax() < 1e-8 * (1.0 + wanted.amax()));
        }
    }
}

/// Change of the evidence by factorising both models anew.
fn difference(readings: &Readings, noise: Noise, before: &Model, after: &Model) -> f64 {
    let grams = readings.grams(noise);
    let own = |model: &Model| model.posterior(&grams).unwrap().log_evidence;
    own(after) - own(before)
}

#[test]
fn gains_are_those_of_factorising_anew() {
    let readings = readings(&cases(&LENGTHS), &ORDERS);
    let noise = noises()[0];
    let grams = readings.grams(noise);
    let wide = Model {
        widths: vec![3, 1, 4],
        tau: vec![30.0, 2.0, 0.0],
        omega: vec![0.0, 0.4, 0.0],
    };
    for model in models().into_iter().chain([wide]) {
        let solved = Solved::of(model.clone(), &model.sums(&grams)).unwrap();
        let same = |gain: f64, changes: &[(usize, f64)]| {
            let mut after = model.clone();
            for &(k, tau) in changes {
                after.tau[k] = tau;
            }
            let wanted = difference(&readings, noise, &model, &after);
            assert!(
                (gain - wanted).abs() < 1e-8 * (1.0 + wanted.abs()),
                "{gain} {wanted}"
            );
        };
        let active = model.active();
        let out: Vec<usize> = (0..model.tau.len())
            .filter(|k| !active.contains(k))
            .collect();
        for tau in [0.01, 3.0, 1e4] {
            for &j in &out {
                same(solved.outside(j).gain(tau), &[(j, tau)]);
            }
            for &k in &active {
                let without = solved.without(k).unwrap();
                same(-without.loss, &[(k, 0.0)]);
                same(without.own.gain(tau) - without.loss, &[(k, tau)]);
                for &j in &out {
                    same(
                        without.other(j).gain(tau) - without.loss,
                        &[(k, 0.0), (j, tau)],
                    );
                }
            }
        }
    }
}

/// All models of a prior, by enumeration.
fn enumerated(prior: &Prior, groups: usize) -> Vec<Model> {
    let mut choices = vec![(0.0, 0.0)];
    for &tau in &prior.sizes {
        choices.push((tau, 0.0));
        choices.extend(prior.effects.iter().map(|&omega| (tau, omega)));
    }
    let count = choices.len();
    let model = |mut number: usize| {
        let mut model = Model::of_orders(groups, 0.0);
        for k in 0..groups {
            (model.tau[k], model.omega[k]) = choices[number % count];
            number /= count;
        }
        model
    };
    (0..count.pow(u32::try_from(groups).unwrap()))
        .map(model)
        .collect()
}

#[test]
fn the_search_finds_the_best_of_all_models() {
    let effects = Prior {
        probabilities: vec![0.1, 0.2, 0.3, 0.2],
        sizes: vec![0.1, 3.0, 40.0],
        effects: vec![0.3],
    };
    let none = Prior {
        effects: Vec::new(),
        ..effects.clone()
    };
    // Runs that share order 1 and differ in order 3, over a part of a turn.
    let mut cases = cases(&[120, 90, 100, 150]);
    for (r, case) in cases.iter_mut().enumerate() {
        for i in 0..case.theta.len() {
            case.theta[i] *= 0.35;
            let differs = [2.0, -1.5, 0.5, -1.0][r];
            let x = case.theta[i];
            case.error[i] = 4.0 * (x + 0.3).cos() + differs * (3.0 * x).sin() + normal(i, r);
        }
    }
    let readings = readings(&cases, &ORDERS);
    let grams = readings.grams(Noise::of([0.8, 0.2, 0.01, 0.01, 0.01, 0.01]));
    for prior in [effects, none] {
        let score = |model: &Model| {
            model.posterior(&grams).unwrap().log_evidence + prior.log_probability(model)
        };
        let all = enumerated(&prior, 4);
        let total: f64 = all
            .iter()
            .map(|model| prior.log_probability(model).exp())
            .sum();
        assert!((total - 1.0).abs() < SAME);
        let best = all
            .iter()
            .max_by(|a, b| score(a).total_cmp(&score(b)))
            .unwrap();
        let mut search = Search::new(&grams, &prior, 6.0);
        let found = search.from(Model::of_orders(4, 0.0)).unwrap();
        assert_eq!(found.model, *best);
        assert!((found.score - score(best)).abs() < 1e-8);
        assert_eq!(
            best.omega.iter().any(|omega| *omega > 0.0),
            !prior.effects.is_empty()
        );
        let met = search.models();
        assert_eq!(met[0].model, *best);
        assert!(met.len() > 2);
        for own in &met {
            assert!((own.score - score(&own.model)).abs() < 1e-7);
            assert!(own.score > met[0].score - 6.0);
        }
        // Of all sets of groups within the window, the search has met the most probable ones.
        let sets = |models: &mut dyn Iterator<Item = &Model>| -> std::collections::BTreeSet<_> {
            models.map(Model::active).collect()
        };
        let near = |model: &&Model| score(model) > found.score - 3.0;
        let wanted = sets(&mut all.iter().filter(near));
        let got = sets(&mut met.iter().map(|own| &own.model));
        assert!(wanted.is_subset(&got), "{wanted:?} {got:?}");
    }
}

#[test]
fn no_noise_near_the_maximum_has_more_evidence() {
    let readings = readings(&cases(&[150, 260]), &ORDERS);
    let prior = NoisePrior { scale: 1.0 };
    for model in models() {
        let found = readings.noise(&model, prior, prior.centre()).unwrap();
        let value = |position: &[f64; VARIANCES]| {
            let grams = readings.grams(prior.noise(position));
            model.posterior(&grams).unwrap().log_evidence + prior.log_density(position)
        };
        assert!((value(&found.position) - found.value).abs() < 1e-8);
        for (i, point) in found.points().into_iter().enumerate() {
            for part in [0.05, 0.3, 1.0] {
                let at = std::array::from_fn(|j| {
                    found.position[j] + part * (point[j] - found.position[j])
                });
                assert!(value(&at) < found.value + 1e-4, "{i} {part}");
            }
        }
        // From far away it is the same.
        let far = readings.noise(&model, prior, [2.0; VARIANCES]).unwrap();
        assert!((far.value - found.value).abs() < 1e-3);
        let spread = found.precision.clone().cholesky().unwrap().inverse();
        for j in 0..VARIANCES {
            assert!((far.position[j] - found.position[j]).abs() < 0.1 * spread[(j, j)].sqrt());
        }
    }
}

fn scaled(cases: &[Case], factor: f64) -> Vec<Case> {
    let mut out = cases.to_vec();
    for case in &mut out {
        case.error.iter_mut().for_each(|e| *e *= factor);
        case.time.iter_mut().for_each(|t| *t *= factor);
    }
    out
}

#[test]
fn an_estimate_is_the_same_in_any_unit_and_every_time() {
    let cases = cases(&[200, 150]);
    let chance = [0.25; 4];
    let found = readings(&cases, &ORDERS).estimate(&chance).unwrap();
    assert!(found.probabilities[0] > 0.99 && found.probabilities[2] > 0.99);
    assert!(found.probabilities[1] < 0.3 && found.probabilities[3] < 0.3);
    for (c, wanted) in [5.0 * 0.3_f64.cos(), -5.0 * 0.3_f64.sin()]
        .into_iter()
        .enumerate()
    {
        let near = 4.0 * found.covariance[(c, c)].sqrt();
        assert!(near < 0.8 && (found.mean[c] - wanted).abs() < near);
    }
    let total: f64 = found.models.iter().map(|(weight, _)| weight).sum();
    assert!((total - 1.0).abs() < SAME);
    let again = readings(&cases, &ORDERS).estimate(&chance).unwrap();
    assert_eq!(again.mean, found.mean);
    assert_eq!(again.covariance, found.covariance);
    // By a power of two, no rounding differs; logarithms do.
    for factor in [2.0_f64.powi(-40), 2.0_f64.powi(60)] {
        let other = readings(&scaled(&cases, factor), &ORDERS)
            .estimate(&chance)
            .unwrap();
        assert!((other.mean / factor - &found.mean).amax() < 1e-5);
        assert!((other.covariance / (factor * factor) - &found.covariance).amax() < 1e-5);
    }
}

#[test]
fn readings_that_tell_nothing_leave_the_prior() {
    let still = Run::new(&[0.1, 0.2, 0.3], &[7.0; 3], None).unwrap();
    let single = Run::new(&[0.4], &[3.0], Some(&[9.0])).unwrap();
    for runs in [
        vec![still.clone(), single.clone()],
        vec![single.clone(), single],
        vec![still],
    ] {
        let found = Readings::new(runs, vec![1, 2])
            .unwrap()
            .estimate(&[0.1, 0.6])
            .unwrap();
        assert!(found.mean.amax() < 1e-90);
        assert!(found.probabilities.iter().all(|p| (0.0..=1.0).contains(p)));
        assert!(found.covariance.iter().all(|c| c.is_finite()));
    }
    // Without orders there is the noise alone.
    let readings = readings(&cases(&[60, 50]), &[]);
    assert_eq!(readings.estimate(&[]).unwrap().models.len(), 1);
}

/// The error is a sum of orders to the last digit: they are found, and the noise is next to nothing.
#[test]
fn readings_without_noise() {
    let mut cases = cases(&[80, 70]);
    for case in &mut cases {
        for (error, x) in case.error.iter_mut().zip(&case.theta) {
            *error = 3.0 * x.cos() + (2.0 * x).sin();
        }
    }
    let found = readings(&cases, &ORDERS).estimate(&[0.25; 4]).unwrap();
    let wanted = [3.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    let apart = found.mean - DVector::from_column_slice(&wanted);
    assert!(apart.amax() < 1e-5);
    assert!(found.noise.total() < 1e-9);
}

#[test]
fn an_estimate_can_be_called_off() {
    let readings = readings(&cases(&[60_000, 50_000]), &ORDERS);
    let start = std::time::Instant::now();
    let done = trueangle::interrupt::within(|| true, || readings.estimate(&[0.25; 4]).is_some());
    assert_eq!(done, Err(trueangle::interrupt::Interrupted));
    assert!(start.elapsed().as_secs_f64() < 2.0);
}
