//! Interaction I2: dP/ds = Q − P S P, from P = F at s = T − t = 0, by exact steps of the Hamiltonian flow.
//!
//! P = Y X⁻¹ with X' = S Y, Y' = Q X. Restarted from (I, P) at every step of length h,
//!
//! X = I + Z, Z = C + E P, C = cosh(√(SQ) h) − I, E = h sinhc(√(SQ) h) S,
//! P⁺ − P = (Q h sinhc(√(SQ) h) + Cᵀ P − P Z) X⁻¹,
//!
//! where the two functions are power series in SQ: no square root is taken. The increment is symmetrised, so P is
//! bitwise symmetric and a million small steps do not add up a million rounding errors of the size of P.
//!
//! **No pole is jumped over.** P exists on (0, h] exactly if X(s) is regular for every s ≤ h, and
//! ‖X(s) − I‖ ≤ (cosh ωs − 1) + ‖SP‖ sinh(ωs)/ω with ω² = ‖SQ‖. A step is taken only if this bound is at most ½;
//! otherwise it is halved (lengths δ 2⁻ʲ, the exponential of each computed once). As ‖Z‖₁ ≤ ½, X is dominated by its
//! diagonal, and elimination without pivoting is stable.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | S = S_a − S_dτ | `s` | 1 1ᵀ / r_a − diag(1/r_d, 1/r_τ), balanced |
//! | Q | `q` | diagonal, balanced |
//! | C, E, h sinhc(·) Q | [`Level`] | one exponential of the Hamiltonian matrix |
//! | D | `balance` | powers of two near (1/r_a + 1/r_i)^½; the code solves for D P D, whose S is of order one |
//!
//! Source: eq:RDE of the paper, with the sign of time reversed; the bound is ours.

use super::escape;
use super::increment::Level;
use crate::cancel::CancelToken;
use crate::error::{EquilibriumError, NoMemory, Stopped};
use crate::game::Game;
use crate::memory::zeros;
use crate::simd::Width;

/// Largest bound on ‖X − I‖ for which a step is taken.
const BOUND: f64 = 0.5;
/// The shortest step is δ 2⁻¹²⁷.
const LEVELS: usize = 128;
/// Distance to a pole, relative to s, at which it is reported.
const RESOLVED: f64 = 1e-13;
/// Steps beyond one per grid interval after which the solver gives up.
const STEP_BUDGET: usize = 20_000_000;
/// What asks for memory here.
const WHAT: &str = "the solution of the Riccati equation";
/// Steps between two polls of the cancel token.
const POLL: usize = 256;
/// N beyond which it is looked at in every step, and within.
const SMALL: usize = 8;

struct Flow {
    n: usize,
    /// Diagonal of −S_dτ and the scaled vector of S_a = w wᵀ.
    s_diagonal: Vec<f64>,
    w: Vec<f64>,
    q: Vec<f64>,
    balance: Vec<f64>,
    omega: f64,
    levels: Vec<Option<Level>>,
    step: f64,
}

impl Flow {
    fn new(game: &Game) -> Result<Self, NoMemory> {
        let weights = game.weights();
        let n = game.size();
        let inverse: Vec<f64> = weights.r_d.iter().chain([&weights.r_tau]).map(|r| 1.0 / r).collect();
        let balance: Vec<f64> = inverse.iter().map(|r| (0.5 * (r + 1.0 / weights.r_a).log2()).round().exp2()).collect();
        let s_diagonal: Vec<f64> = inverse.iter().zip(&balance).map(|(r, d)| -(r / d) / d).collect();
        let w: Vec<f64> = balance.iter().map(|d| (1.0 / weights.r_a).sqrt() / d).collect();
        let q: Vec<f64> = game.state_weights(false)[0].iter().zip(&balance).map(|(q, d)| q * d * d).collect();
        let mut flow = Self {
            n,
            s_diagonal,
            w,
            q,
            balance,
            omega: 0.0,
            levels: (0..LEVELS).map(|_| None).collect(),
            step: game.grid().step(),
        };
        // ‖SQ‖₁: the largest column sum
        let s = flow.s()?;
        let column = |j: usize| (0..n).map(|i| s[i * n + j].abs()).sum::<f64>() * flow.q[j].abs();
        flow.omega = (0..n).map(column).fold(0.0, f64::max).sqrt();
        Ok(flow)
    }

