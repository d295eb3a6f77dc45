//! Newton's method with the exact Hessian, damped by a multiple of the identity.
//!
//! Each iteration factorises H + μ**I** with μ raised until the matrix is positive definite and the step pays (the ratio
//! of actual to predicted decrease is positive), and lowered after good steps; with μ = 0 the last iterations converge
//! quadratically. Where rounding hides the decrease of Θ, a step that lowers the gradient is taken instead. Every loop
//! is bounded, and the bound met is a [`Status`].

use super::dense;
use super::start::{Variable, advance, restrict, restrict_form};

/// A function of gains laid out as one vector of `width` entries.
pub(super) trait Objective {
    fn width(&self) -> usize;
    /// The value at `g`; what it computes on the way serves the next gradient and Hessian.
    fn value(&mut self, g: &[f64]) -> f64;
    /// The gradient at the point last evaluated.
    fn gradient(&mut self, g: &[f64], out: &mut [f64]);
    /// The Hessian at the point last evaluated, row-major; at least the blocks on and below the diagonal.
    fn hessian(&mut self, g: &[f64], out: &mut [f64]);
    /// Size of the parts that cancel in the gradient at `g`: what its norm is relative to.
    fn gradient_scale(&self, g: &[f64]) -> f64;
    /// Size of the parts of the value: what its rounding is relative to.
    fn value_scale(&self) -> f64;
}

/// How a minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The relative gradient norm fell below the tolerance.
    Converged,
    /// Rounding stopped the progress above the tolerance.
    Stalled,
    /// The iteration limit was met.
    IterationLimit,
}

impl Status {
    /// A word for each status.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled",
            Self::IterationLimit => "iteration_limit",
        }
    }
}

/// When to stop, and how far one step may go.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub iterations: usize,
    /// Relative gradient norm aimed at.
    pub tolerance: f64,
    /// Relative gradient norm that counts as converged when rounding stops the progress.
    pub acceptable: f64,
    /// Longest step, `f64::INFINITY` for none.
    pub longest: f64,
}

impl Limits {
    fn end(&self, value: f64, slope: f64, scale: f64, iterations: usize, limit: bool) -> Reached {
        let relative = if slope == 0.0 { 0.0 } else { slope / scale };
        let status = match (relative <= self.acceptable, limit) {
            (true, _) => Status::Converged,
            (false, true) => Status::IterationLimit,
            (false, false) => Status::Stalled,
        };
        Reached { value, gradient_norm: relative, iterations, status }
    }
}

/// The best point known: a descent that only leads back to it, or cannot get below it, need not be finished.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rival<'a> {
    pub g: &'a [f64],
    pub value: f64,
    /// Distance at which a descent has come back to it.
    pub near: f64,
}

/// How much of a Newton step's predicted decrease the steps after it may add, once the prediction holds.
const REST: f64 = 100.0;
/// How fast predictions fall, from one step to the next, once Newton converges quadratically; in a narrow valley they
/// fall slowly for hundreds of steps, and what they add up to cannot be foretold.
const FALLING: f64 = 0.01;

/// What a minimisation reached.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reached {
    pub value: f64,
    pub gradient_norm: f64,
    pub iterations: usize,
    pub status: Status,
}

/// Scratch that is reused from solve to solve.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    full: Vec<f64>,
    form: Vec<f64>,
    gradient: Vec<f64>,
    hessian: Vec<f64>,
    factor: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
}

#[inline(always)]
fn grow(buffer: &mut Vec<f64>, len: usize) -> &mut [f64] {
    if buffer.len() < len {
        buffer.resize(len, 0.0);
    }
    &mut buffer[..len]
}

#[inline(always)]
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// Damping tried per iteration before giving up; each raises μ fourfold.
const DAMPINGS: usize = 80;
/// First damping, relative to the largest diagonal entry of the Hessian.
const FIRST_DAMPING: f64 = 1e-3;

