//! The rules every number of a game obeys, in the words of the scenario's fields.

use super::{Interaction, Weights};
use crate::error::GameError;

/// Whether a number is positive and finite, as weights, times and capture radii are.
pub(crate) fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

pub(crate) fn positive(field: &str, value: f64) -> Result<(), GameError> {
    rule(field, value, is_positive(value), "a positive finite number")
}

/// What a weight may be: far beyond any game, and such that Θ, of the order of (P²/r)², stays within a double.
pub(crate) const WEIGHTS: (f64, f64) = (1e-30, 1e30);
/// The largest coordinate: its square, and a cost, stay within a double.
pub(crate) const FARTHEST: f64 = 1e100;
/// The least visibility radius, relative to the largest distance from the attacker along an axis: positions relative to the
/// attacker are rounded by a 10⁻¹⁶th of that, and so is every distance between two other players.
pub(crate) const FINEST: f64 = 1e-12;
/// How far a player may be driven, and how fast, within a run: beyond it a cost is no double any more.
pub(crate) const BEYOND: f64 = 1e120;
/// The most memory that P on the grid and the empty tables may take.
const MOST_BYTES: u128 = 16 << 30;
/// What the tables take for each instant before they hold anything, at most.
const TABLE_BYTES: u128 = 512;

fn weight(field: &str, value: f64) -> Result<(), GameError> {
    positive(field, value)?;
    rule(field, value, (WEIGHTS.0..=WEIGHTS.1).contains(&value), "between 1e-30 and 1e30")
}

/// Refuses a game whose equilibrium would not fit into [`MOST_BYTES`], before anything is allocated.
pub(crate) fn size(interaction: Interaction, n: usize, steps: usize) -> Result<(), GameError> {
    let groups = if interaction == Interaction::I1 { 3 } else { 1 };
    let (players, instants) = (n as u128 + 1, steps as u128 + 1);
    let bytes = instants * (8 * groups * players * players + TABLE_BYTES);
    if bytes > MOST_BYTES { Err(GameError::Size { players: n + 1, steps, gib: (bytes >> 30) as u64 }) } else { Ok(()) }
}

fn unit(field: &str, value: f64) -> Result<(), GameError> {
    rule(field, value, (0.0..=1.0).contains(&value), "in [0, 1]")
}

pub(crate) fn rule(field: &str, value: f64, holds: bool, rule: &'static str) -> Result<(), GameError> {
    if holds { Ok(()) } else { Err(GameError::Value { field: field.to_owned(), value, rule }) }
}

fn length(field: &'static str, found: usize, expected: usize) -> Result<(), GameError> {
    if found == expected { Ok(()) } else { Err(GameError::Length { field, found, expected }) }
}

/// Checks every weight of `w` for an `interaction` of n defenders.
pub(crate) fn weights(interaction: Interaction, n: usize, w: &Weights) -> Result<(), GameError> {
    rule("defenders", n as f64, n >= 1, "at least one defender")?;
    let both: [(&'static str, &[f64]); 3] =
        [("control_weight", &w.r_d), ("evasion_running_weight", &w.q_ad), ("evasion_terminal_weight", &w.f_ad)];
    let first: [(&'static str, &[f64]); 2] = [("running_weight", &w.q_da), ("terminal_weight", &w.f_da)];
    let with_own = if interaction == Interaction::I1 { &first[..] } else { &[] };
    for &(field, values) in both.iter().chain(with_own) {
        length(field, values.len(), n)?;
        for (i, &v) in values.iter().enumerate() {
            weight(&format!("defenders[{i}].{field}"), v)?;
        }
    }
    weight("target.control_weight", w.r_tau)?;
    weight("attacker.control_weight", w.r_a)?;
    weight("attacker.target_running_weight", w.q_atau)?;
    weight("attacker.target_terminal_weight", w.f_atau)?;
    if interaction == Interaction::I1 {
        weight("target.running_weight", w.q_taua)?;
        weight("target.terminal_weight", w.f_taua)?;
        unit("attacker.evasion", w.lambda)?;
    }
    length("synthesis_weights", w.gamma.len(), interaction.terms())?;
    for (i, &g) in w.gamma.iter().enumerate() {
        unit(&format!("synthesis_weights[{i}]"), g)?;
    }
    rule("synthesis_weights", 0.0, w.gamma.iter().any(|&g| g > 0.0), "positive in at least one entry")
}
