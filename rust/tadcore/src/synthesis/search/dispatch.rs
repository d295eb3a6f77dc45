//! Runs a list of descents as wide as the processor and the list allow: one at a time, or four to sixteen side by side, in
//! double or in single precision.
//!
//! Each descent gives the same bits either way, so the choice is one of speed alone. Sizes above [`SIDE_BY_SIDE_UP_TO`]
//! leave the first cache side by side, and go one at a time.

use crate::lanes::Number;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Eight, Eight32, Sixteen32, Wide, Wide32};
use crate::synthesis::newton::{Limits, Means, Objective, Owner, Tasks, Workspace, factorise, minimise};
use crate::synthesis::theta::{Certificate, Doubled, Parts, Problem, RealGains};
use crate::width::Width;

/// N up to which there is a version with constant loop bounds.
pub(crate) const CONSTANT_UP_TO: usize = 8;
/// N up to which descents go side by side.
pub(crate) const SIDE_BY_SIDE_UP_TO: usize = 6;
/// Descents from which they go side by side.
const SIDE_BY_SIDE_FROM: usize = 2;
/// How far below zero, relative to its largest diagonal entry, rounding may push the certificate's form.
const CERTIFICATE_ROUNDING: f64 = 1e-12;

/// In which gains a list descends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// In the gains themselves.
    Real,
    /// In the gains themselves; each end point is then tried for the certificate.
    Certified,
    /// In the gains themselves, in single precision where the problem has it.
    Scout,
    /// In twice as many, complex or stacked; in single precision where the problem has it.
    Doubled,
}

/// The scratch of the widths in use.
#[derive(Debug)]
pub(crate) struct Engine {
    width: Width,
    one: Workspace<f64>,
    one32: Workspace<f32>,
    #[cfg(target_arch = "x86_64")]
    wide: Workspace<Wide>,
    #[cfg(target_arch = "x86_64")]
    wide32: Workspace<Wide32>,
    #[cfg(target_arch = "x86_64")]
    eight: Workspace<Eight>,
    #[cfg(target_arch = "x86_64")]
    eight32: Workspace<Eight32>,
    #[cfg(target_arch = "x86_64")]
    sixteen32: Workspace<Sixteen32>,
}

impl Default for Engine {
    fn default() -> Self {
        Self::of(Width::detect())
    }
}

/// What a list needs besides its numbers.
struct List<'a> {
    kind: Kind,
    tasks: &'a mut Tasks,
    owners: &'a [Owner<'a>],
    limits: Limits,
    means: Means,
}

impl Engine {
    /// An engine of a width that the processor has.
    pub(crate) fn of(width: Width) -> Self {
        Self {
            width,
            one: Workspace::default(),
            one32: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            wide: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            wide32: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            eight: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            eight32: Workspace::default(),
            #[cfg(target_arch = "x86_64")]
            sixteen32: Workspace::default(),
        }
    }

    /// Makes the descents of `tasks`.
    pub(crate) fn run<const N: usize>(
        &mut self,
        kind: Kind,
        problem: &Problem,
        tasks: &mut Tasks,
        owners: &[Owner],
        limits: Limits,
    ) {
        let means = Means { library: problem.size > CONSTANT_UP_TO, width: self.width };
        let mut list = List { kind, tasks, owners, limits, means };
        match (kind, single::<N>(problem)) {
            (Kind::Scout | Kind::Doubled, Some(parts)) => self.run_single::<N>(parts, &mut list),
            _ => self.run_double::<N>(&problem.double, &mut list),
        }
    }

    fn run_double<const N: usize>(&mut self, parts: &Parts<f64>, list: &mut List) {
        #[cfg(target_arch = "x86_64")]
        if const { side_by_side(N) } && list.tasks.len() >= SIDE_BY_SIDE_FROM && list.kind != Kind::Doubled {
            match self.width {
                Width::Baseline => {}
                Width::Avx2 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("fma"));
                    // SAFETY: this variant exists only where the processor said that it has AVX2 and FMA.
                    return unsafe { real_avx2::<N>(parts, list, &mut self.wide) };
                }
                Width::Avx512 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("avx512vl"));
                    // SAFETY: this variant exists only where the processor said that it has AVX-512F, VL and FMA.
                    return unsafe { real_avx512::<N>(parts, list, &mut self.eight) };
                }
            }
        }
        // Every width gives the same bits; where the processor has only the target's, one version for all sizes will do.
        #[cfg(target_arch = "x86_64")]
        if self.width == Width::Baseline {
            return any_size(parts, list, &mut self.one);
        }
        debug_assert!(self.width != Width::Baseline || cfg!(not(target_arch = "x86_64")));
        // SAFETY: on x86-64 the other widths exist only where the processor said that it has AVX2 and FMA.
        unsafe { one::<N>(parts, list, &mut self.one) }
    }

    fn run_single<const N: usize>(&mut self, parts: &Parts<f32>, list: &mut List) {
        #[cfg(target_arch = "x86_64")]
        if const { side_by_side(N) } && list.tasks.len() >= SIDE_BY_SIDE_FROM {
            match self.width {
                Width::Baseline => {}
                Width::Avx2 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("fma"));
                    // SAFETY: this variant exists only where the processor said that it has AVX2 and FMA.
                    return unsafe { single_avx2::<N>(parts, list, &mut self.wide32) };
                }
                Width::Avx512 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("avx512vl"));
                    // SAFETY: this variant exists only where the processor said that it has AVX-512F, VL and FMA.
                    return unsafe {
                        if list.kind == Kind::Doubled {
                            doubled_avx512::<N>(parts, list, &mut self.eight32)
                        } else {
                            scouts_avx512::<N>(parts, list, &mut self.sixteen32)
                        }
                    };
                }
            }
        }
        #[cfg(target_arch = "x86_64")]
        if self.width == Width::Baseline {
            return any_size(parts, list, &mut self.one32);
        }
        debug_assert!(self.width != Width::Baseline || cfg!(not(target_arch = "x86_64")));
        // SAFETY: on x86-64 the other widths exist only where the processor said that it has AVX2 and FMA.
        unsafe { one32(parts, list, &mut self.one32) }
    }
}

