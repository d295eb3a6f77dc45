//! Newton's method with the exact Hessian, damped by a multiple of the identity; several descents side by side.
//!
//! Each iteration factorises H + μ**I** with μ raised until the matrix is positive definite, the step is no longer than
//! allowed and it pays (the ratio of actual to predicted decrease is positive), and lowered after good steps; with μ = 0
//! the last iterations converge quadratically. Where rounding hides the decrease of Θ, a step that lowers the gradient is
//! taken instead. Every loop is bounded, and the bound met is a [`Status`](super::Status).
//!
//! A list of descents is worked through in the lanes of a [`Number`]: each lane is at its own point, with its own μ, and
//! takes the next descent of the list when its own has ended. No lane sees another, so what a descent gives does not
//! depend on its neighbours, nor on whether it had any: sums over the unknowns, among which a lane finds zeros for those
//! of its neighbours, go in order.

use super::factor::{self, Means};
use super::layout::{Form, packed};
use super::tasks::{Limits, Owner, Reached, Tasks};
use super::workspace::Workspace;
use crate::simd::{Number, dot_in_order, take};

/// A function of gains laid out as one vector of `width` entries, and the form that its Hessian is.
pub(crate) trait Objective<T: Number>: Form<T> {
    fn width(&self) -> usize;
    /// Tells a lane which kind of doubled gains it is to hold, and the scale of their gradient.
    fn set_lane(&mut self, _lane: usize, _complex: bool, _scale: f64) {}
    /// The value at `g`; what it computes on the way serves the next gradient and, once kept, the Hessian.
    fn value(&mut self, g: &[T]) -> T;
    /// The gradient at the point last evaluated.
    fn gradient(&mut self, g: &[T], out: &mut [T]);
    /// Keeps the point last evaluated, in these lanes, for the Hessian.
    fn keep(&mut self, lanes: T::Mask);
    /// Prepares for the rows of the Hessian at `g`, the point kept.
    fn prepare(&mut self, g: &[T]);
    /// Size of the parts that cancel in the gradient at the point last evaluated: what its norm is relative to.
    fn gradient_scale(&self, g: &[T]) -> T;
    /// Size of the parts of the value: what its rounding is relative to.
    fn value_scale(&self) -> f64;
}

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

/// What each lane knows of its descent.
struct State<T> {
    value: T,
    slope: T,
    scale: T,
    damping: T,
    iterations: T,
    /// Damping tried in this iteration.
    dampings: T,
    /// What the last step promised.
    expected: T,
    rival: T,
    near: T,
}

/// How far rounding may be in a value, the parts that cancel in it being of size `scale`.
#[inline(always)]
fn rounding<T: Number>(value: T, scale: T) -> T {
    T::splat(if T::SINGLE { NOISE_SINGLE } else { NOISE }) * (value + (value * scale).sqrt())
}

