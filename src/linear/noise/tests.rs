use super::*;

const BOUNDS: [(usize, usize); 3] = [(0, 9), (9, 11), (11, 24)];
const N: usize = 24;

fn wave(i: usize, k: usize) -> f64 {
    ((3 * i * i + 5 * i * (k + 1)) as f64).sin()
}

fn noise(rho: f64, weighted: bool, ratios: [f64; 2]) -> (Noise, DMatrix<f64>) {
    let roots = weighted.then(|| (0..N).map(|i| 1.0 + 0.05 * i as f64).collect::<Vec<_>>());
    let shapes: Vec<f64> = (0..3 * N).map(|at| wave(at % N, at / N)).collect();
    let effects = [
        RunEffect {
            shapes: &shapes[..N],
            ratio: ratios[0],
        },
        RunEffect {
            shapes: &shapes[N..],
            ratio: ratios[1],
        },
    ];
    let made = Noise::new(BOUNDS.to_vec(), rho, roots.clone(), &effects).unwrap();
    let run = |i: usize| BOUNDS.iter().position(|&(_, stop)| i < stop);
    let covariance = DMatrix::from_fn(N, N, |i, j| {
        if run(i) != run(j) {
            return 0.0;
        }
        let root = |i: usize| roots.as_ref().map_or(1.0, |roots| roots[i]);
        let own = rho.powi(i32::try_from(i.abs_diff(j)).unwrap()) / (1.0 - rho * rho);
        let drawn = (0..3).map(|k| {
            let ratio = ratios[usize::from(k > 0)];
            ratio * shapes[k * N + i] * shapes[k * N + j]
        });
        own / (root(i) * root(j)) + drawn.sum::<f64>()
    });
    (made, covariance)
}

#[test]
fn the_map_makes_the_covariance_the_unit_matrix() {
    for (rho, weighted) in [(0.0, false), (0.6, false), (0.3, true)] {
        let (noise, covariance) = noise(rho, weighted, [0.4, 7.0]);
        let unit = DMatrix::<f64>::identity(N, N);
        let map = DMatrix::from_vec(N, N, noise.map(unit.as_slice()));
        let white = &map * &covariance * map.transpose();
        assert!((white - &unit).amax() < 1e-10);
        assert!(noise.map(&[]).is_empty());
        let back = DMatrix::from_vec(N, N, noise.map_back(unit.as_slice()));
        assert!((back - map.transpose()).amax() < 1e-13);
        let expected = covariance.determinant().ln();
        assert!((noise.log_determinant() - expected).abs() < 1e-9);
        // Products without the map, less what the effects take.
        let (w, c) = noise.taken();
        let width = c.len() / BOUNDS.len();
        let mut gram = noise.correlated_gram();
        for (run, &(start, stop)) in BOUNDS.iter().enumerate() {
            for k in 0..width {
                for (i, j) in (start..stop).flat_map(|i| (start..stop).map(move |j| (i, j))) {
                    gram[(i, j)] -= w[k * N + i] * c[run * width + k] * w[k * N + j];
                }
            }
        }
        assert!((gram - map.tr_mul(&map)).amax() < 1e-12);
    }
}

impl Noise {
    /// `F'F` of the filter alone.
    fn correlated_gram(&self) -> DMatrix<f64> {
        let unit = DMatrix::<f64>::identity(N, N);
        let filter = DMatrix::from_vec(N, N, self.filtered(unit.as_slice()));
        filter.tr_mul(&filter)
    }
}

/// `Z S Z' V^-1 y` of white noise beside, of all effects or some.
#[test]
fn what_runs_draw_is_guessed_best() {
    let (noise, covariance) = noise(0.0, false, [0.4, 7.0]);
    let y = DVector::from_fn(N, |i, _| wave(i, 7));
    let weighed = covariance.lu().solve(&y).unwrap();
    for factors in [None, Some([1.0, 0.0, 0.0]), Some([0.0, 1.0, 1.0])] {
        let found = noise.run_part(y.as_slice(), factors.as_ref().map(|f| &f[..]));
        for &(start, stop) in &BOUNDS {
            for (i, found) in found.iter().enumerate().take(stop).skip(start) {
                let shape = |k: usize, i: usize| noise.shapes[k * N + i];
                let part = |k: usize| {
                    let along: f64 = (start..stop).map(|j| shape(k, j) * weighed[j]).sum();
                    factors.map_or(1.0, |f| f[k]) * shape(k, i) * along
                };
                let expected: f64 = (0..3).map(part).sum();
                assert!((found - expected).abs() < 1e-10);
            }
        }
    }
}

/// Two columns that are one: their sum is known, their difference is as before.
#[test]
fn powers_beside_which_the_unit_is_lost() {
    for power in [2.0_f64.powi(10), 2.0_f64.powi(60)] {
        let share = power / (1.0 + 2.0 * power);
        let found = inverse_beside_one(DMatrix::from_element(2, 2, power));
        let expected = DMatrix::identity(2, 2) - DMatrix::from_element(2, 2, share);
        assert!((found - expected).amax() < 1e-9);
    }
}

#[test]
fn an_effect_far_larger_than_the_noise_and_than_another_takes_all() {
    let ramp = |i: usize| i as f64 / 11.5 - 1.0;
    let shapes: Vec<f64> = (0..2 * N)
        .map(|at| if at < N { 1.0 } else { 1e8 * ramp(at - N) })
        .collect();
    let effects = [RunEffect {
        shapes: &shapes,
        ratio: 1e4,
    }];
    let noise = Noise::new(BOUNDS.to_vec(), 0.0, None, &effects).unwrap();
    let y: Vec<f64> = (0..N).map(|i| 3.0 + 2.0 * ramp(i)).collect();
    for (part, y) in noise.run_part(&y, None).iter().zip(&y) {
        assert!((part - y).abs() < 1e-3);
    }
}

#[test]
fn shapes_that_are_no_numbers_are_no_noise() {
    let shapes = [1.0, f64::NAN, 2.0];
    let effects = [RunEffect {
        shapes: &shapes,
        ratio: 1.0,
    }];
    assert!(Noise::new(vec![(0, 3)], 0.0, None, &effects).is_none());
}
