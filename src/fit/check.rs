//! What must hold of readings before they are fitted.

use super::Run;
use crate::design::Design;
use crate::error::Error;

/// Lengths, finite numbers, weights, and that every run has a reading that counts.
pub fn check(design: &Design, runs: &[Run], ridge: Option<&[f64]>) -> Result<(), Error> {
    if let Some(ridge) = ridge {
        same_length("ridge", ridge.len(), "coefficients", design.columns())?;
        not_negative("ridge", ridge)?;
    }
    for run in runs {
        let wanted = run.reference.len();
        same_length("indicated", run.indicated.len(), "reference", wanted)?;
        finite("reference", run.reference)?;
        finite("indicated", run.indicated)?;
        if let Some(weights) = run.weights {
            same_length("weights", weights.len(), "reference", wanted)?;
            not_negative("weights", weights)?;
        }
    }
    let empty = runs.iter().position(|run| run.count() == 0);
    if runs.is_empty() || empty.is_some() {
        return Err(Error::Rank {
            rank: 0,
            unknowns: runs.len() + design.columns(),
            orders: design.harmonics().collect(),
            reason: match empty {
                Some(run) => format!("run {run} has no reading of positive weight; leave it out"),
                None => "there are no runs".into(),
            },
        });
    }
    Ok(())
}

fn same_length(
    what: &'static str,
    got: usize,
    other: &'static str,
    wanted: usize,
) -> Result<(), Error> {
    if got == wanted {
        return Ok(());
    }
    Err(Error::Length {
        what,
        got,
        other,
        wanted,
    })
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Error::NotFinite {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}

fn not_negative(what: &'static str, values: &[f64]) -> Result<(), Error> {
    let bad = |v: &f64| !(v.is_finite() && *v >= 0.0);
    match values.iter().position(bad) {
        Some(index) => Err(Error::Weight {
            what,
            index,
            got: values[index],
        }),
        None => Ok(()),
    }
}
