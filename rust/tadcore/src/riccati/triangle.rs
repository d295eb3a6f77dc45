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
    let mut triangle = triangle.as_chunks::<TILE>().0;
    let whole = whole.as_chunks_mut::<TILE>().0;
    for i in 0..tiles {
        let (rows, rest) = triangle.split_at(TILE * (i + 1));
        triangle = rest;
        let (above, own) = whole.split_at_mut(TILE * i * tiles);
        let own = &mut own[..TILE * tiles];
        let tile = |j: usize| -> [V::Four; TILE] { std::array::from_fn(|r| V::Four::load(&rows[r * (i + 1) + j])) };
        for (j, above) in above.chunks_exact_mut(TILE * tiles).enumerate() {
            let tile = tile(j);
            for r in 0..TILE {
                tile[r].store(&mut own[r * tiles + j]);
            }
            let columns = V::transpose(tile);
            for c in 0..TILE {
                columns[c].store(&mut above[c * tiles + i]);
            }
        }
        let tile = tile(i);
        for r in 0..TILE {
            tile[r].store(&mut own[r * tiles + i]);
        }
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
    /// Writes the N × N matrix, N ≥ 3. `whole` is work space.
    pub(super) fn unpack<V>(n: usize, triangle: &[f64], whole: &mut Vec<f64>, out: &mut [f64]) {
        let (tiles, stride) = (tiles(n), n.next_multiple_of(TILE));
        whole.resize(stride * stride, 0.0);
        expand::<V>(tiles, triangle, whole);
        let (rows, last) = whole.split_at((n - 1) * stride);
        for (i, row) in rows.chunks_exact(stride).enumerate() {
            // In whole registers: what goes over the end of the row is overwritten by the next.
            let out = out[i * n..][..stride].as_chunks_mut::<TILE>().0;
            for (to, from) in out.iter_mut().zip(row.as_chunks::<TILE>().0) {
                V::Four::load(from).store(to);
            }
        }
        out[(n - 1) * n..].copy_from_slice(&last[..n]);
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
        for n in 3..=13 {
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
