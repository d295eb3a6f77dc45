//! What callers give by words and arrays, as the core takes it.

use numpy::ndarray::{ArrayView2, Dimension};
use numpy::{PyReadonlyArray, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tadcore::ensemble::Batch;
use tadcore::game::{Criterion, Interaction};
use tadcore::network::Topology;
use tadcore::policy::GainKind;
use tadcore::simulation::{Setup, Termination};
use tadcore::synthesis::{Method, Options};

use super::arrays::copied;

fn unknown(option: &str, value: &str, rule: &str) -> PyErr {
    PyValueError::new_err(format!("{option} is {value:?}, but it must be {rule}"))
}

/// Who is constrained.
pub(crate) fn interaction(name: &str) -> PyResult<Interaction> {
    match name {
        "I1" => Ok(Interaction::I1),
        "I2" => Ok(Interaction::I2),
        other => Err(unknown("interaction", other, "I1 or I2")),
    }
}

/// What the gains minimise.
pub(crate) fn criterion(name: &str) -> PyResult<Criterion> {
    match name {
        "paper" => Ok(Criterion::Paper),
        "component" => Ok(Criterion::Component),
        other => Err(unknown("criterion", other, "paper or component")),
    }
}

/// What the gains are made of.
pub(crate) fn gain_kind(name: &str) -> PyResult<GainKind> {
    match name {
        "scalar" => Ok(GainKind::Scalar),
        "turning" => Ok(GainKind::Turning),
        "mirror" => Ok(GainKind::Mirror),
        other => Err(unknown("gains", other, "scalar, turning or mirror")),
    }
}

/// When a game ends.
pub(crate) fn termination(continuous: bool) -> Termination {
    if continuous { Termination::Continuous } else { Termination::Sampled }
}

/// How a synthesis is solved; none for the way in which runs solve it.
pub(crate) fn options(method: &str, max_iterations: Option<usize>) -> PyResult<Option<Options>> {
    let mut options = match method {
        "newton" => max_iterations.map(|_| Options::default()),
        "restarts" => Some(Options::default()),
        "descent" => Some(Options::new(Method::Descent)),
        other => return Err(unknown("method", other, "newton, restarts or descent")),
    };
    if let (Some(options), Some(limit)) = (&mut options, max_iterations) {
        options.max_iterations = limit;
    }
    Ok(options)
}

/// A network from its adjacency, m × N.
pub(crate) fn topology(adjacency: ArrayView2<'_, bool>) -> Topology {
    let (m, n) = adjacency.dim();
    Topology::from_fn(m, n, |i, j| adjacency[(i, j)])
}

/// The numbers of a short array, whatever its strides.
pub(crate) fn numbers(array: &PyReadonlyArray1<'_, f64>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}

/// Positions and radii of one run or of many, copied.
pub(crate) struct Starts {
    dim: usize,
    positions: Vec<f64>,
    visibility: Vec<f64>,
    capture: Vec<f64>,
}

impl Starts {
    /// From contiguous arrays whose last axes are those of the plane or space, of the constrained players, and of the
    /// defenders and the attacker.
    pub(crate) fn copied<P: Dimension, R: Dimension>(
        py: Python<'_>,
        positions: &PyReadonlyArray<'_, f64, P>,
        visibility_radii: &PyReadonlyArray<'_, f64, R>,
        capture_radii: &PyReadonlyArray<'_, f64, R>,
    ) -> PyResult<Self> {
        Ok(Self {
            dim: positions.as_array().shape().last().copied().unwrap_or_default(),
            positions: copied(py, positions)?,
            visibility: copied(py, visibility_radii)?,
            capture: copied(py, capture_radii)?,
        })
    }

    /// As the start of one run.
    pub(crate) fn setup(&self) -> Setup<'_> {
        let Self { dim, positions, visibility, capture } = self;
        Setup { dim: *dim, positions, visibility, capture }
    }

    /// As the starts of many.
    pub(crate) fn batch(&self) -> Batch<'_> {
        let Self { dim, positions, visibility, capture } = self;
        Batch { dim: *dim, positions, visibility, capture }
    }
}
