//! dy/ds = f(y): an adaptive integrator of order 8 with dense output of order 7.
//!
//! y is a stack of equally large blocks, one symmetric matrix per objective, padded with zeros to whole vector lanes.
//! The step is accepted when in every block by itself ‖e‖ ≤ `tolerance` ‖y‖, both in the norm of [`super::weight`].
//! Values at the grid's nodes come from the dense output; steps are never cut to hit a node other than the last.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | s | `s` | time before the horizon, T − t |
//! | h | `h` | step in s |
//! | k_i | `k[i]` | stage derivatives, 13 of the method and 3 for the dense output |
//! | θ | `theta` | where a node lies in a step, in (0, 1] |
//!
//! The step is chosen by the plain controller h ← 0.9 h err^(−1/8), whose eighth root is three square roots: with every
//! operation rounded correctly and none reordered, the same game gives the same bits on every machine.
//!
//! Source: Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., II.4 to II.6.

use super::escape;
use super::stages::{self, DENSE, STAGES};
use crate::cancel::{CancelToken, raised};
use crate::error::{EquilibriumError, NoMemory};
use crate::memory::{MOST_BYTES, within};
use crate::simd::{Aligned, Width};

/// Attempted steps after which the integrator gives up. A game that needs more is stiff (a rate some 10⁶ times the
/// inverse of the horizon), not escaping; ordinary games take some hundred steps, the wildest seen 10⁴.
const STEP_BUDGET: usize = 300_000;
/// What asks for memory here.
pub(super) const WHAT: &str = "the integration of the Riccati equations";
/// Distance to a pole, relative to s, at which it is reported.
const RESOLVED: f64 = 1e-15;
/// Nodes of the grid that are interpolated together.
const TOGETHER: usize = 4;
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 6.0;

/// An autonomous right-hand side on a stack of blocks, each padded with zeros to whole lanes.
pub(super) trait Flow {
    /// Entries of one block, padding included: a multiple of [`stages::LANES`].
    fn block_len(&self) -> usize;
    /// dy/ds at `y`; the padding of `dy` is left at zero. Large flows leave it unfinished once their token is raised.
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]);
    /// Writes the weights of the error norm for one block into `out`.
    fn weigh(&mut self, y: &[f64], out: &mut [f64]);
}

/// The state and everything the integrator needs, allocated once.
struct Workspace {
    width: Width,
    len: usize,
    block: usize,
    y: Aligned,
    y_new: Aligned,
    point: Aligned,
    k: Aligned,
    dense: Aligned,
    cancel: CancelToken,
}

impl Workspace {
    fn new(y0: &[f64], block: usize, cancel: &CancelToken) -> Result<Self, NoMemory> {
        let len = y0.len();
        within(WHAT, (2 + TOGETHER + STAGES + DENSE) as u128 * size_of_val(y0) as u128, MOST_BYTES)?;
        let mut y = Aligned::zeros(WHAT, len)?;
        y.copy_from_slice(y0);
        Ok(Self {
            width: Width::in_use(),
            len,
            block,
            y,
            y_new: Aligned::zeros(WHAT, len)?,
            point: Aligned::zeros(WHAT, TOGETHER * len)?,
            k: Aligned::zeros(WHAT, STAGES * len)?,
            dense: Aligned::zeros(WHAT, DENSE * len)?,
            cancel: cancel.clone(),
        })
    }

    fn stage(&self, i: usize) -> &[f64] {
        &self.k[i * self.len..(i + 1) * self.len]
    }

    /// Evaluates stage `i` of a step of length h; nothing any more once the solver is stopped.
    fn evaluate(&mut self, flow: &mut dyn Flow, i: usize, h: f64) {
        if raised(Some(&self.cancel)) {
            return;
        }
        let point = &mut self.point[..self.len];
        stages::point(self.width, i, point, &self.y, &self.k, h);
        flow.derivative(point, &mut self.k[i * self.len..(i + 1) * self.len]);
    }

