//! `Cells`: a certified map in the making.

use std::sync::{Arc, Mutex, PoisonError};

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use tadcore::cells::{Leaf, Map, Region, Verdict};
use tadcore::policy::Policy;

use super::arrays::entries;
use super::game::Game;
use super::guard::guarded;
use super::inputs::Starts;
use super::stop::Stop;
use super::{detach, errors};

/// Cells of one player's start from which every game ends alike, and those of which that is not known.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct Cells {
    policy: Arc<Policy>,
    map: Mutex<Map>,
}

/// The code of a verdict: an outcome's, or −1 too fine, −2 past the budget, −3 diverges.
fn code(verdict: Verdict) -> i8 {
    match verdict {
        Verdict::Proved(outcome) => outcome.code(),
        Verdict::Fine => -1,
        Verdict::Budget => -2,
        Verdict::Diverges => -3,
    }
}

impl Cells {
    fn with<T>(&self, read: impl FnOnce(&mut Map) -> T) -> T {
        read(&mut self.map.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Cells {
    /// A map that has not begun; `low` and `high` are the corners of the region, `player` the row that varies.
    #[new]
    #[pyo3(signature = (game, positions, visibility_radii, capture_radii, *, player, low, high, resolution, budget))]
    // A keyword for each part of a region.
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        game: &Game,
        positions: PyReadonlyArray2<'_, f64>,
        visibility_radii: PyReadonlyArray1<'_, f64>,
        capture_radii: PyReadonlyArray1<'_, f64>,
        player: usize,
        low: [f64; 2],
        high: [f64; 2],
        resolution: f64,
        budget: usize,
    ) -> PyResult<Self> {
        guarded(|| {
            let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
            let policy = game.policy(py)?;
            let region = Region { setup: starts.setup(), player, low, high };
            let map = Map::new(&policy, &region, resolution, budget)
                .map_err(|error| errors::run(py, policy.game(), error))?;
            Ok(Self { policy, map: Mutex::new(map) })
        })
    }

    /// Goes through the next cells, at most so many; how many it were. Stopped, the map is as before.
    #[pyo3(signature = (cells, *, threads=None, stop=None))]
    fn advance(&self, py: Python<'_>, cells: usize, threads: Option<usize>, stop: Option<&Stop>) -> PyResult<usize> {
        guarded(|| {
            let token = stop.map(|stop| stop.token.clone()).unwrap_or_default();
            detach::stoppable(py, token, |cancel| self.with(|map| map.advance(&self.policy, cells, threads, cancel)))?
                .map_err(|error| errors::run(py, self.policy.game(), error))
        })
    }

    /// Whether every cell is settled.
    #[getter]
    fn done(&self) -> bool {
        self.with(|map| map.is_done())
    }

    /// Cells looked at, and steps of their histories.
    #[getter]
    fn counts(&self) -> (u64, u64) {
        self.with(|map| map.counts())
    }

    /// The settled cells: corners (L, 4) as x and y of the lower left, then of the upper right; level, kind (−1 not known at
    /// the least size, −2 past the budget, −3 diverges), defender.
    #[allow(clippy::type_complexity)]
    fn leaves<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray1<u8>>,
        Bound<'py, PyArray1<i8>>,
        Bound<'py, PyArray1<i32>>,
    )> {
        guarded(|| {
            self.with(|map| {
                let leaves = map.leaves();
                let corner = |leaf: &Leaf, e: usize| if e < 2 { leaf.low[e] } else { leaf.high[e - 2] };
                let defender = |leaf: &Leaf| match leaf.verdict {
                    Verdict::Proved(outcome) => outcome.defender(),
                    _ => -1,
                };
                Ok((
                    entries(py, (leaves.len(), 4), |e| corner(&leaves[e / 4], e % 4))?,
                    entries(py, leaves.len(), |i| u8::try_from(leaves[i].level).unwrap_or(u8::MAX))?,
                    entries(py, leaves.len(), |i| code(leaves[i].verdict))?,
                    entries(py, leaves.len(), |i| defender(&leaves[i]))?,
                ))
            })
        })
    }
}
