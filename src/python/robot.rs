//! `_core.RobotStep`: one sample of all joints of a robot in one call.

use std::ffi::CStr;

use numpy::npyffi::PyArrayObject;
use numpy::npyffi::flags::{
    NPY_ARRAY_ALIGNED, NPY_ARRAY_C_CONTIGUOUS, NPY_ARRAY_OWNDATA, NPY_ARRAY_WRITEABLE,
};
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods, dtype};
use pyo3::exceptions::PyTypeError;
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::array::{as_array, data, shown};
use super::failure::{argument_error, kind_error};
use super::release::{HAS_LOCK, attached};
use super::robotparts::{couplings, fresh, joint, named};
use super::signals::{as_signal, in_order};
use super::step::Definition;
use crate::robot::Robot;
use crate::terms::{Columns, Signal};

/// Correction of one sample of every joint at a time.
#[pyclass(name = "RobotStep", module = "trueangle._core")]
pub struct PyRobotStep {
    inner: Robot,
    names: Vec<String>,
    /// What the joints were made of.
    parts: Vec<Py<PyAny>>,
    /// The dtype of doubles, to know it at a glance.
    doubles: Py<PyArrayDescr>,
    /// The last two results: who has let go of one gets it again.
    results: [Option<Py<PyUntypedArray>>; 2],
}

#[pymethods]
impl PyRobotStep {
    #[new]
    fn new(names: Vec<String>, parts: Vec<Bound<'_, PyAny>>, py: Python<'_>) -> PyResult<Self> {
        let mut joints = Vec::with_capacity(parts.len());
        for part in &parts {
            joints.push(joint(part)?);
        }
        if names.len() != joints.len() || joints.is_empty() {
            let problem = "a robot has one joint or more, each with a name";
            return Err(argument_error(py, problem.to_owned()));
        }
        Ok(Self {
            inner: Robot::coupled(joints, couplings(&names, &parts)?),
            names,
            parts: parts.into_iter().map(Bound::unbind).collect(),
            doubles: dtype::<f64>(py).unbind(),
            results: [None, None],
        })
    }

    /// Correct by the parts of another one of the same joints from the next step on; what is
    /// known of the past stays where these can hold it.
    fn swap(&mut self, other: &Bound<'_, Self>) -> PyResult<()> {
        let py = other.py();
        let other = other.try_borrow()?;
        let parts = other
            .parts
            .iter()
            .map(|part| part.bind(py).clone())
            .collect();
        let mut next = Self::new(other.names.clone(), parts, py)?;
        next.inner.restore(&self.inner.store());
        *self = next;
        Ok(())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
        let own = slf.borrow();
        let parts: Vec<_> = own.parts.iter().map(|part| part.bind(slf.py())).collect();
        let made_of = (own.names.clone(), parts).into_pyobject(slf.py())?;
        Ok((slf.get_type().into_any(), made_of, own.inner.store()))
    }

    fn __setstate__(&mut self, py: Python<'_>, past: Vec<Vec<f64>>) -> PyResult<()> {
        if self.inner.restore(&past) {
            return Ok(());
        }
        let problem = "this is not the state of a robot with such joints";
        Err(argument_error(py, problem.to_owned()))
    }

    /// Forget where all joints were.
    fn reset(&mut self) {
        self.inner.reset();
    }

