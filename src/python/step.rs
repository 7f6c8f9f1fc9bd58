//! `_core.Compensator`: corrections one at a time at the least price of a call.

use std::ffi::{CStr, c_int, c_ulong, c_void};
use std::mem::offset_of;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicPtr, Ordering};

use arc_swap::ArcSwap;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyType};
use pyo3::{ffi, intern};

use super::number::single;
use super::release::{HAS_LOCK, detached};
use super::series::PySeries;
use super::terms::OTHER;
use crate::compensator::Compensator;
use crate::kernel::Quantity;
use crate::terms::Signal;

/// Correction of one sample at a time.
#[pyclass(name = "Compensator", module = "trueangle._core", frozen)]
pub struct PyCompensator {
    held: Exchangeable,
}

struct Held {
    inner: Compensator,
    series: Py<PySeries>,
}

impl Held {
    fn new(series: &Bound<'_, PySeries>) -> PyResult<Self> {
        let evaluator = Arc::clone(&series.get().evaluator);
        let inner = detached(series.py(), || Compensator::new(evaluator))??;
        Ok(Self {
            inner,
            series: series.clone().unbind(),
        })
    }
}

/// What steps correct by: a step ends with what it began with, and a swap waits for none.
struct Exchangeable {
    kept: ArcSwap<Held>,
    /// The same without its count of readers, which costs a step more than its arithmetic.
    now: AtomicPtr<Held>,
}

impl Exchangeable {
    fn new(held: Held) -> Self {
        let kept = Arc::new(held);
        Self {
            now: AtomicPtr::new(Arc::as_ptr(&kept).cast_mut()),
            kept: ArcSwap::new(kept),
        }
    }

    /// What stands here now, for work that does not release the interpreter.
    ///
    /// # Safety
    /// `work` calls nothing of Python.
    #[inline(always)]
    unsafe fn with<R>(&self, _attached: Python<'_>, work: impl FnOnce(&Held) -> R) -> R {
        if HAS_LOCK {
            // SAFETY: whoever swaps holds the lock that this thread has until `work` ends.
            work(unsafe { &*self.now.load(Ordering::Relaxed) })
        } else {
            work(&self.kept.load())
        }
    }

    fn swap(&self, _attached: Python<'_>, held: Held) {
        let held = Arc::new(held);
        let now = Arc::as_ptr(&held).cast_mut();
        let before = self.kept.swap(held);
        self.now.store(now, Ordering::Relaxed);
        // Let go of last: it may call Python.
        drop(before);
    }
}

#[pymethods]
impl PyCompensator {
    #[new]
    fn new(series: &Bound<'_, PySeries>) -> PyResult<Self> {
        let evaluator = &series.get().evaluator;
        if !evaluator.is_ready(Quantity::Correction) {
            evaluator.room()?;
        }
        let held = Exchangeable::new(Held::new(series)?);
        Ok(Self { held })
    }

    /// A function of one float, cheaper to call than a method that PyO3 wraps.
    #[getter]
    fn step<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Step::bound(slf, slf.getattr(intern!(slf.py(), "swap"))?)
    }

    /// The same, whose `swap` is another function.
    fn step_with<'py>(
        slf: &Bound<'py, Self>,
        swap: Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Step::bound(slf, swap)
    }

    /// Correct by another series from the next step on.
    fn swap(&self, series: &Bound<'_, PySeries>) -> PyResult<()> {
        // Made whole before it takes the place of the other.
        self.held.swap(series.py(), Held::new(series)?);
        Ok(())
    }

    /// What a call costs that does nothing: the limit that benchmarks compare `step` with.
    #[pyo3(signature = (indicated, /))]
    fn _empty_step(&self, indicated: f64) -> f64 {
        indicated
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, (Py<PySeries>,)) {
        let py = slf.py();
        let series = slf.get().held.kept.load().series.clone_ref(py);
        (slf.get_type(), (series,))
    }
}

/// Definitions hold pointers, but nobody writes to this one.
pub struct Definition<T>(pub T);

