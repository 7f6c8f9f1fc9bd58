//! `_core.Series` and `_core.Compensator`.

use std::sync::Arc;

use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::ffi;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt};

use super::array::{Angles, Kind, data, numpy_module};
use super::failure::argument_error;
use super::threads::threads;
use crate::compensator::Compensator;
use crate::kernel::{Argument, Batch, Evaluator, Quantity, Real, Route, Sample, TOLERANCE};
use crate::series::{HarmonicSeries, Shaft};

/// Samples from which the interpreter is released: below, that costs more than it frees.
const RELEASED: usize = 1024;

/// How to compute a batch, as the caller wants it.
struct Wish {
    quantity: Quantity,
    route: Option<Route>,
    threads: Option<i64>,
}

#[pyclass(name = "Series", module = "trueangle._core", frozen)]
pub struct PySeries {
    pub(super) evaluator: Arc<Evaluator>,
}

#[pymethods]
impl PySeries {
    #[new]
    #[allow(clippy::too_many_arguments)] // the keywords of the Python constructor
    #[pyo3(signature = (period, constant, cycles, orders, cosine, sine, argument="reference", tolerance=TOLERANCE))]
    fn new(
        py: Python<'_>,
        period: f64,
        constant: f64,
        cycles: Vec<f64>,
        orders: Vec<Vec<u32>>,
        cosine: Vec<Vec<f64>>,
        sine: Vec<Vec<f64>>,
        argument: &str,
        tolerance: f64,
    ) -> PyResult<Self> {
        let shafts = cycles.len();
        for (what, got) in [
            ("orders", orders.len()),
            ("cosine", cosine.len()),
            ("sine", sine.len()),
        ] {
            if got != shafts {
                return Err(argument_error(
                    py,
                    format!("{what} has {got} lists, cycles has {shafts}: one list per shaft"),
                ));
            }
        }
        let argument = match argument {
            "reference" => Argument::Reference,
            "indicated" => Argument::Indicated,
            other => {
                return Err(argument_error(
                    py,
                    format!("argument must be 'reference' or 'indicated', got {other:?}"),
                ));
            }
        };
        let shafts = cycles
            .into_iter()
            .zip(orders)
            .zip(cosine.into_iter().zip(sine))
            .map(|((cycles, orders), (cosine, sine))| Shaft {
                cycles,
                orders,
                cosine,
                sine,
            })
            .collect();
        let series = HarmonicSeries::new(period, constant, shafts)?;
        Ok(Self {
            evaluator: Arc::new(Evaluator::new(series, argument).with_tolerance(tolerance)?),
        })
    }

    #[pyo3(signature = (theta, out=None, threads=None, path=None))]
    fn error<'py>(
        &self,
        theta: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.compute(Quantity::Error, theta, out, threads, path)
    }

    #[pyo3(signature = (theta, out=None, threads=None, path=None))]
    fn slope<'py>(
        &self,
        theta: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.compute(Quantity::Slope, theta, out, threads, path)
    }

    #[pyo3(signature = (indicated, out=None, threads=None, path=None))]
    fn correct<'py>(
        &self,
        indicated: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.compute(Quantity::Correction, indicated, out, threads, path)
    }

    fn compensator(&self) -> PyResult<PyCompensator> {
        Ok(PyCompensator(Compensator::new(Arc::clone(
            &self.evaluator,
        ))?))
    }

    #[getter]
    fn path(&self) -> String {
        let route = self.evaluator.route::<f64, f64>(Quantity::Error, 1);
        route.to_string()
    }

    #[getter]
    fn counts_path(&self) -> String {
        let route = self
            .evaluator
            .route::<u32, f64>(Quantity::Error, usize::MAX);
        route.to_string()
    }

    #[getter]
    fn float32_path(&self) -> String {
        let route = self.evaluator.route::<f32, f32>(Quantity::Error, 1);
        route.to_string()
    }

    #[getter]
    fn float32_bound(&self) -> f64 {
        self.evaluator.single_bound()
    }

    #[getter]
    fn segments(&self) -> usize {
        let table = self.evaluator.table(Quantity::Error);
        table.map_or(0, |table| table.segments())
    }

    #[getter]
    fn error_bound(&self) -> f64 {
        self.evaluator.error_bound()
    }

    #[getter]
    fn slope_bound(&self) -> f64 {
        self.evaluator.slope_bound()
    }

    #[getter]
    fn amplitude_sum(&self) -> f64 {
        self.evaluator.series().amplitude_sum()
    }

    #[getter]
    fn is_periodic(&self) -> bool {
        self.evaluator.series().is_periodic()
    }
}