    /// A bound function of one array, cheaper to call than a method that PyO3 wraps.
    #[getter]
    fn step<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let definition = &raw const STEP.0;
        // SAFETY: the definition is static, and the function holds a reference to `slf`.
        unsafe {
            let function =
                ffi::PyCFunction_NewEx(definition.cast_mut(), slf.as_ptr(), std::ptr::null_mut());
            Bound::from_owned_ptr_or_err(slf.py(), function)
        }
    }

    /// The step with all that it may be given.
    #[pyo3(signature = (positions, /, out=None, **signals))]
    fn _step<'py>(
        &mut self,
        positions: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        signals: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = positions.py();
        let size = self.names.len();
        let (array, _) = as_array(positions, "positions")?;
        if !matches!(array.dtype().kind(), b'f' | b'i' | b'u') {
            let problem = format!("positions must be real numbers, got {}", array.dtype());
            return Err(kind_error(py, problem));
        }
        let wrong = |shape: &[usize], what: &str| {
            let names = self.names.join(", ");
            let shape = shown(shape);
            let problem =
                format!("{what} must have the shape ({size},), a value of {names}; got {shape}");
            Err(argument_error(py, problem))
        };
        if array.shape() != [size] {
            return wrong(array.shape(), "positions");
        }
        let read = in_order(&array)?;
        let target = match out {
            None => fresh(py, size)?,
            Some(out) => match out.cast::<PyUntypedArray>() {
                Ok(out) if out.shape() == [size] => {
                    match self.is_plain(out, PLAIN | NPY_ARRAY_WRITEABLE) {
                        true => out.clone(),
                        false => {
                            let problem = "out must be an array of float64 that is contiguous and may be written to";
                            return Err(argument_error(py, problem.to_owned()));
                        }
                    }
                }
                Ok(out) => return wrong(out.shape(), "out"),
                Err(_) => {
                    let kind = out.get_type().name()?;
                    let problem = format!("out must be an array of float64, got {kind}");
                    return Err(kind_error(py, problem));
                }
            },
        };
        let mut given = Vec::new();
        for (name, values) in signals.into_iter().flatten() {
            let name: String = name.extract()?;
            let signal = Signal::named(&name).ok_or_else(|| {
                let known: Vec<_> = Signal::NAMED.iter().map(|signal| signal.name()).collect();
                PyTypeError::new_err(format!(
                    "got an unexpected keyword argument '{name}'; signals are {}",
                    known.join(", ")
                ))
            })?;
            if !values.is_none() {
                let values = as_signal(&values, signal.name())?;
                if values.len() != 1 && values.shape() != [size] {
                    return wrong(values.shape(), signal.name());
                }
                given.push((signal, values));
            }
        }
        let columns = given
            .iter()
            .fold(Columns::default(), |columns, (s, values)| {
                // SAFETY: a contiguous array of doubles that is kept while the slice is used.
                let values =
                    unsafe { std::slice::from_raw_parts(data::<f64>(values), values.len()) };
                columns.with(*s, values)
            });
        // SAFETY: both are contiguous arrays of so many doubles, perhaps the same.
        let angles = unsafe {
            std::ptr::copy(data::<f64>(&read), data::<f64>(&target), size);
            std::slice::from_raw_parts_mut(data::<f64>(&target), size)
        };
        attached(py, || self.inner.step(angles, &columns))?
            .map_err(|error| named(&self.names, error))?;
        Ok(target.into_any())
    }
}

/// What pickle makes a robot's step of: its class, arguments and state.
type Reduced<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>, Vec<Vec<f64>>);

/// Flags of numpy: elements one after the other, aligned, to be written to.
const PLAIN: i32 = NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED;

impl PyRobotStep {
    /// Whether an array holds a double of every joint, one after the other, in native order.
    #[inline]
    fn is_plain(&self, array: &Bound<'_, PyAny>, flags: i32) -> bool {
        // SAFETY: an array of numpy; its fields are read while it is there.
        let fields = unsafe { &(*array.as_ptr().cast::<PyArrayObject>()).fields };
        fields.descr.cast() == self.doubles.as_ptr()
            && fields.nd == 1
            && unsafe { *fields.dimensions } as usize == self.names.len()
            && fields.flags & flags == flags
    }

    /// An array for a result: one that nobody but this holds any more, or a new one.
    ///
    /// A control loop lets go of a result when it takes the next but one, and allocates nothing.
    #[inline]
    fn result<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyUntypedArray>> {
        for kept in self.results.iter().flatten() {
            let array = kept.bind(py);
            // SAFETY: an object that is there. Under the lock a count of one is one.
            let is_free = HAS_LOCK && unsafe { ffi::Py_REFCNT(array.as_ptr()) } == 1;
            if is_free && self.is_plain(array, PLAIN | NPY_ARRAY_WRITEABLE | NPY_ARRAY_OWNDATA) {
                return Ok(array.clone());
            }
        }
        let made = fresh(py, self.names.len())?;
        self.results.swap(0, 1);
        self.results[0] = Some(made.clone().unbind());
        Ok(made)
    }

