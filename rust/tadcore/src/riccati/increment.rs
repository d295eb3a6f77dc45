//! Interaction I2: one exact step of P by the exponential of the Hamiltonian matrix, as in [`super::hamiltonian`].
//!
//! $$P^+ - P = (F + C^\top P - P Z) X^{-1}, \qquad Z = C + E P, \quad X = I + Z.$$
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | C, E, F | [`Level`]'s `c`, `e`, `f` | of one length of step, from the exponential |
//! | Zᵀ, then Xᵀ | `z` | what is eliminated |
//! | Gᵀ = F + PC − ZᵀP | `g` | the right-hand side, then (ΔP)ᵀ |

use crate::cancel::{CancelToken, raised};
use crate::simd::{Width, widened};

/// What a step of one length needs; matrices in rows, N × N.
pub(super) struct Level {
    /// cosh ωh − 1 and sinh(ωh)/ω.
    pub bound: (f64, f64),
    /// C = cosh(√(SQ) h) − I.
    pub c: Vec<f64>,
    /// h sinhc(√(SQ) h) S, symmetric.
    pub e: Vec<f64>,
    /// Q h sinhc(√(SQ) h), symmetric.
    pub f: Vec<f64>,
}

impl Level {
    /// Moves P, N × N, by this step; `z` and `g` hold a matrix and a row each.
    pub fn advance(&self, width: Width, n: usize, p: &mut [f64], z: &mut [f64], g: &mut [f64], cancel: &CancelToken) {
        match n {
            2 => advance_small::<2>(width, self, p, z, g),
            3 => advance_small::<3>(width, self, p, z, g),
            4 => advance_small::<4>(width, self, p, z, g),
            5 => advance_small::<5>(width, self, p, z, g),
            6 => advance_small::<6>(width, self, p, z, g),
            7 => advance_small::<7>(width, self, p, z, g),
            8 => advance_small::<8>(width, self, p, z, g),
            _ => advance_large(width, n, self, p, z, g, Some(cancel)),
        }
    }
}

/// P ← P + (F + Cᵀ P − P Z) X⁻¹; `z` and `g` are scratch, and so are `z_row` and `g_row`, n long: a row that is summed up
/// stays in registers where n is a constant. Once `cancel` is raised P is left unfinished.
#[inline(always)]
fn advance(
    n: usize,
    level: &Level,
    p: &mut [f64],
    (z, g): (&mut [f64], &mut [f64]),
    (z_row, g_row): (&mut [f64], &mut [f64]),
    cancel: Option<&CancelToken>,
) {
    let (c, e, f) = (&level.c[..n * n], &level.e[..n * n], &level.f[..n * n]);
    let (p, z, g) = (&mut p[..n * n], &mut z[..n * n], &mut g[..n * n]);
    let (z_row, g_row) = (&mut z_row[..n], &mut g_row[..n]);
    // Zᵀ = Cᵀ + P E in `z`; then Gᵀ = F + P C − Zᵀ P in `g`, so that the increment solves Xᵀ (ΔP)ᵀ = Gᵀ.
    for i in 0..n {
        if raised(cancel) {
            return;
        }
        for j in 0..n {
            z_row[j] = c[j * n + i];
            g_row[j] = f[i * n + j];
        }
        for k in 0..n {
            let left = p[i * n + k];
            for j in 0..n {
                z_row[j] += left * e[k * n + j];
                g_row[j] += left * c[k * n + j];
            }
        }
        for k in 0..n {
            let left = z_row[k];
            for j in 0..n {
                g_row[j] -= left * p[k * n + j];
            }
        }
        z_row[i] += 1.0;
        z[i * n..][..n].copy_from_slice(z_row);
        g[i * n..][..n].copy_from_slice(g_row);
    }
    // Elimination without pivoting: ‖Z‖₁ ≤ ½.
    for k in 0..n {
        if raised(cancel) {
            return;
        }
        let pivot = 1.0 / z[k * n + k];
        let (above, below) = z.split_at_mut((k + 1) * n);
        let (g_above, g_below) = g.split_at_mut((k + 1) * n);
        let (row, g_row) = (&above[k * n..], &g_above[k * n..]);
        for (r, g_r) in below.chunks_exact_mut(n).zip(g_below.chunks_exact_mut(n)) {
            let factor = r[k] * pivot;
            for j in k + 1..n {
                r[j] -= factor * row[j];
            }
            for j in 0..n {
                g_r[j] -= factor * g_row[j];
            }
        }
    }
    for k in (0..n).rev() {
        if raised(cancel) {
            return;
        }
        let pivot = 1.0 / z[k * n + k];
        let (above, below) = g.split_at_mut((k + 1) * n);
        let row = &mut above[k * n..];
        for (m, solved) in (k + 1..n).zip(below.chunks_exact(n)) {
            let factor = z[k * n + m];
            for j in 0..n {
                row[j] -= factor * solved[j];
            }
        }
        for j in 0..n {
            row[j] *= pivot;
        }
    }
    for i in 0..n {
        for j in 0..i {
            let half = 0.5 * (g[i * n + j] + g[j * n + i]);
            p[i * n + j] += half;
            p[j * n + i] += half;
        }
        p[i * n + i] += g[i * n + i];
    }
}

widened! {
    #[inline(never)]
    fn advance_small<V, const N: usize>(level: &Level, p: &mut [f64], z: &mut [f64], g: &mut [f64]) {
        advance(N, level, p, (z, g), (&mut [0.0; N], &mut [0.0; N]), None);
    }
}

widened! {
    #[inline(never)]
    fn advance_large<V>(
        n: usize,
        level: &Level,
        p: &mut [f64],
        z: &mut [f64],
        g: &mut [f64],
        cancel: Option<&CancelToken>,
    ) {
        let ((z, z_row), (g, g_row)) = (z.split_at_mut(n * n), g.split_at_mut(n * n));
        advance(n, level, p, (z, g), (z_row, g_row), cancel);
    }
}
