//! Newton's method with the exact Hessian, damped by a multiple of the identity; several descents side by side.
//!
//! Each iteration factorises H + μ**I** with μ raised until the matrix is positive definite, the step is no longer than
//! allowed and it pays (the ratio of actual to predicted decrease is positive), and lowered after good steps; with μ = 0
//! the last iterations converge quadratically. Where rounding hides the decrease of Θ, a step that lowers the gradient is
//! taken instead. Every loop is bounded, and the bound met is a [`Status`](super::Status).
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | Θ, ‖∇Θ‖ | `value`, `slope` | at the point of each lane, ∇Θ with respect to its variables |
//! | H | `hessian` | ∇²Θ there, restricted to the variables; packed lower triangle |
//! | μ | `damping` | what is added to the diagonal of H |
//! | s = −(H + μ**I**)⁻¹∇Θ | `step` | solves (H + μ**I**)s = −∇Θ |
//! | −(∇Θᵀs + ½sᵀHs) | `predicted` | the decrease of the quadratic model, ½(μ‖s‖² − ∇Θᵀs) |
//! | Θ(G) − Θ(G + s) | `actual` | the decrease |
//!
//! A list of descents is worked through in the lanes of a [`Number`]: each lane is at its own point, with its own μ, and
//! takes the next descent of the list when its own has ended. No lane sees another, so what a descent gives does not
//! depend on its neighbours, nor on whether it had any: sums over the unknowns, among which a lane finds zeros for those
//! of its neighbours, go in order. A set of lanes is a number of 16 bits, lane 0 the lowest.
//!
//! All methods are inlined into one function, which is compiled for the instructions of its lanes.

use super::factor::{self, Backend};
use super::layout::{Layout, packed};
use super::objective::Objective;
use super::tasks::{Limits, Owner, Reached, Tasks};
use super::workspace::Workspace;
use crate::cancel::raised;
use crate::error::Stopped;
use crate::simd::{Number, dot_in_order, take};

/// How much of a Newton step's predicted decrease the steps after it may add, once the prediction holds.
const REST: f64 = 100.0;
/// How fast predictions fall, from one step to the next, once Newton converges quadratically; in a narrow valley they
/// fall slowly for hundreds of steps, and what they add up to cannot be foretold.
const FALLING: f64 = 0.1;
/// Rounding of Θ, relative to the parts that cancel in it, in double and in single precision.
const NOISE: f64 = 1e-15;
const NOISE_SINGLE: f64 = 5e-7;
/// Damping tried per iteration before giving up.
const DAMPINGS: f64 = 80.0;
/// First damping, relative to the largest diagonal entry of the Hessian.
const FIRST_DAMPING: f64 = 1e-3;
/// First damping after a step that did not pay, relative likewise.
const FIRST_REJECTED: f64 = 1e-2;
/// Length aimed at where a step was too long, relative to the longest, and the least by which μ is then raised.
const AIM: f64 = 0.8;
const LEAST_RAISE: f64 = 1.25;

/// Descends from every point of `tasks` along the variables of its owner, and leaves each end point in its place; once
/// the backend's token is raised they are left unfinished.
#[inline(always)]
pub fn minimise<T: Number, O: Objective<T>>(
    objective: &mut O,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    backend: Backend,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    let mut descents = Descents::new(objective, tasks, owners, limits, backend, w)?;
    loop {
        descents.refill();
        if descents.busy == 0 || raised(backend.cancel) {
            return Ok(());
        }
        let mut round = Round::new();
        descents.propose(&mut round);
        descents.attempt(&mut round);
        descents.raise(&mut round);
        descents.retire(&round);
    }
}

/// What each lane knows of its descent.
struct State<T> {
    value: T,
    slope: T,
    /// What the slope is relative to.
    scale: T,
    damping: T,
    iterations: T,
    /// Damping tried in this iteration.
    dampings: T,
    /// The decrease predicted for the last step.
    expected: T,
    /// Θ at the incumbent, and the squared distance at which a descent is back at it.
    incumbent: T,
    near: T,
}