    fn s(&self) -> Result<Vec<f64>, NoMemory> {
        let n = self.n;
        let mut s = zeros(WHAT, n * n)?;
        s.iter_mut().enumerate().for_each(|(ij, s)| *s = self.w[ij / n] * self.w[ij % n]);
        for i in 0..n {
            s[i * n + i] += self.s_diagonal[i];
        }
        Ok(s)
    }

    /// The exponential of the Hamiltonian matrix over δ 2⁻ʲ, if the bound allows that length for any P at all.
    fn make_level(&self, j: usize, cancel: &CancelToken) -> Result<Level, Stopped> {
        let n = self.n;
        let h = self.step * (-(j as f64)).exp2();
        let x = self.omega * h;
        let bound = (2.0 * (0.5 * x).sinh().powi(2), if x > 0.0 { x.sinh() / self.omega } else { h });
        let mut level = Level { bound, c: Vec::new(), e: Vec::new(), f: Vec::new() };
        if bound.0 > BOUND {
            return Ok(level);
        }
        // Power series in h² SQ, whose norm is below one here.
        let s = self.s()?;
        let (mut power, mut sinhc) = (zeros(WHAT, n * n)?, zeros(WHAT, n * n)?);
        level.c = zeros(WHAT, n * n)?;
        for i in 0..n {
            power[i * n + i] = 1.0;
            sinhc[i * n + i] = 1.0;
        }
        for k in 1..=10 {
            // power ← h² (power S) Q / ((2k − 1) 2k)
            let product = multiply(n, &power, &s, cancel)?;
            let factor = h * h / f64::from((2 * k - 1) * 2 * k);
            for (ij, p) in power.iter_mut().enumerate() {
                *p = product[ij] * self.q[ij % n] * factor;
            }
            for ij in 0..n * n {
                level.c[ij] += power[ij];
                sinhc[ij] += power[ij] / f64::from(2 * k + 1);
            }
        }
        level.e = multiply(n, &sinhc, &s, cancel)?;
        level.e.iter_mut().for_each(|v| *v *= h);
        level.f = sinhc;
        level.f.iter_mut().enumerate().for_each(|(ij, v)| *v = self.q[ij / n] * *v * h);
        symmetrise(n, &mut level.e);
        symmetrise(n, &mut level.f);
        Ok(level)
    }

    /// ‖SP‖₁ for the balanced P.
    fn norm_sp(&self, p: &[f64]) -> f64 {
        let n = self.n;
        let mut worst = 0.0_f64;
        // Columns of SP are rows of PS, as both are symmetric.
        for row in p.chunks_exact(n) {
            let dot: f64 = row.iter().zip(&self.w).map(|(p, w)| p * w).sum();
            let sum: f64 = (0..n).map(|i| (self.w[i] * dot + self.s_diagonal[i] * row[i]).abs()).sum();
            worst = worst.max(sum);
        }
        worst
    }

    /// dP/ds = Q − P S P.
    fn derivative(&self, p: &[f64], cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
        let n = self.n;
        let v: Vec<f64> = p.chunks_exact(n).map(|row| row.iter().zip(&self.w).map(|(p, w)| p * w).sum()).collect();
        let mut out = zeros(WHAT, n * n)?;
        for i in 0..n {
            cancel.check()?;
            for j in 0..n {
                // Row j is column j, as P is symmetric.
                let rows = p[i * n..][..n].iter().zip(&self.s_diagonal).zip(&p[j * n..][..n]);
                let sum: f64 = rows.map(|((left, s), right)| left * s * right).sum();
                out[i * n + j] = -(sum + v[i] * v[j]);
            }
            out[i * n + i] += self.q[i];
        }
        Ok(out)
    }
}

fn multiply(n: usize, a: &[f64], b: &[f64], cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
    let mut out = zeros(WHAT, n * n)?;
    for i in 0..n {
        cancel.check()?;
        for k in 0..n {
            for j in 0..n {
                out[i * n + j] += a[i * n + k] * b[k * n + j];
            }
        }
    }
    Ok(out)
}

fn symmetrise(n: usize, a: &mut [f64]) {
    for i in 0..n {
        for j in 0..i {
            let mean = 0.5 * (a[i * n + j] + a[j * n + i]);
            a[i * n + j] = mean;
            a[j * n + i] = mean;
        }
    }
}

