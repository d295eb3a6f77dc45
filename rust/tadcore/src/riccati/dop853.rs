//! dy/ds = f(y): an adaptive integrator of order 8 with dense output of order 7.
//!
//! y is a stack of equally large blocks, one symmetric matrix per objective, padded with zeros to whole vector lanes.
//! The step is accepted when, in every block by itself, the estimated error is below `tolerance` relative to the
//! largest entry of that block, so a small matrix beside a large one keeps its digits. Values at the grid's nodes come
//! from the dense output; steps are never cut to hit a node other than the last.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | s | `s` | time before the horizon, T − t |
//! | h | `h` | step in s |
//! | k_i | `k[i]` | stage derivatives, 13 of the method and 3 for the dense output |
//! | θ | `theta` | where a node lies in a step, in (0, 1] |
//!
//! The step is chosen by the plain controller h ← 0.9 h err^(−1/8), whose eighth root is three square roots: with no
//! fused or reordered operation anywhere, the same game gives the same bits on every machine.
//!
//! Source: Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., II.4 to II.6.

use super::escape;
use super::tableau as t;
use crate::cancel::CancelToken;
use crate::error::EquilibriumError;

/// Entries handled together in every loop over the state.
pub(super) const LANES: usize = 8;
type Lane = [f64; LANES];

/// Attempted steps after which the integrator gives up. A game that needs more is stiff (a rate some 10⁶ times the
/// inverse of the horizon), not escaping.
const STEP_BUDGET: usize = 2_000_000;
/// Attempts between two polls of the cancel token.
const POLL: usize = 64;
/// Stages kept: 12, the derivative at the new point, and 3 for the dense output.
const STAGES: usize = 16;
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 6.0;

/// An autonomous right-hand side on a padded stack of blocks.
pub(super) trait Flow {
    /// Blocks in the stack.
    fn blocks(&self) -> usize;
    /// Entries of one block, padding included.
    fn block_len(&self) -> usize;
    /// dy/ds at `y`; the padding of `dy` is left at zero.
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]);
}

/// The state and everything the integrator needs, allocated once.
struct Workspace {
    chunks: usize,
    y: Vec<Lane>,
    y_new: Vec<Lane>,
    stage: Vec<Lane>,
    k: Vec<Lane>,
    dense: Vec<Lane>,
    at_node: Vec<Lane>,
}

impl Workspace {
    fn new(y0: &[f64]) -> Self {
        let chunks = y0.len().div_ceil(LANES);
        let zeros = |count: usize| vec![[0.0; LANES]; count * chunks];
        let mut y = zeros(1);
        y.as_flattened_mut()[..y0.len()].copy_from_slice(y0);
        Self { chunks, y, y_new: zeros(1), stage: zeros(1), k: zeros(STAGES), dense: zeros(7), at_node: zeros(1) }
    }

    fn stage(&self, i: usize) -> &[Lane] {
        &self.k[i * self.chunks..(i + 1) * self.chunks]
    }
}

