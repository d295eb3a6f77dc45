//! Cholesky factorisation of small dense symmetric matrices, in place, and the solve that goes with it.
//!
//! Newton systems here have at most mN unknowns: 12 for three defenders, where plain loops beat any library call. Past
//! [`LIBRARY_SIZE`] unknowns faer's blocked factorisation takes over: it wins from about a hundred on, and by ten at
//! several hundred.

use faer::linalg::cholesky::llt;
use faer::{MatMut, Par};

use super::start::Layout;
use crate::lanes::Number;

/// Unknowns from which faer's factorisation may be used.
const LIBRARY_SIZE: usize = 96;
/// Unknowns that the loops here can have: twice the gains of eight players.
const LARGEST: usize = 128;

/// Factorises H + μI, given by its lower triangle in the row-major `d` × `d` matrix `h`, into L Lᵀ, and says in which
/// lanes it is positive definite to working precision. `l` then holds L below its diagonal and reciprocals on it; `x`,
/// unless it is empty, becomes L⁻¹`b`. Where it is not, the second answer is the pivot that failed, its sign turned: about
/// what μ lacks.
///
/// An unknown that a lane does not have (`layout`) has the unit row there. `library` lets faer factorise large
/// matrices, whose bits differ from those of the loops here.
#[inline(always)]
pub(super) fn factorise<T: Number>(
    h: &[T],
    damping: T,
    layout: &Layout<T>,
    library: bool,
    b: &[T],
    x: &mut [T],
    l: &mut [T],
) -> (T::Mask, T) {
    let d = layout.len();
    if T::LANES > 1 {
        let answer = by_rows(h, damping, layout, l);
        eliminate(l, d, b, x);
        return answer;
    }
    l[..d * d].copy_from_slice(&h[..d * d]);
    for i in 0..d {
        l[i * d + i] = l[i * d + i] + damping;
    }
    let library = library && d >= LIBRARY_SIZE;
    let (definite, lack) = match T::alone(l) {
        Some(alone) if library => (T::mask(u8::from(factorise_large(alone, d))), T::splat(0.0)),
        _ if d <= 16 => by_columns::<T, 16>(l, d),
        _ => by_columns::<T, LARGEST>(l, d),
    };
    if T::bits(definite) == 1 && !x.is_empty() {
        x.copy_from_slice(b);
        forward(l, d, library, x);
    }
    (definite, lack)
}

/// Whether a pivot can be one: not lost in the rounding of the diagonal entry that it comes from.
#[inline(always)]
fn sound<T: Number>(pivot: T, original: T) -> u8 {
    T::bits((T::splat(f64::EPSILON) * original.abs()).less(pivot)) & T::bits(T::splat(0.0).less(original))
}

/// One matrix, column by column, each taken off all that follow at once: the updates of a row do not wait for one
/// another, as the terms of a dot product would. The operations on each entry and their order are those of
/// [`by_rows`].
#[inline(always)]
fn by_columns<T: Number, const SIZE: usize>(a: &mut [T], d: usize) -> (T::Mask, T) {
    let (mut original, mut column) = ([T::splat(0.0); SIZE], [T::splat(0.0); SIZE]);
    for i in 0..d {
        original[i] = a[i * d + i];
    }
    for k in 0..d {
        let pivot = a[k * d + k];
        if sound(pivot, original[k]) == 0 {
            return (T::mask(0), T::splat(0.0) - pivot);
        }
        let reciprocal = T::splat(1.0) / pivot.sqrt();
        a[k * d + k] = reciprocal;
        for i in k + 1..d {
            a[i * d + k] = a[i * d + k] * reciprocal;
            column[i] = a[i * d + k];
        }
        for i in k + 1..d {
            let factor = column[i];
            for (x, &c) in a[i * d + k + 1..i * d + i + 1].iter_mut().zip(&column[k + 1..i + 1]) {
                *x = x.minus(factor, c);
            }
        }
    }
    (T::mask(1), T::splat(0.0))
}

/// Several matrices, row by row: an entry stays in a register until it is done, four of a row at once.
#[inline(always)]
fn by_rows<T: Number>(h: &[T], damping: T, layout: &Layout<T>, l: &mut [T]) -> (T::Mask, T) {
    let d = layout.len();
    let one = T::splat(1.0);
    let (mut ok, mut lack) = (u8::MAX, T::splat(0.0));
    for i in 0..d {
        let (above, row) = l[..(i + 1) * d].split_at_mut(i * d);
        eliminate(above, d, &h[i * d..i * d + i], &mut row[..i]);
        let original = h[i * d + i] + damping;
        let mut pivot = original;
        for &x in &row[..i] {
            pivot = pivot.minus(x, x);
        }
        let active = T::bits(layout.active(i));
        let sound = sound(pivot, original);
        let refused = active & !sound;
        lack = T::select(T::mask(ok & refused), T::splat(0.0) - pivot, lack);
        ok &= !refused;
        // A lane whose matrix is refused goes on with the others; what it computes is not used.
        pivot = T::select(T::mask(sound & active), pivot, one);
        row[i] = one / pivot.sqrt();
    }
    (T::mask(ok), lack)
}

