//! One matrix at a time in registers: four columns of a tile side by side, up to eight rows at once.
//!
//! Every entry takes the operations of [the loops over numbers](super::factorise) in their order, so the bits are the same.

use super::layout::{GROUP, packed};
use super::tile::{Pivots, Tile, diagonal};
use crate::simd::{Number, Simd, widened};

/// Takes the products of the columns before off `R` rows of four entries: rows from `row` on, columns from `column` on.
#[inline(always)]
fn subtract<T: Number<Scalar = f64>, const R: usize>(
    mut a: [T; R],
    row: usize,
    column: usize,
    f: &[f64],
    d: usize,
) -> [T; R] {
    let mut rows: [&[f64]; R] = [&[]; R];
    for i in 0..R {
        rows[i] = &f[(row + i) * d..][..column];
    }
    for k in 0..column {
        let c = T::load(&f[k * d + column..][..GROUP]);
        for i in 0..R {
            a[i] = a[i].minus(T::splat(rows[i][k]), c);
        }
    }
    a
}

widened! {
    /// See [`super::factorise`]; the unknowns from `used` on are empty.
    pub fn factorise_one<V>(h: &[f64], damping: f64, used: usize, d: usize, f: &mut [f64]) -> (bool, f64) {
        factorise::<V>(h, damping, used, d, f)
    }
}

#[inline(always)]
fn factorise<V: Simd>(h: &[f64], damping: f64, used: usize, d: usize, f: &mut [f64]) -> (bool, f64) {
    let mut pivots = Pivots::new();
    for first in (0..d).step_by(GROUP) {
        let (mut tile, mut rows): (Tile<f64>, _) = ([[0.0; GROUP]; GROUP], [V::Four::splat(0.0); GROUP]);
        for i in 0..GROUP {
            // What lies behind the diagonal is the next rows', and not used.
            let row = V::Four::load(&h[packed(first + i) + first..][..GROUP]);
            // Not even the sign of a zero beside the diagonal changes.
            rows[i] = V::Four::select(V::Four::mask(1 << i), row + V::Four::splat(damping), row);
        }
        rows = subtract(rows, first, first, f, d);
        for i in 0..GROUP {
            rows[i].store(&mut tile[i]);
        }
        let active = [first < used, first + 1 < used, first + 2 < used, first + 3 < used];
        let reciprocal = diagonal(&mut tile, first, h, damping, active, f, d, &mut pivots);
        if pivots.ok & 1 == 0 {
            break;
        }
        let mut row = first + GROUP;
        while row < d {
            if row + 2 * GROUP <= d {
                below::<V, 8>(row, first, h, &tile, &reciprocal, f, d);
                row += 2 * GROUP;
            } else {
                below::<V, GROUP>(row, first, h, &tile, &reciprocal, f, d);
                row += GROUP;
            }
        }
    }
    (pivots.ok & 1 == 1, pivots.lack)
}

/// `R` rows of the columns from `first` on, below their tile on the diagonal.
#[inline(always)]
fn below<V: Simd, const R: usize>(
    row: usize,
    first: usize,
    h: &[f64],
    diagonal: &Tile<f64>,
    reciprocal: &[f64; GROUP],
    f: &mut [f64],
    d: usize,
) {
    let mut rows = [V::Four::splat(0.0); R];
    for i in 0..R {
        rows[i] = V::Four::load(&h[packed(row + i) + first..][..GROUP]);
    }
    rows = subtract(rows, row, first, f, d);
    for part in (0..R).step_by(GROUP) {
        let mut c = V::transpose([rows[part], rows[part + 1], rows[part + 2], rows[part + 3]]);
        let mut l = c;
        for j in 0..GROUP {
            c[j].store(&mut f[(first + j) * d + row + part..][..GROUP]);
            l[j] = c[j] * V::Four::splat(reciprocal[j]);
            for k in j + 1..GROUP {
                c[k] = c[k].minus(l[j], V::Four::splat(diagonal[k][j]));
            }
        }
        let l = V::transpose(l);
        for i in 0..GROUP {
            l[i].store(&mut f[(row + part + i) * d + first..][..GROUP]);
        }
    }
}
