//! out = base + h Σ_j a_j k_j: the loops over the state, in whole vector lanes.
//!
//! The stages of eight entries lie together (chunk, stage, lane), so a sum walks memory once. Each loop is compiled
//! twice, for the baseline of the target and for AVX2, and the processor decides at run time. Only the width differs:
//! the operations and their order are the same and none is fused, so both give the same bits.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | k_j | `k[c][j]` | entries 8c…8c+7 of stage j |
//! | a_j | `row` | (stage, weight) pairs of the tableau |
//!
//! Source: the method of `dop853`; the layout is ours, by measurement.

use super::tableau as t;

/// Entries handled together.
pub(super) const LANES: usize = 8;
/// Stages kept: 12, the derivative at the new point, and 3 for the dense output.
pub(super) const STAGES: usize = 16;
/// Coefficients of the dense output.
pub(super) const DENSE: usize = 7;

/// Eight entries.
pub(super) type Lane = [f64; LANES];

/// Which instructions the processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    /// Whatever the target guarantees.
    Baseline,
    /// 256 bits; only made by [`Width::detect`] after asking the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Width {
    /// Asks the processor.
    pub(super) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Baseline
    }
}

/// Defines a function by a body compiled for every [`Width`].
macro_rules! widened {
    ($(#[$doc:meta])* $vis:vis fn $name:ident $(<$(const $g:ident: usize),*>)? ($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name $(<$(const $g: usize),*>)? (width: $crate::riccati::lanes::Width, $($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body $(<$(const $g: usize),*>)? ($($arg: $ty),*) $(-> $ret)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn avx2 $(<$(const $g: usize),*>)? ($($arg: $ty),*) $(-> $ret)? {
                body $(::<$($g),*>)? ($($arg),*)
            }
            match width {
                $crate::riccati::lanes::Width::Baseline => body $(::<$($g),*>)? ($($arg),*),
                // SAFETY: this variant exists only where the processor said that it has AVX2.
                #[cfg(target_arch = "x86_64")]
                $crate::riccati::lanes::Width::Avx2 => unsafe { avx2 $(::<$($g),*>)? ($($arg),*) },
            }
        }
    };
}
pub(super) use widened;

#[inline(always)]
fn sum<const M: usize, const S: usize>(k: &[Lane; S], row: &[(usize, f64); M]) -> Lane {
    let mut sum = [0.0; LANES];
    for &(j, a) in row {
        for i in 0..LANES {
            sum[i] += a * k[j][i];
        }
    }
    sum
}

#[inline(always)]
fn step<const M: usize>(out: &mut [Lane], y: &[Lane], k: &[[Lane; STAGES]], row: &[(usize, f64); M], h: f64) {
    for ((o, y), k) in out.iter_mut().zip(y).zip(k) {
        let sum = sum(k, row);
        for i in 0..LANES {
            o[i] = y[i] + h * sum[i];
        }
    }
}

widened! {
    /// The point at which stage `i` (from zero) is evaluated; 12 is the new point.
    #[inline(never)]
    pub(super) fn point(i: usize, out: &mut [Lane], y: &[Lane], k: &[[Lane; STAGES]], h: f64) {
        match i {
            1 => step(out, y, k, &t::A2, h),
            2 => step(out, y, k, &t::A3, h),
            3 => step(out, y, k, &t::A4, h),
            4 => step(out, y, k, &t::A5, h),
            5 => step(out, y, k, &t::A6, h),
            6 => step(out, y, k, &t::A7, h),
            7 => step(out, y, k, &t::A8, h),
            8 => step(out, y, k, &t::A9, h),
            9 => step(out, y, k, &t::A10, h),
            10 => step(out, y, k, &t::A11, h),
            11 => step(out, y, k, &t::A12, h),
            12 => step(out, y, k, &t::B, h),
            13 => step(out, y, k, &t::A14, h),
            14 => step(out, y, k, &t::A15, h),
            _ => step(out, y, k, &t::A16, h),
        }
    }
}

widened! {
    /// Stores a derivative as stage `i`.
    #[inline(never)]
    pub(super) fn store(i: usize, dy: &[Lane], k: &mut [[Lane; STAGES]]) {
        for (k, dy) in k.iter_mut().zip(dy) {
            k[i % STAGES] = *dy;
        }
    }
}

widened! {
    /// Σ e5², Σ e3² and Σ y² at the new point, over one block.
    #[inline(never)]
    pub(super) fn error_sums(y_new: &[Lane], k: &[[Lane; STAGES]]) -> (f64, f64, f64) {
        let (mut five, mut three, mut size) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (y, k) in y_new.iter().zip(k) {
            let (e5, e3) = (sum(k, &t::E5), sum(k, &t::E3));
            for i in 0..LANES {
                five[i] += e5[i] * e5[i];
                three[i] += e3[i] * e3[i];
                size[i] += y[i] * y[i];
            }
        }
        (five.iter().sum(), three.iter().sum(), size.iter().sum())
    }
}

widened! {
    /// The dense output's coefficients for the step from `y` to `y_new`.
    #[inline(never)]
    pub(super) fn dense(out: &mut [[Lane; DENSE]], y: &[Lane], y_new: &[Lane], k: &[[Lane; STAGES]], h: f64) {
        for (((o, y), y_new), k) in out.iter_mut().zip(y).zip(y_new).zip(k) {
            let high = [sum(k, &t::D4), sum(k, &t::D5), sum(k, &t::D6), sum(k, &t::D7)];
            for i in 0..LANES {
                let (dy, first, last) = (y_new[i] - y[i], h * k[0][i], h * k[12][i]);
                o[0][i] = dy;
                o[1][i] = first - dy;
                o[2][i] = 2.0 * dy - (first + last);
                for (o, high) in o[3..].iter_mut().zip(&high) {
                    o[i] = h * high[i];
                }
            }
        }
    }
}

widened! {
    /// The dense output at θ in (0, 1].
    #[inline(never)]
    pub(super) fn interpolate(out: &mut [Lane], y: &[Lane], dense: &[[Lane; DENSE]], theta: f64) {
        let mut weight = 1.0;
        let row: [(usize, f64); DENSE] = std::array::from_fn(|j| {
            weight *= if j % 2 == 0 { theta } else { 1.0 - theta };
            (j, weight)
        });
        for ((o, y), d) in out.iter_mut().zip(y).zip(dense) {
            let sum = sum(d, &row);
            for i in 0..LANES {
                o[i] = y[i] + sum[i];
            }
        }
    }
}
