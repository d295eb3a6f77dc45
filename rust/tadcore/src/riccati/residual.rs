//! How well a stored solution satisfies the Riccati equations as they are printed.
//!
//! Residual at t_k, for each group: ‖Ṗ + Q − PA − AᵀP + P S P‖ / (‖Q‖ + 2‖PA‖ + ‖P S P‖), in I2 ‖Ṗ + Q − P S P‖ /
//! (‖Q‖ + ‖P S P‖), with dense S_p and A as in the paper ([`super::printed`]): nothing is shared with the solvers. Ṗ is the difference of
//! order 8 of nine stored nodes whose distance is about 1/30 of the time scale of the equation; nothing else is known
//! of how they came about.
//!
//! (A P that hardly changes has rounding in its digits only: a change of 10⁻⁸ P per distance is added to the terms.)
//!
//! A grid too coarse for differences is checked step by step: the printed equation is integrated from t_{k+1} to t_k,
//! and the residual is the mismatch with the stored node, relative to the smaller of ‖P‖ and what a step can change.
//!
//! Source: eq:Riccati and eq:RDE of the paper; Fornberg, *Math. Comp.* 51 (1988), for the differences.

use super::Equilibrium;
use super::dop853;
use super::printed::{Textbook, norm};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::game::Game;
use crate::memory::zeros;

/// Nodes of a difference.
const POINTS: usize = 9;
/// Distance of its nodes times the largest rate at them, at most, where the grid allows a choice.
const SPACING: f64 = 0.03;
/// Distance times rate above which a difference is not trusted: centred, whose error constant is 1/630, and one-sided,
/// up to 1/9.
const COARSE: (f64, f64) = (0.12, 0.06);
/// A change of P by less than this part of it cannot be seen to more than 1e-8 in the rounded nodes.
const ROUNDING: f64 = 1e-8;
/// Tolerance of a fresh integration.
const TOLERANCE: f64 = 1e-13;

/// What asks for memory here.
pub(super) const WHAT: &str = "the residual of the Riccati equations";

/// Weights of the derivative at point `at` of nine equidistant points, for unit distance.
fn difference(at: usize) -> [f64; POINTS] {
    let binomial = |j: usize| (1..=j).fold(1.0, |b, i| b * (POINTS - i) as f64 / i as f64);
    let sign = |j: usize| if j.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut w = [0.0; POINTS];
    for j in 0..POINTS {
        if j != at {
            w[j] = sign(j) * binomial(j) / (sign(at) * binomial(at)) / (at as f64 - j as f64);
        }
    }
    w[at] = -w.iter().sum::<f64>();
    w
}

/// Nine nodes around one node.
struct Stencil {
    /// Nodes before the one of interest.
    before: usize,
    /// Distance in steps of the grid.
    stride: usize,
}

impl Stencil {
    /// The widest stencil about `k`, centred where the ends of the grid allow, whose distance resolves the rates at all
    /// its nodes; `None` if the grid is too coarse.
    fn about(k: usize, step: f64, rates: &[f64]) -> Option<Self> {
        let steps = rates.len() - 1;
        if steps + 1 < POINTS {
            return None;
        }
        let mut stride = ((SPACING / (rates[k] * step)) as usize).clamp(1, steps / (POINTS - 1));
        loop {
            let after = (POINTS / 2).min((steps - k) / stride);
            let before = (POINTS - 1 - after).min(k / stride);
            let stencil = Self { before, stride };
            let fits = k + (POINTS - 1 - before) * stride <= steps;
            let rate =
                if fits { (0..POINTS).map(|j| rates[stencil.node(k, j)]).fold(0.0, f64::max) } else { f64::INFINITY };
            let distance = rate * stride as f64 * step;
            let coarse = if before == POINTS / 2 { COARSE.0 } else { COARSE.1 };
            if distance <= SPACING || (stride == 1 && distance <= coarse) {
                return Some(stencil);
            }
            if stride == 1 {
                return None;
            }
            stride = (stride * 3 / 4).max(1);
        }
    }

    fn node(&self, k: usize, j: usize) -> usize {
        k + j * self.stride - self.before * self.stride
    }
}