/// Descends from `g` along `variables`, leaving the end point in `g`.
#[inline(always)]
pub(super) fn minimise<O: Objective>(
    objective: &mut O,
    g: &mut [f64],
    variables: &[Variable],
    limits: Limits,
    rival: Option<Rival>,
    w: &mut Workspace,
) -> Reached {
    let (d, width) = (variables.len(), objective.width());
    let full = grow(&mut w.full, width);
    let form = grow(&mut w.form, width * width);
    let gradient = grow(&mut w.gradient, d);
    let hessian = grow(&mut w.hessian, d * d);
    let factor = grow(&mut w.factor, d * d);
    let step = grow(&mut w.step, d);
    let trial = grow(&mut w.trial, width);

    let mut value = objective.value(g);
    let noise_scale = objective.value_scale();
    let mut damping = 0.0;
    objective.gradient(g, full);
    restrict(full, variables, gradient);
    let mut slope = super::objective::norm(gradient);
    let mut iterations = 0;
    // Whether the last step kept its promise, and what it promised.
    let (mut trusted, mut expected) = (false, 0.0);
    loop {
        let scale = objective.gradient_scale(g);
        if slope <= limits.tolerance * scale || iterations == limits.iterations {
            return limits.end(value, slope, scale, iterations, iterations == limits.iterations);
        }
        if let Some(rival) = rival
            && value >= rival.value
            && squared_distance(g, rival.g) <= rival.near * rival.near
        {
            return limits.end(value, slope, scale, iterations, false);
        }
        iterations += 1;
        objective.hessian(g, form);
        restrict_form(form, width, variables, hessian, d);
        let largest = (0..d).fold(0.0, |m: f64, i| m.max(hessian[i * d + i].abs()));
        let noise = 1e-15 * (value + (value * noise_scale).sqrt());
        let mut accepted = false;
        for _ in 0..DAMPINGS {
            factor.copy_from_slice(hessian);
            for i in 0..d {
                factor[i * d + i] += damping;
            }
            let raise = (4.0 * damping).max(FIRST_DAMPING * largest).max(f64::MIN_POSITIVE);
            if !dense::factorise(factor, d) {
                damping = raise;
                continue;
            }
            for (s, g) in step.iter_mut().zip(gradient.iter()) {
                *s = -g;
            }
            dense::solve(factor, d, step);
            let length2: f64 = step.iter().map(|s| s * s).sum();
            if length2 > limits.longest * limits.longest {
                damping = raise;
                continue;
            }
            let inner: f64 = step.iter().zip(gradient.iter()).map(|(s, g)| s * g).sum();
            let predicted = -0.5 * (inner - damping * length2);
            if let Some(rival) = rival
                && trusted
                && damping == 0.0
                && predicted < FALLING * expected
                && value - REST * predicted > rival.value
            {
                return limits.end(value, slope, scale, iterations, false);
            }
            trial.copy_from_slice(g);
            advance(trial, variables, step);
            let next = objective.value(trial);
            let actual = value - next;
            let paid = actual > 1e-4 * predicted;
            if paid || predicted <= noise {
                objective.gradient(trial, full);
                restrict(full, variables, step);
                let next_slope = super::objective::norm(step);
                if paid || next_slope < slope && actual >= -noise {
                    gradient.copy_from_slice(step);
                    g.copy_from_slice(trial);
                    if actual > 0.75 * predicted {
                        damping *= 0.125;
                        if damping < FIRST_DAMPING * FIRST_DAMPING * largest {
                            damping = 0.0;
                        }
                    }
                    trusted = damping == 0.0 && (actual - predicted).abs() <= 0.25 * predicted;
                    expected = predicted;
                    (value, slope, accepted) = (next, next_slope, true);
                    break;
                }
                if predicted <= noise {
                    break;
                }
            }
            damping = raise;
        }
        if !accepted {
            value = objective.value(g);
            let scale = objective.gradient_scale(g);
            return limits.end(value, slope, scale, iterations, false);
        }
    }
}