/// Descends from every point of `tasks` along the variables of its owner, and leaves each end point in its place.
#[inline(always)]
pub(crate) fn minimise<T: Number, O: Objective<T>>(
    objective: &mut O,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<T>,
) {
    let width = objective.width();
    w.grow(width);
    let Workspace { layout, g, slope: full, trial, trial_slope, rival, row, hessian, factor, gradient, step, other } =
        w;
    let (g, full, trial, trial_slope, rival) =
        (&mut g[..width], &mut full[..width], &mut trial[..width], &mut trial_slope[..width], &mut rival[..width]);
    let (zero, noise_scale) = (T::splat(0.0), T::splat(objective.value_scale()));
    let mut s = State {
        value: zero,
        slope: zero,
        scale: zero,
        damping: zero,
        iterations: zero,
        dampings: zero,
        expected: zero,
        rival: zero,
        near: zero,
    };
    layout.begin(tasks.width(), width / tasks.width().max(1));
    let mut task = [0; 16];
    let (mut next, mut largest, mut stale) = (0, zero, true);
    // Lanes that work; that have a new point, not yet evaluated; whose last step kept its promise; that have a rival.
    let (mut busy, mut fresh, mut trusted, mut rivals) = (0u16, 0u16, 0u16, 0u16);
    loop {
        let mut changed = false;
        for lane in 0..T::LANES {
            if busy >> lane & 1 == 1 || next == tasks.len() {
                continue;
            }
            let (owner, bit) = (&owners[tasks.owner(next)], 1 << lane);
            for (g, &x) in g.iter_mut().zip(tasks.point(next)) {
                g.set_lane(lane, x);
            }
            let (complex, scale) = tasks.kind(next);
            objective.set_lane(lane, complex, scale);
            rivals &= !bit;
            if let Some(known) = owner.rival {
                rivals |= bit;
                for (rival, &x) in rival.iter_mut().zip(known.g) {
                    rival.set_lane(lane, x);
                }
                s.rival.set_lane(lane, known.value);
                s.near.set_lane(lane, known.near * known.near);
            }
            s.damping.set_lane(lane, 0.0);
            s.iterations.set_lane(lane, 0.0);
            (busy, fresh, trusted) = (busy | bit, fresh | bit, trusted & !bit);
            layout.place(lane, owner.variables);
            task[lane] = next;
            (next, changed) = (next + 1, true);
        }
        if busy == 0 {
            return;
        }
        if changed {
            layout.list();
            stale = true;
        }
        let d = layout.len();
        let (gradient, step, w_step) = (&mut gradient[..d], &mut step[..d], &mut other[..d]);
        let (hessian, factor) = (&mut hessian[..packed(d)], &mut factor[..d * d]);
        let old = busy & !fresh;
        let (mut moved, mut failed, mut ended) = (0, 0, 0);
        // Of the lanes that ended: those that cannot get below their rival, and those that rounding stopped.
        let (mut settled, mut stopped) = (0, 0);
        let (mut noise, mut predicted, mut raise) = (zero, zero, zero);
        if old != 0 {
            if stale {
                objective.prepare(g);
                layout.restrict_form(objective, g, row, hessian);
                layout.restrict(full, gradient);
                largest = layout.largest(hessian);
                stale = false;
            }
            noise = rounding(s.value, noise_scale);
            raise = (T::splat(4.0) * s.damping).or_larger(T::splat(FIRST_DAMPING) * largest).or_larger(T::least());
            let (definite, lack) = factor::factorise(hessian, s.damping, layout, means, factor);
            let definite = T::bits(definite) & old;
            failed = old & !definite;
            // An indefinite matrix lacks about what its pivot did.
            let lack = s.damping + T::select(lack.less(largest), lack, largest);
            raise = T::select(T::mask(definite), raise, raise.or_larger(lack));
            if definite != 0 {
                for (step, &g) in step.iter_mut().zip(gradient.iter()) {
                    *step = zero - g;
                }
                factor::forward(factor, d, step);
                factor::back(factor, d, step);
                let length2 = dot_in_order(step, step);
                let short = T::bits(length2.at_most(T::splat(limits.longest * limits.longest)));
                let long = definite & !short;
                if long != 0 {
                    // Moré and Sorensen's step towards the μ at which the length is right: Newton on its reciprocal.
                    w_step.copy_from_slice(step);
                    let slope = factor::forward(factor, d, w_step);
                    let length = length2.sqrt();
                    let excess = length * T::splat(1.0 / (AIM * limits.longest)) - T::splat(1.0);
                    let better = s.damping + length2 / slope * excess;
                    let least = (T::splat(LEAST_RAISE) * s.damping)
                        .or_larger(T::splat(FIRST_DAMPING * FIRST_DAMPING) * largest)
                        .or_larger(T::least());
                    raise = T::select(T::mask(long), least.or_larger(better), raise);
                }
                failed |= long;
                predicted = T::splat(-0.5) * (dot_in_order(step, gradient) - s.damping * length2);
                let margin = if T::SINGLE { noise } else { zero };
                let rest = s.value - T::splat(REST) * predicted - margin;
                let hopeless = T::bits(s.damping.at_most(zero))
                    & T::bits(predicted.less(T::splat(FALLING) * s.expected))
                    & T::bits(s.rival.less(rest));
                ended = definite & short & rivals & trusted & hopeless;
                settled = ended;
                moved = definite & short & !ended;
            }
        }
        trial.copy_from_slice(g);
        if moved != 0 {
            if T::LANES > 1 {
                let mask = T::mask(moved);
                for s in step.iter_mut() {
                    *s = T::select(mask, *s, zero);
                }
            }
            layout.advance(trial, step);
        }
        if moved | fresh != 0 {
            let value = objective.value(trial);
            objective.gradient(trial, trial_slope);
            layout.restrict(trial_slope, step);
            let slope = dot_in_order(step, step).sqrt();
            let actual = s.value - value;
            let paid = T::bits((T::splat(1e-4) * predicted).less(actual));
            let small = T::bits(predicted.at_most(noise));
            let flatter = T::bits(slope.less(s.slope)) & T::bits((zero - noise).at_most(actual));
            let accepted = moved & (paid | small & flatter);
            stopped = moved & !accepted & small;
            ended |= stopped;
            failed |= moved & !accepted & !small;

            let mut damping = s.damping * T::splat(0.125);
            damping = T::select(damping.less(T::splat(FIRST_DAMPING * FIRST_DAMPING) * largest), zero, damping);
            let good = accepted & T::bits((T::splat(0.75) * predicted).less(actual));
            s.damping = T::select(T::mask(good), damping, s.damping);
            let kept = T::bits((actual - predicted).abs().at_most(T::splat(0.25) * predicted))
                & T::bits(s.damping.at_most(zero));
            trusted = trusted & !accepted | accepted & kept;
            s.expected = T::select(T::mask(accepted), predicted, s.expected);

            let taken = accepted | fresh;
            if taken != 0 {
                let mask = T::mask(taken);
                take(mask, trial, g);
                take(mask, trial_slope, full);
                objective.keep(mask);
                s.value = T::select(mask, value, s.value);
                s.slope = T::select(mask, slope, s.slope);
                s.scale = T::select(mask, objective.gradient_scale(trial), s.scale);
                let mut distance = zero;
                for (&a, &b) in g.iter().zip(rival.iter()) {
                    distance = distance.plus(a - b, a - b);
                }
                // Near its rival a value in single precision does not say which is lower.
                let above = if T::SINGLE { u16::MAX } else { T::bits(s.rival.at_most(s.value)) };
                let back = above & T::bits(distance.at_most(s.near));
                let flat = T::bits(s.slope.at_most(T::splat(limits.tolerance) * s.scale));
                let spent = T::bits(T::splat(limits.iterations as f64).at_most(s.iterations));
                ended |= taken & (flat | spent | rivals & back);
                stopped |= taken & flat;
                let going = T::mask(taken & !ended);
                s.iterations = T::select(going, s.iterations + T::splat(1.0), s.iterations);
                s.dampings = T::select(going, zero, s.dampings);
                stale = true;
            }
        }
        if failed != 0 {
            let mask = T::mask(failed);
            let rejected = T::mask(moved & failed);
            raise =
                T::select(rejected, (T::splat(8.0) * s.damping).or_larger(T::splat(FIRST_REJECTED) * largest), raise);
            s.damping = T::select(mask, raise, s.damping);
            s.dampings = T::select(mask, s.dampings + T::splat(1.0), s.dampings);
            ended |= failed & T::bits(T::splat(DAMPINGS).at_most(s.dampings));
        }
        fresh = 0;
        busy &= !ended;
        if T::SINGLE && stopped != 0 {
            // Nor can steps that rounding hides lead below a rival that lies so much lower.
            let hidden = T::splat(REST * REST) * rounding(s.value, noise_scale);
            settled |= stopped & rivals & T::bits((s.rival + hidden).less(s.value));
        }
        while ended != 0 {
            let lane = ended.trailing_zeros() as usize;
            ended &= ended - 1;
            for (x, g) in tasks.point_mut(task[lane]).iter_mut().zip(g.iter()) {
                *x = g.lane(lane);
            }
            layout.place(lane, &[]);
            let (iterations, scale) = (s.iterations.lane(lane) as usize, s.scale.lane(lane));
            let reached = Reached::new(s.value.lane(lane), s.slope.lane(lane), scale, iterations, &limits);
            tasks.end(task[lane], reached, settled >> lane & 1 == 1);
        }
    }
}
