//! The Riccati equations as they are printed, with dense matrices: nothing is shared with the solvers.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | S_d, S_τ, S_a | `s` | B R⁻¹ Bᵀ, dense; in I2 the one matrix S_a − S_dτ |
//! | A | `a` | S_d P_d + S_τ P_τ + S_a P_a |
//! | Q_p | `q` | running weights |
//!
//! Source: eq:Riccati and eq:RDE of the paper.

use super::dop853::Flow;
use super::residual::WHAT;
use super::stages::LANES;
use super::weight;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::game::{Game, Interaction};
use crate::memory::{reserve, zeros};

/// The printed equations.
pub(super) struct Textbook {
    pub cancel: CancelToken,
    pub n: usize,
    interaction: Interaction,
    s: Vec<Vec<f64>>,
    q: Vec<Vec<f64>>,
    pub block: usize,
}

/// The right-hand side at one node.
pub(super) struct Evaluation {
    /// dP/ds, (group, i, j).
    pub derivative: Vec<f64>,
    /// Norms of its terms, per group.
    pub scale: Vec<f64>,
}

impl Textbook {
    pub fn new(game: &Game, cancel: &CancelToken) -> Result<Self, Stopped> {
        let (n, w) = (game.size(), game.weights());
        let diagonal = |d: &[f64]| -> Result<Vec<f64>, Stopped> {
            let mut m = zeros(WHAT, n * n)?;
            for (i, v) in d.iter().enumerate() {
                m[i * n + i] = *v;
            }
            Ok(m)
        };
        let mut inverse: Vec<f64> = w.r_d.iter().map(|r| 1.0 / r).collect();
        inverse.push(0.0);
        let s_d = diagonal(&inverse)?;
        let mut last = vec![0.0; n];
        last[n - 1] = 1.0 / w.r_tau;
        let s_tau = diagonal(&last)?;
        let mut s_a = zeros(WHAT, n * n)?;
        s_a.fill(1.0 / w.r_a);
        let s = match game.interaction() {
            Interaction::I1 => vec![s_d, s_tau, s_a],
            Interaction::I2 => {
                s_a.iter_mut().zip(s_d.iter().zip(&s_tau)).for_each(|(a, (d, tau))| *a = *a - d - tau);
                vec![s_a]
            }
        };
        let q = game.state_weights(false).iter().map(|q| diagonal(q)).collect::<Result<_, Stopped>>()?;
        Ok(Self {
            cancel: cancel.clone(),
            n,
            interaction: game.interaction(),
            s,
            q,
            block: (n * n).next_multiple_of(LANES),
        })
    }

    /// A = Σ S P.
    fn closed_loop(&self, p: &[&[f64]]) -> Result<Vec<f64>, Stopped> {
        let mut a = zeros(WHAT, self.n * self.n)?;
        for (s, p) in self.s.iter().zip(p) {
            for (a, v) in a.iter_mut().zip(self.multiply(s, p)?) {
                *a += v;
            }
        }
        Ok(a)
    }

    fn multiply(&self, a: &[f64], b: &[f64]) -> Result<Vec<f64>, Stopped> {
        let n = self.n;
        let mut out = zeros(WHAT, n * n)?;
        for (row, a) in out.chunks_exact_mut(n).zip(a.chunks_exact(n)) {
            self.cancel.check()?;
            for (a, b) in a.iter().zip(b.chunks_exact(n)).filter(|(a, _)| **a != 0.0) {
                for (o, b) in row.iter_mut().zip(b) {
                    *o += a * b;
                }
            }
        }
        Ok(out)
    }

    fn transpose(&self, a: &[f64]) -> Result<Vec<f64>, Stopped> {
        let n = self.n;
        let mut out = zeros(WHAT, n * n)?;
        out.iter_mut().enumerate().for_each(|(ij, x)| *x = a[(ij % n) * n + ij / n]);
        Ok(out)
    }

    /// How fast the equation can change its solution: 2‖A‖ + (‖S‖ ‖Q‖)^½.
    pub fn rate(&self, p: &[&[f64]]) -> Result<f64, Stopped> {
        let largest = |m: &[Vec<f64>]| m.iter().map(|m| norm(m)).fold(0.0, f64::max);
        Ok(2.0 * norm(&self.closed_loop(p)?) + (largest(&self.s) * largest(&self.q)).sqrt())
    }

    /// `p`: one N × N matrix per group.
    pub fn evaluate(&self, p: &[&[f64]]) -> Result<Evaluation, Stopped> {
        let n = self.n;
        let a = self.closed_loop(p)?;
        let (mut derivative, mut scale) = (Vec::new(), Vec::new());
        reserve(WHAT, &mut derivative, p.len() * n * n)?;
        for ((p, s), q) in p.iter().zip(&self.s).zip(&self.q) {
            let psp = self.multiply(&self.multiply(p, s)?, p)?;
            match self.interaction {
                Interaction::I1 => {
                    let pa = self.multiply(p, &a)?;
                    let ap = self.multiply(&self.transpose(&a)?, p)?;
                    derivative.extend((0..n * n).map(|i| q[i] - pa[i] - ap[i] + psp[i]));
                    scale.push(norm(q) + 2.0 * norm(&pa) + norm(&psp));
                }
                Interaction::I2 => {
                    derivative.extend((0..n * n).map(|i| q[i] - psp[i]));
                    scale.push(norm(q) + norm(&psp));
                }
            }
        }
        Ok(Evaluation { derivative, scale })
    }
}

impl Flow for Textbook {
    fn block_len(&self) -> usize {
        self.block
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        let len = self.n * self.n;
        let p: Vec<&[f64]> = y.chunks_exact(self.block).map(|b| &b[..len]).collect();
        // Without an answer no step is accepted.
        let Ok(value) = self.evaluate(&p) else { return dy.fill(f64::NAN) };
        for (out, d) in dy.chunks_exact_mut(self.block).zip(value.derivative.chunks_exact(len)) {
            for i in 0..self.n {
                for j in 0..self.n {
                    out[i * self.n + j] = 0.5 * (d[i * self.n + j] + d[j * self.n + i]);
                }
            }
        }
    }
    fn weigh(&mut self, y: &[f64], out: &mut [f64]) {
        let len = self.n * self.n;
        weight::whole(&y[..len], self.n, &mut vec![0.0; self.n], &mut out[..len]);
    }
}

/// The Frobenius norm.
pub(super) fn norm(a: &[f64]) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}
