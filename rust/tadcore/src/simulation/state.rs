//! The state z as rows: made from positions and turned into them, and multiplied by a row of gains or of a transition.

use std::borrow::Cow;

use crate::policy::GainKind;

/// z from positions ordered d₁…d_n, target, attacker: every row less the attacker's.
pub fn relative_state(positions: &[f64], dim: usize, z: &mut Vec<f64>) {
    let (players, attacker) = positions.split_at(positions.len() - dim);
    z.clear();
    z.extend(players.chunks_exact(dim).flat_map(|row| row.iter().zip(attacker).map(|(x, a)| x - a)));
}

/// X from z and X_a, the inverse of [`relative_state`].
pub(super) fn positions<'a>(z: &'a [f64], attacker: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let players = z.chunks_exact(attacker.len()).flat_map(move |row| row.iter().zip(attacker).map(|(x, a)| x + a));
    players.chain(attacker.iter().copied())
}

/// What the rows of gains of some kind act on: z, beside it Jz for gains that turn, −Jz for their mirror images; J is a
/// quarter turn in the plane.
pub(crate) fn acted_on(z: &[f64], kind: GainKind) -> Cow<'_, [f64]> {
    let sign = match kind {
        GainKind::Scalar => return z.into(),
        GainKind::Turning => 1.0,
        GainKind::Mirror => -1.0,
    };
    let turned = z.chunks_exact(2).flat_map(|row| [-sign * row[1], sign * row[0]]);
    z.iter().copied().chain(turned).collect()
}

/// out = row · z.
pub(crate) fn apply(row: &[f64], z: &[f64], dim: usize, out: &mut [f64]) {
    out.fill(0.0);
    for (g, zj) in row.iter().zip(z.chunks_exact(dim)) {
        for (o, x) in out.iter_mut().zip(zj) {
            *o += g * x;
        }
    }
}