    /// The step of a plain array into a plain array or a new one; `None` of anything else.
    #[inline]
    fn quick<'py>(
        &mut self,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> Option<PyResult<Bound<'py, PyAny>>> {
        let array = x.cast_exact::<PyUntypedArray>().ok()?;
        if !self.is_plain(array, PLAIN) {
            return None;
        }
        let size = self.names.len();
        let target = match out {
            Some(out) => {
                let out = out.cast_exact::<PyUntypedArray>().ok()?;
                if !self.is_plain(out, PLAIN | NPY_ARRAY_WRITEABLE) {
                    return None;
                }
                out.clone()
            }
            None => match self.result(x.py()) {
                Ok(target) => target,
                Err(error) => return Some(Err(error)),
            },
        };
        // SAFETY: contiguous arrays of so many doubles, perhaps the same.
        let angles = unsafe {
            std::ptr::copy(data::<f64>(array), data::<f64>(&target), size);
            std::slice::from_raw_parts_mut(data::<f64>(&target), size)
        };
        Some(match self.inner.step(angles, &Columns::default()) {
            Ok(()) => Ok(target.into_any()),
            Err(error) => Err(named(&self.names, error)),
        })
    }
}

const DOCUMENTATION: &CStr = c"step(positions, /, out=None, *, velocity=None, temperature=None, \
torque=None, direction=None, current=None)\n--\n\nThe true angles of all joints, of their indicated \
ones. Signals are one value per joint, or one for all.";

static STEP: Definition<ffi::PyMethodDef> = Definition(ffi::PyMethodDef {
    ml_name: c"step".as_ptr(),
    ml_meth: ffi::PyMethodDefPointer {
        PyCFunctionFastWithKeywords: step,
    },
    ml_flags: ffi::METH_FASTCALL | ffi::METH_KEYWORDS,
    ml_doc: DOCUMENTATION.as_ptr(),
});

/// `RobotStep.step`: a plain array at once, all else by the way of `_step`.
///
/// # Safety
/// Called by the interpreter, attached, with the robot the function is bound to.
unsafe extern "C" fn step(
    robot: *mut ffi::PyObject,
    arguments: *const *mut ffi::PyObject,
    given: ffi::Py_ssize_t,
    keywords: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        let bound = Bound::from_borrowed_ptr(py, robot);
        let by_name = !keywords.is_null() && given == 1 && is_out(keywords);
        let out = if by_name || given == 2 {
            Some(Bound::from_borrowed_ptr(py, *arguments.add(1)))
        } else {
            None
        };
        if (by_name || (keywords.is_null() && (1..=2).contains(&given)))
            && let Ok(mut own) = bound.cast_unchecked::<PyRobotStep>().try_borrow_mut()
            && let Some(result) = own.quick(&Bound::from_borrowed_ptr(py, *arguments), out.as_ref())
        {
            return match result {
                Ok(array) => array.into_ptr(),
                Err(error) => {
                    error.restore(py);
                    std::ptr::null_mut()
                }
            };
        }
        match in_full(&bound, arguments, given, keywords) {
            Ok(array) => array.into_ptr(),
            Err(error) => {
                error.restore(py);
                std::ptr::null_mut()
            }
        }
    }
}

/// Whether names of arguments are `out` alone.
///
/// # Safety
/// A tuple of texts, as the calling convention has it.
unsafe fn is_out(keywords: *mut ffi::PyObject) -> bool {
    unsafe {
        ffi::PyTuple_Size(keywords) == 1
            && ffi::PyUnicode_CompareWithASCIIString(
                ffi::PyTuple_GetItem(keywords, 0),
                c"out".as_ptr(),
            ) == 0
    }
}

/// `_step` with the arguments of a quick call.
///
/// # Safety
/// As of [`step`].
#[cold]
unsafe fn in_full<'py>(
    robot: &Bound<'py, PyAny>,
    arguments: *const *mut ffi::PyObject,
    given: ffi::Py_ssize_t,
    keywords: *mut ffi::PyObject,
) -> PyResult<Bound<'py, PyAny>> {
    let py = robot.py();
    // SAFETY: so many arguments by place and, after them, one for each name of a tuple.
    let argument = |i: usize| unsafe { Bound::from_borrowed_ptr(py, *arguments.add(i)) };
    let given = given as usize;
    let named = PyDict::new(py);
    if !keywords.is_null() {
        // SAFETY: a tuple of names, as the calling convention has it.
        let names = unsafe { Bound::from_borrowed_ptr(py, keywords) };
        for (i, name) in names.try_iter()?.enumerate() {
            named.set_item(name?, argument(given + i))?;
        }
    }
    let placed = PyTuple::new(py, (0..given).map(argument))?;
    robot.call_method(pyo3::intern!(py, "_step"), placed, Some(&named))
}
