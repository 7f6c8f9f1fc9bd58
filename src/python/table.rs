//! `_core.table_correction`: tables in the arithmetic of the firmware that evaluates them.

use numpy::{PyArray1, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::failure::argument_error;
use crate::table;

/// Knots as they stand in the table; a cubic's are pairs of value and slope.
#[derive(FromPyObject)]
enum Knots<'py> {
    Short(PyReadonlyArray1<'py, i16>),
    Long(PyReadonlyArray1<'py, i32>),
    Single(PyReadonlyArray1<'py, f32>),
}

/// Corrections of ``angles`` (2^-32 turns): int32 in that unit, or float32 radians.
#[pyfunction]
pub fn table_correction<'py>(
    py: Python<'py>,
    method: &str,
    knots: &Bound<'py, PyAny>,
    bits: u32,
    shift: u32,
    angles: PyReadonlyArray1<'py, u32>,
) -> PyResult<Bound<'py, PyAny>> {
    let cubic = match method {
        "linear" => false,
        "cubic" => true,
        other => return Err(argument_error(py, format!("no method {other:?} of tables"))),
    };
    let knots: Knots<'py> = knots.extract()?;
    let length = match &knots {
        Knots::Short(values) => values.len(),
        Knots::Long(values) => values.len(),
        Knots::Single(values) => values.len(),
    };
    let wanted = ((1 << bits.min(16)) + 1) << usize::from(cubic);
    if !(1..=16).contains(&bits) || shift > 15 || length != wanted {
        let message = format!(
            "a table of 2^{bits} segments needs {wanted} numbers, 1 to 16 bits and a shift of at \
             most 15, got {length} numbers and a shift of {shift}"
        );
        return Err(argument_error(py, message));
    }
    let angles = angles.as_slice()?;
    Ok(match knots {
        Knots::Short(values) => {
            let flat = values.as_slice()?;
            let pairs = flat.as_chunks::<2>().0;
            each(py, angles, |a| match cubic {
                true => table::cubic_i16(pairs, bits, shift, a),
                false => table::linear_i16(flat, bits, shift, a),
            })
        }
        Knots::Long(values) => {
            let flat = values.as_slice()?;
            let pairs = flat.as_chunks::<2>().0;
            each(py, angles, |a| match cubic {
                true => table::cubic_i32(pairs, bits, a),
                false => table::linear_i32(flat, bits, a),
            })
        }
        Knots::Single(values) => {
            let flat = values.as_slice()?;
            let pairs = flat.as_chunks::<2>().0;
            each(py, angles, |a| match cubic {
                true => table::cubic_f32(pairs, bits, a),
                false => table::linear_f32(flat, bits, a),
            })
        }
    })
}

fn each<'py, T: numpy::Element + Send>(
    py: Python<'py>,
    angles: &[u32],
    value: impl Fn(u32) -> T + Send + Sync,
) -> Bound<'py, PyAny> {
    let values: Vec<T> = py.detach(|| angles.iter().map(|&a| value(a)).collect());
    PyArray1::from_vec(py, values).into_any()
}

/// Source of the functions of a method, to be carried along by an exported Rust program.
#[pyfunction]
pub fn table_source(method: &str) -> &'static str {
    match method {
        "cubic" => table::source::CUBIC,
        _ => table::source::LINEAR,
    }
}