/// Writes the row y with y Lᵀ = x, L being the rows `above`.
#[inline(always)]
fn eliminate<T: Number>(above: &[T], d: usize, x: &[T], row: &mut [T]) {
    let len = row.len();
    let x = &x[..len];
    let mut j = 0;
    while j + 4 <= len {
        let r0 = &above[j * d..][..j + 1];
        let r1 = &above[(j + 1) * d..][..j + 2];
        let r2 = &above[(j + 2) * d..][..j + 3];
        let r3 = &above[(j + 3) * d..][..j + 4];
        let (done, rest) = row.split_at_mut(j);
        let rest = &mut rest[..4];
        let (mut x0, mut x1, mut x2, mut x3) = (x[j], x[j + 1], x[j + 2], x[j + 3]);
        let (s0, s1, s2, s3) = (&r0[..j], &r1[..j], &r2[..j], &r3[..j]);
        for k in 0..j {
            let f = done[k];
            x0 = x0.minus(f, s0[k]);
            x1 = x1.minus(f, s1[k]);
            x2 = x2.minus(f, s2[k]);
            x3 = x3.minus(f, s3[k]);
        }
        x0 = x0 * r0[j];
        x1 = x1.minus(x0, r1[j]) * r1[j + 1];
        x2 = x2.minus(x0, r2[j]).minus(x1, r2[j + 1]) * r2[j + 2];
        x3 = x3.minus(x0, r3[j]).minus(x1, r3[j + 1]).minus(x2, r3[j + 2]) * r3[j + 3];
        (rest[0], rest[1], rest[2], rest[3]) = (x0, x1, x2, x3);
        j += 4;
    }
    while j < len {
        let r = &above[j * d..][..j + 1];
        let (done, rest) = row.split_at_mut(j);
        let mut y = x[j];
        for (&a, &b) in done.iter().zip(r) {
            y = y.minus(a, b);
        }
        rest[0] = y * r[j];
        j += 1;
    }
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

/// x := L⁻¹x.
#[inline(always)]
pub(super) fn forward<T: Number>(l: &[T], d: usize, library: bool, x: &mut [T]) {
    if library && d >= LIBRARY_SIZE || T::LANES > 1 {
        // Rows lie together in memory.
        for i in 0..d {
            let row = &l[i * d..i * d + i + 1];
            let mut sum = x[i];
            for (&a, &b) in row[..i].iter().zip(&x[..i]) {
                sum = sum.minus(a, b);
            }
            x[i] = sum * row[i];
        }
    } else {
        // The entries of a column do not wait for one another.
        for j in 0..d {
            let value = x[j] * l[j * d + j];
            x[j] = value;
            for i in j + 1..d {
                x[i] = x[i].minus(l[i * d + j], value);
            }
        }
    }
}

/// x := L⁻ᵀx with a factor from [`factorise`], which has made x = L⁻¹b: the solution of L Lᵀ x = b.
#[inline(always)]
pub(super) fn back<T: Number>(l: &[T], d: usize, x: &mut [T]) {
    for i in (0..d).rev() {
        let row = &l[i * d..i * d + i + 1];
        let value = x[i] * row[i];
        x[i] = value;
        for (&a, b) in row[..i].iter().zip(&mut x[..i]) {
            *b = b.minus(a, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::start::Variable;
    use super::*;

    fn layout(d: usize) -> Layout<f64> {
        let variables: Vec<Variable> = (0..d).map(|entry| Variable { entry, own: 0, relative: false }).collect();
        let mut layout = Layout::default();
        layout.list([&variables, &[], &[], &[], &[], &[], &[], &[]], d, 1);
        layout
    }

    #[test]
    fn both_factorisations_solve_the_same_system() {
        for d in [1, 2, 5, 12, 95, 96, 128] {
            let mut a = vec![0.0; d * d];
            for i in 0..d {
                for j in 0..=i {
                    a[i * d + j] = 1.0 / (1.0 + (i - j) as f64) + if i == j { 2.0 } else { 0.0 };
                }
            }
            let full = |i: usize, j: usize| a[i.max(j) * d + i.min(j)] + if i == j { 0.25 } else { 0.0 };
            let b: Vec<f64> = (0..d).map(|i| (i as f64 + 1.0).sin()).collect();
            for library in [false, true] {
                let mut l = a.clone();
                let mut x = vec![0.0; d];
                assert!(factorise(&a, 0.25, &layout(d), library, &b, &mut x, &mut l).0);
                back(&l, d, &mut x);
                for i in 0..d {
                    let sum: f64 = (0..d).map(|j| full(i, j) * x[j]).sum();
                    assert!((sum - b[i]).abs() < 1e-13 * d as f64, "{d} {i}");
                }
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        for (d, library) in [(2, false), (96, false), (96, true)] {
            let mut a = vec![0.0; d * d];
            for i in 0..d {
                a[i * d + i] = 1.0;
            }
            a[d] = 2.0;
            let mut l = a.clone();
            assert!(!factorise(&a, 0.0, &layout(d), library, &[], &mut [], &mut l).0, "{d}");
        }
    }
}
