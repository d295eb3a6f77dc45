//! The terms of Θ one by one, of gains A or, where they turn, of A + iB.
//!
//! With G = A + iB the forms are Hermitian: GᴴRG = AᵀRA + BᵀRB + i(AᵀRB − BᵀRA), and W_pΔ + (W_pΔ)ᴴ has the real part
//! W_pΔ_A + (W_pΔ_A)ᵀ and the imaginary part W_pB − (W_pB)ᵀ, Δ_A = A − F. Squared norms are sums over both parts.

use super::Problem;
use super::problem::WHAT;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::game::Interaction;
use crate::memory::{copy, zeros};

impl Problem {
    /// The squared residual norms of the gain rows `g`, unweighted and reduced, in the order of γ:
    /// ‖ΔQ_d‖², ‖ΔQ_τ‖², ‖ΔQ_a‖², ‖S₁‖² in I1 (`p`: the Riccati matrices of the instant) and ‖ΔQ‖², ‖S₂‖², ‖S₃‖² in I2.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory, or `cancel` was raised.
    pub fn terms(&self, p: &[f64], g: &[f64], cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
        self.turning_terms(p, g, &[], cancel)
    }

    /// The same of gains that turn, `g` + i `turn`; of scalar ones where `turn` is empty.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory, or `cancel` was raised.
    pub fn turning_terms(&self, p: &[f64], g: &[f64], turn: &[f64], cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
        let (n, m, of) = (self.size, self.rows, &self.theta.double);
        let mut delta = copy(WHAT, g)?;
        delta.iter_mut().zip(&of.fne).for_each(|(d, f)| *d -= f);
        let closeness = |rows: std::ops::Range<usize>| -> f64 {
            let parts = [&delta[..], turn].into_iter().filter(|part| !part.is_empty());
            parts.flat_map(|part| (rows.start * n..rows.end * n).map(|e| (of.r[e / n] * part[e]).powi(2))).sum()
        };
        let (mut product, mut other) = (zeros(WHAT, n * n)?, zeros(WHAT, if turn.is_empty() { 0 } else { n * n })?);
        multiply(n, Some(&of.r), g, g, &mut product, cancel)?;
        let mut quadratic = 0.0;
        if !turn.is_empty() {
            multiply(n, Some(&of.r), turn, turn, &mut other, cancel)?;
            product.iter_mut().zip(&other).for_each(|(x, y)| *x += y);
            multiply(n, Some(&of.r), g, turn, &mut other, cancel)?;
            quadratic += squared(n, &other, -1.0);
        }
        quadratic += product.iter().zip(&of.target).map(|(gain, m)| (gain - m).powi(2)).sum::<f64>();
        if self.interaction == Interaction::I2 {
            return Ok(vec![quadratic, closeness(0..m - 1), closeness(m - 1..m)]);
        }
        let mut coupled = |group: usize| -> Result<f64, Stopped> {
            let w = &p[group * n * n..][..m * n];
            multiply(n, None, w, &delta, &mut product, cancel)?;
            let mut total = squared(n, &product, 1.0);
            if !turn.is_empty() {
                multiply(n, None, w, turn, &mut product, cancel)?;
                total += squared(n, &product, -1.0);
            }
            Ok(total)
        };
        Ok(vec![quadratic, coupled(1)?, coupled(2)?, closeness(0..m)])
    }
}

/// ‖X ± Xᵀ‖².
fn squared(n: usize, x: &[f64], sign: f64) -> f64 {
    (0..n * n).map(|e| (x[e] + sign * x[e % n * n + e / n]).powi(2)).sum()
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
