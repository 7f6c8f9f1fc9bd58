//! Runs one kernel over so many samples: what `benches/callgrind.py` counts.
//!
//! Without arguments it lists the cases.

use std::f64::consts::TAU;
use std::sync::Arc;

use trueangle::compensator::Compensator;
use trueangle::kernel::{Argument, Batch, Evaluator, Quantity, Real, Sample};
use trueangle::{HarmonicSeries, Shaft};

/// Instruction sets that callgrind can emulate.
const CASES: [&str; 8] = [
    "table-avx2",
    "table-portable",
    "cubics-avx2",
    "cubics-portable",
    "exact-avx2",
    "exact-portable",
    "counts",
    "step",
];

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(case) = arguments.next() else {
        println!("{}", CASES.join("\n"));
        return;
    };
    let samples = arguments.next().and_then(|text| text.parse().ok());
    let samples: u32 = samples.expect("usage: kernels CASE SAMPLES");
    let evaluator = Arc::new(evaluator(if case == "counts" { 4096.0 } else { TAU }));
    let mut out = vec![0.0; samples as usize];
    match case.as_str() {
        "step" => {
            let compensator = Compensator::new(evaluator).expect("not steep");
            for (i, out) in (0..).zip(&mut out) {
                *out = compensator.step(f64::from(i) * 0.01);
            }
        }
        "counts" => {
            let x: Vec<u32> = (0..samples).collect();
            run(
                &evaluator,
                &case,
                Batch::apart(&x, &mut out).expect("equally long"),
            );
        }
        "cubics-avx2" | "cubics-portable" => {
            let mut singles: Vec<f32> = (0..samples).map(|i| i as f32 * 0.01).collect();
            run(&evaluator, &case, Batch::in_place(&mut singles));
            assert!(singles.iter().all(|v| v.is_finite()));
        }
        _ => {
            for (i, out) in (0..).zip(&mut out) {
                *out = f64::from(i) * 0.01;
            }
            run(&evaluator, &case, Batch::in_place(&mut out));
        }
    }
    assert!(out.iter().all(|v| v.is_finite()));
}

fn run<X: Sample, Y: Real>(evaluator: &Evaluator, case: &str, batch: Batch<'_, X, Y>) {
    let route = case.parse().expect("one of the cases");
    evaluator
        .run(Quantity::Error, Some(route), Some(1), batch)
        .expect("this processor has the instruction set");
}

fn evaluator(period: f64) -> Evaluator {
    let orders: Vec<u32> = (1..=17).collect();
    let shaft = Shaft {
        cycles: 1.0,
        cosine: orders.iter().map(|&k| 1e-5 * f64::from(k).cos()).collect(),
        sine: orders.iter().map(|&k| 1e-5 * f64::from(k).sin()).collect(),
        orders,
    };
    let series = HarmonicSeries::new(period, 0.0, vec![shaft]).expect("finite");
    Evaluator::new(series, Argument::Reference)
}
