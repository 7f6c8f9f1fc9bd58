//! Fits of the core alone: `cargo bench --bench fit`.

#![allow(missing_docs)]

use std::f64::consts::{PI, TAU};
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use trueangle::design::{Design, Frequencies};
use trueangle::fit::{Method, Options, Run, fit};

/// Angles that fill an arc evenly but in no order, and an error with noise.
fn readings(len: usize, arc: f64) -> (Vec<f64>, Vec<f64>) {
    let golden = 0.618_033_988_749_894_9;
    let reference: Vec<f64> = (0..len)
        .map(|i| arc * (golden * i as f64).fract())
        .collect();
    let error = |(i, x): (usize, &f64)| x + 1e-3 * (3.0 * x).cos() + 1e-5 * (i as f64).sin();
    let indicated = reference.iter().enumerate().map(error).collect();
    (reference, indicated)
}

fn fits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fit");
    group.sample_size(10);
    for (name, len, orders, arc, method) in [
        ("37 readings", 37, 5, TAU, None),
        ("plain", 10_000, 17, TAU, Some(Method::Plain)),
        ("moments", 1_000_000, 17, TAU, None),
        ("moments, 512 orders", 1_000_000, 512, TAU, None),
        ("half a turn", 1_000_000, 8, PI, None),
    ] {
        let (reference, indicated) = readings(len, arc);
        let shaft = Frequencies {
            cycles: 1.0,
            orders: (1..=orders).collect(),
        };
        let design = Design::new(TAU, vec![shaft]).expect("orders are in order");
        group.throughput(Throughput::Elements(len as u64));
        for threads in [1, 2] {
            if threads > 1 && len < 1_000_000 {
                continue;
            }
            let id = BenchmarkId::new(name, format!("{threads}t"));
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    let run = Run {
                        reference: &reference,
                        indicated: &indicated,
                        weights: None,
                    };
                    let options = Options {
                        method,
                        threads,
                        ..Options::default()
                    };
                    fit(black_box(&design), &[run], options)
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, fits);
criterion_main!(benches);
