//! Flat core buffers as NumPy arrays, and arrays as buffers of our own.
//!
//! NumPy allocates the arrays, so that one too large is a `MemoryError`; they are filled in pieces, between which signals
//! are looked for.

use numpy::{Element, PyArray, PyArrayMethods, PyReadonlyArray, ndarray::Dimension, ndarray::IntoDimension};
use pyo3::prelude::*;
use tadcore::memory;

use super::errors;

/// Entries of a piece: some milliseconds of copying.
const PIECE: usize = 1 << 21;

/// An array of `shape`; `fill` is told where in it a piece begins.
pub(crate) fn filled<'py, T: Element + Copy, D: Dimension>(
    py: Python<'py>,
    shape: impl IntoDimension<Dim = D>,
    mut fill: impl FnMut(usize, &mut [T]),
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let shape = shape.into_dimension().slice().to_vec();
    let made = py.import("numpy")?.call_method1("empty", (shape, T::get_dtype(py)))?;
    let array = made.cast_into::<PyArray<T, D>>()?;
    let mut entries = array.readwrite();
    for (i, piece) in entries.as_slice_mut()?.chunks_mut(PIECE).enumerate() {
        fill(i * PIECE, piece);
        py.check_signals()?;
    }
    drop(entries);
    Ok(array)
}

/// The same, entry by entry.
pub(crate) fn entries<'py, T: Element + Copy, D: Dimension>(
    py: Python<'py>,
    shape: impl IntoDimension<Dim = D>,
    entry: impl Fn(usize) -> T,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    filled(py, shape, |start, piece| piece.iter_mut().enumerate().for_each(|(i, x)| *x = entry(start + i)))
}

/// A copy of `values` with `shape`.
pub(crate) fn shaped<'py, T: Element + Copy, D: Dimension>(
    py: Python<'py>,
    values: &[T],
    shape: impl IntoDimension<Dim = D>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    filled(py, shape, |start, piece| piece.copy_from_slice(&values[start..start + piece.len()]))
}

/// The numbers of a contiguous array: a copy, since another thread may write to the array while the core reads.
pub(crate) fn copied<D: Dimension>(py: Python<'_>, array: &PyReadonlyArray<'_, f64, D>) -> PyResult<Vec<f64>> {
    memory::copy("the inputs of a batch", array.as_slice()?).map_err(|none| errors::memory(py, none))
}
