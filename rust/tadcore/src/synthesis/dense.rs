//! Cholesky factorisation of small dense symmetric matrices, in place, and the solve that goes with it.
//!
//! Newton systems here have at most mN unknowns: 12 for three defenders, where a plain row-by-row factorisation beats
//! any library call. Past [`LIBRARY_SIZE`] unknowns faer's blocked factorisation takes over: it wins from about a
//! hundred on, and by ten at several hundred.

use faer::linalg::cholesky::llt;
use faer::{MatMut, Par};

/// Unknowns from which faer's factorisation is used.
const LIBRARY_SIZE: usize = 96;

/// Factorises the lower triangle of the row-major `d` × `d` matrix `a` into L Lᵀ, in place; `false` when it is not
/// positive definite to working precision.
#[inline(always)]
pub(super) fn factorise(a: &mut [f64], d: usize) -> bool {
    if d >= LIBRARY_SIZE { factorise_large(a, d) } else { factorise_small(a, d) }
}

#[inline(always)]
fn factorise_small(a: &mut [f64], d: usize) -> bool {
    for j in 0..d {
        let (done, rest) = a.split_at_mut(j * d);
        let row = &mut rest[..d];
        for k in 0..j {
            let other = &done[k * d..k * d + k + 1];
            let mut sum = row[k];
            for (x, y) in row[..k].iter().zip(&other[..k]) {
                sum -= x * y;
            }
            // The diagonal holds reciprocals while factorising, so that the inner solves multiply.
            row[k] = sum * other[k];
        }
        let mut pivot = row[j];
        let original = pivot;
        for x in &row[..j] {
            pivot -= x * x;
        }
        if pivot.is_nan() || pivot <= f64::EPSILON * original.abs() || original <= 0.0 {
            return false;
        }
        row[j] = 1.0 / pivot.sqrt();
    }
    true
}

#[inline(never)]
fn factorise_large(a: &mut [f64], d: usize) -> bool {
    // faer reads columns: the transposed view turns our lower triangle, stored by rows, into its row-strided one.
    let mut view = MatMut::from_row_major_slice_mut(&mut a[..d * d], d, d);
    let need = llt::factor::cholesky_in_place_scratch::<f64>(d, Par::Seq, faer::Spec::default());
    let mut memory = faer::dyn_stack::MemBuffer::new(need);
    let stack = faer::dyn_stack::MemStack::new(&mut memory);
    let done = llt::factor::cholesky_in_place(
        view.as_mut(),
        llt::factor::LltRegularization::default(),
        Par::Seq,
        stack,
        faer::Spec::default(),
    );
    if done.is_err() {
        return false;
    }
    for j in 0..d {
        let pivot = a[j * d + j];
        if !pivot.is_finite() || pivot <= 0.0 {
            return false;
        }
        a[j * d + j] = 1.0 / pivot;
    }
    true
}

/// Solves L Lᵀ x = b in place with a factor from [`factorise`].
#[inline(always)]
pub(super) fn solve(l: &[f64], d: usize, x: &mut [f64]) {
    for i in 0..d {
        let row = &l[i * d..i * d + i + 1];
        let mut sum = x[i];
        for (a, b) in row[..i].iter().zip(&x[..i]) {
            sum -= a * b;
        }
        x[i] = sum * row[i];
    }
    for i in (0..d).rev() {
        let row = &l[i * d..i * d + i + 1];
        let value = x[i] * row[i];
        x[i] = value;
        for (a, b) in row[..i].iter().zip(&mut x[..i]) {
            *b -= a * value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_factorisations_solve_the_same_system() {
        for d in [1, 2, 5, 12, 95, 96, 130] {
            let mut a = vec![0.0; d * d];
            for i in 0..d {
                for j in 0..=i {
                    a[i * d + j] = 1.0 / (1.0 + (i - j) as f64) + if i == j { 2.0 } else { 0.0 };
                }
            }
            let full = |i: usize, j: usize| a[i.max(j) * d + i.min(j)];
            let b: Vec<f64> = (0..d).map(|i| (i as f64 + 1.0).sin()).collect();
            let mut l = a.clone();
            assert!(factorise(&mut l, d));
            let mut x = b.clone();
            solve(&l, d, &mut x);
            for i in 0..d {
                let sum: f64 = (0..d).map(|j| full(i, j) * x[j]).sum();
                assert!((sum - b[i]).abs() < 1e-13 * d as f64, "{d} {i}");
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        for d in [2, 96] {
            let mut a = vec![0.0; d * d];
            for i in 0..d {
                a[i * d + i] = 1.0;
            }
            a[d] = 2.0;
            assert!(!factorise(&mut a, d), "{d}");
        }
    }
}
