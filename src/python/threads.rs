//! The `threads=` argument.

use pyo3::intern;
use pyo3::prelude::*;

use super::number::whole;
use crate::threads::MOST_THREADS;

/// As many threads as a caller asks for; `None` leaves it to the core.
pub type Asked<'py> = Option<Bound<'py, PyAny>>;

/// Threads to use: as asked, or one in a worker process (its siblings have the other
/// cores), or `None` for as many as the core sees fit.
pub fn threads(
    py: Python<'_>,
    asked: Option<&Bound<'_, PyAny>>,
    samples: usize,
) -> PyResult<Option<usize>> {
    match asked {
        Some(n) => {
            let wanted = "threads must be 1 or more, at most 1024, or None for all cores";
            whole(n, 1..=MOST_THREADS, wanted).map(Some)
        }
        None if samples >= crate::kernel::THREADED && in_worker_process(py)? => Ok(Some(1)),
        None => Ok(None),
    }
}

/// How many threads work that is worth splitting may use.
#[pyfunction]
#[pyo3(signature = (threads=None))]
pub fn thread_count(py: Python<'_>, threads: Asked<'_>) -> PyResult<usize> {
    count(py, threads.as_ref(), usize::MAX)
}

/// As [`threads`], for work that takes a number of threads. Few samples get one without
/// a look at the cores, which takes longer than they do.
pub fn count(py: Python<'_>, asked: Option<&Bound<'_, PyAny>>, samples: usize) -> PyResult<usize> {
    let few = samples < crate::kernel::THREADED;
    let own = || if few { 1 } else { crate::threads::available() };
    Ok(threads(py, asked, samples)?.unwrap_or_else(own))
}

/// True in a child of `multiprocessing` (and so of joblib, concurrent.futures, dask).
fn in_worker_process(py: Python<'_>) -> PyResult<bool> {
    let modules = py
        .import(intern!(py, "sys"))?
        .getattr(intern!(py, "modules"))?;
    let module = modules.call_method1(intern!(py, "get"), ("multiprocessing.process",))?;
    if module.is_none() {
        return Ok(false);
    }
    Ok(!module
        .call_method0(intern!(py, "parent_process"))?
        .is_none())
}