impl PySeries {
    fn compute<'py>(
        &self,
        quantity: Quantity,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
        path: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = x.py();
        let wish = &Wish {
            quantity,
            route: path.map(|name| parse_route(py, name)).transpose()?,
            threads,
        };
        if out.is_none() && is_number(x) {
            let mut sample = [x.extract::<f64>()?];
            self.run(py, wish, Batch::in_place(&mut sample))?;
            return Ok(PyFloat::new(py, sample[0]).into_any());
        }
        let angles = Angles::new(x)?;
        let (target, copy_to) = angles.output(out)?;
        match angles.kind {
            Kind::F64 => self.fill::<f64, f64>(wish, &angles.plain, &target),
            Kind::F32 => self.fill::<f32, f32>(wish, &angles.plain, &target),
            Kind::I8 => self.fill::<i8, f64>(wish, &angles.plain, &target),
            Kind::I16 => self.fill::<i16, f64>(wish, &angles.plain, &target),
            Kind::I32 => self.fill::<i32, f64>(wish, &angles.plain, &target),
            Kind::I64 => self.fill::<i64, f64>(wish, &angles.plain, &target),
            Kind::U8 => self.fill::<u8, f64>(wish, &angles.plain, &target),
            Kind::U16 => self.fill::<u16, f64>(wish, &angles.plain, &target),
            Kind::U32 => self.fill::<u32, f64>(wish, &angles.plain, &target),
            Kind::U64 => self.fill::<u64, f64>(wish, &angles.plain, &target),
        }?;
        if let Some(destination) = copy_to {
            numpy_module(py)?.call_method1(intern!(py, "copyto"), (&destination, &target))?;
            return Ok(destination.into_any());
        }
        if out.is_none() && target.ndim() == 0 {
            // As numpy's own functions: a scalar for an array without dimensions.
            return target.get_item(());
        }
        Ok(target.into_any())
    }

    /// Results of the plain array `x` to the plain array `out` of the same shape and order.
    fn fill<X: Sample + Element, Y: Real + Element>(
        &self,
        wish: &Wish,
        x: &Bound<'_, PyUntypedArray>,
        out: &Bound<'_, PyUntypedArray>,
    ) -> PyResult<()> {
        // SAFETY: both are aligned, contiguous, of these types and equally long, and are
        // either the same memory or apart (`Angles`). As everywhere in numpy, a caller
        // who changes an array in another thread meanwhile gets undefined values.
        let batch = unsafe { Batch::from_raw(data::<X>(x), data::<Y>(out), x.len()) };
        self.run(x.py(), wish, batch)
    }

    fn run<X: Sample, Y: Real>(
        &self,
        py: Python<'_>,
        wish: &Wish,
        batch: Batch<'_, X, Y>,
    ) -> PyResult<()> {
        let threads = threads(py, wish.threads, batch.len())?;
        let evaluator = &self.evaluator;
        if batch.len() < RELEASED {
            evaluator.run(wish.quantity, wish.route, threads, batch)?;
        } else {
            py.detach(|| evaluator.run(wish.quantity, wish.route, threads, batch))?;
        }
        Ok(())
    }
}

/// True for Python's own float and int (numpy.float64 is a float).
fn is_number(x: &Bound<'_, PyAny>) -> bool {
    x.is_instance_of::<PyFloat>() || (x.is_instance_of::<PyInt>() && !x.is_instance_of::<PyBool>())
}

fn parse_route(py: Python<'_>, name: &str) -> PyResult<Route> {
    name.parse().map_err(|()| {
        argument_error(
            py,
            format!(
                "path must be 'table', 'cubics', 'exact', 'direct' or 'counts', with '-portable', \
                 '-avx2' or '-avx512' to force an instruction set, got {name:?}"
            ),
        )
    })
}

#[pyclass(name = "Compensator", module = "trueangle._core", frozen)]
pub struct PyCompensator(Compensator);

#[pymethods]
impl PyCompensator {
    /// A bound function of one float, cheaper to call than a method that PyO3 wraps.
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

    /// What a call costs that does nothing: the limit that benchmarks compare `step` with.
    #[pyo3(signature = (indicated, /))]
    fn _empty_step(&self, indicated: f64) -> f64 {
        indicated
    }
}

/// Definitions hold pointers, but nobody writes to this one.
struct Definition(ffi::PyMethodDef);

// SAFETY: read-only.
unsafe impl Sync for Definition {}

static STEP: Definition = Definition(ffi::PyMethodDef {
    ml_name: c"step".as_ptr(),
    ml_meth: ffi::PyMethodDefPointer { PyCFunction: step },
    ml_flags: ffi::METH_O,
    ml_doc: c"step(indicated, /)\n--\n\nThe true angle of an indicated one.".as_ptr(),
});

/// `Compensator.step`: nothing in it can panic.
///
/// # Safety
/// Called by the interpreter, attached, with the compensator the function is bound to.
unsafe extern "C" fn step(
    compensator: *mut ffi::PyObject,
    indicated: *mut ffi::PyObject,
) -> *mut ffi::PyObject {
    unsafe {
        let angle = ffi::PyFloat_AsDouble(indicated);
        if angle == -1.0 && !ffi::PyErr_Occurred().is_null() {
            return std::ptr::null_mut();
        }
        let py = Python::assume_attached();
        let compensator = Bound::from_borrowed_ptr(py, compensator);
        let corrected = compensator
            .cast_unchecked::<PyCompensator>()
            .get()
            .0
            .step(angle);
        ffi::PyFloat_FromDouble(corrected)
    }
}
