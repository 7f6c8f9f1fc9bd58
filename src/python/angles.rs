//! Arguments that are angles: floats, integers, sequences and arrays of every layout.
//!
//! An array that is aligned, contiguous and in native byte order is used where it is.
//! Any other is copied into one that is, and a result that has to go into such an array
//! is copied there by numpy.

use numpy::npyffi::npy_intp;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

use super::array::{Kind, as_array, data, empty, numpy_module, shown};
use super::failure::{argument_error, kind_error};

/// Angles as an array of a known kind, aligned, in native order, C- or F-contiguous.
pub struct Angles<'py> {
    /// The array the caller gave.
    pub given: Bound<'py, PyUntypedArray>,
    /// The array to read: the same, or a plain copy.
    pub plain: Bound<'py, PyUntypedArray>,
    pub kind: Kind,
    /// What puts the labels of the caller's data on results.
    pub labels: Option<Bound<'py, PyAny>>,
}

impl<'py> Angles<'py> {
    /// Accepts whatever numpy makes an array of real numbers from.
    pub fn new(value: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = value.cast_exact::<PyUntypedArray>() {
            return Self::of_array(array.clone(), None, false);
        }
        let (array, labels) = as_array(value, "angles")?;
        Self::of_array(array, labels, false)
    }

    /// Angles of an array; `in_order` where elements are to be read as numpy counts them
    /// (C order).
    pub fn of_array(
        given: Bound<'py, PyUntypedArray>,
        labels: Option<Bound<'py, PyAny>>,
        in_order: bool,
    ) -> PyResult<Self> {
        let dtype = given.dtype();
        let kind = match Kind::of(&dtype) {
            Some(kind) => kind,
            None if dtype.kind() == b'f' && dtype.itemsize() < 4 => Kind::F32,
            None if dtype.kind() == b'f' => Kind::F64,
            None => {
                return Err(kind_error(
                    given.py(),
                    format!("angles must be real numbers, got an array of dtype {dtype}"),
                ));
            }
        };
        let usable = is_plain(&given) && (!in_order || given.is_c_contiguous());
        let plain = if usable && Kind::of(&dtype).is_some() {
            given.clone()
        } else {
            plain_copy(&given, kind)?
        };
        Ok(Self {
            given,
            plain,
            kind,
            labels,
        })
    }

    /// The array to write results to and, where that is not the caller's own, the
    /// caller's array to copy it to afterwards. Nothing is written to what is read `beside`.
    pub fn output(
        &self,
        out: Option<&Bound<'py, PyAny>>,
        beside: &[&Bound<'py, PyUntypedArray>],
    ) -> PyResult<(
        Bound<'py, PyUntypedArray>,
        Option<Bound<'py, PyUntypedArray>>,
    )> {
        let Some(out) = out else {
            return Ok((self.fresh_output()?, None));
        };
        let out = self.check_output(out)?;
        let (low, high) = extent(&out);
        let apart = |other: &&Bound<'py, PyUntypedArray>| {
            let (other_low, other_high) = extent(other);
            other_high <= low || high <= other_low
        };
        if is_plain(&out) && same_order(&self.plain, &out) && beside.iter().all(apart) {
            Ok((out, None))
        } else {
            Ok((self.fresh_output()?, Some(out)))
        }
    }

    /// A new array of the result's kind, laid out like the one that is read.
    fn fresh_output(&self) -> PyResult<Bound<'py, PyUntypedArray>> {
        let (py, shape) = (self.plain.py(), self.plain.shape());
        let fortran = !self.plain.is_c_contiguous();
        match self.kind.of_result() {
            Kind::F32 => empty::<f32>(py, shape, fortran),
            _ => empty::<f64>(py, shape, fortran),
        }
    }

    fn check_output(&self, out: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
        let py = out.py();
        let Ok(out) = out.cast::<PyUntypedArray>() else {
            return Err(argument_error(
                py,
                format!("out must be a numpy array, got {}", out.get_type().name()?),
            ));
        };
        let wanted = self.kind.of_result();
        if Kind::of(&out.dtype()) != Some(wanted) {
            return Err(argument_error(
                py,
                format!(
                    "out must be of dtype {} for angles of dtype {}, got {}",
                    wanted.name(),
                    self.given.dtype(),
                    out.dtype()
                ),
            ));
        }
        if out.shape() != self.given.shape() {
            return Err(argument_error(
                py,
                format!(
                    "out must have the shape of the angles {}, got {}",
                    shown(self.given.shape()),
                    shown(out.shape())
                ),
            ));
        }
        if !is_writeable(out) {
            return Err(argument_error(py, "out is read-only".to_owned()));
        }
        if overlap(&self.given, out)? {
            return Err(argument_error(
                py,
                "out overlaps the angles in part: give the same array to work in place, \
                 or memory of its own"
                    .to_owned(),
            ));
        }
        Ok(out.clone())
    }
}

/// True when the kernels can use the memory as it is.
fn is_plain(array: &Bound<'_, PyUntypedArray>) -> bool {
    array.is_contiguous()
        && array.is_aligned()
        && array.dtype().is_native_byteorder().unwrap_or(true)
}

/// True when elements of both follow one another in the same order of indices.
fn same_order(a: &Bound<'_, PyUntypedArray>, b: &Bound<'_, PyUntypedArray>) -> bool {
    (a.is_c_contiguous() && b.is_c_contiguous())
        || (a.is_fortran_contiguous() && b.is_fortran_contiguous())
}

fn plain_copy<'py>(
    array: &Bound<'py, PyUntypedArray>,
    kind: Kind,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = array.py();
    let options = [("order", "C")].into_py_dict(py)?;
    let copy = numpy_module(py)?.call_method(
        intern!(py, "array"),
        (array, kind.name()),
        Some(&options),
    )?;
    Ok(copy.cast_into::<PyUntypedArray>()?)
}

fn is_writeable(array: &Bound<'_, PyUntypedArray>) -> bool {
    array
        .getattr(intern!(array.py(), "flags"))
        .and_then(|flags| flags.getattr(intern!(array.py(), "writeable")))
        .and_then(|flag| flag.extract())
        .unwrap_or(false)
}

/// First byte and the byte after the last.
fn extent(array: &Bound<'_, PyUntypedArray>) -> (isize, isize) {
    let start = data::<u8>(array) as isize;
    if array.is_empty() {
        return (start, start);
    }
    let (mut low, mut high) = (start, start + array.dtype().itemsize() as isize);
    for (&n, &stride) in array.shape().iter().zip(array.strides()) {
        let reach = (n as isize - 1) * stride as npy_intp;
        if reach < 0 {
            low += reach;
        } else {
            high += reach;
        }
    }
    (low, high)
}

/// True when two arrays share memory without being the same elements in the same places.
fn overlap(x: &Bound<'_, PyUntypedArray>, out: &Bound<'_, PyUntypedArray>) -> PyResult<bool> {
    let ((x_low, x_high), (out_low, out_high)) = (extent(x), extent(out));
    if x_high <= out_low || out_high <= x_low {
        return Ok(false);
    }
    let same = data::<u8>(x) == data::<u8>(out)
        && x.strides() == out.strides()
        && x.dtype().itemsize() == out.dtype().itemsize();
    if same {
        return Ok(false);
    }
    let py = x.py();
    numpy_module(py)?
        .call_method1(intern!(py, "shares_memory"), (x, out))?
        .extract()
}
