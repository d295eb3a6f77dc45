//! Tiles of 4 × 4 entries of a symmetric matrix, and its pivots.

use super::layout::{GROUP, packed};
use crate::simd::Number;

/// A tile.
pub type Tile<T> = [[T; GROUP]; GROUP];

/// Factorises a tile of the diagonal, from which the columns before are taken off, and writes its part of the factor. The
/// tile is left with C, and 1/D is the answer.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into loops that hold these in registers")]
pub fn diagonal<T: Number>(
    on: &mut Tile<T>,
    first: usize,
    h: &[T],
    damping: T,
    active: [T::Mask; GROUP],
    f: &mut [T],
    d: usize,
    pivots: &mut Pivots<T>,
) -> [T; GROUP] {
    let mut reciprocal = [T::splat(0.0); GROUP];
    for j in 0..GROUP {
        let original = h[packed(first + j) + first + j] + damping;
        reciprocal[j] = T::splat(1.0) / pivots.check(on[j][j], original, active[j]);
        for i in j + 1..GROUP {
            let l = on[i][j] * reciprocal[j];
            for k in j + 1..i + 1 {
                on[i][k] = on[i][k].minus(l, on[k][j]);
            }
            f[(first + i) * d + first + j] = l;
            f[(first + j) * d + first + i] = on[i][j];
        }
        f[(first + j) * d + first + j] = reciprocal[j];
    }
    reciprocal
}

/// The tile of H + μI at (`row`, `column`), less the products of the columns before it. On the diagonal, what lies above
/// is not used.
#[inline(always)]
pub fn tile<T: Number>(h: &[T], row: usize, column: usize, damping: T, f: &[T], d: usize) -> Tile<T> {
    let mut a = [[T::splat(0.0); GROUP]; GROUP];
    for i in 0..GROUP {
        let len = if row == column { i + 1 } else { GROUP };
        a[i][..len].copy_from_slice(&h[packed(row + i) + column..][..len]);
        if row == column {
            a[i][i] = a[i][i] + damping;
        }
    }
    let rows: [&[T]; GROUP] = std::array::from_fn(|i| &f[(row + i) * d..][..column]);
    for k in 0..column {
        let c = &f[k * d + column..][..GROUP];
        for i in 0..GROUP {
            let l = rows[i][k];
            for j in 0..GROUP {
                a[i][j] = a[i][j].minus(l, c[j]);
            }
        }
    }
    a
}

/// What the pivots said so far.
pub struct Pivots<T> {
    /// The lanes whose pivots were all sound.
    pub ok: u16,
    /// The first that was not, its sign turned.
    pub lack: T,
}

impl<T: Number> Pivots<T> {
    #[inline(always)]
    pub fn new() -> Self {
        Self { ok: u16::MAX, lack: T::splat(0.0) }
    }

    /// The pivot to divide by: one where there is no unknown or the matrix is refused, whose lane goes on with the others
    /// and is not used. A pivot is sound unless it is lost in the rounding of the diagonal entry that it comes from.
    #[inline(always)]
    fn check(&mut self, pivot: T, original: T, active: T::Mask) -> T {
        let sound = T::bits((T::epsilon() * original.abs()).less(pivot)) & T::bits(T::splat(0.0).less(original));
        let active = T::bits(active);
        let refused = active & !sound;
        self.lack = T::select(T::mask(self.ok & refused), T::splat(0.0) - pivot, self.lack);
        self.ok &= !refused;
        T::select(T::mask(sound & active), pivot, T::splat(1.0))
    }
}
