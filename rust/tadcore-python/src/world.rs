//! `World`: what a run is given besides positions and radii.

use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tadcore::network::Frame;
use tadcore::random::Begin;
use tadcore::simulation::{Communication, World as CoreWorld};

use super::errors;
use super::guard::guarded;
use super::inputs::numbers;

/// What may fail, who talks and who is shaken; checked.
#[pyclass(frozen, module = "tadcore._core")]
pub(crate) struct World {
    world: CoreWorld,
}

impl World {
    pub(crate) fn core(&self) -> &CoreWorld {
        &self.world
    }
}

fn begin(stationary: bool) -> Begin {
    if stationary { Begin::Stationary } else { Begin::Up }
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (*, mean_time_to_failure, mean_time_to_repair, mean_time_detected, mean_time_missed, stationary,
        link_radius=None, relays=None, common_frame=false, link_mean_time_up=None, link_mean_time_down=None,
        link_stationary=false, disturbance))]
    // A keyword for each field.
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        mean_time_to_failure: PyReadonlyArray1<'_, f64>,
        mean_time_to_repair: PyReadonlyArray1<'_, f64>,
        mean_time_detected: PyReadonlyArray1<'_, f64>,
        mean_time_missed: PyReadonlyArray1<'_, f64>,
        stationary: PyReadonlyArray1<'_, bool>,
        link_radius: Option<Vec<Option<f64>>>,
        relays: Option<i64>,
        common_frame: bool,
        link_mean_time_up: Option<PyReadonlyArray1<'_, f64>>,
        link_mean_time_down: Option<PyReadonlyArray1<'_, f64>>,
        link_stationary: bool,
        disturbance: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        guarded(|| {
            let given = [
                ("relays", relays.is_some()),
                ("common_frame", common_frame),
                ("link_mean_time_up", link_mean_time_up.is_some()),
                ("link_mean_time_down", link_mean_time_down.is_some()),
                ("link_stationary", link_stationary),
            ];
            let communication = match link_radius {
                None => match given.into_iter().find(|(_, is)| *is) {
                    None => None,
                    Some((name, _)) => {
                        let text = format!("{name} is given, but without link_radius nobody talks");
                        return Err(PyValueError::new_err(text));
                    }
                },
                Some(radius) => {
                    let always = vec![f64::INFINITY; radius.len()];
                    let times = |given: Option<PyReadonlyArray1<'_, f64>>| {
                        given.map_or_else(|| always.clone(), |times| numbers(&times))
                    };
                    Some(Communication {
                        relays,
                        frame: if common_frame { Frame::Common } else { Frame::Relative },
                        mean_time_up: times(link_mean_time_up),
                        mean_time_down: times(link_mean_time_down),
                        begin: begin(link_stationary),
                        radius,
                    })
                }
            };
            let world = CoreWorld {
                mean_time_to_failure: numbers(&mean_time_to_failure),
                mean_time_to_repair: numbers(&mean_time_to_repair),
                mean_time_detected: numbers(&mean_time_detected),
                mean_time_missed: numbers(&mean_time_missed),
                begin: stationary.as_array().iter().map(|&is| begin(is)).collect(),
                communication,
                disturbance: numbers(&disturbance),
            };
            world.check().map_err(|error| errors::game(py, error))?;
            Ok(Self { world })
        })
    }
}
