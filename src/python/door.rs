//! The one way of samples into the core and of results out of it.
//!
//! Floats come out as floats, arrays as arrays, labelled data with their labels, whatever
//! computes: a series alone or with its terms.

use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyFloat;

use super::angles::Angles;
use super::array::{Kind, data, numpy_module};
use super::failure::argument_error;
use super::number::{is_number, value_of};
use super::release::{attached, detached};
use crate::error::Error;
use crate::kernel::{Batch, Real, Route, Sample, Stretch};

/// Samples from which the interpreter is released: below, that costs more than it frees.
const RELEASED: usize = 1024;

/// What is computed sample by sample; returns how many results lie outside a stretch.
pub trait Computation: Send {
    /// Results of a batch in its place.
    fn run<X: Sample, Y: Real>(&mut self, batch: Batch<'_, X, Y>) -> Result<usize, Error>;

    /// What must be there before the work starts.
    fn prepare(&self) -> Result<(), Error>;

    /// True when few samples take little time.
    fn is_ready(&self) -> bool;
}

/// What was computed, and how many results lie outside a stretch.
pub type Computed<'py> = (Bound<'py, PyAny>, usize);

/// A number through the core.
pub fn number<'py>(x: &Bound<'py, PyAny>, work: &mut impl Computation) -> PyResult<Computed<'py>> {
    let py = x.py();
    let mut sample = [value_of(x, "angles")?];
    let outside = carry_out(py, work, Batch::in_place(&mut sample))?;
    Ok((PyFloat::new(py, sample[0]).into_any(), outside))
}

/// Anything through the core: numbers, arrays and what numpy makes arrays of.
pub fn anything<'py>(
    x: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
    work: &mut impl Computation,
) -> PyResult<Computed<'py>> {
    if out.is_none() && is_number(x) {
        return number(x, work);
    }
    array(&Angles::new(x)?, out, &[], work)
}

/// An array through the core; `beside` it are others that are read meanwhile.
pub fn array<'py>(
    angles: &Angles<'py>,
    out: Option<&Bound<'py, PyAny>>,
    beside: &[&Bound<'py, PyUntypedArray>],
    work: &mut impl Computation,
) -> PyResult<Computed<'py>> {
    let py = angles.plain.py();
    let (target, copy_to) = angles.output(out, beside)?;
    let outside = match angles.kind {
        Kind::F64 => fill::<f64, f64>(work, &angles.plain, &target),
        Kind::F32 => fill::<f32, f32>(work, &angles.plain, &target),
        Kind::I8 => fill::<i8, f64>(work, &angles.plain, &target),
        Kind::I16 => fill::<i16, f64>(work, &angles.plain, &target),
        Kind::I32 => fill::<i32, f64>(work, &angles.plain, &target),
        Kind::I64 => fill::<i64, f64>(work, &angles.plain, &target),
        Kind::U8 => fill::<u8, f64>(work, &angles.plain, &target),
        Kind::U16 => fill::<u16, f64>(work, &angles.plain, &target),
        Kind::U32 => fill::<u32, f64>(work, &angles.plain, &target),
        Kind::U64 => fill::<u64, f64>(work, &angles.plain, &target),
    }?;
    if let Some(destination) = copy_to {
        numpy_module(py)?.call_method1(intern!(py, "copyto"), (&destination, &target))?;
        return Ok((destination.into_any(), outside));
    }
    let result = match (out, &angles.labels) {
        (None, Some(labels)) => labels.call1((&target,))?,
        // As numpy's own functions: a scalar for an array without dimensions.
        (None, None) if target.ndim() == 0 => target.get_item(())?,
        _ => target.into_any(),
    };
    Ok((result, outside))
}

/// Results of the plain array `x` to the plain array `out` of the same shape and order.
fn fill<X: Sample + Element, Y: Real + Element>(
    work: &mut impl Computation,
    x: &Bound<'_, PyUntypedArray>,
    out: &Bound<'_, PyUntypedArray>,
) -> PyResult<usize> {
    // SAFETY: both are aligned, contiguous, of these types and equally long, and are
    // either the same memory or apart (`Angles`). As everywhere in numpy, a caller
    // who changes an array in another thread meanwhile gets undefined values.
    let batch = unsafe { Batch::from_raw(data::<X>(x), data::<Y>(out), x.len()) };
    carry_out(x.py(), work, batch)
}

fn carry_out<X: Sample, Y: Real>(
    py: Python<'_>,
    work: &mut impl Computation,
    batch: Batch<'_, X, Y>,
) -> PyResult<usize> {
    let ready = work.is_ready();
    if !ready {
        work.prepare()?;
    }
    Ok(if ready && batch.len() < RELEASED {
        attached(py, || work.run(batch))?
    } else {
        detached(py, || work.run(batch))?
    }?)
}

/// The route of a name.
pub fn route(py: Python<'_>, path: Option<&str>) -> PyResult<Option<Route>> {
    let parse = |name: &str| {
        name.parse().map_err(|()| {
            argument_error(
                py,
                format!(
                    "path must be 'table', 'cubics', 'exact', 'direct' or 'counts', with \
                     '-portable', '-avx2' or '-avx512' to force an instruction set, got {name:?}"
                ),
            )
        })
    };
    path.map(parse).transpose()
}

/// A stretch given as its ends and whether turns look the same.
pub fn stretch(period: f64, ends: Option<(f64, f64, bool)>) -> Option<Stretch> {
    ends.map(|(start, stop, repeats)| Stretch::new(start, stop, period, repeats))
}
