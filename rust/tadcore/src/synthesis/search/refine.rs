//! Newton to the end for every player, where the parts of Θ differ by decades from player to player.
//!
//! A descent ends where the gradient is small relative to the parts that cancel in it, those of all players together. What
//! it leaves of a player whose own parts are a 10⁻⁶th of another's may then be anything. Where players differ by more than
//! [`UNEVEN`], each row of the gradient is measured by the parts of its own player, and the search ends with Newton's
//! method in variables scaled by the Hessian's diagonal.
//!
//! In a flat valley even that says little: what a gradient leaves to be gained is ½∇Θᵀ∇²Θ⁻¹∇Θ. There, and where S has
//! next to no weight, Newton goes on until this is a [`NOTHING`]th of Θ, and gains that leave more than [`LITTLE`] of it
//! are not called converged.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ‖∇_iΘ‖ / s_i, the largest | [`Rows::worst`] | the relative gradient of one player |
//! | s_i | `Rows::scale` | the sizes of the parts of ∇_iΘ at F |
//! | ½∇Θᵀ∇²Θ⁻¹∇Θ | `left` | what Newton's model at the point has still to gain |
//!
//! Source: ours.

use super::candidate::Candidate;
use super::dispatch::Kind;
use super::stages::Search;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::zeros;
use crate::simd::{Width, norm, widened};
use crate::synthesis::newton::{
    Backend, Layout, Limits, Objective, Reached, Status, Variable, back, factorise, forward, packed,
};
use crate::synthesis::theta::{Problem, RealGains};

/// Ratio of the parts of two players from which they are looked at one by one.
const UNEVEN: f64 = 100.0;
/// Steps, and dampings tried in one.
const STEPS: usize = 100;
const DAMPINGS: usize = 60;
/// Rounding of Θ, relative to the parts that cancel in it.
const NOISE: f64 = 1e-15;
/// Damping after the first step that does not pay; the diagonal of the scaled Hessian is one.
const FIRST_DAMPING: f64 = 1e-3;
/// What may be left to be gained, relative to Θ: where Newton ends, and where gains count as converged.
const NOTHING: f64 = 1e-10;
const LITTLE: f64 = 1e-7;
/// What is added to the scaled Hessian, whose diagonal is one, where rounding makes it indefinite.
const ROUNDED: [f64; 4] = [0.0, 1e-14, 1e-12, 1e-10];
/// The least curvature that a scaled Hessian can show.
const ROUNDING: f64 = 1e-16;
/// A weight on S, relative to Θ's parts, below which doubles do not show the slope along the valley that it makes.
const UNSEEN: f64 = 1e-13;
/// Iterations, at most, after the tolerance is met in a narrow valley.
const POLISH: usize = 50;
/// What asks for memory here.
const WHAT: &str = "the last steps of the synthesis of one network";

/// The sizes of the parts of Θ's gradient, player by player.
pub(super) struct Rows {
    scale: Vec<f64>,
}

impl Rows {
    pub(super) fn of(problem: &Problem) -> Self {
        let (n, of) = (problem.size, &problem.theta.double);
        let rows = |matrix: &[f64]| -> Vec<f64> { matrix.chunks_exact(n).map(norm).collect() };
        let f = rows(&of.fne);
        let mut scale: Vec<f64> = (0..problem.rows)
            .map(|i| f[i] * (3.0 * of.strength[i] * of.scale.target + 4.0 * of.closeness[i]))
            .collect();
        for w in &of.coupling {
            let w = rows(w);
            let all: f64 = w.iter().zip(&f).map(|(w, f)| w * f).sum();
            scale.iter_mut().zip(&w).for_each(|(s, w)| *s += 16.0 * w * all);
        }
        Self { scale }
    }

