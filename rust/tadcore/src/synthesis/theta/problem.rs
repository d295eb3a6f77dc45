//! The data of one instant: what Θ compares the gains with.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | F | `fne` | FNE rows: −R_d⁻¹B_dᵀP_d (I1), R⁻¹P (I2); m × N |
//! | M = FᵀRF | `target` | P_dS_dP_d (I1), PS_dP + PS_τP (I2); N × N |
//! | W_p | `coupling` | √γ · P_pB_d for p = τ, a, stored by columns: row i is √γ P_p[i, :]; I1 only |
//! | R | `r` | control weights of the constrained players |
//!
//! With Δ = G − F every residual of the paper reads (reduced; a block norm is `dim` times as large):
//! S = RΔ (S₁, or S₂ and S₃ stacked), ±ΔQ = GᵀRG − M, ΔQ_p = −(P_pB_dΔ + ·ᵀ), so that
//! Θ = γ₁‖GᵀRG − M‖² + Σ_p‖W_pΔ + (W_pΔ)ᵀ‖² + Σ_i c_i‖Δ_i‖², c_i = γ r_i² (eq:errfun1, eq:errfun2).

use super::{Coefficients, Precisions, Scale};
use crate::game::{Game, Interaction};
use crate::simd::{norm, sum_of_squares};

/// Everything Θ needs to know of one instant t_k.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub(crate) interaction: Interaction,
    pub(crate) size: usize,
    pub(crate) rows: usize,
    pub(crate) gamma: Vec<f64>,
    /// What Θ is made of.
    pub(crate) theta: Precisions,
}

impl Problem {
    /// The problem of `game` at an instant whose Riccati matrices are `p` (all groups, N × N each, one after another).
    #[must_use]
    pub fn new(game: &Game, p: &[f64]) -> Self {
        let (r, gamma) = (game.constrained_control_weights(), game.weights().gamma.clone());
        Self::from_parts(game.interaction(), r, gamma, p)
    }

    /// The same from its parts: control weights of the constrained players, γ and the Riccati matrices.
    ///
    /// # Panics
    /// When `p` does not hold the interaction's matrices (a programming error).
    #[must_use]
    pub fn from_parts(interaction: Interaction, r: Vec<f64>, gamma: Vec<f64>, p: &[f64]) -> Self {
        let rows = r.len();
        let size = if interaction == Interaction::I1 { rows + 1 } else { rows };
        let groups = if interaction == Interaction::I1 { 3 } else { 1 };
        assert_eq!(p.len(), groups * size * size, "Riccati matrices of the wrong size");
        let own = &p[..size * size];
        let sign = if interaction == Interaction::I1 { -1.0 } else { 1.0 };
        let fne: Vec<f64> = (0..rows * size).map(|e| sign * own[e] / r[e / size]).collect();
        let mut target = vec![0.0; size * size];
        for i in 0..rows {
            let f = &fne[i * size..(i + 1) * size];
            for a in 0..size {
                for b in 0..size {
                    target[a * size + b] += r[i] * f[a] * f[b];
                }
            }
        }
        let coupling: Vec<Vec<f64>> = (1..groups)
            .filter(|&p| gamma[p] > 0.0)
            .map(|group| {
                let matrix = &p[group * size * size..(group + 1) * size * size];
                let scale = gamma[group].sqrt();
                (0..rows * size).map(|e| scale * matrix[e]).collect()
            })
            .collect();
        let mut coupling_gram = vec![0.0; rows * rows];
        for w in &coupling {
            for i in 0..rows {
                for j in 0..rows {
                    coupling_gram[i * rows + j] += (0..size).map(|a| w[i * size + a] * w[j * size + a]).sum::<f64>();
                }
            }
        }
        let closeness: Vec<f64> = (0..rows)
            .map(|i| {
                let term = match interaction {
                    Interaction::I1 => 3,
                    Interaction::I2 => 1 + usize::from(i + 1 == rows),
                };
                gamma[term] * r[i] * r[i]
            })
            .collect();
        let quadratic = [1.0, -1.0].map(|sign| constant(size, sign, &coupling, &coupling_gram, &closeness));
        let largest = |numbers: &[f64]| numbers.iter().fold(0.0, |a: f64, &b| a.max(b));
        let (size_of_f, size_of_m) = (norm(&fne), norm(&target));
        let of_w: f64 = coupling.iter().map(|w| sum_of_squares(w)).sum();
        let of_c = largest(&closeness);
        let scale = Scale {
            fne: size_of_f,
            target: size_of_m,
            coupling: of_w,
            closeness: of_c,
            quartic: 4.0 * gamma[0] * largest(&r),
            value: gamma[0] * size_of_m * size_of_m + (4.0 * of_w + of_c) * size_of_f * size_of_f,
        };
        let strength = r.iter().map(|r| 4.0 * gamma[0] * r).collect();
        let first = gamma[0];
        let double =
            Coefficients { size, rows, first, strength, r, fne, target, coupling, closeness, quadratic, scale };
        Self { interaction, size, rows, gamma, theta: double.into() }
    }

