//! Arguments that are angles: floats, integers, sequences and arrays of every layout.
//!
//! An array that is aligned, contiguous and in native byte order is used where it is.
//! Any other is copied into one that is, and a result that has to go into such an array
//! is copied there by numpy.

use numpy::npyffi::{NpyTypes, PY_ARRAY_API, get_type_object, npy_intp};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyUntypedArray, PyUntypedArrayMethods, dtype,
};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{IntoPyDict, PyBool, PyList, PyTuple};

use super::failure::{argument_error, kind_error};

/// The numpy module, imported once.
pub fn numpy_module(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    static NUMPY: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    NUMPY
        .get_or_try_init(py, || PyModule::import(py, "numpy").map(Bound::unbind))
        .map(|module| module.bind(py))
}

/// Element types that kernels read without conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    F64,
    F32,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
}

impl Kind {
    /// The kind of a dtype, whatever its byte order; `None` for what needs a conversion.
    fn of(dtype: &Bound<'_, PyArrayDescr>) -> Option<Self> {
        Some(match (dtype.kind(), dtype.itemsize()) {
            (b'f', 8) => Self::F64,
            (b'f', 4) => Self::F32,
            (b'i', 1) => Self::I8,
            (b'i', 2) => Self::I16,
            (b'i', 4) => Self::I32,
            (b'i', 8) => Self::I64,
            (b'u', 1) => Self::U8,
            (b'u', 2) => Self::U16,
            (b'u', 4) => Self::U32,
            (b'u', 8) => Self::U64,
            _ => return None,
        })
    }

    /// The kind of the results: float32 for float32, else float64.
    pub fn of_result(self) -> Self {
        match self {
            Self::F32 => Self::F32,
            _ => Self::F64,
        }
    }

    /// numpy's name of the dtype.
    fn name(self) -> &'static str {
        match self {
            Self::F64 => "float64",
            Self::F32 => "float32",
            Self::I8 => "int8",
            Self::I16 => "int16",
            Self::I32 => "int32",
            Self::I64 => "int64",
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::U64 => "uint64",
        }
    }
}

/// Most dimensions of an array of numpy.
const MOST_DIMENSIONS: usize = 64;

/// A shape as Python writes it.
pub fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let sizes: Vec<_> = shape.iter().map(ToString::to_string).collect();
            format!("({})", sizes.join(", "))
        }
    }
}

/// A new array whose elements are to be written before they are seen, or `MemoryError`.
pub fn empty<'py, T: Element>(
    py: Python<'py>,
    shape: &[usize],
    fortran: bool,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    // As many dimensions as numpy has, without an allocation.
    let mut lengths: [npy_intp; MOST_DIMENSIONS] = [0; MOST_DIMENSIONS];
    for (length, &n) in lengths.iter_mut().zip(shape) {
        *length = n as npy_intp;
    }
    // SAFETY: numpy takes over the reference to the dtype, and reads as many lengths as
    // there are dimensions, which are those of an array that exists.
    unsafe {
        let array = PY_ARRAY_API.PyArray_NewFromDescr(
            py,
            get_type_object(py, NpyTypes::PyArray_Type),
            dtype::<T>(py).into_dtype_ptr(),
            shape.len() as _,
            lengths.as_mut_ptr(),
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            fortran.into(),
            std::ptr::null_mut(),
        );
        Ok(Bound::from_owned_ptr_or_err(py, array)?.cast_into_unchecked())
    }
}

/// Values as an array of their own, or `MemoryError`.
pub fn vector<'py, T: Element + Copy>(
    py: Python<'py>,
    values: &[T],
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let array = empty::<T>(py, &[values.len()], false)?;
    // SAFETY: a fresh contiguous array of this type and length.
    unsafe {
        std::ptr::copy_nonoverlapping(values.as_ptr(), data::<T>(&array), values.len());
        Ok(array.into_any().cast_into_unchecked())
    }
}

/// The elements of a contiguous array.
pub fn slice<'a>(array: &'a Bound<'_, PyArray1<f64>>) -> PyResult<&'a [f64]> {
    // SAFETY: as everywhere in numpy, a caller who changes an array in another thread
    // meanwhile gets undefined values.
    Ok(unsafe { array.as_slice() }?)
}

/// Rows one after the other as a square matrix, or `MemoryError`.
pub fn square<'py>(
    py: Python<'py>,
    rows: &[f64],
    size: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    vector(py, rows)?.reshape([size, size])
}

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

/// An array, and what puts the labels of the data it came from on results.
pub type Labelled<'py> = (Bound<'py, PyUntypedArray>, Option<Bound<'py, PyAny>>);

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

/// Where the elements lie.
pub fn data<T: Element>(array: &Bound<'_, PyUntypedArray>) -> *mut T {
    // SAFETY: only the address is read; callers match `T` to the array's kind.
    unsafe { array.cast_unchecked::<PyArrayDyn<T>>() }.data()
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

/// `numpy.asarray`, without losing a mask or the labels of data that have some, and without
/// taking truth values for numbers.
pub fn as_array<'py>(value: &Bound<'py, PyAny>, what: &str) -> PyResult<Labelled<'py>> {
    let py = value.py();
    let numpy = numpy_module(py)?;
    if value.is_instance_of::<PyBool>() {
        let problem = format!("{what} must be real numbers, got {value}");
        return Err(kind_error(py, problem));
    }
    let (mut source, mut labels) = (value.clone(), None);
    if value.cast::<PyUntypedArray>().is_ok() {
        let masked = numpy.getattr(intern!(py, "ma"))?.getattr("MaskedArray")?;
        if value.is_instance(&masked)? {
            return Err(argument_error(
                py,
                format!(
                    "{what}: masked arrays are not supported: fill them with NaN \
                     (array.filled(numpy.nan)) or compress them first"
                ),
            ));
        }
    } else if !value.is_instance_of::<PyList>() && !value.is_instance_of::<PyTuple>() {
        (source, labels) = PyModule::import(py, "trueangle.support.labelled")?
            .call_method1(intern!(py, "take_apart"), (value,))?
            .extract()?;
    }
    let array = numpy
        .call_method1(intern!(py, "asarray"), (source,))
        .and_then(|array| Ok(array.cast_into::<PyUntypedArray>()?))
        .map_err(|cause| {
            if cause.is_instance_of::<pyo3::exceptions::PyMemoryError>(py) {
                return cause;
            }
            argument_error(py, format!("{what} must be numbers in an array: {cause}"))
        })?;
    Ok((array, labels))
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
