//! Runs a list of descents as wide as the processor and the list allow: one at a time, or four to sixteen side by side, in
//! double or in single precision.
//!
//! Each descent is bitwise the same either way, so the choice is one of speed alone. Sizes above [`SIDE_BY_SIDE_UP_TO`]
//! leave the first cache side by side, and go one at a time.

use std::any::Any;

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::simd::{Number, Width, dispatch, widened};
use crate::synthesis::newton::{
    Backend, Limits, Objective, Owner, Tasks, Workspace, factorise, forward, minimise, packed, unknowns,
};
use crate::synthesis::theta::{Certificate, Coefficients, Doubled, Parts, Precisions, RealGains};

/// N up to which there is a version with constant loop bounds.
pub const CONSTANT_UP_TO: usize = 8;
/// N up to which descents go side by side.
pub const SIDE_BY_SIDE_UP_TO: usize = 6;
/// Descents from which they go side by side.
const SIDE_BY_SIDE_FROM: usize = 2;
/// How far below zero rounding may push the certificate's form where its parts are scaled to one, variable by variable.
const CERTIFICATE_ROUNDING: f64 = 1e-12;
/// What a certified minimum may leave to be gained: a part of Θ, and a part of what cancels in it.
const LEFT: (f64, f64) = (1e-10, 1e-15);

/// In which gains a list descends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// In the gains themselves.
    Real,
    /// In the gains themselves; each end point is then tried for the certificate.
    Certified,
    /// In the gains themselves, in single precision where the problem has it.
    Screening,
    /// In twice as many, complex or stacked; in single precision where the problem has it.
    Doubled,
}

/// Runs lists at one width.
#[derive(Debug)]
pub struct Dispatcher {
    width: Width,
    scratch: Scratch,
    cancel: CancelToken,
}

impl Default for Dispatcher {
    fn default() -> Self {
        Self::of(Width::in_use())
    }
}

/// Scratch memory for each kind of number in use, made when it is first asked for.
#[derive(Debug, Default)]
struct Scratch(Vec<Box<dyn Any + Send>>);

impl Scratch {
    fn of<T: Number>(&mut self) -> &mut Workspace<T> {
        let at = self.0.iter().position(|held| held.is::<Workspace<T>>()).unwrap_or_else(|| {
            self.0.push(Box::<Workspace<T>>::default());
            self.0.len() - 1
        });
        self.0[at].downcast_mut().unwrap_or_else(|| unreachable!("found by its type"))
    }
}

/// What a list needs besides its numbers.
struct List<'a> {
    kind: Kind,
    tasks: &'a mut Tasks,
    owners: &'a [Owner<'a>],
    limits: Limits,
    backend: Backend<'a>,
}

impl Dispatcher {
    /// A dispatcher for a width that the processor has.
    pub fn of(width: Width) -> Self {
        Self { width, scratch: Scratch::default(), cancel: CancelToken::new() }
    }

    /// Lets `cancel` stop what it runs.
    pub fn watch(&mut self, cancel: &CancelToken) {
        self.cancel = cancel.clone();
    }

    /// What stops it.
    pub fn cancel(&self) -> &CancelToken {
        &self.cancel
    }

    /// Makes the descents of `tasks`; where that is an error, nothing they hold means anything.
    // Inlined, it would have every version compiled once more where it is called.
    #[inline(never)]
    pub fn run(
        &mut self,
        kind: Kind,
        problem: &Precisions,
        tasks: &mut Tasks,
        owners: &[Owner],
        limits: Limits,
    ) -> Result<(), Stopped> {
        match problem.double.size {
            2 => self.run_sized::<2>(kind, problem, tasks, owners, limits),
            3 => self.run_sized::<3>(kind, problem, tasks, owners, limits),
            4 => self.run_sized::<4>(kind, problem, tasks, owners, limits),
            5 => self.run_sized::<5>(kind, problem, tasks, owners, limits),
            6 => self.run_sized::<6>(kind, problem, tasks, owners, limits),
            7 => self.run_sized::<7>(kind, problem, tasks, owners, limits),
            8 => self.run_sized::<8>(kind, problem, tasks, owners, limits),
            _ => self.run_sized::<0>(kind, problem, tasks, owners, limits),
        }
    }

