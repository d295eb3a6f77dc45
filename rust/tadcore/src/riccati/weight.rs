//! The weights of the error norm: entry (i, j) of a symmetric matrix is divided by m_i m_j, m_i² its row's largest entry.
//!
//! A small matrix beside a large one keeps its digits, and so do small rows beside large ones. (On games whose weights
//! span four orders of magnitude this gives errors up to ten times smaller than one scale per matrix, for 5 % more
//! steps.)
//!
//! Source: ours, by measurement.

use super::triangle::TILE;

/// Rows smaller than this part of the largest row are weighed as if they were not.
const FLOOR: f64 = 1e-3;

fn larger(m: f64, x: f64) -> f64 {
    if x.abs() > m { x.abs() } else { m }
}

/// From the largest entry of every row to 1/m_i.
fn invert(sizes: &mut [f64]) {
    let floor = FLOOR * sizes.iter().copied().fold(f64::MIN_POSITIVE, larger);
    for m in sizes {
        *m = 1.0 / (*m).max(floor).sqrt();
    }
}

/// Weights of a whole matrix in rows of `stride` entries. `sizes` is work space of one entry for every row and column.
pub(super) fn whole(y: &[f64], stride: usize, sizes: &mut [f64], out: &mut [f64]) {
    sizes.fill(0.0);
    let rows = y.len() / stride;
    for (m, row) in sizes.iter_mut().zip(y.chunks_exact(stride)) {
        *m = row.iter().copied().fold(0.0, larger);
    }
    invert(&mut sizes[..rows]);
    for (row, m) in out.chunks_exact_mut(stride).zip(&*sizes) {
        for (w, other) in row.iter_mut().zip(sizes.iter()) {
            *w = m * other;
        }
    }
}

/// Weights of a [triangle](super::triangle): an entry that stands for two counts twice.
pub(super) fn triangle(y: &[f64], tiles: usize, sizes: &mut [f64], out: &mut [f64]) {
    let sizes = &mut sizes[..TILE * tiles];
    sizes.fill(0.0);
    let mut rest = y.as_chunks::<TILE>().0.as_chunks::<TILE>().0.iter();
    for i in 0..tiles {
        let mut largest = [[0.0_f64; TILE]; TILE];
        for (tile, sizes) in rest.by_ref().take(i + 1).zip(sizes.as_chunks_mut::<TILE>().0) {
            for r in 0..TILE {
                for c in 0..TILE {
                    sizes[c] = larger(sizes[c], tile[r][c]);
                    largest[r][c] = larger(largest[r][c], tile[r][c]);
                }
            }
        }
        for r in 0..TILE {
            sizes[TILE * i + r] = largest[r].into_iter().fold(sizes[TILE * i + r], larger);
        }
    }
    invert(sizes);
    let mut rest = out.as_chunks_mut::<TILE>().0.as_chunks_mut::<TILE>().0.iter_mut();
    let sizes = sizes.as_chunks::<TILE>().0;
    for i in 0..tiles {
        for (j, tile) in rest.by_ref().take(i + 1).enumerate() {
            let twice = if j < i { std::f64::consts::SQRT_2 } else { 1.0 };
            for r in 0..TILE {
                let row = twice * sizes[i][r];
                tile[r] = sizes[j].map(|column| row * column);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::triangle;
    use super::*;

    /// Entry (i, j) is divided by m_i m_j, m_i² being the largest entry of row i, but at least a thousandth of all.
    #[test]
    fn every_row_is_weighed_by_its_own_size() {
        let (mut sizes, mut w) = ([0.0; 2], [0.0; 4]);
        whole(&[16.0, -2.0, -2.0, 4.0], 2, &mut sizes, &mut w);
        assert_eq!(w, [1.0 / 16.0, 1.0 / 8.0, 1.0 / 8.0, 1.0 / 4.0]);
        // The largest entry may be a negative one.
        whole(&[1.0, -16.0, -16.0, 4.0], 2, &mut sizes, &mut w);
        assert_eq!(w, [1.0 / 16.0; 4]);
        whole(&[4000.0, 0.0, 0.0, 1e-9], 2, &mut sizes, &mut w);
        assert!((w[3] - 0.25).abs() < 1e-15 && (w[0] * 4000.0 - 1.0).abs() < 1e-15);
    }

    /// The norm over a triangle is the norm over the whole matrix.
    #[test]
    fn a_triangle_weighs_as_much_as_the_whole() {
        for tiles in 1..=3 {
            let stride = TILE * tiles;
            let mut y = vec![0.0; triangle::len(tiles)];
            let mut full = vec![0.0; stride * stride];
            for i in 0..stride {
                for j in 0..=i {
                    let x = 40.0 * (0.7 + (i * i + j) as f64).sin();
                    (full[i * stride + j], full[j * stride + i], y[triangle::entry(i, j)]) = (x, x, x);
                    if i / TILE == j / TILE {
                        y[triangle::entry(j, i)] = x;
                    }
                }
            }
            let (mut sizes, mut w, mut w_full) = (vec![0.0; stride], vec![0.0; y.len()], vec![0.0; full.len()]);
            triangle(&y, tiles, &mut sizes, &mut w);
            whole(&full, stride, &mut sizes, &mut w_full);
            let norm = |w: &[f64], y: &[f64]| w.iter().zip(y).map(|(w, y)| (w * y).powi(2)).sum::<f64>();
            assert!((norm(&w, &y) / norm(&w_full, &full) - 1.0).abs() < 1e-13);
        }
    }
}
