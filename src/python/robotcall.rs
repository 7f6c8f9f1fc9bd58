//! `RobotStep.step` by the quickest door there is: the interpreter's own calling convention.

use std::ffi::CStr;

use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::robot::PyRobotStep;
use super::step::Definition;

const DOCUMENTATION: &CStr = c"step(positions, /, out=None, *, velocity=None, temperature=None, \
torque=None, direction=None, current=None)\n--\n\nThe true angles of all joints, of their indicated \
ones. Signals are one value per joint, or one for all.";

pub static STEP: Definition = Definition(ffi::PyMethodDef {
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
