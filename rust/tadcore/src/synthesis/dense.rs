//! Cholesky factorisation of small dense symmetric matrices, in place, and the solve that goes with it.
//!
//! Newton systems here have at most mN unknowns: 12 for three defenders, where plain loops beat any library call. Past
//! [`LIBRARY_SIZE`] unknowns faer's blocked factorisation takes over: it wins from about a hundred on, and by ten at
//! several hundred.

use faer::linalg::cholesky::llt;
use faer::{MatMut, Par};

/// Unknowns from which faer's factorisation is used.
const LIBRARY_SIZE: usize = 96;

/// Factorises the lower triangle of the row-major `d` × `d` matrix `a` into L Lᵀ, in place; `false` when it is not
/// positive definite to working precision.
#[inline(always)]
pub(super) fn factorise(a: &mut [f64], d: usize) -> bool {
    match d {
        0..=16 => factorise_small::<16>(a, d),
        17..LIBRARY_SIZE => factorise_small::<LIBRARY_SIZE>(a, d),
        _ => factorise_large(a, d),
    }
}

/// Column by column, each taken off all that follow at once: the updates of a row do not wait for one another, as the
/// terms of a dot product would. The operations on each entry and their order are those of the row-by-row form.
#[inline(always)]
fn factorise_small<const SIZE: usize>(a: &mut [f64], d: usize) -> bool {
    let (mut original, mut column) = ([0.0; SIZE], [0.0; SIZE]);
    for i in 0..d {
        original[i] = a[i * d + i];
    }
    for k in 0..d {
        let pivot = a[k * d + k];
        if pivot.is_nan() || pivot <= f64::EPSILON * original[k].abs() || original[k] <= 0.0 {
            return false;
        }
        // The diagonal holds reciprocals, so that the solves multiply.
        let reciprocal = 1.0 / pivot.sqrt();
        a[k * d + k] = reciprocal;
        for i in k + 1..d {
            a[i * d + k] *= reciprocal;
            column[i] = a[i * d + k];
        }
        for i in k + 1..d {
            let factor = column[i];
            for (x, c) in a[i * d + k + 1..i * d + i + 1].iter_mut().zip(&column[k + 1..i + 1]) {
                *x -= factor * c;
            }
        }
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
    if d >= LIBRARY_SIZE {
        // By rows, which lie together in memory.
        for i in 0..d {
            let row = &l[i * d..i * d + i + 1];
            let mut sum = x[i];
            for (a, b) in row[..i].iter().zip(&x[..i]) {
                sum -= a * b;
            }
            x[i] = sum * row[i];
        }
    } else {
        // By columns, whose entries do not wait for one another.
        for j in 0..d {
            let value = x[j] * l[j * d + j];
            x[j] = value;
            for i in j + 1..d {
                x[i] -= l[i * d + j] * value;
            }
        }
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
