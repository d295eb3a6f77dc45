//! The right-hand side of interaction I1 for large N: sums of rank-two updates of a lower triangle.
//!
//! With the rows P_p[k], then v_p = P_p 1, beside the rows μ_k = −P_d[k]/r_{d_k} for k < n, μ_n = −P_τ[n]/r_τ and
//! μ_N = −v_a/r_a,
//!
//! dP_p/ds = Q_p + Σ_k (P_p[k]ᵀ μ_k + μ_kᵀ P_p[k]),
//!
//! except that a player's own terms (k < n for d, k = n for τ, k = N for a), which are symmetric, count once:
//! P_p[k]ᵀ μ_k alone. Every sum runs over k in one order, entry by entry and fused, so neither the tiles nor the width of
//! the vectors show in the bits; only entries on and below the diagonal are computed, so P_p is symmetric to the bit.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | P_p[k], v_p | `p` | N rows and one more, of `stride` entries |
//! | μ_k | `m` | as many |
//! | Q_p | `q` | running weights, diagonal |
//!
//! Source: eq:Riccati of the paper as in [`super::coupled`]; the tiles are ours, by measurement.

use std::ops::Range;

use super::dop853::Flow;
use super::triangle::{self, TILE};
use super::weight;
use crate::game::Game;
use crate::width::{Width, fused};

pub(super) struct Large {
    width: Width,
    n: usize,
    tiles: usize,
    stride: usize,
    q: Vec<Vec<f64>>,
    minus_inv_rd: Vec<f64>,
    minus_inv_rtau: f64,
    minus_inv_ra: f64,
    p: [Vec<f64>; 3],
    m: Vec<f64>,
    sizes: Vec<f64>,
}

impl Large {
    pub(super) fn new(game: &Game, width: Width) -> Self {
        let (w, n) = (game.weights(), game.size());
        let (tiles, stride) = (triangle::tiles(n), n.next_multiple_of(TILE));
        Self {
            width,
            n,
            tiles,
            stride,
            q: game.state_weights(false),
            minus_inv_rd: w.r_d.iter().map(|r| -1.0 / r).collect(),
            minus_inv_rtau: -1.0 / w.r_tau,
            minus_inv_ra: -1.0 / w.r_a,
            // The rows past N are zeros, but for row N, which holds the sum of the others.
            p: std::array::from_fn(|_| vec![0.0; (stride + 1) * stride]),
            m: vec![0.0; (n + 1) * stride],
            sizes: vec![0.0; stride],
        }
    }

    #[inline(always)]
    fn evaluate<const R: usize>(&mut self, y: &[f64], dy: &mut [f64]) {
        let (n, l, block) = (self.n, self.stride, triangle::len(self.tiles));
        for (p, y) in self.p.iter_mut().zip(y.chunks_exact(block)) {
            // Row N may be a row of padding: it is written after the matrix.
            triangle::expand(self.tiles, y, p);
            let (rows, sums) = p.split_at_mut(n * l);
            row_sums(rows, l, &mut sums[..l]);
        }
        let m = self.m.chunks_exact_mut(l);
        let target = &self.p[1][(n - 1) * l..n * l];
        let attacker = &self.p[2][n * l..(n + 1) * l];
        let rows = self.p[0].chunks_exact(l).take(n - 1).chain([target, attacker]);
        let scales = self.minus_inv_rd.iter().chain([&self.minus_inv_rtau, &self.minus_inv_ra]);
        for ((m, row), scale) in m.zip(rows).zip(scales) {
            for (m, x) in m.iter_mut().zip(row) {
                *m = x * scale;
            }
        }
        let own = [0..n - 1, n - 1..n, n..n + 1];
        for (p, own) in own.into_iter().enumerate() {
            let update = Update { p: &self.p[p][..(n + 1) * l], m: &self.m, l, own };
            let out = &mut dy[p * block..(p + 1) * block];
            update.lower::<R>(self.tiles, out);
            for (i, q) in self.q[p].iter().enumerate() {
                out[triangle::row(i) + i] += q;
            }
            triangle::mirror_diagonal(self.tiles, out);
        }
    }
}

