//! out = base + h Σ_j a_j k_j: the loops over the state, in whole vector lanes, at the processor's [`crate::width`].
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | k_j | `k[j * len..]` | stage j, as long as the state |
//! | a_j | `row` | (stage, weight) pairs of the tableau |
//!
//! Source: the method of `dop853`; the layout is ours, by measurement.

use super::tableau as t;
use crate::width::widened;

/// Entries handled together.
pub(super) const LANES: usize = 8;
/// Stages kept: 12, the derivative at the new point, and 3 for the dense output.
pub(super) const STAGES: usize = 16;
/// Coefficients of the dense output.
pub(super) const DENSE: usize = 7;

/// The stages that a row of the tableau uses, cut to the length of the state.
#[inline(always)]
fn stages<'a, const M: usize>(k: &'a [f64], len: usize, row: &[(usize, f64); M]) -> [&'a [f64]; M] {
    std::array::from_fn(|j| &k[row[j].0 * len..][..len])
}

/// Σ_j a_j k_j at entry i.
#[inline(always)]
fn sum<const M: usize>(k: &[&[f64]; M], row: &[(usize, f64); M], i: usize) -> f64 {
    let mut sum = row[0].1 * k[0][i];
    for j in 1..M {
        sum += row[j].1 * k[j][i];
    }
    sum
}

#[inline(always)]
fn step<const M: usize>(out: &mut [f64], y: &[f64], k: &[f64], row: &[(usize, f64); M], h: f64) {
    let len = out.len();
    let (y, k) = (&y[..len], stages(k, len, row));
    for i in 0..len {
        out[i] = y[i] + h * sum(&k, row, i);
    }
}

widened! {
    /// The point at which stage `i` (from zero) is evaluated; 12 is the new point.
    #[inline(never)]
    pub(super) fn point(i: usize, out: &mut [f64], y: &[f64], k: &[f64], h: f64) {
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
    /// Σ (w e5)², Σ (w e3)² and Σ (w y)² over the block of entries from `start`.
    #[inline(never)]
    pub(super) fn error_sums(k: &[f64], y: &[f64], weight: &[f64], start: usize, block: usize) -> (f64, f64, f64) {
        let len = weight.len();
        let k5 = stages(k, len, &t::E5).map(|k| &k[start..][..block]);
        let k3 = stages(k, len, &t::E3).map(|k| &k[start..][..block]);
        let (y, weight) = (&y[start..][..block], &weight[start..][..block]);
        let (mut five, mut three, mut size) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for c in 0..block / LANES {
            for i in 0..LANES {
                let at = c * LANES + i;
                let (e5, e3) = (weight[at] * sum(&k5, &t::E5, at), weight[at] * sum(&k3, &t::E3, at));
                five[i] += e5 * e5;
                three[i] += e3 * e3;
                let part = weight[at] * y[at];
                size[i] += part * part;
            }
        }
        (five.iter().sum(), three.iter().sum(), size.iter().sum())
    }
}

widened! {
    /// The dense output's coefficients for the step from `y` to `y_new`.
    #[inline(never)]
    pub(super) fn dense(out: &mut [f64], y: &[f64], y_new: &[f64], k: &[f64], h: f64) {
        let len = y.len();
        let (low, high) = out.split_at_mut(3 * len);
        let (k4, k5, k6, k7) =
            (stages(k, len, &t::D4), stages(k, len, &t::D5), stages(k, len, &t::D6), stages(k, len, &t::D7));
        let (first, last) = (&k[..len], &k[12 * len..13 * len]);
        let (o0, rest) = low.split_at_mut(len);
        let (o1, o2) = rest.split_at_mut(len);
        let y_new = &y_new[..len];
        for i in 0..len {
            let dy = y_new[i] - y[i];
            o0[i] = dy;
            o1[i] = h * first[i] - dy;
            o2[i] = 2.0 * dy - h * (first[i] + last[i]);
        }
        let (o4, rest) = high.split_at_mut(len);
        let (o5, rest) = rest.split_at_mut(len);
        let (o6, o7) = rest.split_at_mut(len);
        for i in 0..len {
            o4[i] = h * sum(&k4, &t::D4, i);
        }
        for i in 0..len {
            o5[i] = h * sum(&k5, &t::D5, i);
        }
        for i in 0..len {
            o6[i] = h * sum(&k6, &t::D6, i);
        }
        for i in 0..len {
            o7[i] = h * sum(&k7, &t::D7, i);
        }
    }
}

widened! {
    /// The dense output at θ in (0, 1].
    #[inline(never)]
    pub(super) fn interpolate(out: &mut [f64], y: &[f64], dense: &[f64], theta: f64) {
        let mut weight = 1.0;
        let row: [(usize, f64); DENSE] = std::array::from_fn(|j| {
            weight *= if j % 2 == 0 { theta } else { 1.0 - theta };
            (j, weight)
        });
        step(out, y, dense, &row, 1.0);
    }
}
