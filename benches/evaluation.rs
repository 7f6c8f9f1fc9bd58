//! Evaluation of the core alone: `cargo bench --bench evaluation`.

#![allow(missing_docs)]

use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use trueangle::compensator::Compensator;
use trueangle::kernel::{Argument, Batch, Evaluator, Quantity};
use trueangle::{HarmonicSeries, Shaft};

fn evaluator(orders: &[u32]) -> Evaluator {
    let amplitude = 1e-3 / f64::from(orders.iter().sum::<u32>());
    let shaft = Shaft {
        cycles: 1.0,
        orders: orders.to_vec(),
        cosine: orders
            .iter()
            .map(|&k| amplitude * f64::from(k).cos())
            .collect(),
        sine: orders
            .iter()
            .map(|&k| amplitude * f64::from(k).sin())
            .collect(),
    };
    let series = HarmonicSeries::new(TAU, 0.0, vec![shaft]).expect("finite");
    Evaluator::new(series, Argument::Reference)
}

/// Angles that fill the circle evenly but in no order.
fn angles(len: usize) -> Vec<f64> {
    let golden = 0.618_033_988_749_894_9;
    (0..len)
        .map(|i| TAU * (golden * i as f64).fract())
        .collect()
}

fn batches(criterion: &mut Criterion) {
    let dense: Vec<u32> = (1..=17).collect();
    let many: Vec<u32> = (1..=512).collect();
    let x = angles(100_000 - 1);
    let mut out = vec![0.0; x.len()];
    for (name, orders) in [
        ("17 orders", &dense[..]),
        ("sparse orders", &[1, 2, 100, 200, 202, 400]),
        ("512 orders", &many),
    ] {
        let evaluator = evaluator(orders);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(x.len() as u64));
        for path in [
            "table",
            "table-avx2",
            "table-portable",
            "exact",
            "exact-portable",
        ] {
            let route = path.parse().expect("a path");
            let mut run = |quantity| {
                let batch = Batch::apart(&x, &mut out).expect("equally long");
                evaluator.run(quantity, Some(route), Some(1), batch)
            };
            if run(Quantity::Error).is_err() {
                continue; // not on this processor
            }
            group.bench_function(path, |b| b.iter(|| run(black_box(Quantity::Error))));
        }
        group.finish();
    }
}

fn tables(criterion: &mut Criterion) {
    let many: Vec<u32> = (1..=512).collect();
    for (name, orders) in [("17 orders", &many[..17]), ("512 orders", &many)] {
        for quantity in [Quantity::Error, Quantity::Correction] {
            criterion.bench_function(&format!("table of {quantity:?}, {name}"), |b| {
                b.iter_with_setup(|| evaluator(orders), |e| e.table(quantity).is_some());
            });
        }
    }
}

fn single(criterion: &mut Criterion) {
    let orders: Vec<u32> = (1..=17).collect();
    let compensator = Compensator::new(Arc::new(evaluator(&orders))).expect("not steep");
    criterion.bench_function("step", |b| b.iter(|| compensator.step(black_box(0.7))));
}

criterion_group!(evaluation, batches, tables, single);
criterion_main!(evaluation);