// SAFETY: read-only.
unsafe impl<T> Sync for Definition<T> {}

const DOCUMENTATION: &CStr = c"step(indicated, /, velocity=None, temperature=None, torque=None, \
direction=None, current=None)\n--\n\nThe true angle of an indicated one. Signals are taken, as by every \
model, and not needed.";

/// `Compensator.step` as the interpreter calls it: the function stands in the object, and nothing is
/// between. It has attributes, as a builtin function has not.
#[repr(C)]
struct Step {
    head: ffi::PyObject,
    call: ffi::vectorcallfunc,
    /// None before it is filled, as its memory comes as zeros.
    compensator: Option<Py<PyCompensator>>,
    swap: Option<Py<PyAny>>,
}

impl Step {
    fn bound<'py>(
        compensator: &Bound<'py, PyCompensator>,
        swap: Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = compensator.py();
        let kind = Self::kind(py)?;
        let call: ffi::vectorcallfunc = if PlainFloat::is_what_floats_are(py)? {
            step::<true>
        } else {
            step::<false>
        };
        // SAFETY: the type is that of `Step`, which is filled before anybody sees it.
        unsafe {
            let made = ffi::PyType_GenericAlloc(kind.as_type_ptr(), 0);
            let made = Bound::from_owned_ptr_or_err(py, made)?;
            let own = made.as_ptr().cast::<Self>();
            (*own).call = call;
            (*own).compensator = Some(compensator.clone().unbind());
            (*own).swap = Some(swap.unbind());
            Ok(made)
        }
    }

    /// The type, which no macro of PyO3 can make: `__vectorcalloffset__`.
    fn kind(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
        static KIND: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        let kind = KIND.get_or_try_init(py, || {
            // SAFETY: the specification is static, and a type comes of it.
            unsafe {
                let kind = ffi::PyType_FromSpec((&raw const SPECIFICATION.0).cast_mut());
                Ok::<_, PyErr>(
                    Bound::from_owned_ptr_or_err(py, kind)?
                        .cast_into_unchecked()
                        .unbind(),
                )
            }
        })?;
        Ok(kind.bind(py))
    }
}

/// Of `Py_TPFLAGS_HAVE_VECTORCALL`, the same in every version; only its name came with 3.12.
const HAVE_VECTORCALL: c_ulong = 1 << 11;

const fn member(name: &CStr, kind: c_int, offset: usize) -> ffi::PyMemberDef {
    ffi::PyMemberDef {
        name: name.as_ptr(),
        type_code: kind,
        offset: offset as ffi::Py_ssize_t,
        flags: ffi::Py_READONLY,
        doc: ptr::null(),
    }
}

static MEMBERS: Definition<[ffi::PyMemberDef; 3]> = Definition([
    member(
        c"__vectorcalloffset__",
        ffi::Py_T_PYSSIZET,
        offset_of!(Step, call),
    ),
    member(c"swap", ffi::Py_T_OBJECT_EX, offset_of!(Step, swap)),
    // SAFETY: zeros end the list.
    unsafe { std::mem::zeroed() },
]);

static METHODS: Definition<[ffi::PyMethodDef; 2]> = Definition([
    ffi::PyMethodDef {
        ml_name: c"__reduce__".as_ptr(),
        ml_meth: ffi::PyMethodDefPointer {
            PyCFunction: reduce,
        },
        ml_flags: ffi::METH_NOARGS,
        ml_doc: ptr::null(),
    },
    ffi::PyMethodDef::zeroed(),
]);

const fn slot(slot: c_int, pfunc: *mut c_void) -> ffi::PyType_Slot {
    ffi::PyType_Slot { slot, pfunc }
}

static SLOTS: Definition<[ffi::PyType_Slot; 7]> = Definition([
    slot(ffi::Py_tp_doc, DOCUMENTATION.as_ptr().cast_mut().cast()),
    slot(ffi::Py_tp_call, call as *mut c_void),
    slot(ffi::Py_tp_members, (&raw const MEMBERS.0).cast_mut().cast()),
    slot(ffi::Py_tp_methods, (&raw const METHODS.0).cast_mut().cast()),
    slot(ffi::Py_tp_traverse, traverse as *mut c_void),
    slot(ffi::Py_tp_dealloc, release as *mut c_void),
    slot(0, ptr::null_mut()),
]);