    /// One trial step: the stages and the new point. Returns the error estimate of the method in the weighted norm, the
    /// largest over the blocks, or NaN if the trial left the range of the numbers.
    fn attempt(&mut self, flow: &mut dyn Flow, h: f64) -> f64 {
        for i in 1..12 {
            self.evaluate(flow, i, h);
        }
        if raised(Some(&self.cancel)) {
            return f64::NAN;
        }
        stages::point(self.width, 12, &mut self.y_new, &self.y, &self.k, h);
        let mut worst = 0.0_f64;
        for start in (0..self.len).step_by(self.block) {
            let end = start + self.block;
            flow.weigh(&self.y_new[start..end], &mut self.point[start..end]);
            let weight = &self.point[..self.len];
            let (five, three, size) = stages::error_sums(self.width, &self.k, &self.y_new, weight, start, self.block);
            if !(five.is_finite() && three.is_finite()) {
                return f64::NAN;
            }
            if five > 0.0 {
                // The largest entry of a matrix weighs one: a size below that is a matrix of zeros.
                worst = worst.max(h * five / ((five + 0.01 * three) * size.max(1.0)).sqrt());
            }
        }
        worst
    }

    /// The derivative at the new point, once its step is accepted.
    fn finish(&mut self, flow: &mut dyn Flow) {
        flow.derivative(&self.y_new, &mut self.k[12 * self.len..13 * self.len]);
    }

    /// Prepares the dense output of the step just taken.
    fn prepare_dense(&mut self, flow: &mut dyn Flow, h: f64) {
        for i in 13..STAGES {
            self.evaluate(flow, i, h);
        }
        stages::dense(self.width, &mut self.dense, &self.y, &self.y_new, &self.k, h);
    }

    /// A hundredth of the time in which some block would change by its own size.
    fn first_step(&self, horizon: f64) -> f64 {
        let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let blocks = self.y.chunks(self.block).zip(self.stage(0).chunks(self.block));
        blocks
            .map(|(y, dy)| (largest(y), largest(dy)))
            .fold(horizon, |h, (size, rate)| if size > 0.0 && rate > 0.0 { h.min(0.01 * size / rate) } else { h })
    }

    /// The largest relative growth of a block at the new point.
    fn growth(&self) -> f64 {
        let blocks = self.y_new.chunks(self.block).zip(self.stage(12).chunks(self.block));
        blocks.map(|(p, dp)| escape::growth(p, dp)).fold(0.0, f64::max)
    }
}

/// Runs a flow from `y0` at s = 0 to s = `horizon` and hands `sink(j, y)` the state at s = j · horizon / steps for every
/// j = 0…steps. Returns the number of accepted steps.
pub(super) fn integrate(
    flow: &mut dyn Flow,
    y0: &[f64],
    horizon: f64,
    steps: usize,
    tolerance: f64,
    cancel: &CancelToken,
    sink: &mut dyn FnMut(usize, &[f64]),
) -> Result<usize, EquilibriumError> {
    let mut w = Workspace::new(y0, flow.block_len(), cancel)?;
    // The last node is the horizon itself, however the quotient rounds: it is delivered by the step that ends there.
    let node = |j: usize| if j < steps { j as f64 * horizon / steps as f64 } else { horizon };
    sink(0, y0);
    flow.derivative(y0, &mut w.k[..y0.len()]);
    let mut h = w.first_step(horizon);
    // s = `s` + `low`: near a pole the steps fall below the last digit of s.
    let (mut s, mut low) = (0.0_f64, 0.0_f64);
    let (mut next, mut accepted, mut attempts, mut rejected) = (1, 0, 0, false);
    while next <= steps {
        let left = (horizon - s) - low;
        let last = 1.01 * h >= left;
        if last {
            h = left;
        }
        if attempts >= STEP_BUDGET || h <= 1e-20 * s {
            return Err(EquilibriumError::StepBudget { steps: attempts, reached: s, horizon });
        }
        attempts += 1;
        let err = w.attempt(flow, h) / tolerance;
        // A flow that noticed it, too, has left its derivative unfinished.
        cancel.check()?;
        let factor = SAFETY / err.sqrt().sqrt().sqrt();
        // A trial that overflowed has an error that is not a number.
        if err.is_nan() || err > 1.0 {
            h *= if factor.is_nan() { SHRINK } else { factor.clamp(SHRINK, SAFETY) };
            rejected = true;
            continue;
        }
        accepted += 1;
        w.finish(flow);
        cancel.check()?;
        let (reached, reached_low) = if last { (horizon, 0.0) } else { two_sum(s, low + h) };
        if last || h < escape::GATE * reached {
            escape::check(reached, w.growth(), horizon, RESOLVED)?;
        }
        if node(next) <= reached {
            if !(last && next == steps) {
                w.prepare_dense(flow, h);
                cancel.check()?;
            }
            while next <= steps && node(next) <= reached {
                if last && next == steps {
                    sink(next, &w.y_new);
                    next += 1;
                    continue;
                }
                // The nodes that follow are computed with this one, and used if they lie in this step, too.
                let theta: [f64; TOGETHER] = std::array::from_fn(|i| ((node(next + i) - s) - low) / h);
                let end = if last { steps } else { steps + 1 };
                let count = 1 + (next + 1..end).take(TOGETHER - 1).take_while(|&j| node(j) <= reached).count();
                if count == 1 {
                    stages::interpolate(w.width, &mut w.point, &w.y, &w.dense, [theta[0]]);
                } else {
                    stages::interpolate(w.width, &mut w.point, &w.y, &w.dense, theta);
                }
                for point in w.point.chunks_exact(w.len).take(count) {
                    sink(next, point);
                    next += 1;
                }
                if next % 1024 < count {
                    cancel.check()?;
                }
            }
        }
        std::mem::swap(&mut w.y, &mut w.y_new);
        w.k.copy_within(12 * w.len..13 * w.len, 0);
        (s, low) = (reached, reached_low);
        h *= factor.clamp(SHRINK, if rejected { 1.0 } else { GROW });
        rejected = false;
    }
    Ok(accepted)
}

