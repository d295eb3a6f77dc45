//! Flat core buffers as NumPy arrays.

use numpy::{Element, PyArray, PyArray1, PyArrayMethods, ndarray::Dimension};
use pyo3::prelude::*;

/// A copy of `values` with `shape`.
pub(crate) fn shaped<'py, T: Element + Copy, D: Dimension>(
    py: Python<'py>,
    values: &[T],
    shape: impl numpy::ndarray::IntoDimension<Dim = D>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    PyArray1::from_slice(py, values).reshape(shape)
}
