//! The lower triangle of a symmetric matrix by tiles of 4 × 4: what the integrator carries for a large game.
//!
//! Tile (I, J), J ≤ I, holds the entries (4I…4I+3, 4J…4J+3), row by row, and the tiles of a row of tiles lie one after the
//! other: a tile on the diagonal is stored whole and one below it once. All that is done entry by entry then costs half;
//! only products want the whole matrix, and want it in *panels* of eight columns, row after row. Rows and columns past
//! N are zeros.
//!
//! Source: ours, by measurement.

use crate::simd::{Number, Simd, dispatch};

/// Rows and columns of a tile.
pub(super) const TILE: usize = 4;
/// Columns of a panel.
pub(super) const PANEL: usize = 8;

/// Tiles along a side of an N × N matrix.
pub(super) fn tiles(n: usize) -> usize {
    n.div_ceil(TILE)
}

/// Entries of the triangle of a matrix with so many tiles along a side: a multiple of 16.
pub(super) fn len(tiles: usize) -> usize {
    TILE * TILE * number(tiles, 0)
}

/// The number of tile (I, J) in the triangle.
#[inline(always)]
pub(super) fn number(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// Where entry (i, j) lies, for i ≥ j or both in one tile.
pub(super) fn entry(i: usize, j: usize) -> usize {
    TILE * TILE * number(i / TILE, j / TILE) + i % TILE * TILE + j % TILE
}

/// Writes the whole matrix in panels of `height` rows, a multiple of four.
#[inline(always)]
pub(super) fn expand<V: Simd>(tiles: usize, height: usize, triangle: &[f64], panels: &mut [f64]) {
    let panels = panels.as_chunks_mut::<TILE>().0.as_chunks_mut::<PANEL>().0;
    let mut rest = triangle.as_chunks::<TILE>().0.as_chunks::<TILE>().0.iter();
    let height = height / TILE;
    for i in 0..tiles {
        for (j, tile) in rest.by_ref().take(i + 1).enumerate() {
            let mut rows = [V::Four::splat(0.0); TILE];
            for r in 0..TILE {
                rows[r] = V::Four::load(&tile[r]);
            }
            put::<V>(rows, &mut panels[j / 2 * height + i], j % 2);
            if j < i {
                put::<V>(V::transpose(rows), &mut panels[i / 2 * height + j], i % 2);
            }
        }
    }
}

/// Writes a tile into the left or the right half of four rows of a panel.
#[inline(always)]
fn put<V: Simd>(tile: [V::Four; TILE], rows: &mut [[f64; TILE]; PANEL], half: usize) {
    for r in 0..TILE {
        tile[r].store(&mut rows[2 * r + half]);
    }
}

/// The work space that [`unpack`] needs for N × N matrices.
pub(super) fn panels_len(n: usize) -> usize {
    tiles(n).div_ceil(2) * n.next_multiple_of(TILE) * PANEL
}

dispatch! {
    /// Writes the N × N matrix. `panels` is work space of [`panels_len`].
    pub(super) fn unpack<V>(n: usize, triangle: &[f64], panels: &mut [f64], out: &mut [f64]) {
        let (tiles, height) = (tiles(n), n.next_multiple_of(TILE));
        expand::<V>(tiles, height, triangle, panels);
        for (s, panel) in panels.as_chunks::<PANEL>().0.chunks_exact(height).enumerate() {
            for (row, out) in panel.iter().zip(out.chunks_exact_mut(n)) {
                let out = &mut out[s * PANEL..];
                if let Some(out) = out.first_chunk_mut::<PANEL>() {
                    V::Eight::load(row).store(out);
                } else {
                    for (out, x) in out.iter_mut().zip(row) {
                        *out = *x;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Width;

    /// Entry (i, j) of the matrix is entry (max, min) of the triangle, for every width.
    #[test]
    fn the_whole_is_symmetric() {
        for n in 1..=19 {
            let mut triangle: Vec<f64> = (0..len(tiles(n))).map(|i| i as f64).collect();
            for i in 0..n {
                for j in 0..i {
                    if j / TILE == i / TILE {
                        triangle[entry(j, i)] = triangle[entry(i, j)];
                    }
                }
            }
            for width in Width::all() {
                let mut out = vec![f64::NAN; n * n];
                unpack(width, n, &triangle, &mut vec![0.0; panels_len(n)], &mut out);
                for (ij, x) in out.into_iter().enumerate() {
                    let (i, j) = (ij / n, ij % n);
                    assert_eq!(x, triangle[entry(i.max(j), i.min(j))], "{n}: {i}, {j}");
                }
            }
        }
    }
}
