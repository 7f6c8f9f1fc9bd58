//! Gains, search, noise and estimate against models factorised anew.

use nalgebra::DVector;
use trueangle::Error;
use trueangle::evidence::{
    Model, Noise, NoisePrior, Prior, Readings, Run, Search, Solved, VARIANCES,
};

use crate::cases::*;

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
        Readings::new(Vec::new(), vec![1.0]).err(),
        Some(Error::NoReadings)
    );
    let run = Run::new(&[1.0], &[2.0], None).unwrap();
    let orders = |orders: &[f64]| Readings::new(vec![run.clone()], orders.to_vec()).err();
    assert!(matches!(orders(&[0.0]), Some(Error::OrderValue { .. })));
    assert!(matches!(
        orders(&[2.0, 2.0]),
        Some(Error::OrderValue { .. })
    ));
    assert_eq!(orders(&[0.5, 7.0]), None);
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
    choices.extend(prior.effects.iter().map(|&omega| (0.0, omega)));
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

/// From wherever it is sought: the evidence of few readings may have two maxima.
#[test]
fn no_noise_near_the_maximum_has_more_evidence() {
    let readings = readings(&cases(&[150, 260]), &ORDERS);
    let prior = NoisePrior {
        scale: 1.0,
        least: 0.0,
    };
    let starts = [prior.centre(), prior.start(), [2.0; VARIANCES]];
    for (model, start) in models().iter().flat_map(|m| starts.map(|start| (m, start))) {
        let found = readings.noise(model, prior, start).unwrap();
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
        let found = Readings::new(runs, vec![1.0, 2.0])
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
    assert_eq!(found.places, [0, 1]);
    let wanted = [3.0, 0.0, 0.0, 1.0];
    let apart = found.mean - DVector::from_column_slice(&wanted);
    assert!(apart.amax() < 1e-5);
    assert!(found.noise.total() < 1e-9);
}

/// Over part of a turn many columns are nearly one: the sums hold their differences to rounding alone.
#[test]
fn readings_without_noise_over_arcs() {
    let orders: Vec<f64> = (1..30).map(f64::from).collect();
    for (count, arcs) in [
        (90, vec![(0.0, 0.5), (0.5, 0.5)]),
        (250, vec![(0.1, 0.7), (0.3, 0.7), (0.8, 0.2)]),
    ] {
        let run = |&(from, width): &(f64, f64)| {
            let turn = |i| std::f64::consts::TAU * (from + width * i as f64 / count as f64);
            let theta: Vec<f64> = (0..count).map(turn).collect();
            let error: Vec<f64> = theta.iter().map(|x| (2.0 * x + 0.3).cos() + from).collect();
            Run::new(&theta, &error, None).unwrap()
        };
        let readings = Readings::new(arcs.iter().map(run).collect(), orders.clone()).unwrap();
        let found = readings.estimate(&[0.1; 29]).unwrap();
        assert!(found.probabilities[1] > 0.99, "{:?}", found.probabilities);
        let at = 2 * found.places.iter().position(|&k| k == 1).unwrap();
        assert!(
            (found.mean[at] - 0.3_f64.cos()).abs() < 1e-4,
            "{}",
            found.mean[at]
        );
    }
}

#[test]
fn an_estimate_can_be_called_off() {
    let readings = readings(&cases(&[60_000, 50_000]), &ORDERS);
    let start = std::time::Instant::now();
    let done = trueangle::interrupt::within(|| true, || readings.estimate(&[0.25; 4]).is_some());
    assert_eq!(done, Err(trueangle::interrupt::Interrupted));
    assert!(start.elapsed().as_secs_f64() < 2.0);
}
