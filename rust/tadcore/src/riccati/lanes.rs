//! out = base + h Σ_j a_j k_j: the loops over the state, in whole vector lanes, at the processor's [`crate::width`].
//!
//! A product and the sum it goes into are one operation.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | k_j | `k[j * len..]` | stage j, as long as the state |
//! | a_j | `row` | (stage, weight) pairs of the tableau |
//!
//! Source: the method of `dop853`; the layout is ours, by measurement.

use super::tableau as t;
use crate::width::fused;

/// Entries handled together.
pub(super) const LANES: usize = 8;
/// Stages kept: 12, the derivative at the new point, and 3 for the dense output.
pub(super) const STAGES: usize = 16;
/// Coefficients of the dense output.
pub(super) const DENSE: usize = 7;

type Lane = [f64; LANES];

fn lanes(x: &[f64]) -> &[Lane] {
    x.as_chunks().0
}

fn lanes_mut(x: &mut [f64]) -> &mut [Lane] {
    x.as_chunks_mut().0
}

/// The stages that a row of the tableau uses, cut to the length of the state.
#[inline(always)]
fn stages<'a, T, const M: usize>(k: &'a [f64], len: usize, row: &[(usize, T); M]) -> [&'a [Lane]; M] {
    std::array::from_fn(|j| &lanes(&k[row[j].0 * len..][..len])[..len / LANES])
}

/// a x + y, entry by entry.
#[inline(always)]
fn add(a: f64, x: &Lane, y: Lane) -> Lane {
    std::array::from_fn(|c| a.mul_add(x[c], y[c]))
}

/// Σ_j a_j k_j at lane i.
#[inline(always)]
fn sum<const M: usize>(k: &[&[Lane]; M], row: &[(usize, f64); M], i: usize) -> Lane {
    let mut sum = k[0][i].map(|x| row[0].1 * x);
    for j in 1..M {
        sum = add(row[j].1, &k[j][i], sum);
    }
    sum
}

#[inline(always)]
fn step<const M: usize>(out: &mut [f64], y: &[f64], k: &[f64], row: &[(usize, f64); M], h: f64) {
    let len = out.len();
    let (out, y, k) = (lanes_mut(out), lanes(&y[..len]), stages(k, len, row));
    for i in 0..len / LANES {
        out[i] = add(h, &sum(&k, row, i), y[i]);
    }
}

fused! {
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

fused! {
    /// Σ (w e5)², Σ (w e3)² and Σ (w y)² over the block of entries from `start`.
    #[inline(never)]
    pub(super) fn error_sums(k: &[f64], y: &[f64], weight: &[f64], start: usize, block: usize) -> (f64, f64, f64) {
        let (len, from, count) = (weight.len(), start / LANES, block / LANES);
        let k5 = stages(k, len, &t::E5).map(|k| &k[from..][..count]);
        let k3 = stages(k, len, &t::E3).map(|k| &k[from..][..count]);
        let (y, weight) = (&lanes(y)[from..][..count], &lanes(weight)[from..][..count]);
        let (mut five, mut three, mut size) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..count {
            let (e5, e3) = (sum(&k5, &t::E5, i), sum(&k3, &t::E3, i));
            for c in 0..LANES {
                let (e5, e3, y) = (weight[i][c] * e5[c], weight[i][c] * e3[c], weight[i][c] * y[i][c]);
                five[c] = e5.mul_add(e5, five[c]);
                three[c] = e3.mul_add(e3, three[c]);
                size[c] = y.mul_add(y, size[c]);
            }
        }
        (five.iter().sum(), three.iter().sum(), size.iter().sum())
    }
}

fused! {
    /// The dense output's coefficients for the step from `y` to `y_new`.
    #[inline(never)]
    pub(super) fn dense(out: &mut [f64], y: &[f64], y_new: &[f64], k: &[f64], h: f64) {
        let len = y.len();
        let count = len / LANES;
        let used = stages(k, len, &t::D);
        let (first, last) = (used[0], &lanes(&k[12 * len..13 * len])[..count]);
        let (y, y_new) = (&lanes(y)[..count], &lanes(y_new)[..count]);
        let out = &mut lanes_mut(out)[..DENSE * count];
        for i in 0..count {
            let mut sum = [[0.0; LANES]; 4];
            for j in 0..t::D.len() {
                let k = used[j][i];
                for q in 0..4 {
                    sum[q] = add(t::D[j].1[q], &k, sum[q]);
                }
            }
            let dy: Lane = std::array::from_fn(|c| y_new[i][c] - y[i][c]);
            let ends: Lane = std::array::from_fn(|c| first[i][c] + last[i][c]);
            out[i] = dy;
            out[count + i] = std::array::from_fn(|c| h.mul_add(first[i][c], -dy[c]));
            out[2 * count + i] = std::array::from_fn(|c| 2.0f64.mul_add(dy[c], -(h * ends[c])));
            for q in 0..4 {
                out[(3 + q) * count + i] = sum[q].map(|x| h * x);
            }
        }
    }
}

fused! {
    /// The dense output at M places θ in (0, 1], one after the other in `out`.
    #[inline(never)]
    pub(super) fn interpolate<const M: usize>(out: &mut [f64], y: &[f64], dense: &[f64], theta: [f64; M]) {
        let count = y.len() / LANES;
        let mut weights = [[0.0; DENSE]; M];
        for (row, theta) in weights.iter_mut().zip(theta) {
            let mut weight = 1.0;
            for (j, w) in row.iter_mut().enumerate() {
                weight *= if j % 2 == 0 { theta } else { 1.0 - theta };
                *w = weight;
            }
        }
        let (y, dense) = (&lanes(y)[..count], &lanes(dense)[..DENSE * count]);
        let out = &mut lanes_mut(out)[..M * count];
        for i in 0..count {
            let mut sum = [y[i]; M];
            for j in 0..DENSE {
                let d = dense[j * count + i];
                for m in 0..M {
                    sum[m] = add(weights[m][j], &d, sum[m]);
                }
            }
            for m in 0..M {
                out[m * count + i] = sum[m];
            }
        }
    }
}