    /// The same by the version for N, or by the one for any size where N is 0.
    pub fn run_sized<const N: usize>(
        &mut self,
        kind: Kind,
        problem: &Precisions,
        tasks: &mut Tasks,
        owners: &[Owner],
        limits: Limits,
    ) -> Result<(), Stopped> {
        let Self { width, scratch, cancel } = self;
        let (width, library) = (*width, problem.double.size > CONSTANT_UP_TO);
        let backend = Backend { library, width, cancel: Some(cancel) };
        let mut list = List { kind, tasks, owners, limits, backend };
        let several = list.tasks.len() >= SIDE_BY_SIDE_FROM;
        let wanted = matches!(kind, Kind::Screening | Kind::Doubled) && side_by_side(N);
        let single = if wanted { problem.single() } else { None };
        match (kind, single) {
            (Kind::Screening | Kind::Doubled, Some(coefficients)) => {
                if const { side_by_side(N) } && several {
                    several_single::<N>(width, coefficients, &mut list, scratch)?;
                } else {
                    one_single(width, coefficients, &mut list, scratch)?;
                }
            }
            _ => {
                if const { side_by_side(N) } && several && kind != Kind::Doubled {
                    several_double::<N>(width, &problem.double, &mut list, scratch)?;
                } else if const { side_by_side(N) } && kind == Kind::Doubled {
                    // Doubled gains only where single precision cannot hold the problem: one version for all small sizes.
                    one_double::<0>(width, &problem.double, &mut list, scratch)?;
                } else {
                    one_double::<N>(width, &problem.double, &mut list, scratch)?;
                }
            }
        }
        Ok(cancel.check()?)
    }
}

/// Whether games of this size go side by side.
const fn side_by_side(n: usize) -> bool {
    0 < n && n <= SIDE_BY_SIDE_UP_TO
}

/// Whether descents are made in single precision: where they go side by side, twice as many fit a register.
#[must_use]
pub fn single(problem: &Precisions) -> bool {
    side_by_side(problem.double.size) && problem.single().is_some()
}

// All widths agree bitwise: where loops are slow anyway, one version for all sizes will do.

dispatch! {
    /// As many descents side by side as a register holds.
    fn several_double<V, const N: usize>(coefficients: &Coefficients<f64>, list: &mut List, scratch: &mut Scratch) -> Result<(), Stopped> {
        if const { V::SIZED } {
            descend::<V::Double, N>(coefficients, list, scratch.of())
        } else {
            any_size::<f64>(coefficients, list, scratch.of())
        }
    }
}

dispatch! {
    /// The same in single precision.
    fn several_single<V, const N: usize>(coefficients: &Coefficients<f32>, list: &mut List, scratch: &mut Scratch) -> Result<(), Stopped> {
        if const { !V::SIZED } {
            any_size::<f32>(coefficients, list, scratch.of())
        } else if list.kind == Kind::Doubled {
            descend_doubled::<V::Half, N>(coefficients, list, scratch.of())
        } else {
            descend::<V::Single, N>(coefficients, list, scratch.of())
        }
    }
}

widened! {
    /// One descent after another.
    fn one_double<V, const N: usize>(coefficients: &Coefficients<f64>, list: &mut List, scratch: &mut Scratch) -> Result<(), Stopped> {
        if const { !V::SIZED } {
            any_size::<f64>(coefficients, list, scratch.of())
        } else if const { side_by_side(N) } || list.kind != Kind::Doubled {
            descend::<f64, N>(coefficients, list, scratch.of())
        } else {
            descend_doubled::<f64, N>(coefficients, list, scratch.of())
        }
    }
}