/// What one round through the lanes finds: numbers for each lane, and sets of lanes.
struct Round<T> {
    /// How far rounding may be in Θ.
    noise: T,
    predicted: T,
    /// What μ becomes where the round fails.
    raise: T,
    /// Lanes with a step to be tried.
    moved: u16,
    /// Lanes that need a higher μ.
    failed: u16,
    /// Lanes whose descent ends, and among them those that cannot get below their incumbent and those that rounding
    /// stopped.
    ended: u16,
    pruned: u16,
    stopped: u16,
}

impl<T: Number> Round<T> {
    #[inline(always)]
    fn new() -> Self {
        let zero = T::splat(0.0);
        Self { noise: zero, predicted: zero, raise: zero, moved: 0, failed: 0, ended: 0, pruned: 0, stopped: 0 }
    }
}

/// How far rounding may be in a value, the parts that cancel in it being of size `scale`.
#[inline(always)]
fn rounding<T: Number>(value: T, scale: T) -> T {
    T::splat(if T::SINGLE { NOISE_SINGLE } else { NOISE }) * (value + (value * scale).sqrt())
}

/// The unknowns that the lanes may have together: one network's, or where there are several anything.
#[inline(always)]
pub fn unknowns<T: Number>(tasks: &Tasks, owners: &[Owner]) -> usize {
    if T::LANES > 1 {
        return tasks.width();
    }
    (0..tasks.len()).map(|task| owners[tasks.owner(task)].variables.len()).max().unwrap_or(0)
}

/// The descents of a list, as many at a time as there are lanes.
struct Descents<'a, T: Number, O> {
    objective: &'a mut O,
    tasks: &'a mut Tasks,
    owners: &'a [Owner<'a>],
    limits: Limits,
    backend: Backend<'a>,
    layout: &'a mut Layout<T>,
    /// The points, and the gradients there with respect to all gains; the same for the points tried.
    g: &'a mut [T],
    full: &'a mut [T],
    trial: &'a mut [T],
    trial_full: &'a mut [T],
    /// The incumbents.
    best: &'a mut [T],
    row: &'a mut [T],
    hessian: &'a mut [T],
    factor: &'a mut [T],
    gradient: &'a mut [T],
    step: &'a mut [T],
    other: &'a mut [T],
    s: State<T>,
    noise_scale: T,
    /// The largest diagonal entry of H.
    largest: T,
    /// Whether H is that of former points.
    stale: bool,
    /// The descent in each lane, and the next of the list.
    task: [usize; 16],
    next: usize,
    /// Lanes that work; that have a new point, not yet evaluated; whose last step kept its promise; with an incumbent.
    busy: u16,
    fresh: u16,
    trusted: u16,
    compared: u16,
}

