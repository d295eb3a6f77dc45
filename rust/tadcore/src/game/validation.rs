//! The rules every number of a game obeys, in the words of the scenario's fields.

use super::{Interaction, Weights};
use crate::error::GameError;

pub(crate) fn positive(field: &str, value: f64) -> Result<(), GameError> {
    rule(field, value, value > 0.0 && value.is_finite(), "a positive finite number")
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
            positive(&format!("defenders[{i}].{field}"), v)?;
        }
    }
    positive("target.control_weight", w.r_tau)?;
    positive("attacker.control_weight", w.r_a)?;
    positive("attacker.target_running_weight", w.q_atau)?;
    positive("attacker.target_terminal_weight", w.f_atau)?;
    if interaction == Interaction::I1 {
        positive("target.running_weight", w.q_taua)?;
        positive("target.terminal_weight", w.f_taua)?;
        unit("attacker.evasion", w.lambda)?;
    }
    length("synthesis_weights", w.gamma.len(), interaction.terms())?;
    for (i, &g) in w.gamma.iter().enumerate() {
        unit(&format!("synthesis_weights[{i}]"), g)?;
    }
    rule("synthesis_weights", 0.0, w.gamma.iter().any(|&g| g > 0.0), "positive in at least one entry")
}
