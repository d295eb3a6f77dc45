//! Factorisation of small dense symmetric matrices, H + μ**I** = **L D L**ᵀ with a unit diagonal in **L**, and the solves
//! that go with it.
//!
//! Newton systems here have at most mN unknowns: 12 for three defenders, where plain loops beat any library call, some
//! 100 for fourteen, where they still take a quarter of faer's time, and 200 to 420 for twenty, half of it. Past
//! [`LIBRARY_SIZE`] unknowns faer's blocked factorisation takes over.
//!
//! The loops work on tiles of 4 × 4 entries, which stay in registers while products of the columns before them come off;
//! four divisions follow one another in a tile of the diagonal, and nothing else waits. There is no square root. A factor
//! holds **L** below its diagonal, C = **LD** above it (entry (j, i), j < i, is C_ij), and 1/D on it: what a tile takes
//! off its neighbours lies together in memory, by rows and by columns.
//!
//! Past [`BLOCKED_SIZE`] faer's is called on blocks of columns, so that a cancellation is noticed between two of them.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::{Accum, MatMut, Par, Spec};

use super::factor_one::factorise_one;
use super::layout::{GROUP, Layout, packed};
use super::tile::{Pivots, diagonal, tile};
use crate::cancel::{CancelToken, raised};
use crate::simd::{Number, Width};

/// Unknowns from which faer's factorisation may be used.
pub const LIBRARY_SIZE: usize = 512;
/// Unknowns beyond which it goes by blocks, and the columns and rows of one.
pub const BLOCKED_SIZE: usize = 768;
pub const BLOCK: usize = 256;

/// What may work on one matrix at a time.
#[derive(Debug, Clone, Copy)]
pub struct Backend<'a> {
    /// faer, on large matrices; its bits differ from those of the loops here.
    pub library: bool,
    /// Registers, bitwise equal.
    pub width: Width,
    /// What stops it.
    pub cancel: Option<&'a CancelToken>,
}

/// Factorises H + μI, given by its packed lower triangle, into `f`, and says in which lanes it is positive definite to
/// working precision. Where it is not, the second answer is the pivot that failed, its sign turned: about what μ lacks.
/// Once the backend's token is raised, no.
///
/// An unknown that a lane does not have (`layout`) has the unit row there.
#[inline(always)]
pub fn factorise<T: Number>(h: &[T], damping: T, layout: &Layout<T>, backend: Backend, f: &mut [T]) -> (T::Mask, T) {
    let d = layout.len();
    if let (Some(h), Some(f)) = (T::alone(h), T::alone_mut(f)) {
        let (damping, used) = (damping.lane(0), layout.used());
        let (definite, lack) = if backend.library && d >= LIBRARY_SIZE {
            (factorise_large(h, damping, used, d, f, backend.cancel), 0.0)
        } else {
            factorise_one(backend.width, h, damping, used, d, f)
        };
        return (T::mask(u16::from(definite)), T::splat(lack));
    }
    let mut pivots = Pivots::new();
    for first in (0..d).step_by(GROUP) {
        let active = std::array::from_fn(|j| layout.active(first + j));
        factorise_columns(h, damping, first, active, f, d, &mut pivots);
    }
    (T::mask(pivots.ok), pivots.lack)
}

/// The columns of one tile.
#[inline(always)]
fn factorise_columns<T: Number>(
    h: &[T],
    damping: T,
    first: usize,
    active: [T::Mask; GROUP],
    f: &mut [T],
    d: usize,
    pivots: &mut Pivots<T>,
) {
    let mut on = tile(h, first, first, damping, f, d);
    let reciprocal = diagonal(&mut on, first, h, damping, active, f, d, pivots);
    for row in (first + GROUP..d).step_by(GROUP) {
        let mut below = tile(h, row, first, damping, f, d);
        let mut l = [[T::splat(0.0); GROUP]; GROUP];
        for j in 0..GROUP {
            for i in 0..GROUP {
                l[i][j] = below[i][j] * reciprocal[j];
                for k in j + 1..GROUP {
                    below[i][k] = below[i][k].minus(l[i][j], on[k][j]);
                }
            }
        }
        for i in 0..GROUP {
            f[(row + i) * d + first..][..GROUP].copy_from_slice(&l[i]);
        }
        for j in 0..GROUP {
            let column = [below[0][j], below[1][j], below[2][j], below[3][j]];
            f[(first + j) * d + row..][..GROUP].copy_from_slice(&column);
        }
    }
}

#[inline(never)]
fn factorise_large(
    h: &[f64],
    damping: f64,
    used: usize,
    d: usize,
    f: &mut [f64],
    cancel: Option<&CancelToken>,
) -> bool {
    for i in 0..d {
        f[i * d..][..i + 1].copy_from_slice(&h[packed(i)..][..i + 1]);
        f[i * d + i] = if i < used { f[i * d + i] + damping } else { 1.0 };
    }
    // faer reads columns: the transposed view turns our lower triangle, stored by rows, into its row-strided one.
    let view = MatMut::from_row_major_slice_mut(&mut f[..d * d], d, d);
    if !(if d > BLOCKED_SIZE { by_blocks(view, cancel) } else { at_once(view) }) {
        return false;
    }
    // C = LD, by blocks of both: one of them is read across its rows.
    for (first, last) in blocks(0, d) {
        if raised(cancel) {
            return false;
        }
        for j in first..last {
            let pivot = f[j * d + j];
            if !pivot.is_finite() || pivot <= 0.0 {
                return false;
            }
        }
        for (low, high) in blocks(first, d) {
            for j in first..last {
                let pivot = f[j * d + j];
                for i in low.max(j + 1)..high {
                    f[j * d + i] = f[i * d + j] * pivot;
                }
            }
        }
        for j in first..last {
            f[j * d + j] = 1.0 / f[j * d + j];
        }
    }
    true
}

