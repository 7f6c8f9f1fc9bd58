//! Bindings: extract, release the interpreter, call, convert. Nothing is computed here.

// Arguments of a Python function have names: many of them are no confusion.
#![allow(clippy::too_many_arguments)]

mod alike;
mod angles;
mod array;
mod beside;
mod channels;
mod circle;
mod corrector;
mod door;
mod evidence;
mod factor;
mod failure;
mod fit;
mod groups;
mod linear;
mod lines;
mod moments;
mod monitor;
mod motion;
mod noise;
mod number;
mod outliers;
mod release;
mod robot;
mod robotparts;
mod series;
mod signals;
mod spectrum;
mod step;
mod table;
mod terms;
mod threads;
mod whitening;

use pyo3::prelude::*;

/// Of the extension alone: who links the crate chooses for themselves.
#[global_allocator]
static ALLOCATOR: crate::reserve::Reserve = crate::reserve::Reserve;

/// The compiled core of trueangle.
#[pymodule(gil_used = false)]
mod _core {
    use super::*;

    #[pymodule_export]
    use super::series::PySeries;

    #[pymodule_export]
    use super::step::PyCompensator;

    #[pymodule_export]
    use super::beside::PyBeside;

    #[pymodule_export]
    use super::channels::{PyDecoder, channel_faults, curve_slopes, demodulate, fit_curve};

    #[pymodule_export]
    use super::circle::{covered_span, following, residuals, resultant};

    #[pymodule_export]
    use super::alike::PyAlike;

    #[pymodule_export]
    use super::corrector::PyCorrector;

    #[pymodule_export]
    use super::evidence::PyEvidence;

    #[pymodule_export]
    use super::groups::{PyGroupSums, PyGroups};

    #[pymodule_export]
    use super::factor::{PyFactor, settled, short_stretches};

    #[pymodule_export]
    use super::fit::{
        Solution, band, fit, folds, median_magnitude, sample_residuals, scan_residuals, triangle,
    };

    #[pymodule_export]
    use super::linear::{PyLinearModel, cluster_covariance, left_out, ridge_path};

    #[pymodule_export]
    use super::lines::{lagged, line_columns, line_sum, line_sum_and_slope, unit_sums};

    #[pymodule_export]
    use super::moments::{PyMoments, fit_moments};

    #[pymodule_export]
    use super::monitor::{PyClosedWindow, PyMonitor};

    #[pymodule_export]
    use super::motion::{PyBanded, harmonic_rows, harmonic_sum};

    #[pymodule_export]
    use super::noise::{block_products, clipped, median, rounded, rounded_drawn, two_normals};

    #[pymodule_export]
    use super::outliers::{outliers, sensor_count};

    #[pymodule_export]
    use super::robot::PyRobotStep;

    #[pymodule_export]
    use super::spectrum::add_relative_power;

    #[pymodule_export]
    use super::table::{table_correction, table_source};

    #[pymodule_export]
    use super::threads::thread_count;

    #[pymodule_export]
    use super::whitening::{PyLagCorrelation, PyRunEffect, PyWhitener};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        crate::reserve::fill();
        crate::threads::prepare();
        // The stub lists the names; a second list would have to be kept in step with it.
        module.delattr("__all__")
    }
}
