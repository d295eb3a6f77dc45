//! The state z as rows: made from positions, and multiplied by a row of gains or of a transition.

/// z from positions ordered d₁…d_n, target, attacker: every row less the attacker's.
pub fn relative_state(positions: &[f64], dim: usize, z: &mut Vec<f64>) {
    let (players, attacker) = positions.split_at(positions.len() - dim);
    z.clear();
    z.extend(players.chunks_exact(dim).flat_map(|row| row.iter().zip(attacker).map(|(x, a)| x - a)));
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
