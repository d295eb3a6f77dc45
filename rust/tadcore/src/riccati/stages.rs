//! out = base + h Σ_j a_j k_j: the loops over the state, in whole vector lanes, at the processor's [`Width`](crate::simd::Width).
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
use crate::simd::{Number, Simd, dispatch};

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

/// Σ_j a_j k_j at lane i.
#[inline(always)]
fn sum<V: Simd, const M: usize>(k: &[&[Lane]; M], row: &[(usize, f64); M], i: usize) -> V::Eight {
    let mut sum = V::Eight::splat(row[0].1) * V::Eight::load(&k[0][i]);
    for j in 1..M {
        sum = sum.plus(V::Eight::splat(row[j].1), V::Eight::load(&k[j][i]));
    }
    sum
}

#[inline(always)]
fn step<V: Simd, const M: usize>(out: &mut [f64], y: &[f64], k: &[f64], row: &[(usize, f64); M], h: f64) {
    let len = out.len();
    let (y, k, h) = (&lanes(&y[..len])[..len / LANES], stages(k, len, row), V::Eight::splat(h));
    for (i, out) in lanes_mut(out).iter_mut().enumerate() {
        V::Eight::load(&y[i]).plus(h, sum::<V, M>(&k, row, i)).store(out);
    }
}

dispatch! {
    /// The point at which stage `i` (from zero) is evaluated; 12 is the new point.
    #[inline(never)]
    pub(super) fn point<V>(i: usize, out: &mut [f64], y: &[f64], k: &[f64], h: f64) {
        match i {
            1 => step::<V, _>(out, y, k, &t::A2, h),
            2 => step::<V, _>(out, y, k, &t::A3, h),
            3 => step::<V, _>(out, y, k, &t::A4, h),
            4 => step::<V, _>(out, y, k, &t::A5, h),
            5 => step::<V, _>(out, y, k, &t::A6, h),
            6 => step::<V, _>(out, y, k, &t::A7, h),
            7 => step::<V, _>(out, y, k, &t::A8, h),
            8 => step::<V, _>(out, y, k, &t::A9, h),
            9 => step::<V, _>(out, y, k, &t::A10, h),
            10 => step::<V, _>(out, y, k, &t::A11, h),
            11 => step::<V, _>(out, y, k, &t::A12, h),
            12 => step::<V, _>(out, y, k, &t::B, h),
            13 => step::<V, _>(out, y, k, &t::A14, h),
            14 => step::<V, _>(out, y, k, &t::A15, h),
            _ => step::<V, _>(out, y, k, &t::A16, h),
        }
    }
}

dispatch! {
    /// Σ (w e5)², Σ (w e3)² and Σ (w y)² over the block of entries from `start`.
    #[inline(never)]
    pub(super) fn error_sums<V>(k: &[f64], y: &[f64], weight: &[f64], start: usize, block: usize) -> (f64, f64, f64) {
        let (len, from, count) = (weight.len(), start / LANES, block / LANES);
        let k5 = stages(k, len, &t::E5).map(|k| &k[from..][..count]);
        let k3 = stages(k, len, &t::E3).map(|k| &k[from..][..count]);
        let (y, weight) = (&lanes(y)[from..][..count], &lanes(weight)[from..][..count]);
        let (mut five, mut three, mut size) = (V::Eight::splat(0.0), V::Eight::splat(0.0), V::Eight::splat(0.0));
        for i in 0..count {
            let weight = V::Eight::load(&weight[i]);
            let (e5, e3) = (weight * sum::<V, _>(&k5, &t::E5, i), weight * sum::<V, _>(&k3, &t::E3, i));
            let y = weight * V::Eight::load(&y[i]);
            five = five.plus(e5, e5);
            three = three.plus(e3, e3);
            size = size.plus(y, y);
        }
        let total = |x: V::Eight| {
            let mut lanes = [0.0; LANES];
            x.store(&mut lanes);
            lanes.iter().sum()
        };
        (total(five), total(three), total(size))
    }
}

dispatch! {
    /// The dense output's coefficients for the step from `y` to `y_new`.
    #[inline(never)]
    pub(super) fn dense<V>(out: &mut [f64], y: &[f64], y_new: &[f64], k: &[f64], h: f64) {
        let len = y.len();
        let count = len / LANES;
        let used = stages(k, len, &t::D);
        let (first, last) = (used[0], &lanes(&k[12 * len..13 * len])[..count]);
        let (y, y_new) = (&lanes(y)[..count], &lanes(y_new)[..count]);
        let out = &mut lanes_mut(out)[..DENSE * count];
        let (h, two) = (V::Eight::splat(h), V::Eight::splat(2.0));
        for i in 0..count {
            let mut sum = [V::Eight::splat(0.0); 4];
            for j in 0..t::D.len() {
                let k = V::Eight::load(&used[j][i]);
                for q in 0..4 {
                    sum[q] = sum[q].plus(V::Eight::splat(t::D[j].1[q]), k);
                }
            }
            let (first, last) = (V::Eight::load(&first[i]), V::Eight::load(&last[i]));
            let dy = V::Eight::load(&y_new[i]) - V::Eight::load(&y[i]);
            dy.store(&mut out[i]);
            (h * first - dy).store(&mut out[count + i]);
            (two * dy - h * (first + last)).store(&mut out[2 * count + i]);
            for q in 0..4 {
                (h * sum[q]).store(&mut out[(3 + q) * count + i]);
            }
        }
    }
}

dispatch! {
    /// The dense output at M places θ in (0, 1], one after the other in `out`.
    #[inline(never)]
    pub(super) fn interpolate<V, const M: usize>(out: &mut [f64], y: &[f64], dense: &[f64], theta: [f64; M]) {
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
            let mut sum = [V::Eight::load(&y[i]); M];
            for j in 0..DENSE {
                let d = V::Eight::load(&dense[j * count + i]);
                for m in 0..M {
                    sum[m] = sum[m].plus(V::Eight::splat(weights[m][j]), d);
                }
            }
            for m in 0..M {
                sum[m].store(&mut out[m * count + i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Width;

    /// Points, error sums, dense output and its values have the same bits for every vector width.
    #[test]
    fn widths_agree_to_the_bit() {
        let len = 3 * LANES;
        let wave = |count: usize, shift: f64| (0..count).map(|i| (shift + 1.7 * i as f64).sin()).collect::<Vec<f64>>();
        let (y, y_new, k, weight) = (wave(len, 0.1), wave(len, 0.2), wave(STAGES * len, 0.3), wave(len, 0.4));
        let values = |width: Width| {
            let mut all = Vec::new();
            for i in 1..STAGES {
                let mut out = vec![0.0; len];
                point(width, i, &mut out, &y, &k, 0.37);
                all.extend(out);
            }
            let (five, three, size) = error_sums(width, &k, &y, &weight, LANES, 2 * LANES);
            let (mut coefficients, mut inside) = (vec![0.0; DENSE * len], vec![0.0; 4 * len]);
            dense(width, &mut coefficients, &y, &y_new, &k, 0.37);
            interpolate(width, &mut inside, &y, &coefficients, [0.1, 0.4, 0.7, 1.0]);
            // At θ = 1 the dense output is the new point.
            for (a, b) in inside[3 * len..].iter().zip(&y_new) {
                assert!((a - b).abs() < 1e-15, "{width:?}: {a} and {b}");
            }
            all.extend([five, three, size]);
            all.extend(coefficients);
            all.extend(inside);
            all
        };
        let expected = values(Width::Baseline);
        for width in Width::all() {
            assert_eq!(values(width), expected, "{width:?}");
        }
    }
}
