//! The closed loop over one step: ż = C z with the feedback of every player held at t_k (zero-order hold).
//!
//! ż_i = u_i − u_a for each row i (B_d, B_τ and B_a written out), with u_i = g_i z for the constrained players, and
//! u_a = h_a z, u_a = −r_a⁻¹B_aᵀP_a z = r_a⁻¹(1ᵀP_a) z. In I1 the target's own row is −r_τ⁻¹P_τ[N, :].
//!
//! Gains A + iB that turn couple the two axes of the plane: u = Az + BJz, J a quarter turn of every row. Beside z stands
//! Jz then, and all rows have 2N entries, [a_i b_i]: with C = A + iB, J(Jz) = −z makes
//!
//! $$\frac{\mathrm{d}}{\mathrm{d}t}\begin{pmatrix} z \\ Jz \end{pmatrix} =
//!   \begin{pmatrix} A & B \\ -B & A \end{pmatrix} \begin{pmatrix} z \\ Jz \end{pmatrix},$$
//!
//! a loop that acts on both axes alike, as one of scalar gains does. For the mirror image A − iB of the gains −Jz stands
//! there.

use crate::game::{Game, Interaction};

/// The feedback of the players that see everything, as rows on z.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeRows {
    /// u_a = h_a z.
    pub attacker: Vec<f64>,
    /// u_τ = row · z in I1; `None` in I2, where the target is constrained.
    pub target: Option<Vec<f64>>,
}

impl FreeRows {
    /// The same on z and Jz.
    #[must_use]
    pub fn beside_turned(mut self) -> Self {
        let width = 2 * self.attacker.len();
        self.attacker.resize(width, 0.0);
        self.target.iter_mut().for_each(|row| row.resize(width, 0.0));
        self
    }
}

/// The rows [a_i b_i] on z and Jz, m × 2N, of gains A + iB, m × N each.
#[must_use]
pub fn beside_turned(rows: &[f64], turn: &[f64], n: usize) -> Vec<f64> {
    rows.chunks_exact(n).zip(turn.chunks_exact(n)).flat_map(|(a, b)| a.iter().chain(b)).copied().collect()
}

/// The rows of the unconstrained players at an instant with Riccati matrices `p` (all groups, one after another).
#[must_use]
pub fn free_rows(game: &Game, p: &[f64]) -> FreeRows {
    let n = game.size();
    let w = game.weights();
    let own = match game.interaction() {
        Interaction::I1 => &p[2 * n * n..3 * n * n],
        Interaction::I2 => &p[..n * n],
    };
    let attacker = (0..n).map(|j| (0..n).map(|i| own[i * n + j]).sum::<f64>() / w.r_a).collect();
    let target = (game.interaction() == Interaction::I1)
        .then(|| p[n * n + (n - 1) * n..2 * n * n].iter().map(|x| -x / w.r_tau).collect());
    FreeRows { attacker, target }
}

/// ‖C‖, the largest sum of a row.
#[must_use]
pub fn norm(c: &[f64], size: usize) -> f64 {
    c.chunks_exact(size).map(|row| row.iter().map(|x| x.abs()).sum()).fold(0.0, f64::max)
}

/// Writes C (N × N, row-major) for the gain rows `gains` (m × N); where all rows are on z and Jz, the 2N × 2N matrix of both.
pub fn matrix(free: &FreeRows, gains: &[f64], c: &mut [f64]) {
    let width = free.attacker.len();
    c[..gains.len()].copy_from_slice(gains);
    let mut known = gains.len();
    if let Some(target) = &free.target {
        known += width;
        c[gains.len()..known].copy_from_slice(target);
    }
    let (c, turned) = c.split_at_mut(known);
    for row in c.chunks_exact_mut(width) {
        for (x, a) in row.iter_mut().zip(&free.attacker) {
            *x -= a;
        }
    }
    for (row, out) in c.chunks_exact(width).zip(turned.chunks_exact_mut(width)) {
        let (a, b) = row.split_at(width / 2);
        out[width / 2..].copy_from_slice(a);
        out.iter_mut().zip(b).for_each(|(x, b)| *x = -b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beside_jz_a_complex_loop_is_a_real_one() {
        let free = FreeRows { attacker: vec![0.5, -1.0], target: Some(vec![2.0, 3.0]) }.beside_turned();
        let rows = beside_turned(&[1.0, 4.0], &[7.0, -2.0], 2);
        assert_eq!(rows, [1.0, 4.0, 7.0, -2.0]);
        let mut c = [0.0; 16];
        matrix(&free, &rows, &mut c);
        assert_eq!(c, [0.5, 5.0, 7.0, -2.0, 1.5, 4.0, 0.0, 0.0, -7.0, 2.0, 0.5, 5.0, 0.0, 0.0, 1.5, 4.0]);
    }
}
