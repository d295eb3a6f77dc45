//! Runs a list of descents as wide as the processor and the list allow: one at a time, or four or eight side by side.
//!
//! Each descent gives the same bits either way, so the choice is one of speed alone. Sizes above [`SIDE_BY_SIDE_UP_TO`]
//! leave the first cache side by side, and go one at a time.

use super::dense::{self, Means};
use super::doubled::Doubled;
use super::newton::{Objective, minimise};
use super::objective::{Certificate, RealGains};
use super::problem::Problem;
use super::tasks::{Limits, Owner, Tasks};
use super::workspace::Workspace;
use crate::lanes::Number;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Eight, Four, Wide};
use crate::width::Width;

/// N up to which there is a version with constant loop bounds.
pub(super) const CONSTANT_UP_TO: usize = 8;
/// N up to which descents go side by side.
pub(crate) const SIDE_BY_SIDE_UP_TO: usize = 6;
/// Descents from which they go side by side.
const SIDE_BY_SIDE_FROM: usize = 2;
/// How far below zero, relative to its largest diagonal entry, rounding may push the certificate's form.
const CERTIFICATE_ROUNDING: f64 = 1e-12;

/// In which gains a list descends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// In the gains themselves.
    Real,
    /// In the gains themselves; each end point is then tried for the certificate.
    Certified,
    /// In twice as many, complex or stacked.
    Doubled,
}

/// The scratch of the widths in use.
#[derive(Debug)]
pub(super) struct Engine {
    width: Width,
    one: Workspace<f64>,
    #[cfg(target_arch = "x86_64")]
    wide: Workspace<Wide>,
    #[cfg(target_arch = "x86_64")]
    four: Workspace<Four>,
    #[cfg(target_arch = "x86_64")]
    eight: Workspace<Eight>,
}

impl Default for Engine {
    fn default() -> Self {
        Self::of(Width::detect())
    }
}

impl Engine {
    /// An engine of a width that the processor has.
    pub(super) fn of(width: Width) -> Self {
        Self {
            width,
            one: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            wide: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            four: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            eight: Workspace::default(),
        }
    }

    /// Makes the descents of `tasks`.
    pub(super) fn run<const N: usize>(
        &mut self,
        kind: Kind,
        problem: &Problem,
        tasks: &mut Tasks,
        owners: &[Owner],
        limits: Limits,
    ) {
        let means = Means { library: problem.size > CONSTANT_UP_TO, width: self.width };
        #[cfg(target_arch = "x86_64")]
        if const { 0 < N && N <= SIDE_BY_SIDE_UP_TO } && tasks.len() >= SIDE_BY_SIDE_FROM {
            match self.width {
                Width::Baseline => {}
                Width::Avx2 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("fma"));
                    // SAFETY: this variant exists only where the processor said that it has AVX2 and FMA.
                    return unsafe { run_avx2::<N>(kind, problem, tasks, owners, limits, means, &mut self.wide) };
                }
                Width::Avx512 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("avx512vl"));
                    // SAFETY: this variant exists only where the processor said that it has AVX-512F, VL and FMA.
                    return unsafe {
                        if kind == Kind::Doubled {
                            run_avx512_doubled::<N>(problem, tasks, owners, limits, means, &mut self.four)
                        } else {
                            run_avx512_real::<N>(kind, problem, tasks, owners, limits, means, &mut self.eight)
                        }
                    };
                }
            }
        }
        // Every width gives the same bits; where the processor has only the target's, one version for all sizes will do.
        #[cfg(target_arch = "x86_64")]
        if self.width == Width::Baseline {
            return run::<f64, 0>(kind, problem, tasks, owners, limits, means, &mut self.one);
        }
        debug_assert!(self.width != Width::Baseline || cfg!(not(target_arch = "x86_64")));
        // SAFETY: on x86-64 the other widths exist only where the processor said that it has AVX2 and FMA.
        unsafe { run_one::<N>(kind, problem, tasks, owners, limits, means, &mut self.one) }
    }
}

/// One descent after another.
///
/// # Safety
/// On x86-64 the processor must have AVX2 and FMA.
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
unsafe fn run_one<const N: usize>(
    kind: Kind,
    problem: &Problem,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<f64>,
) {
    run::<f64, N>(kind, problem, tasks, owners, limits, means, w);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<const N: usize>(
    kind: Kind,
    problem: &Problem,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<Wide>,
) {
    run::<Wide, N>(kind, problem, tasks, owners, limits, means, w);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn run_avx512_real<const N: usize>(
    kind: Kind,
    problem: &Problem,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<Eight>,
) {
    // So that the compiler makes no version of eight doubled gains.
    let kind = if kind == Kind::Certified { Kind::Certified } else { Kind::Real };
    run::<Eight, N>(kind, problem, tasks, owners, limits, means, w);
}

/// Four at a time: the Hessian of eight would not stay in the first cache.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn run_avx512_doubled<const N: usize>(
    problem: &Problem,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<Four>,
) {
    run::<Four, N>(Kind::Doubled, problem, tasks, owners, limits, means, w);
}

#[inline(always)]
fn run<T: Number, const N: usize>(
    kind: Kind,
    problem: &Problem,
    tasks: &mut Tasks,
    owners: &[Owner],
    limits: Limits,
    means: Means,
    w: &mut Workspace<T>,
) {
    if kind == Kind::Doubled {
        minimise(&mut Doubled::<T, N>::new(problem), tasks, owners, limits, means, w);
        return;
    }
    let mut real = RealGains::<T, N>::new(problem);
    minimise(&mut real, tasks, owners, limits, means, w);
    if kind == Kind::Certified {
        certify(&mut real, tasks, owners, means, w);
    }
}

/// Tries every end point for the certificate that proves a critical point to be a global minimiser.
#[inline(always)]
fn certify<T: Number, const N: usize>(
    real: &mut RealGains<T, N>,
    tasks: &mut Tasks,
    owners: &[Owner],
    means: Means,
    w: &mut Workspace<T>,
) {
    let width = real.width();
    let mut first = 0;
    while first < tasks.len() {
        let last = tasks.len().min(first + T::LANES);
        w.layout.begin(tasks.width(), 1);
        for task in first..last {
            let lane = task - first;
            w.layout.place(lane, owners[tasks.owner(task)].variables);
            for (g, &x) in w.g.iter_mut().zip(tasks.point(task)) {
                g.set_lane(lane, x);
            }
        }
        w.layout.list();
        real.value(&w.g[..width]);
        w.layout.restrict_form(&Certificate(real), &w.g, &mut w.row, &mut w.hessian);
        let largest = w.layout.largest(&w.hessian);
        let allowance = T::splat(CERTIFICATE_ROUNDING) * largest;
        let (definite, _) = dense::factorise(&w.hessian, allowance, &w.layout, means, &mut w.factor);
        let proved = T::bits(definite) | T::bits(largest.at_most(T::splat(0.0)));
        for task in first..last {
            if proved >> (task - first) & 1 == 1 {
                tasks.certify(task);
            }
        }
        first = last;
    }
}
