//! Disturbances: after the drift of a step, every position is shaken on its own.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ξ_p | [`normal`] of A or B of [`Purpose::Disturbance`] | standard normal, a number for each axis |
//! | s_p | `spread` | ς_p √δ |
//! | z_i + (s_i ξ_i − s_a ξ_a), X_a + s_a ξ_a | [`shake`] | the state after the step |

use crate::random::{Draws, Purpose, normal};

/// Writes s_p ξ_p of the step from t_k into `added`, (n + 2) × dim; a player without disturbance draws nothing.
pub(crate) fn draw(spread: &[f64], draws: &Draws, k: usize, dim: usize, added: &mut [f64]) {
    for (p, (row, &s)) in added.chunks_exact_mut(dim).zip(spread).enumerate() {
        row.fill(0.0);
        if s == 0.0 {
            continue;
        }
        for (pair, axes) in row.chunks_mut(2).enumerate() {
            let both = draws.uniforms(Purpose::Disturbance(pair as u8), p as u32, k as u32);
            axes.iter_mut().zip(both).for_each(|(x, u)| *x = s * normal(u));
        }
    }
}

/// Adds what was drawn to the state and to the attacker's position.
pub(crate) fn shake(added: &[f64], dim: usize, z: &mut [f64], attacker: &mut [f64]) {
    let (players, own) = added.split_at(added.len() - dim);
    for (row, by) in z.chunks_exact_mut(dim).zip(players.chunks_exact(dim)) {
        for (x, (by, own)) in row.iter_mut().zip(by.iter().zip(own)) {
            *x += by - own;
        }
    }
    attacker.iter_mut().zip(own).for_each(|(x, own)| *x += own);
}