static SPECIFICATION: Definition<ffi::PyType_Spec> = Definition(ffi::PyType_Spec {
    name: c"trueangle._core.Step".as_ptr(),
    basicsize: size_of::<Step>() as c_int,
    itemsize: 0,
    flags: (ffi::Py_TPFLAGS_DEFAULT
        | ffi::Py_TPFLAGS_DISALLOW_INSTANTIATION
        | ffi::Py_TPFLAGS_IMMUTABLETYPE
        | ffi::Py_TPFLAGS_HAVE_GC
        | HAVE_VECTORCALL) as _,
    slots: (&raw const SLOTS.0).cast_mut().cast(),
});

/// A step: nothing in it can panic. `PLAIN`, where a float is a head and a double.
///
/// # Safety
/// Called by the interpreter, attached, with a `Step`.
unsafe extern "C" fn step<const PLAIN: bool>(
    own: *mut ffi::PyObject,
    arguments: *const *mut ffi::PyObject,
    given: usize,
    keywords: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    // The uppermost bit says that the place before the first may be written to.
    let alone = given << 1 == 2 && keywords.is_null();
    unsafe {
        if alone && ffi::PyFloat_Check(*arguments) != 0 {
            let angle = if PLAIN {
                (*(*arguments).cast::<PlainFloat>()).value
            } else {
                ffi::PyFloat_AsDouble(*arguments)
            };
            return corrected(Python::assume_attached(), own, angle);
        }
        in_full(own, arguments, given << 1 >> 1, keywords)
    }
}

/// A float as CPython has it, where its size leaves room for nothing else.
#[repr(C)]
struct PlainFloat {
    _head: ffi::PyObject,
    value: f64,
}

impl PlainFloat {
    fn is_what_floats_are(py: Python<'_>) -> PyResult<bool> {
        let size = py
            .get_type::<PyFloat>()
            .getattr(intern!(py, "__basicsize__"))?;
        Ok(size.extract::<usize>()? == size_of::<Self>())
    }
}

/// # Safety
/// As of [`step`].
#[inline(always)]
unsafe fn corrected(py: Python<'_>, own: *mut ffi::PyObject, angle: f64) -> *mut ffi::PyObject {
    unsafe {
        // Without a reference of this call: to count it would cost more than the correction.
        let compensator = (*own.cast::<Step>()).compensator.as_ref();
        let held = &compensator.unwrap_unchecked().get().held;
        ffi::PyFloat_FromDouble(held.with(py, |held| held.inner.step(angle)))
    }
}

/// A step with signals, or of an angle that is no float.
///
/// # Safety
/// As of [`step`].
#[cold]
unsafe fn in_full(
    own: *mut ffi::PyObject,
    arguments: *const *mut ffi::PyObject,
    given: usize,
    keywords: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        let angle = check_arguments(py, given, keywords, (1, "an angle")).and_then(|()| {
            single(
                &Bound::from_borrowed_ptr(py, *arguments),
                "the angle of a step",
            )
        });
        match angle {
            Ok(angle) => corrected(py, own, angle),
            Err(error) => {
                error.restore(py);
                ptr::null_mut()
            }
        }
    }
}