/// Whether games of this size go side by side.
const fn side_by_side(n: usize) -> bool {
    0 < n && n <= SIDE_BY_SIDE_UP_TO
}

/// The problem in single precision: where descents go side by side, twice as many fit a register.
pub(crate) fn single<const N: usize>(problem: &Problem) -> Option<&Parts<f32>> {
    problem.single.as_ref().filter(|_| side_by_side(N))
}

/// One descent after another by the target's own instructions, one version for all sizes.
#[cfg(target_arch = "x86_64")]
#[inline(never)]
fn any_size<T: Number>(parts: &Parts<T::Scalar>, list: &mut List, w: &mut Workspace<T>) {
    run::<T, 0>(parts, list, w);
}

/// One descent after another.
///
/// # Safety
/// On x86-64 the processor must have AVX2 and FMA.
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
unsafe fn one<const N: usize>(parts: &Parts<f64>, list: &mut List, w: &mut Workspace<f64>) {
    if list.kind != Kind::Doubled {
        descend::<f64, N>(parts, list, w);
    } else if const { side_by_side(N) } {
        // Only where single precision cannot hold the problem.
        // SAFETY: as promised to this function.
        unsafe { one::<0>(parts, list, w) }
    } else {
        descend_doubled::<f64, N>(parts, list, w);
    }
}

/// The same in single precision: seldom enough for one version for all sizes.
///
/// # Safety
/// On x86-64 the processor must have AVX2 and FMA.
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
unsafe fn one32(parts: &Parts<f32>, list: &mut List, w: &mut Workspace<f32>) {
    run::<f32, 0>(parts, list, w);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn real_avx2<const N: usize>(parts: &Parts<f64>, list: &mut List, w: &mut Workspace<Wide>) {
    descend::<Wide, N>(parts, list, w);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn single_avx2<const N: usize>(parts: &Parts<f32>, list: &mut List, w: &mut Workspace<Wide32>) {
    match list.kind {
        Kind::Doubled => descend_doubled::<Wide32, N>(parts, list, w),
        _ => descend::<Wide32, N>(parts, list, w),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn real_avx512<const N: usize>(parts: &Parts<f64>, list: &mut List, w: &mut Workspace<Eight>) {
    descend::<Eight, N>(parts, list, w);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn scouts_avx512<const N: usize>(parts: &Parts<f32>, list: &mut List, w: &mut Workspace<Sixteen32>) {
    descend::<Sixteen32, N>(parts, list, w);
}

/// Eight at a time: the Hessian of sixteen would not stay in the first cache.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,fma")]
fn doubled_avx512<const N: usize>(parts: &Parts<f32>, list: &mut List, w: &mut Workspace<Eight32>) {
    descend_doubled::<Eight32, N>(parts, list, w);
}

#[inline(always)]
fn run<T: Number, const N: usize>(parts: &Parts<T::Scalar>, list: &mut List, w: &mut Workspace<T>) {
    match list.kind {
        Kind::Doubled => descend_doubled::<T, N>(parts, list, w),
        _ => descend::<T, N>(parts, list, w),
    }
}

#[inline(always)]
fn descend_doubled<T: Number, const N: usize>(parts: &Parts<T::Scalar>, list: &mut List, w: &mut Workspace<T>) {
    minimise(&mut Doubled::<T, N>::new(parts), list.tasks, list.owners, list.limits, list.means, w);
}

#[inline(always)]
fn descend<T: Number, const N: usize>(parts: &Parts<T::Scalar>, list: &mut List, w: &mut Workspace<T>) {
    let mut real = RealGains::<T, N>::new(parts);
    minimise(&mut real, list.tasks, list.owners, list.limits, list.means, w);
    if !T::SINGLE && list.kind == Kind::Certified {
        certify(&mut real, list.tasks, list.owners, list.means, w);
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
        let (definite, _) = factorise(&w.hessian, allowance, &w.layout, means, &mut w.factor);
        let proved = T::bits(definite) | T::bits(largest.at_most(T::splat(0.0)));
        for task in first..last {
            if proved >> (task - first) & 1 == 1 {
                tasks.certify(task);
            }
        }
        first = last;
    }
}