widened! {
    /// The same in single precision: seldom enough for one version for all sizes.
    fn one_single<V>(coefficients: &Coefficients<f32>, list: &mut List, scratch: &mut Scratch) -> Result<(), Stopped> {
        if const { V::SIZED } {
            run::<f32, 0>(coefficients, list, scratch.of())
        } else {
            any_size::<f32>(coefficients, list, scratch.of())
        }
    }
}

#[inline(never)]
fn any_size<T: Number>(
    coefficients: &Coefficients<T::Scalar>,
    list: &mut List,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    run::<T, 0>(coefficients, list, w)
}

#[inline(always)]
fn run<T: Number, const N: usize>(
    coefficients: &Coefficients<T::Scalar>,
    list: &mut List,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    match list.kind {
        Kind::Doubled => descend_doubled::<T, N>(coefficients, list, w),
        _ => descend::<T, N>(coefficients, list, w),
    }
}

#[inline(always)]
fn descend_doubled<T: Number, const N: usize>(
    coefficients: &Coefficients<T::Scalar>,
    list: &mut List,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    let mut doubled = Doubled::<T, N>::new(coefficients, list.backend.cancel)?;
    minimise(&mut doubled, list.tasks, list.owners, list.limits, list.backend, w)
}

#[inline(always)]
fn descend<T: Number, const N: usize>(
    coefficients: &Coefficients<T::Scalar>,
    list: &mut List,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    let mut real = RealGains::<T, N>::new(coefficients, list.backend.cancel)?;
    minimise(&mut real, list.tasks, list.owners, list.limits, list.backend, w)?;
    if !T::SINGLE && list.kind == Kind::Certified {
        certify(&mut real, list.tasks, list.owners, list.backend, w)?;
    }
    Ok(())
}

/// Tries every end point for the certificate that proves a critical point to be a global minimiser.
#[inline(always)]
fn certify<T: Number, const N: usize>(
    real: &mut RealGains<T, N>,
    tasks: &mut Tasks,
    owners: &[Owner],
    backend: Backend,
    w: &mut Workspace<T>,
) -> Result<(), Stopped> {
    let width = real.width();
    w.grow_matrices(unknowns::<T>(tasks, owners), backend.cancel)?;
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
        let value = real.value(&w.g[..width]);
        real.gradient(&w.g[..width], &mut w.slope[..width]);
        let (d, used, zero, one) = (w.layout.len(), w.layout.used(), T::splat(0.0), T::splat(1.0));
        w.layout.restrict(&w.slope[..width], &mut w.gradient[..d]);
        w.layout.restrict_form(&Certificate(real), &w.g, &mut w.row, &mut w.hessian, backend.cancel);
        real.measure();
        w.layout.diagonal(&Parts(real), &w.g, &mut w.row, &mut w.other);
        for i in 0..used {
            let parts = w.other[i];
            let scale = one / T::select(zero.less(parts), parts, one).sqrt();
            w.other[i] = scale;
            w.gradient[i] = w.gradient[i] * scale;
            for (x, &other) in w.hessian[packed(i)..].iter_mut().zip(&w.other[..i + 1]) {
                *x = *x * (scale * other);
            }
        }
        let (definite, _) = factorise(&w.hessian, T::splat(CERTIFICATE_ROUNDING), &w.layout, backend, &mut w.factor);
        let left = T::splat(0.5) * forward(&w.factor, d, &mut w.gradient[..d]);
        let allowed = T::splat(LEFT.0) * value + T::splat(LEFT.1 * real.value_scale());
        let proved = T::bits(definite) & T::bits(left.at_most(allowed));
        for task in first..last {
            if proved >> (task - first) & 1 == 1 {
                tasks.certify(task);
            }
        }
        first = last;
    }
    Ok(())
}