/// out = base + h Σ a_j k_j.
#[inline(never)]
fn combine<const M: usize>(out: &mut [Lane], base: &[Lane], k: &[Lane], row: &[(usize, f64); M], h: f64) {
    let chunks = out.len();
    let stages: [&[Lane]; M] = std::array::from_fn(|j| &k[row[j].0 * chunks..][..chunks]);
    let weights: [f64; M] = std::array::from_fn(|j| row[j].1);
    for (c, (o, b)) in out.iter_mut().zip(base).enumerate() {
        let mut sum = [0.0; LANES];
        for j in 0..M {
            let v = &stages[j][c];
            for i in 0..LANES {
                sum[i] += weights[j] * v[i];
            }
        }
        for i in 0..LANES {
            o[i] = b[i] + h * sum[i];
        }
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
    let len = y0.len();
    let mut w = Workspace::new(y0);
    let node = |j: usize| j as f64 * horizon / steps as f64;
    sink(0, y0);
    let mut next = 1;
    let (mut s, mut accepted, mut attempts) = (0.0_f64, 0, 0);
    flow.derivative(y0, &mut w.k.as_flattened_mut()[..len]);
    let mut h = first_step(flow, &w, horizon);
    let mut rejected = false;
    while next <= steps {
        if attempts % POLL == 0 {
            cancel.check()?;
        }
        let last = s + 1.01 * h >= horizon;
        if last {
            h = horizon - s;
        }
        let stuck = s + 1e-2 * h <= s;
        if attempts >= STEP_BUDGET || stuck {
            return Err(EquilibriumError::StepBudget { steps: attempts, reached: s, horizon });
        }
        attempts += 1;
        attempt(flow, &mut w, len, h);
        let err = error_norm(flow, &w, h) / tolerance;
        let factor = if err > 0.0 { SAFETY / err.sqrt().sqrt().sqrt() } else { GROW };
        if !(err <= 1.0) {
            // Also where the trial left the range of floating point, and err is not a number.
            h *= if factor.is_finite() { factor.clamp(SHRINK, SAFETY) } else { SHRINK };
            rejected = true;
            continue;
        }
        accepted += 1;
        let s_new = if last { horizon } else { s + h };
        if node(next) <= s_new {
            dense(flow, &mut w, len, h);
            while next <= steps && node(next) <= s_new {
                let theta = (node(next) - s) / h;
                if last && next == steps {
                    sink(next, &w.y_new.as_flattened()[..len]);
                } else {
                    interpolate(&mut w, theta);
                    sink(next, &w.at_node.as_flattened()[..len]);
                }
                next += 1;
                if next % 1024 == 0 {
                    cancel.check()?;
                }
            }
        }
        if h < escape::GATE * s_new || last {
            let block = flow.block_len();
            let (y, dy) = (w.y_new.as_flattened(), &w.k.as_flattened()[12 * w.chunks * LANES..]);
            let rate = y[..len].chunks(block).zip(dy.chunks(block)).map(|(p, dp)| escape::growth(p, dp));
            escape::check(s_new, rate.fold(0.0, f64::max), horizon)?;
        }
        std::mem::swap(&mut w.y, &mut w.y_new);
        let (first, rest) = w.k.split_at_mut(w.chunks);
        first.copy_from_slice(&rest[11 * w.chunks..12 * w.chunks]);
        s = s_new;
        h *= factor.clamp(SHRINK, if rejected { 1.0 } else { GROW });
        rejected = false;
    }
    Ok(accepted)
}

/// A hundredth of the time in which some block would change by its own size.
fn first_step(flow: &dyn Flow, w: &Workspace, horizon: f64) -> f64 {
    let block = flow.block_len();
    let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut h = horizon;
    let (y, dy) = (w.y.as_flattened(), w.stage(0).as_flattened());
    for b in 0..flow.blocks() {
        let (size, rate) = (largest(&y[b * block..(b + 1) * block]), largest(&dy[b * block..(b + 1) * block]));
        if size > 0.0 && rate > 0.0 {
            h = h.min(0.01 * size / rate);
        }
    }
    h
}

/// One trial step: the stages, the new point and its derivative (stage 13).
fn attempt(flow: &mut dyn Flow, w: &mut Workspace, len: usize, h: f64) {
    macro_rules! stage {
        ($i:literal, $row:expr) => {
            combine(&mut w.stage, &w.y, &w.k, $row, h);
            let at = $i * w.chunks * LANES;
            flow.derivative(&w.stage.as_flattened()[..len], &mut w.k.as_flattened_mut()[at..at + len]);
        };
    }
    stage!(1, &t::A2);
    stage!(2, &t::A3);
    stage!(3, &t::A4);
    stage!(4, &t::A5);
    stage!(5, &t::A6);
    stage!(6, &t::A7);
    stage!(7, &t::A8);
    stage!(8, &t::A9);
    stage!(9, &t::A10);
    stage!(10, &t::A11);
    stage!(11, &t::A12);
    combine(&mut w.y_new, &w.y, &w.k, &t::B, h);
    let at = 12 * w.chunks * LANES;
    flow.derivative(&w.y_new.as_flattened()[..len], &mut w.k.as_flattened_mut()[at..at + len]);
}

/// The error estimate of the method, relative to each block's largest entry; the largest over the blocks.
fn error_norm(flow: &dyn Flow, w: &Workspace, h: f64) -> f64 {
    let block = flow.block_len();
    let lanes = block / LANES;
    let mut worst = 0.0_f64;
    for b in 0..flow.blocks() {
        let (mut five, mut three, mut scale) = ([0.0; LANES], [0.0; LANES], [0.0_f64; LANES]);
        for c in b * lanes..(b + 1) * lanes {
            let (mut e5, mut e3) = ([0.0; LANES], [0.0; LANES]);
            for &(j, a) in &t::E5 {
                let v = &w.k[j * w.chunks + c];
                for i in 0..LANES {
                    e5[i] += a * v[i];
                }
            }
            for &(j, a) in &t::E3 {
                let v = &w.k[j * w.chunks + c];
                for i in 0..LANES {
                    e3[i] += a * v[i];
                }
            }
            for i in 0..LANES {
                five[i] += e5[i] * e5[i];
                three[i] += e3[i] * e3[i];
                scale[i] = scale[i].max(w.y[c][i].abs()).max(w.y_new[c][i].abs());
            }
        }
        let (five, three) = (five.iter().sum::<f64>(), three.iter().sum::<f64>());
        let scale = scale.iter().fold(0.0_f64, |m, &v| m.max(v));
        if five.is_nan() || three.is_nan() || scale.is_infinite() {
            return f64::NAN;
        }
        if five > 0.0 && scale > 0.0 {
            worst = worst.max(h * five / (five + 0.01 * three).sqrt() / scale);
        }
    }
    worst
}

/// The dense output's coefficients for the step just taken.
fn dense(flow: &mut dyn Flow, w: &mut Workspace, len: usize, h: f64) {
    macro_rules! stage {
        ($i:literal, $row:expr) => {
            combine(&mut w.stage, &w.y, &w.k, $row, h);
            let at = $i * w.chunks * LANES;
            flow.derivative(&w.stage.as_flattened()[..len], &mut w.k.as_flattened_mut()[at..at + len]);
        };
    }
    stage!(13, &t::A14);
    stage!(14, &t::A15);
    stage!(15, &t::A16);
    let n = w.chunks;
    for c in 0..n {
        for i in 0..LANES {
            let (dy, first, last) = (w.y_new[c][i] - w.y[c][i], h * w.k[c][i], h * w.k[12 * n + c][i]);
            w.dense[c][i] = dy;
            w.dense[n + c][i] = first - dy;
            w.dense[2 * n + c][i] = 2.0 * dy - (first + last);
        }
    }
    w.stage.fill([0.0; LANES]);
    combine(&mut w.dense[3 * n..4 * n], &w.stage, &w.k, &t::D4, h);
    combine(&mut w.dense[4 * n..5 * n], &w.stage, &w.k, &t::D5, h);
    combine(&mut w.dense[5 * n..6 * n], &w.stage, &w.k, &t::D6, h);
    combine(&mut w.dense[6 * n..7 * n], &w.stage, &w.k, &t::D7, h);
}

/// The state at s + θ h.
fn interpolate(w: &mut Workspace, theta: f64) {
    let back = 1.0 - theta;
    let mut weight = 1.0;
    let row: [(usize, f64); 7] = std::array::from_fn(|j| {
        weight *= if j % 2 == 0 { theta } else { back };
        (j, weight)
    });
    combine(&mut w.at_node, &w.y, &w.dense, &row, 1.0);
}
