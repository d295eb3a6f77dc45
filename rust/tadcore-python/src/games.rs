//! `simulate_games`: trials that each have a game of their own.

use numpy::{PyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tadcore::ensemble::Between;
use tadcore::ensemble::games::{GameEnd, run_games};
use tadcore::error::GameError;
use tadcore::game::{Game, Grid, Interaction, Weights};

use super::arrays::{copied, entries};
use super::guard::guarded;
use super::inputs::Starts;
use super::stop::Stop;
use super::{detach, errors, inputs};

/// The code of a game without an equilibrium, after those of outcomes.
const NO_EQUILIBRIUM: i8 = 3;

/// A game from its row of numbers; `simulate_games` says in which order they are.
fn game(interaction: Interaction, n: usize, row: &[f64]) -> Result<Game, GameError> {
    let (single, teams) = row.split_at(9);
    let (team, gamma) = teams.split_at(5 * n);
    let of = |group: usize| team[group * n..(group + 1) * n].to_vec();
    let own = |group: usize| if interaction == Interaction::I1 { of(group) } else { Vec::new() };
    let weights = Weights {
        r_tau: single[2],
        r_a: single[3],
        q_atau: single[4],
        f_atau: single[5],
        q_taua: single[6],
        f_taua: single[7],
        lambda: single[8],
        r_d: of(0),
        q_ad: of(1),
        f_ad: of(2),
        q_da: own(3),
        f_da: own(4),
        gamma: gamma.to_vec(),
    };
    Game::new(interaction, weights, Grid::new(single[0], single[1])?)
}

/// Outcomes of runs whose weights, horizons or steps differ, one row of numbers for each: horizon, step, r_τ, r_a,
/// q_{aτ}, f_{aτ}, q_{τa}, f_{τa}, λ; then of all defenders r_d, q_{ad}, f_{ad}, q_{da}, f_{da}; then γ. What does not
/// belong to the interaction is not read. Kind (3 where there is no equilibrium), defender, time, grid index, whether
/// the game diverged, and whether it passed within a radius.
#[pyfunction]
#[pyo3(signature = (interaction, numbers, positions, visibility_radii, capture_radii, *, continuous=false, passes=false,
    threads=None, stop=None))]
// A keyword for each rule.
#[allow(clippy::type_complexity, clippy::too_many_arguments)]
pub(crate) fn simulate_games<'py>(
    py: Python<'py>,
    interaction: &str,
    numbers: PyReadonlyArray2<'py, f64>,
    positions: PyReadonlyArray3<'py, f64>,
    visibility_radii: PyReadonlyArray2<'py, f64>,
    capture_radii: PyReadonlyArray2<'py, f64>,
    continuous: bool,
    passes: bool,
    threads: Option<usize>,
    stop: Option<&Stop>,
) -> PyResult<(
    Bound<'py, PyArray1<i8>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
)> {
    guarded(|| {
        let interaction = inputs::interaction(interaction)?;
        let (trials, players, _) = positions.as_array().dim();
        let n = players.saturating_sub(2);
        let width = 9 + 5 * n + interaction.terms();
        if numbers.as_array().dim() != (trials, width) {
            return Err(PyValueError::new_err(format!("numbers must have the shape ({trials}, {width})")));
        }
        let numbers = copied(py, &numbers)?;
        let games: Vec<Game> = numbers
            .chunks_exact(width)
            .map(|row| game(interaction, n, row))
            .collect::<Result<_, _>>()
            .map_err(|error| errors::game(py, error))?;
        let starts = Starts::copied(py, &positions, &visibility_radii, &capture_radii)?;
        let token = stop.map(|stop| stop.token.clone()).unwrap_or_default();
        let ends = detach::stoppable(py, token, |cancel| {
            let between = Between { termination: inputs::termination(continuous), passes };
            run_games(&games, &starts.batch(), between, threads, cancel)
        })?;
        let ends = match (ends, games.first()) {
            (Ok(ends), _) => ends,
            (Err(error), Some(first)) => return Err(errors::run(py, first, error)),
            (Err(error), None) => return Err(PyValueError::new_err(error.to_string())),
        };
        let played = |i: usize| match ends[i] {
            GameEnd::Played { end, time } => Some((end, time)),
            GameEnd::NoEquilibrium { .. } => None,
        };
        Ok((
            entries(py, ends.len(), |i| played(i).map_or(NO_EQUILIBRIUM, |(end, _)| end.outcome.code()))?,
            entries(py, ends.len(), |i| played(i).map_or(-1, |(end, _)| end.outcome.defender()))?,
            entries(py, ends.len(), |i| played(i).map_or(0.0, |(_, time)| time))?,
            entries(py, ends.len(), |i| played(i).map_or(0, |(end, _)| end.step as i64 + i64::from(end.after > 0.0)))?,
            entries(py, ends.len(), |i| played(i).is_some_and(|(end, _)| end.diverged))?,
            entries(py, ends.len(), |i| played(i).is_some_and(|(end, _)| end.passed))?,
        ))
    })
}