/// The blocks of `first..end`: where each begins and ends.
fn blocks(first: usize, end: usize) -> impl Iterator<Item = (usize, usize)> {
    (first..end).step_by(BLOCK).map(move |at| (at, end.min(at + BLOCK)))
}

/// **L** below the diagonal and D on it, by one call; whether the matrix is definite.
fn at_once(a: MatMut<'_, f64>) -> bool {
    let need = factor::cholesky_in_place_scratch::<f64>(a.nrows(), Par::Seq, Spec::default());
    let Ok(mut memory) = MemBuffer::try_new(need) else { return false };
    let (stack, signs) = (MemStack::new(&mut memory), factor::LdltRegularization::default());
    factor::cholesky_in_place(a, signs, Par::Seq, stack, Spec::default()).is_ok()
}

/// The same by blocks of columns: what remains loses the products of each before the next is looked at.
fn by_blocks(mut a: MatMut<'_, f64>, cancel: Option<&CancelToken>) -> bool {
    let d = a.nrows();
    for (first, last) in blocks(0, d) {
        let (_, _, _, mut rest) = a.as_mut().split_at_mut(first, first);
        let width = last - first;
        let (mut on, _, mut below, mut after) = rest.as_mut().split_at_mut(width, width);
        if !at_once(on.as_mut()) {
            return false;
        }
        for (low, high) in blocks(0, d - last) {
            if raised(cancel) {
                return false;
            }
            // Rows of A := A L⁻ᵀ, which is C = LD.
            let part = below.as_mut().subrows_mut(low, high - low);
            solve_unit_lower_triangular_in_place(on.as_ref(), part.transpose_mut(), Par::Seq);
        }
        let scaled = below.as_ref().to_owned();
        let reciprocals: Vec<f64> = (0..width).map(|j| 1.0 / on[(j, j)]).collect();
        for i in 0..d - last {
            for (j, reciprocal) in reciprocals.iter().enumerate() {
                below[(i, j)] *= reciprocal;
            }
        }
        for (low, high) in blocks(0, d - last) {
            for (left, right) in blocks(0, high) {
                if raised(cancel) {
                    return false;
                }
                let tile = after.as_mut().submatrix_mut(low, left, high - low, right - left);
                let shape = if left == low { BlockStructure::TriangularLower } else { BlockStructure::Rectangular };
                triangular::matmul(
                    tile,
                    shape,
                    Accum::Add,
                    below.as_ref().subrows(low, high - low),
                    BlockStructure::Rectangular,
                    scaled.as_ref().subrows(left, right - left).transpose(),
                    BlockStructure::Rectangular,
                    -1.0,
                    Par::Seq,
                );
            }
        }
    }
    true
}

/// x := (**LD**)⁻¹x; the sum Σx²/D of **L**⁻¹x, that is xᵀ(H + μ**I**)⁻¹x of the x given.
#[inline(always)]
pub fn forward<T: Number>(f: &[T], d: usize, x: &mut [T]) -> T {
    let mut sum = T::splat(0.0);
    for first in (0..d).step_by(GROUP) {
        let (mut y, mut z) = ([T::splat(0.0); GROUP], [T::splat(0.0); GROUP]);
        y.copy_from_slice(&x[first..first + GROUP]);
        let c: [&[T]; GROUP] = std::array::from_fn(|j| &f[(first + j) * d..][..d]);
        for j in 0..GROUP {
            z[j] = y[j] * c[j][first + j];
            sum = sum.plus(y[j], z[j]);
            for i in j + 1..GROUP {
                y[i] = y[i].minus(z[j], c[j][first + i]);
            }
        }
        x[first..first + GROUP].copy_from_slice(&z);
        for i in first + GROUP..d {
            x[i] = x[i].minus(z[0], c[0][i]).minus(z[1], c[1][i]).minus(z[2], c[2][i]).minus(z[3], c[3][i]);
        }
    }
    sum
}

/// x := **L**⁻ᵀx: after [`forward`], the solution of (H + μ**I**)x = b.
#[inline(always)]
pub fn back<T: Number>(f: &[T], d: usize, x: &mut [T]) {
    for first in (0..d).step_by(GROUP).rev() {
        let l: [&[T]; GROUP] = std::array::from_fn(|i| &f[(first + i) * d..][..first + GROUP]);
        let (above, rest) = x.split_at_mut(first);
        let z = &mut rest[..GROUP];
        for i in (0..GROUP).rev() {
            for j in 0..i {
                z[j] = z[j].minus(l[i][first + j], z[i]);
            }
        }
        for j in 0..first {
            above[j] = above[j].minus(l[3][j], z[3]).minus(l[2][j], z[2]).minus(l[1][j], z[1]).minus(l[0][j], z[0]);
        }
    }
}
