//! The lower triangle of a symmetric matrix by tiles of 4 × 4: what the integrator carries for a large game.
//!
//! Row i holds its first 4 (⌊i/4⌋ + 1) entries and the rows lie one after the other, so a tile on the diagonal is stored
//! whole and one below it once. All that is done entry by entry then costs half; only products want the whole matrix.
//! Rows and columns past N are zeros.
//!
//! Source: ours, by measurement.

use super::register::{Pack, Registers, fused};

/// Rows and columns of a tile.
pub(super) const TILE: usize = 4;

/// Tiles along a side of an N × N matrix.
pub(super) fn tiles(n: usize) -> usize {
    n.div_ceil(TILE)
}

/// Entries of the triangle of a matrix with so many tiles along a side: a multiple of 16.
pub(super) fn len(tiles: usize) -> usize {
    TILE * TILE * tiles * (tiles + 1) / 2
}

/// Where row i begins.
#[inline(always)]
pub(super) fn row(i: usize) -> usize {
    let above = i / TILE;
    len(above) + (i % TILE) * TILE * (above + 1)
}

/// Writes the whole matrix in rows of 4 · `tiles` entries.
#[inline(always)]
pub(super) fn expand<V: Registers>(tiles: usize, triangle: &[f64], whole: &mut [f64]) {
    let triangle = triangle.as_chunks::<TILE>().0;
    let whole = whole.as_chunks_mut::<TILE>().0;
    let mut at = 0;
    for i in 0..tiles {
        let stride = i + 1;
        let rows = &triangle[at..at + TILE * stride];
        for j in 0..stride {
            let tile: [V::Four; TILE] = std::array::from_fn(|r| V::Four::load(&rows[r * stride + j]));
            for r in 0..TILE {
                tile[r].store(&mut whole[(TILE * i + r) * tiles + j]);
            }
            if j < i {
                let columns = V::transpose(tile);
                for c in 0..TILE {
                    columns[c].store(&mut whole[(TILE * j + c) * tiles + i]);
                }
            }
        }
        at += TILE * stride;
    }
}

/// Makes the tiles on the diagonal symmetric to the bit, by what lies below it.
#[inline(always)]
pub(super) fn mirror_diagonal(tiles: usize, triangle: &mut [f64]) {
    for i in 0..tiles {
        let (at, stride) = (len(i) + TILE * i, TILE * (i + 1));
        for r in 0..TILE {
            for c in 0..r {
                triangle[at + c * stride + r] = triangle[at + r * stride + c];
            }
        }
    }
}

fused! {
    /// Writes the N × N matrix. `whole` is work space.
    pub(super) fn unpack<V>(n: usize, triangle: &[f64], whole: &mut Vec<f64>, out: &mut [f64]) {
        let (tiles, stride) = (tiles(n), n.next_multiple_of(TILE));
        whole.resize(stride * stride, 0.0);
        expand::<V>(tiles, triangle, whole);
        for (i, row) in out.chunks_exact_mut(n).enumerate() {
            row.copy_from_slice(&whole[i * stride..][..n]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::register::Plain;
    use super::*;
    use crate::width::Width;

    /// There and back: entry (i, j) of the whole is entry (max, min) of the triangle.
    #[test]
    fn the_whole_is_symmetric() {
        for n in 1..=13 {
            let (tiles, stride) = (tiles(n), n.next_multiple_of(TILE));
            let mut triangle: Vec<f64> = (0..len(tiles)).map(|i| i as f64).collect();
            mirror_diagonal(tiles, &mut triangle);
            let mut whole = vec![f64::NAN; stride * stride];
            expand::<Plain>(tiles, &triangle, &mut whole);
            for i in 0..stride {
                for j in 0..stride {
                    assert_eq!(whole[i * stride + j], triangle[row(i.max(j)) + i.min(j)], "{n}: {i}, {j}");
                }
            }
            let mut out = vec![0.0; n * n];
            unpack(Width::detect(), n, &triangle, &mut Vec::new(), &mut out);
            for (ij, x) in out.into_iter().enumerate() {
                assert_eq!(x, whole[ij / n * stride + ij % n]);
            }
        }
    }
}