impl<'a, T: Number, O: Objective<T>> Descents<'a, T, O> {
    #[inline(always)]
    fn new(
        objective: &'a mut O,
        tasks: &'a mut Tasks,
        owners: &'a [Owner<'a>],
        limits: Limits,
        backend: Backend<'a>,
        w: &'a mut Workspace<T>,
    ) -> Result<Self, Stopped> {
        let (width, zero, noise_scale) = (objective.width(), T::splat(0.0), T::splat(objective.value_scale()));
        let copies = width / tasks.width().max(1);
        let unknowns = copies * unknowns::<T>(tasks, owners);
        w.grow(width, unknowns)?;
        if limits.iterations > 0 {
            w.grow_matrices(unknowns, backend.cancel)?;
        }
        w.layout.reserve(tasks.width(), unknowns)?;
        w.layout.begin(tasks.width(), copies);
        Ok(Self {
            objective,
            tasks,
            owners,
            limits,
            backend,
            layout: &mut w.layout,
            g: &mut w.g[..width],
            full: &mut w.slope[..width],
            trial: &mut w.trial[..width],
            trial_full: &mut w.trial_slope[..width],
            best: &mut w.incumbent[..width],
            row: &mut w.row,
            hessian: &mut w.hessian,
            factor: &mut w.factor,
            gradient: &mut w.gradient,
            step: &mut w.step,
            other: &mut w.other,
            s: State {
                value: zero,
                slope: zero,
                scale: zero,
                damping: zero,
                iterations: zero,
                dampings: zero,
                expected: zero,
                incumbent: zero,
                near: zero,
            },
            noise_scale,
            largest: zero,
            stale: true,
            task: [0; 16],
            next: 0,
            busy: 0,
            fresh: 0,
            trusted: 0,
            compared: 0,
        })
    }

    /// Gives the lanes without work the next descents of the list.
    #[inline(always)]
    fn refill(&mut self) {
        let mut changed = false;
        for lane in 0..T::LANES {
            if self.busy >> lane & 1 == 0 && self.next < self.tasks.len() {
                self.begin(lane);
                changed = true;
            }
        }
        if changed {
            self.layout.list();
            self.stale = true;
        }
    }

    /// Begins the next descent of the list in a lane.
    #[inline(always)]
    fn begin(&mut self, lane: usize) {
        let (next, bit) = (self.next, 1 << lane);
        let owner = &self.owners[self.tasks.owner(next)];
        for (g, &x) in self.g.iter_mut().zip(self.tasks.point(next)) {
            g.set_lane(lane, x);
        }
        let (complex, scale) = self.tasks.kind(next);
        self.objective.set_lane(lane, complex, scale);
        self.compared &= !bit;
        if let Some(known) = owner.incumbent {
            self.compared |= bit;
            for (best, &x) in self.best.iter_mut().zip(known.g) {
                best.set_lane(lane, x);
            }
            self.s.incumbent.set_lane(lane, known.value);
            self.s.near.set_lane(lane, known.near * known.near);
        }
        self.s.damping.set_lane(lane, 0.0);
        self.s.iterations.set_lane(lane, 0.0);
        self.busy |= bit;
        self.fresh |= bit;
        self.trusted &= !bit;
        self.layout.place(lane, owner.variables);
        self.task[lane] = next;
        self.next += 1;
    }

    /// Finds the step of every lane whose point is known: it is to be tried, or μ to be raised, or the descent pruned.
    #[inline(always)]
    fn propose(&mut self, round: &mut Round<T>) {
        let known = self.busy & !self.fresh;
        if known == 0 {
            return;
        }
        self.differentiate();
        let largest = self.largest;
        round.noise = rounding(self.s.value, self.noise_scale);
        let raise = (T::splat(4.0) * self.s.damping).or_larger(T::splat(FIRST_DAMPING) * largest).or_larger(T::least());
        let d = self.layout.len();
        let (hessian, factor) = (&self.hessian[..packed(d)], &mut self.factor[..d * d]);
        let (definite, lack) = factor::factorise(hessian, self.s.damping, self.layout, self.backend, factor);
        let definite = T::bits(definite) & known;
        round.failed = known & !definite;
        // An indefinite matrix lacks about what its pivot did.
        let lack = self.s.damping + T::select(lack.less(largest), lack, largest);
        round.raise = T::select(T::mask(definite), raise, raise.or_larger(lack));
        if definite == 0 {
            return;
        }
        let length2 = self.solve();
        let longest = self.limits.longest;
        let short = T::bits(length2.at_most(T::splat(longest * longest)));
        let long = definite & !short;
        if long != 0 {
            round.raise = T::select(T::mask(long), self.damping_for_length(length2), round.raise);
        }
        round.failed |= long;
        let along = dot_in_order(&self.step[..d], &self.gradient[..d]);
        round.predicted = T::splat(-0.5) * (along - self.s.damping * length2);
        round.pruned = definite & short & self.cannot_win(round);
        round.ended = round.pruned;
        round.moved = definite & short & !round.pruned;
    }

    /// Brings the Hessian and the gradient with respect to the variables up to date.
    #[inline(always)]
    fn differentiate(&mut self) {
        if self.stale {
            let d = self.layout.len();
            let hessian = &mut self.hessian[..packed(d)];
            self.objective.prepare(self.g);
            self.layout.restrict_form(&*self.objective, self.g, self.row, hessian, self.backend.cancel);
            self.layout.restrict(self.full, &mut self.gradient[..d]);
            self.largest = self.layout.largest(hessian);
            self.stale = false;
        }
    }

    /// Solves (H + μ**I**)s = −∇Θ by the factor; ‖s‖².
    #[inline(always)]
    fn solve(&mut self) -> T {
        let (d, zero) = (self.layout.len(), T::splat(0.0));
        let (factor, step) = (&self.factor[..d * d], &mut self.step[..d]);
        for (step, &g) in step.iter_mut().zip(self.gradient.iter()) {
            *step = zero - g;
        }
        factor::forward(factor, d, step);
        factor::back(factor, d, step);
        dot_in_order(step, step)
    }

    /// μ at which a step that is too long has about the length aimed at: Moré and Sorensen's, by Newton on the length's
    /// reciprocal.
    #[inline(always)]
    fn damping_for_length(&mut self, length2: T) -> T {
        let (d, damping) = (self.layout.len(), self.s.damping);
        let other = &mut self.other[..d];
        other.copy_from_slice(&self.step[..d]);
        let slope = factor::forward(&self.factor[..d * d], d, other);
        let length = length2.sqrt();
        let excess = length * T::splat(1.0 / (AIM * self.limits.longest)) - T::splat(1.0);
        let better = damping + length2 / slope * excess;
        let least = (T::splat(LEAST_RAISE) * damping)
            .or_larger(T::splat(FIRST_DAMPING * FIRST_DAMPING) * self.largest)
            .or_larger(T::least());
        least.or_larger(better)
    }

    /// Lanes in which all that is left to gain, foretold by quadratic convergence, does not lead below the incumbent.
    #[inline(always)]
    fn cannot_win(&self, round: &Round<T>) -> u16 {
        let (s, zero) = (&self.s, T::splat(0.0));
        let margin = if T::SINGLE { round.noise } else { zero };
        let rest = s.value - T::splat(REST) * round.predicted - margin;
        self.compared
            & self.trusted
            & T::bits(s.damping.at_most(zero))
            & T::bits(round.predicted.less(T::splat(FALLING) * s.expected))
            & T::bits(s.incumbent.less(rest))
    }

    /// Tries the steps proposed, and evaluates new points; takes the steps that pay.
    #[inline(always)]
    fn attempt(&mut self, round: &mut Round<T>) {
        let tried = round.moved | self.fresh;
        if tried == 0 {
            return;
        }
        let d = self.layout.len();
        let step = &mut self.step[..d];
        self.trial.copy_from_slice(self.g);
        if round.moved != 0 {
            if T::LANES > 1 {
                let mask = T::mask(round.moved);
                for s in step.iter_mut() {
                    *s = T::select(mask, *s, T::splat(0.0));
                }
            }
            self.layout.advance(self.trial, step);
        }
        let value = self.objective.value(self.trial);
        self.objective.gradient(self.trial, self.trial_full);
        self.layout.restrict(self.trial_full, step);
        let slope = dot_in_order(step, step).sqrt();
        let taken = self.judge(round, value, slope) | self.fresh;
        if taken != 0 {
            self.accept(round, taken, value, slope);
        }
        self.fresh = 0;
    }

    /// Which of the steps tried are taken; the others need a higher μ, or rounding stops them.
    #[inline(always)]
    fn judge(&mut self, round: &mut Round<T>, value: T, slope: T) -> u16 {
        let (s, predicted, zero) = (&mut self.s, round.predicted, T::splat(0.0));
        let actual = s.value - value;
        let paid = T::bits((T::splat(1e-4) * predicted).less(actual));
        let small = T::bits(predicted.at_most(round.noise));
        let flatter = T::bits(slope.less(s.slope)) & T::bits((zero - round.noise).at_most(actual));
        let accepted = round.moved & (paid | small & flatter);
        round.stopped = round.moved & !accepted & small;
        round.ended |= round.stopped;
        round.failed |= round.moved & !accepted & !small;

        let mut damping = s.damping * T::splat(0.125);
        damping = T::select(damping.less(T::splat(FIRST_DAMPING * FIRST_DAMPING) * self.largest), zero, damping);
        let good = accepted & T::bits((T::splat(0.75) * predicted).less(actual));
        s.damping = T::select(T::mask(good), damping, s.damping);
        let kept =
            T::bits((actual - predicted).abs().at_most(T::splat(0.25) * predicted)) & T::bits(s.damping.at_most(zero));
        self.trusted = self.trusted & !accepted | accepted & kept;
        s.expected = T::select(T::mask(accepted), predicted, s.expected);
        accepted
    }

    /// Makes the points tried those of the lanes `taken`, and ends the descents that have arrived.
    #[inline(always)]
    fn accept(&mut self, round: &mut Round<T>, taken: u16, value: T, slope: T) {
        let (mask, zero) = (T::mask(taken), T::splat(0.0));
        take(mask, self.trial, self.g);
        take(mask, self.trial_full, self.full);
        self.objective.keep(mask);
        let s = &mut self.s;
        s.value = T::select(mask, value, s.value);
        s.slope = T::select(mask, slope, s.slope);
        s.scale = T::select(mask, self.objective.gradient_scale(self.trial), s.scale);
        let mut distance = zero;
        for (&a, &b) in self.g.iter().zip(self.best.iter()) {
            distance = distance.plus(a - b, a - b);
        }
        // Near its incumbent a value in single precision does not say which is lower.
        let above = if T::SINGLE { u16::MAX } else { T::bits(s.incumbent.at_most(s.value)) };
        let back = above & T::bits(distance.at_most(s.near));
        let flat = T::bits(s.slope.at_most(T::splat(self.limits.tolerance) * s.scale));
        let spent = T::bits(T::splat(self.limits.iterations as f64).at_most(s.iterations));
        round.ended |= taken & (flat | spent | self.compared & back);
        round.stopped |= taken & flat;
        let going = T::mask(taken & !round.ended);
        s.iterations = T::select(going, s.iterations + T::splat(1.0), s.iterations);
        s.dampings = T::select(going, zero, s.dampings);
        self.stale = true;
    }

    /// Raises μ where the matrix was indefinite, the step too long, or not worth taking.
    #[inline(always)]
    fn raise(&mut self, round: &mut Round<T>) {
        if round.failed == 0 {
            return;
        }
        let s = &mut self.s;
        let rejected = T::mask(round.moved & round.failed);
        let higher = (T::splat(8.0) * s.damping).or_larger(T::splat(FIRST_REJECTED) * self.largest);
        let raise = T::select(rejected, higher, round.raise);
        let mask = T::mask(round.failed);
        s.damping = T::select(mask, raise, s.damping);
        s.dampings = T::select(mask, s.dampings + T::splat(1.0), s.dampings);
        round.ended |= round.failed & T::bits(T::splat(DAMPINGS).at_most(s.dampings));
    }

    /// Writes down what the descents that ended have reached, and frees their lanes.
    #[inline(always)]
    fn retire(&mut self, round: &Round<T>) {
        let (s, mut pruned) = (&self.s, round.pruned);
        self.busy &= !round.ended;
        if T::SINGLE && round.stopped != 0 {
            // Nor can steps that rounding hides lead below an incumbent that lies so much lower.
            let hidden = T::splat(REST * REST) * rounding(s.value, self.noise_scale);
            pruned |= round.stopped & self.compared & T::bits((s.incumbent + hidden).less(s.value));
        }
        let mut ended = round.ended;
        while ended != 0 {
            let lane = ended.trailing_zeros() as usize;
            ended &= ended - 1;
            let task = self.task[lane];
            for (x, g) in self.tasks.point_mut(task).iter_mut().zip(self.g.iter()) {
                *x = g.lane(lane);
            }
            self.layout.place(lane, &[]);
            let (iterations, scale) = (s.iterations.lane(lane) as usize, s.scale.lane(lane));
            let reached = Reached::new(s.value.lane(lane), s.slope.lane(lane), scale, iterations, &self.limits);
            self.tasks.end(task, reached, pruned >> lane & 1 == 1);
        }
    }
}