/// See [`Equilibrium::residual`].
pub(super) fn residual(equilibrium: &Equilibrium, game: &Game, cancel: &CancelToken) -> Result<Vec<f64>, Stopped> {
    let (n, steps, groups) = (equilibrium.size(), equilibrium.steps(), equilibrium.groups());
    let (len, step) = (n * n, game.grid().step());
    let mut book = Textbook::new(game, cancel)?;
    let terminal = game.state_weights(true);
    if let Some(ahead) = game.prediction_horizon() {
        return receding(&mut book, equilibrium, &terminal, ahead);
    }
    let weights: [[f64; POINTS]; POINTS] = std::array::from_fn(difference);
    let mut rates = zeros(WHAT, steps + 1)?;
    for (k, rate) in rates.iter_mut().enumerate() {
        *rate = book.rate(&node(equilibrium, k))?;
    }
    let mut out = zeros(WHAT, groups * (steps + 1))?;
    for k in 0..=steps {
        let p = node(equilibrium, k);
        let value = book.evaluate(&p)?;
        let stencil = Stencil::about(k, step, &rates);
        let fresh = if stencil.is_none() && k < steps { again(&mut book, equilibrium.node(k + 1), step) } else { None };
        for g in 0..groups {
            let mut worst = 0.0_f64;
            if let Some(stencil) = &stencil {
                let mut defect = value.derivative[g * len..(g + 1) * len].to_vec();
                for (j, w) in weights[stencil.before].iter().enumerate() {
                    let factor = w / (stencil.stride as f64 * step);
                    for (x, p) in defect.iter_mut().zip(equilibrium.p(g, stencil.node(k, j))) {
                        *x += factor * p;
                    }
                }
                worst = norm(&defect) / (value.scale[g] + ROUNDING * norm(p[g]) / (stencil.stride as f64 * step));
            } else if let Some(fresh) = &fresh {
                worst = mismatch(p[g], &fresh[g * book.block..])
                    / norm(p[g]).min(step * value.scale[g] + ROUNDING * norm(p[g]));
            } else if k < steps {
                worst = f64::INFINITY;
            }
            if k == steps {
                let f = &terminal[g];
                let defect: Vec<f64> =
                    (0..len).map(|ij| p[g][ij] - if ij / n == ij % n { f[ij / n] } else { 0.0 }).collect();
                worst = worst.max(norm(&defect) / norm(f));
            }
            out[g * (steps + 1) + k] = worst;
        }
    }
    cancel.check()?;
    Ok(out)
}

/// ‖P − P'‖ for a P' that is padded.
fn mismatch(p: &[f64], fresh: &[f64]) -> f64 {
    norm(&p.iter().zip(fresh).map(|(a, b)| a - b).collect::<Vec<f64>>())
}

/// The residual of a constant P, against the printed equation over the horizon of its prediction.
fn receding(
    book: &mut Textbook,
    equilibrium: &Equilibrium,
    terminal: &[Vec<f64>],
    ahead: f64,
) -> Result<Vec<f64>, Stopped> {
    let (n, nodes) = (equilibrium.size(), equilibrium.steps() + 1);
    let mut out = zeros(WHAT, terminal.len() * nodes)?;
    let mut end = zeros(WHAT, terminal.len() * n * n)?;
    for (block, f) in end.chunks_exact_mut(n * n).zip(terminal) {
        f.iter().enumerate().for_each(|(i, f)| block[i * n + i] = *f);
    }
    let fresh = again(book, &end, ahead);
    book.cancel.check()?;
    for (g, out) in out.chunks_exact_mut(nodes).enumerate() {
        let p = equilibrium.p(g, 0);
        out.fill(fresh.as_ref().map_or(f64::INFINITY, |fresh| mismatch(p, &fresh[g * book.block..]) / norm(p)));
    }
    Ok(out)
}

fn node(equilibrium: &Equilibrium, k: usize) -> Vec<&[f64]> {
    (0..equilibrium.groups()).map(|g| equilibrium.p(g, k)).collect()
}

/// P a time `step` before the matrices `p`, as a padded stack.
fn again(book: &mut Textbook, p: &[f64], step: f64) -> Option<Vec<f64>> {
    let len = book.n * book.n;
    let mut y = vec![0.0; p.len() / len * book.block];
    for (block, p) in y.chunks_exact_mut(book.block).zip(p.chunks_exact(len)) {
        block[..len].copy_from_slice(p);
    }
    let mut last = None;
    let keep = &mut |j: usize, y: &[f64]| {
        if j == 1 {
            last = Some(y.to_vec());
        }
    };
    let cancel = book.cancel.clone();
    dop853::integrate(book, &y, step, 1, TOLERANCE, &cancel, keep).ok()?;
    last
}
