//! What must hold of readings before they are fitted.

use crate::check::{finite, not_negative, same_length};
use crate::design::Design;
use crate::error::Error;
use crate::readings::{Argument, Run};

/// Lengths, weights, and that every run has a reading that counts.
pub fn shapes(design: &Design, runs: &[Run], ridge: Option<&[f64]>) -> Result<(), Error> {
    if let Some(ridge) = ridge {
        penalties(design, ridge)?;
    }
    runs.iter().try_for_each(lengths)?;
    let weights = |run: &Run| run.weights.map_or(Ok(()), |w| not_negative("weights", w));
    runs.iter().try_for_each(weights)?;
    let counts = |run: &Run| run.readings(Argument::Reference).count();
    have_readings(design, runs.iter().map(counts))
}

/// That there is one penalty for each coefficient, and none is negative.
pub fn penalties(design: &Design, ridge: &[f64]) -> Result<(), Error> {
    same_length("ridge", ridge.len(), "coefficients", design.columns())?;
    not_negative("ridge", ridge)
}

/// That the columns of a run are equally long.
pub fn lengths(run: &Run) -> Result<(), Error> {
    let wanted = run.reference.len();
    same_length("indicated", run.indicated.len(), "reference", wanted)?;
    run.weights.map_or(Ok(()), |weights| {
        same_length("weights", weights.len(), "reference", wanted)
    })
}

/// That there are runs, and none without a reading that counts.
pub fn have_readings(
    design: &Design,
    mut counts: impl ExactSizeIterator<Item = usize>,
) -> Result<(), Error> {
    let runs = counts.len();
    let reason = match counts.position(|count| count == 0) {
        Some(run) => format!("run {run} has no reading of positive weight; leave it out"),
        None if runs == 0 => "there are no runs".into(),
        None => return Ok(()),
    };
    Err(Error::Rank {
        rank: 0,
        unknowns: runs + design.columns(),
        orders: design.harmonics().collect(),
        reason,
    })
}

/// That every angle is a finite number.
pub fn angles(runs: &[Run]) -> Result<(), Error> {
    for run in runs {
        finite("reference", run.reference)?;
        finite("indicated", run.indicated)?;
    }
    Ok(())
}
