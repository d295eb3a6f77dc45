//! One matrix at a time in the registers of AVX2: four columns of a tile side by side, up to eight rows at once.
//!
//! Every entry takes the operations of [the loops over numbers](super::factor::factorise) in their order, so the bits are the same.

use std::arch::x86_64::*;

use super::layout::{GROUP, packed};
use super::tile::{Pivots, Tile, diagonal};
use crate::lanes::transpose;

/// Four numbers from `from[at]` on.
#[inline]
#[target_feature(enable = "avx2")]
fn load(from: &[f64], at: usize) -> __m256d {
    let from: &[f64; GROUP] = from[at..at + GROUP].try_into().unwrap_or_else(|_| unreachable!("four numbers"));
    // SAFETY: reads the four numbers of the array.
    unsafe { _mm256_loadu_pd(from.as_ptr()) }
}

/// Writes four numbers to `to[at]` and on.
#[inline]
#[target_feature(enable = "avx2")]
fn store(x: __m256d, to: &mut [f64], at: usize) {
    let to: &mut [f64; GROUP] = (&mut to[at..at + GROUP]).try_into().unwrap_or_else(|_| unreachable!("four numbers"));
    // SAFETY: writes the four numbers of the array.
    unsafe { _mm256_storeu_pd(to.as_mut_ptr(), x) }
}

/// Takes the products of the columns before off `R` rows of four entries: rows from `row` on, columns from `column` on.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn subtract<const R: usize>(mut a: [__m256d; R], row: usize, column: usize, f: &[f64], d: usize) -> [__m256d; R] {
    let mut rows: [&[f64]; R] = [&[]; R];
    for i in 0..R {
        rows[i] = &f[(row + i) * d..][..column];
    }
    for k in 0..column {
        let c = load(f, k * d + column);
        for i in 0..R {
            a[i] = _mm256_fnmadd_pd(_mm256_set1_pd(rows[i][k]), c, a[i]);
        }
    }
    a
}

/// See [`super::factor::factorise`].
#[target_feature(enable = "avx2,fma")]
pub(crate) fn factorise(h: &[f64], damping: f64, used: usize, d: usize, f: &mut [f64]) -> (bool, f64) {
    let mut pivots = Pivots::new();
    for first in (0..d).step_by(GROUP) {
        let (mut tile, mut rows): (Tile<f64>, _) = ([[0.0; GROUP]; GROUP], [_mm256_setzero_pd(); GROUP]);
        let own = _mm256_setr_epi64x(0, 1, 2, 3);
        for i in 0..GROUP {
            // What lies behind the diagonal is the next rows', and not used.
            let row = load(h, packed(first + i) + first);
            let on = _mm256_castsi256_pd(_mm256_cmpeq_epi64(own, _mm256_set1_epi64x(i as i64)));
            // Not even the sign of a zero beside the diagonal changes.
            rows[i] = _mm256_blendv_pd(row, _mm256_add_pd(row, _mm256_set1_pd(damping)), on);
        }
        rows = subtract(rows, first, first, f, d);
        for i in 0..GROUP {
            store(rows[i], &mut tile[i], 0);
        }
        let active = [first < used, first + 1 < used, first + 2 < used, first + 3 < used];
        let reciprocal = diagonal(&mut tile, first, h, damping, active, f, d, &mut pivots);
        if pivots.ok & 1 == 0 {
            break;
        }
        let mut row = first + GROUP;
        while row < d {
            if row + 2 * GROUP <= d {
                below::<8>(row, first, h, &tile, &reciprocal, f, d);
                row += 2 * GROUP;
            } else {
                below::<GROUP>(row, first, h, &tile, &reciprocal, f, d);
                row += GROUP;
            }
        }
    }
    (pivots.ok & 1 == 1, pivots.lack)
}

/// `R` rows of the columns from `first` on, below their tile on the diagonal.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn below<const R: usize>(
    row: usize,
    first: usize,
    h: &[f64],
    diagonal: &Tile<f64>,
    reciprocal: &[f64; GROUP],
    f: &mut [f64],
    d: usize,
) {
    let mut rows = [_mm256_setzero_pd(); R];
    for i in 0..R {
        rows[i] = load(h, packed(row + i) + first);
    }
    rows = subtract(rows, row, first, f, d);
    for part in (0..R).step_by(GROUP) {
        let mut c = transpose([rows[part], rows[part + 1], rows[part + 2], rows[part + 3]]);
        let mut l = c;
        for j in 0..GROUP {
            store(c[j], f, (first + j) * d + row + part);
            l[j] = _mm256_mul_pd(c[j], _mm256_set1_pd(reciprocal[j]));
            for k in j + 1..GROUP {
                c[k] = _mm256_fnmadd_pd(l[j], _mm256_set1_pd(diagonal[k][j]), c[k]);
            }
        }
        let l = transpose(l);
        for i in 0..GROUP {
            store(l[i], f, (row + part + i) * d + first);
        }
    }
}
