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

use super::{Coefficients, Precisions, Scale, TABULATED_UP_TO};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::game::{Game, Interaction};
use crate::memory::{copy, zeros};
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
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn new(game: &Game, p: &[f64], cancel: &CancelToken) -> Result<Self, Stopped> {
        let (r, gamma) = (game.constrained_control_weights(), game.weights().gamma.clone());
        Self::from_parts(game.interaction(), r, gamma, p, cancel)
    }

    /// The same from its parts: control weights of the constrained players, γ and the Riccati matrices.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    ///
    /// # Panics
    /// When `p` does not hold the interaction's matrices (a programming error).
    pub fn from_parts(
        interaction: Interaction,
        r: Vec<f64>,
        gamma: Vec<f64>,
        p: &[f64],
        cancel: &CancelToken,
    ) -> Result<Self, Stopped> {
        let rows = r.len();
        let size = if interaction == Interaction::I1 { rows + 1 } else { rows };
        let groups = if interaction == Interaction::I1 { 3 } else { 1 };
        assert_eq!(p.len(), groups * size * size, "Riccati matrices of the wrong size");
        let own = &p[..size * size];
        let sign = if interaction == Interaction::I1 { -1.0 } else { 1.0 };
        let mut fne = zeros(WHAT, rows * size)?;
        for (e, f) in fne.iter_mut().enumerate() {
            *f = sign * own[e] / r[e / size];
        }
        let mut target = zeros(WHAT, size * size)?;
        for i in 0..rows {
            cancel.check()?;
            let f = &fne[i * size..(i + 1) * size];
            for a in 0..size {
                for b in 0..size {
                    target[a * size + b] += r[i] * f[a] * f[b];
                }
            }
        }
        let mut coupling: Vec<Vec<f64>> = Vec::new();
        for group in (1..groups).filter(|&p| gamma[p] > 0.0) {
            let scale = gamma[group].sqrt();
            let mut w = copy(WHAT, &p[group * size * size..][..rows * size])?;
            w.iter_mut().for_each(|x| *x *= scale);
            coupling.push(w);
        }
        let mut gram = zeros(WHAT, rows * rows)?;
        for w in &coupling {
            for i in 0..rows {
                cancel.check()?;
                for j in 0..rows {
                    gram[i * rows + j] += (0..size).map(|a| w[i * size + a] * w[j * size + a]).sum::<f64>();
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
        let quadratic = [1.0, -1.0].map(|sign| {
            if size > TABULATED_UP_TO { Vec::new() } else { constant(size, sign, &coupling, &gram, &closeness) }
        });
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
            Coefficients { size, rows, first, strength, r, fne, target, coupling, gram, closeness, quadratic, scale };
        Ok(Self { interaction, size, rows, gamma, theta: double.into() })
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
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory, or `cancel` was raised.
    pub fn terms(&self, p: &[f64], g: &[f64], cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
        let (n, m, of) = (self.size, self.rows, &self.theta.double);
        let mut delta = copy(WHAT, g)?;
        delta.iter_mut().zip(&of.fne).for_each(|(d, f)| *d -= f);
        let closeness = |rows: std::ops::Range<usize>| -> f64 {
            rows.flat_map(|i| delta[i * n..(i + 1) * n].iter().map(move |d| (of.r[i] * d).powi(2))).sum()
        };
        let mut product = zeros(WHAT, n * n)?;
        multiply(n, Some(&of.r), g, g, &mut product, cancel)?;
        let quadratic = product.iter().zip(&of.target).map(|(gain, m)| (gain - m).powi(2)).sum();
        if self.interaction == Interaction::I2 {
            return Ok(vec![quadratic, closeness(0..m - 1), closeness(m - 1..m)]);
        }
        let mut coupled = |group: usize| -> Result<f64, Stopped> {
            multiply(n, None, &p[group * n * n..][..m * n], &delta, &mut product, cancel)?;
            let pair = |e: usize| product[e] + product[e % n * n + e / n];
            Ok((0..n * n).map(|e| pair(e).powi(2)).sum())
        };
        Ok(vec![quadratic, coupled(1)?, coupled(2)?, closeness(0..m)])
    }

    /// Θ = γ · terms.
    #[must_use]
    pub fn weigh(&self, terms: &[f64]) -> f64 {
        self.gamma.iter().zip(terms).map(|(g, t)| g * t).sum()
    }
}

/// out = Σ_i r_i left_iᵀ right_i, rows of N each; without r where there is none.
fn multiply(
    n: usize,
    r: Option<&[f64]>,
    left: &[f64],
    right: &[f64],
    out: &mut [f64],
    cancel: &CancelToken,
) -> Result<(), Stopped> {
    out.fill(0.0);
    for (i, (left, right)) in left.chunks_exact(n).zip(right.chunks_exact(n)).enumerate() {
        cancel.check()?;
        for (row, &l) in out.chunks_exact_mut(n).zip(left) {
            let l = r.map_or(l, |r| r[i] * l);
            row.iter_mut().zip(right).for_each(|(x, r)| *x += l * r);
        }
    }
    Ok(())
}

/// What asks for memory here.
const WHAT: &str = "the synthesis problem of one instant";

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