/// P 1, as the sum of the rows of a symmetric P.
#[inline(always)]
fn row_sums(rows: &[f64], l: usize, out: &mut [f64]) {
    for (s, out) in out.as_chunks_mut::<TILE>().0.iter_mut().enumerate() {
        let mut sum = [[0.0; TILE]; 2];
        for (k, row) in rows.chunks_exact(l).enumerate() {
            let row = row.as_chunks::<TILE>().0[s];
            for c in 0..TILE {
                sum[k % 2][c] += row[c];
            }
        }
        *out = std::array::from_fn(|c| sum[0][c] + sum[1][c]);
    }
}

/// Σ_k (pᵀ μ + μᵀ p), the rows of `own` once.
struct Update<'a> {
    p: &'a [f64],
    m: &'a [f64],
    l: usize,
    own: Range<usize>,
}

impl Update<'_> {
    /// All entries on and below the diagonal, eight columns by R rows where there are as many.
    #[inline(always)]
    fn lower<const R: usize>(&self, tiles: usize, out: &mut [f64]) {
        let mut i = 0;
        while i < tiles * TILE {
            let height = R.min(tiles * TILE - i);
            let mut j = 0;
            while j + 8 <= i + height {
                if height == R {
                    self.tile::<R, 8>(i, j, out);
                } else {
                    self.tile::<TILE, 8>(i, j, out);
                }
                j += 8;
            }
            if j < i + height {
                self.tile::<TILE, TILE>(i, j, out);
            }
            i += height;
        }
    }

    /// R rows from row i, W columns from column j.
    #[inline(always)]
    fn tile<const R: usize, const W: usize>(&self, i: usize, j: usize, out: &mut [f64]) {
        let l = self.l;
        let rows = |r: Range<usize>| {
            self.p[r.start * l..r.end * l].chunks_exact(l).zip(self.m[r.start * l..r.end * l].chunks_exact(l))
        };
        let mut sum = [[0.0; W]; R];
        for half in [0..self.own.start, self.own.end..self.p.len() / l] {
            for (p, m) in rows(half) {
                add::<R, W>(&p[i..], &m[j..], &mut sum);
                add::<R, W>(&m[i..], &p[j..], &mut sum);
            }
        }
        for (p, m) in rows(self.own.clone()) {
            add::<R, W>(&p[i..], &m[j..], &mut sum);
        }
        for r in 0..R {
            // The first four rows of a tile on the diagonal end with the diagonal's own tile of 4 × 4.
            let width = W.min(TILE * ((i + r) / TILE + 1) - j);
            let out = &mut out[triangle::row(i + r) + j..];
            if width == W {
                out[..W].copy_from_slice(&sum[r]);
            } else {
                out[..TILE].copy_from_slice(&sum[r][..TILE]);
            }
        }
    }
}

/// sum += leftᵀ right.
#[inline(always)]
fn add<const R: usize, const W: usize>(left: &[f64], right: &[f64], sum: &mut [[f64; W]; R]) {
    let (left, right) = (&left[..R], &right[..W]);
    for r in 0..R {
        for c in 0..W {
            sum[r][c] = left[r].mul_add(right[c], sum[r][c]);
        }
    }
}

fused! {
    #[inline(never)]
    fn evaluate<const R: usize>(flow: &mut Large, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<R>(y, dy);
    }
}

impl Flow for Large {
    fn block_len(&self) -> usize {
        triangle::len(self.tiles)
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        // Sixteen registers hold 4 × 8 sums of four numbers each and what goes into them; thirty-two hold 8 × 8 of eight.
        if self.width.holds_eight() {
            evaluate::<8>(self.width, self, y, dy);
        } else {
            evaluate::<4>(self.width, self, y, dy);
        }
    }
    fn weigh(&mut self, y: &[f64], out: &mut [f64]) {
        weight::triangle(y, self.tiles, &mut self.sizes, out);
    }
}