    /// Whether players differ so much that they are looked at one by one.
    pub(super) fn uneven(&self) -> bool {
        let positive = self.scale.iter().filter(|&&s| s > 0.0);
        let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(low, high), &s| (low.min(s), high.max(s)));
        high > UNEVEN * low
    }

    /// The largest relative gradient of a player.
    fn worst(&self, variables: &[Variable], gradient: &[f64], n: usize) -> f64 {
        let mut rest = gradient;
        let mut worst = 0.0_f64;
        for row in variables.chunk_by(|a, b| a.own == b.own) {
            let (of_row, others) = rest.split_at(row.len());
            let size = norm(of_row);
            if size > 0.0 {
                worst = worst.max(size / self.scale[row[0].own / n]);
            }
            rest = others;
        }
        worst
    }
}

impl Search<'_> {
    /// In a narrow valley a gradient within the tolerance still leaves the gains uncertain: Newton goes on there for as
    /// long as the gradient falls.
    pub(super) fn polish(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        self.begin(1);
        for (e, candidate) in candidates.iter().enumerate().filter(|(_, candidate)| !candidate.quick) {
            self.tasks.add(e, false, 0.0)?.copy_from_slice(&candidate.g);
        }
        if self.tasks.len() == 0 {
            return Ok(());
        }
        let limits = self.limits;
        self.limits = Limits { iterations: POLISH, tolerance: 0.0, ..limits };
        self.descend(Kind::Real, candidates)?;
        self.limits = limits;
        for task in 0..self.tasks.len() {
            let (candidate, reached) = (&mut candidates[self.tasks.owner(task)], self.tasks.reached(task));
            candidate.iterations += reached.iterations;
            if reached.gradient_norm < candidate.reached.gradient_norm {
                candidate.take(candidate.start, self.tasks.point(task), reached);
            }
        }
        Ok(())
    }

    /// Where players differ much: Newton to the end for each of them. The relative gradient of a candidate is then the
    /// largest of a player, and says whether it has converged.
    pub(super) fn refine(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        let rows = Rows::of(self.problem);
        // Where some S has no weight, minima need not be points.
        let measured = self.problem.unweighted().is_empty();
        let faint = if measured { self.problem.faint() } else { Vec::new() };
        if !rows.uneven() && faint.is_empty() {
            return Ok(());
        }
        let unseen = faint.iter().any(|&i| self.problem.weight(&[i]) < UNSEEN);
        let mut moved = Vec::new();
        for (e, candidate) in candidates.iter_mut().enumerate().filter(|(_, c)| !c.complete && !c.variables.is_empty())
        {
            let before = candidate.iterations;
            follow(Width::in_use(), self.problem, &rows, measured, candidate, self.limits, self.dispatcher.cancel())?;
            if candidate.iterations > before && !candidate.certified {
                moved.push(e);
            }
            if unseen && candidate.reached.status == Status::Converged {
                candidate.reached.status = Status::Stalled;
            }
        }
        self.certify(candidates, &moved)
    }
}