/// a + b = sum + rest exactly, for |a| ≥ |b|.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y' = 1 + y² in every entry: y = tan(s + s₀).
    struct Tangent;
    impl Flow for Tangent {
        fn block_len(&self) -> usize {
            8
        }
        fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
            dy.iter_mut().zip(y).for_each(|(d, y)| *d = 1.0 + y * y);
        }
        fn weigh(&mut self, y: &[f64], out: &mut [f64]) {
            super::super::weight::whole(y, 4, &mut [0.0; 4], out);
        }
    }

    /// Errors of one step from 0.1: at its end and, by the dense output, the largest inside.
    fn errors(h: f64) -> (f64, f64) {
        let start = 0.1_f64;
        let mut w = Workspace::new(&[start.tan(); 8], 8, &CancelToken::new()).expect("memory");
        Tangent.derivative(&[start.tan(); 8], &mut w.k[..8]);
        w.attempt(&mut Tangent, h);
        w.finish(&mut Tangent);
        let end = (w.y_new[0] - (start + h).tan()).abs();
        w.prepare_dense(&mut Tangent, h);
        let mut inside = 0.0_f64;
        for i in 1..10 {
            let theta = f64::from(i) / 10.0;
            stages::interpolate(w.width, &mut w.point, &w.y, &w.dense, [theta]);
            inside = inside.max((w.point[0] - (start + theta * h).tan()).abs());
        }
        (end, inside)
    }

    /// Steps small against the distance to the pole at π/2, so that the leading term of the error leads.
    #[test]
    fn local_errors_have_order_nine_and_eight() {
        let (coarse, fine) = (errors(0.2), errors(0.1));
        let (end, dense) = ((coarse.0 / fine.0).log2(), (coarse.1 / fine.1).log2());
        assert!((8.5..10.0).contains(&end), "order of the step: {end}");
        assert!((8.0..9.5).contains(&dense), "order of the dense output: {dense}");
    }

    /// e5 is of order 5 and e3 of order 3, so that the estimate h e5² / (e5² + e3² / 100)^½ is of order 8.
    #[test]
    fn the_error_estimate_has_order_eight() {
        let estimate = |h: f64| {
            let start = 0.1_f64;
            let mut w = Workspace::new(&[start.tan(); 8], 8, &CancelToken::new()).expect("memory");
            Tangent.derivative(&[start.tan(); 8], &mut w.k[..8]);
            w.attempt(&mut Tangent, h)
        };
        for h in [0.1, 0.05] {
            assert!((7.3..8.7).contains(&(estimate(h) / estimate(0.5 * h)).log2()), "{h}");
        }
    }
}