    /// N.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// m, the constrained players.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The FNE rows F, m × N.
    #[must_use]
    pub fn fne(&self) -> &[f64] {
        &self.theta.double.fne
    }

    /// The squared residual norms of the gain rows `g`, unweighted and reduced, in the order of γ:
    /// ‖ΔQ_d‖², ‖ΔQ_τ‖², ‖ΔQ_a‖², ‖S₁‖² in I1 (`p`: the Riccati matrices of the instant) and ‖ΔQ‖², ‖S₂‖², ‖S₃‖² in I2.
    #[must_use]
    pub fn terms(&self, p: &[f64], g: &[f64]) -> Vec<f64> {
        let (n, m, of) = (self.size, self.rows, &self.theta.double);
        let delta: Vec<f64> = g.iter().zip(&of.fne).map(|(g, f)| g - f).collect();
        let closeness = |rows: std::ops::Range<usize>| -> f64 {
            rows.flat_map(|i| delta[i * n..(i + 1) * n].iter().map(move |d| (of.r[i] * d).powi(2))).sum()
        };
        let mut quadratic = 0.0;
        for a in 0..n {
            for b in 0..n {
                let gain: f64 = (0..m).map(|i| of.r[i] * g[i * n + a] * g[i * n + b]).sum();
                quadratic += (gain - of.target[a * n + b]).powi(2);
            }
        }
        match self.interaction {
            Interaction::I2 => vec![quadratic, closeness(0..m - 1), closeness(m - 1..m)],
            Interaction::I1 => {
                let coupled = |group: usize| -> f64 {
                    let matrix = &p[group * n * n..(group + 1) * n * n];
                    let product =
                        |a: usize, b: usize| -> f64 { (0..m).map(|i| matrix[i * n + a] * delta[i * n + b]).sum() };
                    let mut sum = 0.0;
                    for a in 0..n {
                        for b in 0..n {
                            sum += (product(a, b) + product(b, a)).powi(2);
                        }
                    }
                    sum
                };
                vec![quadratic, coupled(1), coupled(2), closeness(0..m)]
            }
        }
    }

    /// Θ = γ · terms.
    #[must_use]
    pub fn weigh(&self, terms: &[f64]) -> f64 {
        self.gamma.iter().zip(terms).map(|(g, t)| g * t).sum()
    }
}

/// The constant part of the Hessian, by the sign of its second term.
fn constant(n: usize, sign: f64, coupling: &[Vec<f64>], gram: &[f64], closeness: &[f64]) -> Vec<f64> {
    let m = closeness.len();
    let width = m * n;
    let mut out = vec![0.0; width * width];
    for i in 0..m {
        for j in 0..=i {
            let own = if i == j { 2.0 * closeness[i] } else { 0.0 };
            let diagonal = 4.0 * gram[i * m + j] + own;
            for a in 0..n {
                let row = &mut out[(i * n + a) * width + j * n..][..n];
                for w in coupling {
                    let factor = 4.0 * sign * w[j * n + a];
                    for (x, wi) in row.iter_mut().zip(&w[i * n..(i + 1) * n]) {
                        *x += factor * wi;
                    }
                }
                row[a] += diagonal;
            }
        }
    }
    out
}