widened! {
    /// Newton's method from the best point of one candidate.
    #[inline(never)]
    fn follow<V>(
        problem: &Problem,
        rows: &Rows,
        measured: bool,
        candidate: &mut Candidate,
        limits: Limits,
        cancel: &CancelToken,
    ) -> Result<(), Stopped> {
        let mut objective = RealGains::<f64, 0>::new(&problem.theta.double, Some(cancel))?;
        let backend = Backend { library: true, width: Width::in_use(), cancel: Some(cancel) };
        let (n, mut layout) = (problem.size, Layout::default());
        layout.reserve(candidate.g.len(), candidate.variables.len())?;
        layout.begin(candidate.g.len(), 1);
        layout.place(0, &candidate.variables);
        layout.list();
        let (d, used) = (layout.len(), layout.used());
        let (mut full, mut row) = (zeros(WHAT, objective.width())?, zeros(WHAT, objective.width())?);
        let (mut gradient, mut step, mut diagonal) = (zeros(WHAT, d)?, zeros(WHAT, d)?, vec![1.0; d]);
        let (mut hessian, mut factor) = (Vec::new(), Vec::new());

        let mut value = objective.value(&candidate.g);
        objective.gradient(&candidate.g, &mut full);
        layout.restrict(&full, &mut gradient);
        let mut worst = rows.worst(&candidate.variables, &gradient, n);
        let (mut damping, mut steps) = (0.0_f64, 0);
        // What is within the tolerance of all is left as it is.
        let enough = if worst > limits.acceptable { limits.tolerance } else { f64::INFINITY };
        let (mut left, mut noise) = (0.0, 0.0);
        while measured || worst > enough && steps < STEPS {
            cancel.check()?;
            if factor.is_empty() {
                (hessian, factor) = (zeros(WHAT, packed(d))?, zeros(WHAT, d * d)?);
            }
            objective.keep(true);
            objective.prepare(&candidate.g);
            layout.restrict_form(&objective, &candidate.g, &mut row, &mut hessian, Some(cancel));
            for (a, scale) in diagonal[..used].iter_mut().enumerate() {
                let size = hessian[packed(a) + a].abs().sqrt();
                *scale = if size > 0.0 { 1.0 / size } else { 1.0 };
            }
            for a in 0..used {
                hessian[packed(a)..packed(a + 1)].iter_mut().zip(&diagonal).for_each(|(h, s)| *h *= diagonal[a] * s);
            }
            noise = NOISE * (value + (value * objective.value_scale()).sqrt());
            if measured {
                left = f64::INFINITY;
                for more in ROUNDED {
                    if factorise(&hessian, more, &layout, backend, &mut factor).0 {
                        step.iter_mut().zip(&gradient).zip(&diagonal).for_each(|((s, g), scale)| *s = g * scale);
                        // What was added may be all that there is along the valley.
                        left = 0.5 * forward(&factor, d, &mut step) * (1.0 + more / ROUNDING);
                        break;
                    }
                }
                if steps == STEPS || worst <= enough && left <= NOTHING * value + noise {
                    break;
                }
            }
            let mut better = None;
            for _ in 0..DAMPINGS {
                cancel.check()?;
                if factorise(&hessian, damping, &layout, backend, &mut factor).0 {
                    step.iter_mut().zip(&gradient).zip(&diagonal).for_each(|((s, g), scale)| *s = -g * scale);
                    forward(&factor, d, &mut step);
                    back(&factor, d, &mut step);
                    let length2: f64 = step.iter().map(|s| s * s).sum();
                    step.iter_mut().zip(&diagonal).for_each(|(s, scale)| *s *= scale);
                    let along: f64 = step.iter().zip(&gradient).map(|(s, g)| s * g).sum();
                    let predicted = -0.5 * (along - damping * length2);
                    let mut trial = candidate.g.clone();
                    layout.advance(&mut trial, &step);
                    let reached = objective.value(&trial);
                    objective.gradient(&trial, &mut full);
                    layout.restrict(&full, &mut step);
                    let slope = rows.worst(&candidate.variables, &step, n);
                    let pays = value - reached > 1e-4 * predicted && predicted > noise;
                    if pays || predicted <= noise && reached <= value + noise && slope < worst {
                        better = Some((trial, reached, slope));
                        break;
                    }
                    if predicted <= noise {
                        break;
                    }
                }
                damping = (8.0 * damping).max(FIRST_DAMPING);
            }
            let Some((trial, reached, slope)) = better else { break };
            damping = if damping > FIRST_DAMPING * FIRST_DAMPING { 0.125 * damping } else { 0.0 };
            candidate.g = trial;
            gradient.copy_from_slice(&step);
            (value, worst, steps) = (reached, slope, steps + 1);
        }
        candidate.iterations += steps;
        let limits = Limits { iterations: usize::MAX, ..limits };
        let scale = candidate.reached.scale;
        candidate.reached = Reached { scale, ..Reached::new(value, worst, 1.0, candidate.iterations, &limits) };
        if candidate.reached.status == Status::Converged && left > LITTLE * value + noise {
            candidate.reached.status = Status::Stalled;
        }
        Ok(())
    }
}
