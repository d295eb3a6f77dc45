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
//!
//! γ is divided by the power of two that brings its largest entry into [1, 2): the search and its gains are bitwise the
//! same for γ and 2^k γ, and nothing underflows. Θ is reported in the scale of γ as given.

use super::{Coefficients, Precisions, Scale, TABULATED_UP_TO};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::game::{Criterion, Game, Interaction};
use crate::memory::{copy, zeros};
use crate::simd::{norm, sum_of_squares};

/// A term of Θ this small beside the others is lost in their rounding.
const LOST: f64 = 1e-15;
/// A weight on S this small beside the largest entry of γ, and a term of Θ this small beside the others, is faint: the
/// floor of the valley that it makes is too flat to be searched.
const FAINT: f64 = 1e-4;

/// Everything Θ needs to know of one instant t_k.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub(crate) interaction: Interaction,
    pub(crate) size: usize,
    pub(crate) rows: usize,
    /// Whether who knows everything plays the equilibrium.
    pub(crate) criterion: Criterion,
    pub(crate) gamma: Vec<f64>,
    /// γ is 2^`exponent` times what `theta` is made with.
    exponent: i32,
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
        Ok(Self::from_parts(game.interaction(), r, gamma, p, cancel)?.under(game.criterion()))
    }

    /// The same problem under another criterion.
    #[must_use]
    pub fn under(self, criterion: Criterion) -> Self {
        Self { criterion, ..self }
    }

    /// The same from its parts, under the paper's criterion: control weights of the constrained players, γ and the Riccati matrices.
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
        let exponent = exponent(gamma.iter().fold(0.0, |a: f64, &b| a.max(b)));
        let scaled: Vec<f64> = gamma.iter().map(|&g| times_power(g, -exponent)).collect();
        let mut coupling: Vec<Vec<f64>> = Vec::new();
        for group in (1..groups).filter(|&p| scaled[p] > 0.0) {
            let scale = scaled[group].sqrt();
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
                scaled[term] * r[i] * r[i]
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
            quartic: 4.0 * scaled[0] * largest(&r),
            value: scaled[0] * size_of_m * size_of_m + (4.0 * of_w + of_c) * size_of_f * size_of_f,
        };
        let strength = r.iter().map(|r| 4.0 * scaled[0] * r).collect();
        let first = scaled[0];
        let double =
            Coefficients { size, rows, first, strength, r, fne, target, coupling, gram, closeness, quadratic, scale };
        Ok(Self { interaction, size, rows, criterion: Criterion::Paper, gamma, exponent, theta: double.into() })
    }

    /// A value of `theta` in the scale of γ.
    pub(crate) fn in_scale_of_gamma(&self, value: f64) -> f64 {
        times_power(value, self.exponent)
    }

    /// The players whose ‖S_i‖² has no weight, or one lost in the rounding of Θ.
    pub(crate) fn unweighted(&self) -> Vec<usize> {
        let weights = self.weights();
        (0..self.rows).filter(|&i| weights[i] <= LOST).collect()
    }

    /// Those, and the players whose ‖S_i‖² γ gives next to no weight: what it adds to Θ is faint as well.
    pub(crate) fn faint(&self) -> Vec<usize> {
        let (weights, most) = (self.weights(), self.gamma.iter().fold(0.0, |a: f64, &b| a.max(b)));
        let gamma = |i: usize| match self.interaction {
            Interaction::I1 => self.gamma[3],
            Interaction::I2 => self.gamma[1 + usize::from(i + 1 == self.rows)],
        };
        let faint = |&i: &usize| weights[i] <= LOST || gamma(i) <= FAINT * most && weights[i] <= FAINT;
        (0..self.rows).filter(faint).collect()
    }

    /// The weight on ‖S_i‖² of each player, relative to the parts of Θ; one where there are none.
    fn weights(&self) -> Vec<f64> {
        let (of, all) = (&self.theta.double, self.feedback(0..self.rows));
        let weight = |i: usize| of.closeness[i] / (of.r[i] * of.r[i]) * all / of.scale.value;
        (0..self.rows).map(|i| if of.scale.value > 0.0 { weight(i) } else { 1.0 }).collect()
    }

    /// The largest of them, of those players.
    pub(crate) fn weight(&self, players: &[usize]) -> f64 {
        let weights = self.weights();
        players.iter().map(|&i| weights[i]).fold(0.0, f64::max)
    }

    /// The same problem with another Θ.
    pub(crate) fn with(&self, theta: Precisions) -> Self {
        Self { theta, ..self.clone() }
    }

    /// Θ with a weight on ‖S_i‖² of those players besides: what it is of Θ's parts, all of them together.
    pub(crate) fn weighted(&self, players: &[usize], weight: f64) -> Precisions {
        let all = self.feedback(players.iter().copied());
        let common = if all > 0.0 { weight * self.theta.double.scale.value / all } else { 0.0 };
        Precisions::double_only(self.reweighted(players, |i, own| own + common * self.theta.double.r[i].powi(2)))
    }

    /// Θ without weight on ‖S_i‖² of those players.
    pub(crate) fn without(&self, players: &[usize]) -> Precisions {
        if players.iter().all(|&i| self.theta.double.closeness[i] == 0.0) {
            return self.theta.clone();
        }
        self.reweighted(players, |_, _| 0.0).into()
    }

    /// Θ with other weights on ‖S_i‖² of those players, by the player and its own.
    fn reweighted(&self, players: &[usize], weight: impl Fn(usize, f64) -> f64) -> Coefficients<f64> {
        let (mut of, n) = (self.theta.double.clone(), self.size);
        for &i in players {
            let other = weight(i, of.closeness[i]);
            let more = other - of.closeness[i];
            of.closeness[i] = other;
            for entry in i * n..(i + 1) * n {
                of.quadratic
                    .iter_mut()
                    .filter(|q| !q.is_empty())
                    .for_each(|q| q[entry * self.rows * n + entry] += 2.0 * more);
            }
            of.scale.closeness = of.scale.closeness.max(other);
        }
        of
    }

    /// Σ r_i²‖F_i‖² over some players.
    fn feedback(&self, players: impl IntoIterator<Item = usize>) -> f64 {
        let (n, of) = (self.size, &self.theta.double);
        players.into_iter().map(|i| of.r[i] * of.r[i] * sum_of_squares(&of.fne[i * n..(i + 1) * n])).sum()
    }

    /// Whether Θ is even in row i of those: its sign changes nothing.
    pub(crate) fn even(&self) -> bool {
        self.theta.double.coupling.is_empty()
    }

    /// Whether the game is large: past tables of every product, with a search of its own.
    pub(crate) fn is_large(&self) -> bool {
        self.size > TABULATED_UP_TO
    }

    /// Whether minima are followed from one instant to another: not in large games, nor where S has next to no weight.
    pub(crate) fn is_followed(&self) -> bool {
        !self.is_large() && self.faint().is_empty()
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

    /// Θ = γ · terms.
    #[must_use]
    pub fn weigh(&self, terms: &[f64]) -> f64 {
        self.gamma.iter().zip(terms).map(|(g, t)| g * t).sum()
    }
}

/// What asks for memory here.
pub(super) const WHAT: &str = "the synthesis problem of one instant";

/// e of the power of two with 2^e ≤ x < 2^(e + 1); 0 for x = 0.
fn exponent(x: f64) -> i32 {
    let of_normal = |x: f64| (x.to_bits() >> 52 & 0x7ff) as i32 - 1023;
    match x {
        0.0 => 0,
        _ if x < f64::MIN_POSITIVE => of_normal(x * 2f64.powi(64)) - 64,
        _ => of_normal(x),
    }
}

/// x · 2^e in two steps, of which none overflows where the product does not.
fn times_power(x: f64, e: i32) -> f64 {
    x * 2f64.powi(e / 2) * 2f64.powi(e - e / 2)
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