/// Solves eq:RDE backward over the grid of `game`, writing N × N matrices into `nodes`, one after the other. Returns
/// the number of steps.
pub(super) fn solve(game: &Game, cancel: &CancelToken, nodes: &mut [f64]) -> Result<usize, EquilibriumError> {
    let mut flow = Flow::new(game)?;
    let (n, grid, width) = (flow.n, game.grid(), Width::in_use());
    let (horizon, steps) = (grid.horizon(), grid.steps());
    let mut p = zeros(WHAT, n * n)?;
    for (i, f) in game.state_weights(true)[0].iter().enumerate() {
        p[i * n + i] = f * flow.balance[i] * flow.balance[i];
    }
    let (mut z, mut g) = (zeros(WHAT, n * n + n)?, zeros(WHAT, n * n + n)?); // matrices, and a row each
    let (mut taken, mut j) = (0, 0_usize);
    write(&flow, &p, &mut nodes[steps * n * n..]);
    for k in 1..=steps {
        // The part of this interval already covered, a sum of powers of two.
        let mut done = 0.0_f64;
        while done < 1.0 {
            if taken % POLL == 0 || n > SMALL {
                cancel.check()?;
            }
            let norm = flow.norm_sp(&p);
            j = j.saturating_sub(1);
            while !fits(&mut flow, j, norm, 1.0 - done, cancel)? {
                j += 1;
                let s = grid.time(k - 1) + done * flow.step;
                if j >= LEVELS || taken > steps + STEP_BUDGET || !norm.is_finite() {
                    escape::check(s, escape::growth(&p, &flow.derivative(&p, cancel)?), horizon, RESOLVED)?;
                    return Err(EquilibriumError::StepBudget { steps: taken, reached: s, horizon });
                }
                if flow.step * (-(j as f64)).exp2() < escape::GATE * s {
                    escape::check(s, escape::growth(&p, &flow.derivative(&p, cancel)?), horizon, RESOLVED)?;
                }
            }
            if let Some(level) = &flow.levels[j] {
                level.advance(width, n, &mut p, &mut z, &mut g, cancel);
            }
            taken += 1;
            done += (-(j as f64)).exp2();
        }
        write(&flow, &p, &mut nodes[(steps - k) * n * n..]);
    }
    escape::check(horizon, escape::growth(&p, &flow.derivative(&p, cancel)?), horizon, RESOLVED)?;
    Ok(taken)
}

/// Whether a step of δ 2⁻ʲ stays inside the interval and provably away from every pole.
fn fits(flow: &mut Flow, j: usize, norm: f64, left: f64, cancel: &CancelToken) -> Result<bool, Stopped> {
    if j >= LEVELS || (-(j as f64)).exp2() > left {
        return Ok(false);
    }
    if flow.levels[j].is_none() {
        flow.levels[j] = Some(flow.make_level(j, cancel)?);
    }
    Ok(flow.levels[j].as_ref().is_some_and(|level| level.bound.0 + norm * level.bound.1 <= BOUND))
}

/// Undoes the balancing.
fn write(flow: &Flow, p: &[f64], out: &mut [f64]) {
    let n = flow.n;
    for i in 0..n {
        for j in 0..n {
            out[i * n + j] = p[i * n + j] / flow.balance[i] / flow.balance[j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};

    /// ‖SP‖₁ is the largest column sum of the product written out, for a P of both signs.
    #[test]
    fn the_norm_of_the_product_is_that_of_the_dense_one() -> Result<(), crate::error::GameError> {
        let game = bank::varied_game(Interaction::I2, 3, 1.0, 0.1)?;
        let (flow, w, n) = (Flow::new(&game).expect("memory"), game.weights(), 4);
        let r = [w.r_d[0], w.r_d[1], w.r_d[2], w.r_tau];
        for seed in 0..20 {
            let p: Vec<f64> =
                (0..n * n).map(|e| (1.7 * (e / n + e % n + 5 * (e / n) * (e % n) + seed) as f64).sin()).collect();
            let s = |i: usize, j: usize| {
                (1.0 / w.r_a - if i == j { 1.0 / r[i] } else { 0.0 }) / flow.balance[i] / flow.balance[j]
            };
            let entry = |i: usize, j: usize| (0..n).map(|k| s(i, k) * p[k * n + j]).sum::<f64>().abs();
            let largest = (0..n).map(|j| (0..n).map(|i| entry(i, j)).sum::<f64>()).fold(0.0, f64::max);
            assert!((flow.norm_sp(&p) - largest).abs() < 1e-13 * largest, "{seed}");
        }
        Ok(())
    }
}
