//! Arrays of numpy: made, read, and known by the kind of their elements.

use std::borrow::Cow;

use numpy::npyffi::{NpyTypes, PY_ARRAY_API, get_type_object, npy_intp};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescr, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyReadonlyArray1, PyUntypedArray, dtype,
};

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyList, PyTuple};

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
    pub fn of(dtype: &Bound<'_, PyArrayDescr>) -> Option<Self> {
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
    pub fn name(self) -> &'static str {
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

/// A new contiguous array that `work` fills.
pub fn filled<'py, T: Element>(
    py: Python<'py>,
    shape: &[usize],
    work: impl FnOnce(&mut [T]) -> PyResult<()>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let array = empty::<T>(py, shape, false)?;
    let size = shape.iter().product();
    // SAFETY: a fresh contiguous array of this type and size, that nobody else knows.
    work(unsafe { std::slice::from_raw_parts_mut(data::<T>(&array), size) })?;
    Ok(array)
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

/// Numbers one after the other.
pub fn values<'a>(array: &'a PyReadonlyArray1<'_, f64>) -> Cow<'a, [f64]> {
    let copied = |_| Cow::Owned(array.as_array().iter().copied().collect());
    array.as_slice().map_or_else(copied, Cow::Borrowed)
}

/// Columns as numpy has them that stand one after the other.
pub fn columns<'py>(
    py: Python<'py>,
    values: &[f64],
    shape: &[usize],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    vector(py, values)?
        .reshape([shape[1], shape[0]])?
        .transpose()
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

/// An array, and what puts the labels of the data it came from on results.
pub type Labelled<'py> = (Bound<'py, PyUntypedArray>, Option<Bound<'py, PyAny>>);

/// Where the elements lie.
pub fn data<T: Element>(array: &Bound<'_, PyUntypedArray>) -> *mut T {
    // SAFETY: only the address is read; callers match `T` to the array's kind.
    unsafe { array.cast_unchecked::<PyArrayDyn<T>>() }.data()
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