/// The same with arguments in a tuple and a dictionary, as `PyVectorcall_Call` does it: the limited
/// interface has that from 3.12 on.
///
/// # Safety
/// As of [`step`].
unsafe extern "C" fn call(
    own: *mut ffi::PyObject,
    arguments: *mut ffi::PyObject,
    named: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        let given = ffi::PyTuple_Size(arguments);
        let placed: Vec<_> = (0..given)
            .map(|i| ffi::PyTuple_GetItem(arguments, i))
            .collect();
        let names = if named.is_null() {
            None
        } else {
            let keys = Bound::from_owned_ptr_or_opt(py, ffi::PyDict_Keys(named));
            let Some(names) = keys.and_then(|keys| {
                Bound::from_owned_ptr_or_opt(py, ffi::PyList_AsTuple(keys.as_ptr()))
            }) else {
                return ptr::null_mut();
            };
            Some(names)
        };
        let keywords = names.as_ref().map_or(ptr::null_mut(), Bound::as_ptr);
        // Of signals the names are looked at, the values are not.
        in_full(own, placed.as_ptr(), placed.len(), keywords)
    }
}

/// What pickle makes a step of: its compensator and its `swap`.
///
/// # Safety
/// As of [`step`].
unsafe extern "C" fn reduce(own: *mut ffi::PyObject, _: *mut ffi::PyObject) -> *mut ffi::PyObject {
    unsafe {
        let py = Python::assume_attached();
        let own = &*own.cast::<Step>();
        let (Some(compensator), Some(swap)) = (&own.compensator, &own.swap) else {
            return ptr::null_mut();
        };
        let made = compensator
            .bind(py)
            .get_type()
            .getattr(intern!(py, "step_with"))
            // The compensator among the arguments: its copy is that of the copy's `swap`.
            .and_then(|maker| (maker, (compensator, swap)).into_pyobject(py));
        match made {
            Ok(parts) => parts.into_ptr(),
            Err(error) => {
                error.restore(py);
                ptr::null_mut()
            }
        }
    }
}

/// # Safety
/// Called by the collector, with a `Step`.
unsafe extern "C" fn traverse(
    own: *mut ffi::PyObject,
    visit: ffi::visitproc,
    what_for: *mut c_void,
) -> c_int {
    unsafe {
        let kind = ffi::Py_TYPE(own).cast();
        let own = &*own.cast::<Step>();
        let compensator = own.compensator.as_ref().map(Py::as_ptr);
        [Some(kind), compensator, own.swap.as_ref().map(Py::as_ptr)]
            .into_iter()
            .flatten()
            .map(|held| visit(held, what_for))
            .find(|&found| found != 0)
            .unwrap_or(0)
    }
}

/// # Safety
/// Called by the interpreter, with a `Step` that nobody holds.
unsafe extern "C" fn release(own: *mut ffi::PyObject) {
    unsafe {
        ffi::PyObject_GC_UnTrack(own.cast());
        let kind = ffi::Py_TYPE(own);
        let held = own.cast::<Step>();
        // By hand: PyO3, which is not asked to be here, would put it off to its next call.
        let compensator = (*held).compensator.take().map(Py::into_ptr);
        for part in [compensator, (*held).swap.take().map(Py::into_ptr)] {
            ffi::Py_XDECREF(part.unwrap_or(ptr::null_mut()));
        }
        ffi::PyObject_GC_Del(own.cast());
        ffi::Py_DECREF(kind.cast());
    }
}

/// That the first arguments are there, so many, and beside them nothing but signals.
#[cold]
pub(super) fn check_arguments(
    py: Python<'_>,
    given: usize,
    keywords: *mut ffi::PyObject,
    (first, named): (usize, &str),
) -> PyResult<()> {
    if !(first..=first + Signal::NAMED.len()).contains(&given) {
        let problem = format!(
            "step takes {named} and up to {} signals, got {given} arguments",
            Signal::NAMED.len()
        );
        return Err(PyTypeError::new_err(problem));
    }
    if keywords.is_null() {
        return Ok(());
    }
    // SAFETY: a tuple of names, as the calling convention has it.
    let names: Vec<String> = unsafe { Bound::from_borrowed_ptr(py, keywords) }.extract()?;
    let is_known = |name: &str| Signal::named(name).is_some() || name.starts_with(OTHER);
    match names.iter().find(|name| !is_known(name)) {
        Some(name) => {
            let problem = format!("step got an unexpected keyword argument '{name}'");
            Err(PyTypeError::new_err(problem))
        }
        None => Ok(()),
    }
}
