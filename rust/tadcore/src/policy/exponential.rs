//! exp(Cδ), and with it ∫₀^δ h exp(Cs) ds for one row h: the exact step of a sampled-data linear loop.
//!
//! A Taylor series on a step halved until ‖C‖δ/2^s ≤ ½, summed until its terms vanish, then doubled back s times:
//! E(2h) = E(h)², a(2h) = a(h) + a(h) E(h). At the sizes of a step (‖C‖δ ≈ 0.02) this is eight small products.
//! Up to N = 8 the products are nalgebra's on the stack; beyond, faer's. (At N = 9 the two cost the same; at N = 31
//! faer is 3 times as fast.)

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::{copy, spare, zeros};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{RowSVector, SMatrix};

/// Halvings of a step; a loop that needs more moves by 2^1000 in one step and is reported as not finite.
const HALVINGS: i32 = 1000;
/// What asks for memory here.
pub(super) const WHAT: &str = "the transition of one step";
/// Rows and columns of a product that are formed between two looks at the cancel token; no game within the sizes that
/// were measured has as many.
const ROWS: usize = 512;
/// Terms of the series; fifteen reach rounding at ‖C‖h = ½.
const TERMS: usize = 24;

fn halvings(c: &[f64], n: usize, step: f64) -> i32 {
    let norm = c.chunks_exact(n).map(|row| row.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max) * step;
    let mut s = 0;
    let mut size = norm;
    while size > 0.5 && s < HALVINGS {
        size *= 0.5;
        s += 1;
    }
    s
}

/// Writes exp(C·step) into `e` (N × N, row-major) and h ∫₀^step exp(Cs) ds into `a` (N), h being `row`.
///
/// # Errors
/// [`Stopped`] when there is no memory for it, or `cancel` was raised.
pub fn exponential(
    c: &[f64],
    row: &[f64],
    step: f64,
    e: &mut [f64],
    a: &mut [f64],
    cancel: &CancelToken,
) -> Result<(), Stopped> {
    match row.len() {
        1 => small::<1>(c, row, step, e, a),
        2 => small::<2>(c, row, step, e, a),
        3 => small::<3>(c, row, step, e, a),
        4 => small::<4>(c, row, step, e, a),
        5 => small::<5>(c, row, step, e, a),
        6 => small::<6>(c, row, step, e, a),
        7 => small::<7>(c, row, step, e, a),
        8 => small::<8>(c, row, step, e, a),
        _ => return large(c, row, step, e, a, cancel),
    }
    Ok(())
}

fn small<const N: usize>(c: &[f64], row: &[f64], step: f64, e: &mut [f64], a: &mut [f64]) {
    let s = halvings(c, N, step);
    let h = step * 0.5f64.powi(s);
    let x = SMatrix::<f64, N, N>::from_row_slice(c) * h;
    let (mut sum, mut term) = (SMatrix::<f64, N, N>::identity(), SMatrix::<f64, N, N>::identity());
    // Σ X^k / (k + 1)!, which gives the integral.
    let mut integral = SMatrix::<f64, N, N>::identity();
    for k in 1..=TERMS {
        term = term * x / k as f64;
        sum += term;
        integral += term / (k + 1) as f64;
        if term.amax() <= 1e-18 * sum.amax() {
            break;
        }
    }
    let mut moved = RowSVector::<f64, N>::from_row_slice(row) * integral * h;
    for _ in 0..s {
        moved += moved * sum;
        sum *= sum;
    }
    for i in 0..N {
        for j in 0..N {
            e[i * N + j] = sum[(i, j)];
        }
        a[i] = moved[i];
    }
}

fn large(c: &[f64], row: &[f64], step: f64, e: &mut [f64], a: &mut [f64], cancel: &CancelToken) -> Result<(), Stopped> {
    let n = row.len();
    let s = halvings(c, n, step);
    let h = step * 0.5f64.powi(s);
    // faer takes some megabytes for each thread, by a call that ends the process where there are none.
    spare(WHAT)?;
    let mut x = copy(WHAT, c)?;
    x.iter_mut().for_each(|v| *v *= h);
    let mut term = zeros(WHAT, n * n)?;
    for i in 0..n {
        term[i * n + i] = 1.0;
    }
    let (mut sum, mut integral, mut next) = (copy(WHAT, &term)?, copy(WHAT, &term)?, zeros(WHAT, n * n)?);
    let largest = |m: &[f64]| m.iter().fold(0.0, |a: f64, &b| a.max(b.abs()));
    for k in 1..=TERMS {
        multiply(&mut next, &term, &x, n, cancel)?;
        for ((t, v), (s, i)) in term.iter_mut().zip(&next).zip(sum.iter_mut().zip(&mut integral)) {
            *t = v / k as f64;
            *s += *t;
            *i += *t / (k + 1) as f64;
        }
        if largest(&term) <= 1e-18 * largest(&sum) {
            break;
        }
    }
    let times = |row: &[f64], m: &[f64], factor: f64| -> Vec<f64> {
        (0..n).map(|j| factor * (0..n).map(|i| row[i] * m[i * n + j]).sum::<f64>()).collect()
    };
    a.copy_from_slice(&times(row, &integral, h));
    for _ in 0..s {
        let more = times(a, &sum, 1.0);
        a.iter_mut().zip(more).for_each(|(a, m)| *a += m);
        multiply(&mut next, &sum, &sum, n, cancel)?;
        std::mem::swap(&mut sum, &mut next);
    }
    e.copy_from_slice(&sum);
    Ok(())
}

/// out = a b, N × N, in tiles of [`ROWS`].
pub(crate) fn multiply(out: &mut [f64], a: &[f64], b: &[f64], n: usize, cancel: &CancelToken) -> Result<(), Stopped> {
    let (a, b) = (MatRef::from_row_major_slice(a, n, n), MatRef::from_row_major_slice(b, n, n));
    let mut out = MatMut::from_row_major_slice_mut(out, n, n);
    for row in (0..n).step_by(ROWS) {
        for column in (0..n).step_by(ROWS) {
            cancel.check()?;
            let (height, width) = (ROWS.min(n - row), ROWS.min(n - column));
            let tile = out.as_mut().submatrix_mut(row, column, height, width);
            let (a, b) = (a.subrows(row, height), b.subcols(column, width));
            matmul(tile, Accum::Replace, a, b, 1.0, Par::Seq);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rotation has a closed form, at every size and also far beyond one turn.
    #[test]
    fn rotations_come_out_exactly() {
        for n in [2usize, 4, 8, 10] {
            for angle in [1e-3, 0.7, 40.0] {
                let mut c = vec![0.0; n * n];
                for i in (0..n).step_by(2) {
                    c[i * n + i + 1] = -1.0;
                    c[(i + 1) * n + i] = 1.0;
                }
                let mut row = vec![0.0; n];
                row[0] = 1.0;
                let (mut e, mut a) = (vec![0.0; n * n], vec![0.0; n]);
                exponential(&c, &row, angle, &mut e, &mut a, &CancelToken::new()).expect("memory");
                let tolerance = 1e-15 * (1.0 + 10.0 * angle);
                assert!((e[0] - angle.cos()).abs() < tolerance, "{n} {angle}");
                assert!((e[1] + angle.sin()).abs() < tolerance);
                assert!((a[0] - angle.sin()).abs() < tolerance);
                assert!((a[1] - (angle.cos() - 1.0)).abs() < tolerance);
            }
        }
    }
}
