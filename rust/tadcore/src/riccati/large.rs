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
use super::register::{Pack, Registers, fused};
use super::triangle::{self, TILE};
use super::weight;
use crate::game::Game;
use crate::width::Width;

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
    fn evaluate<V: Registers>(&mut self, y: &[f64], dy: &mut [f64]) {
        let (n, l, block) = (self.n, self.stride, triangle::len(self.tiles));
        for (p, y) in self.p.iter_mut().zip(y.chunks_exact(block)) {
            // Row N may be a row of padding: it is written after the matrix.
            triangle::expand::<V>(self.tiles, y, p);
            let (rows, sums) = p.split_at_mut(n * l);
            row_sums::<V>(rows, l, &mut sums[..l]);
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
            update.lower::<V>(self.tiles, out);
            for (i, q) in self.q[p].iter().enumerate() {
                out[triangle::row(i) + i] += q;
            }
            triangle::mirror_diagonal(self.tiles, out);
        }
    }
}

/// P 1, as the sum of the rows of a symmetric P.
#[inline(always)]
fn row_sums<V: Registers>(rows: &[f64], l: usize, out: &mut [f64]) {
    let rows = rows.as_chunks::<TILE>().0;
    for (s, out) in out.as_chunks_mut::<TILE>().0.iter_mut().enumerate() {
        let mut sum = [V::Four::splat(0.0); 2];
        for (k, row) in rows[s..].iter().step_by(l / TILE).enumerate() {
            sum[k % 2] = sum[k % 2].add(V::Four::load(row));
        }
        sum[0].add(sum[1]).store(out);
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
    /// All entries on and below the diagonal.
    #[inline(always)]
    fn lower<V: Registers>(&self, tiles: usize, out: &mut [f64]) {
        let rows = tiles * TILE;
        let mut i = 0;
        while i < rows {
            let tall = V::ROWS == 8 && i + 8 <= rows;
            let end = if tall { i + 8 } else { i + 4 };
            let mut j = 0;
            while j + 8 <= end {
                if tall {
                    self.tile::<V::Eight, 8, 8>(i, j, out);
                } else {
                    self.tile::<V::Eight, 4, 8>(i, j, out);
                }
                j += 8;
            }
            if j < end {
                self.tile::<V::Four, 4, 4>(i, j, out);
            }
            i = end;
        }
    }

    /// R rows from row i, W columns from column j.
    #[inline(always)]
    fn tile<P: Pack<W>, const R: usize, const W: usize>(&self, i: usize, j: usize, out: &mut [f64]) {
        let rows = |r: Range<usize>| {
            let (start, end) = (r.start * self.l, r.end * self.l);
            self.p[start..end].chunks_exact(self.l).zip(self.m[start..end].chunks_exact(self.l))
        };
        let mut sum = [[0.0; W]; R].map(|x| P::load(&x));
        for (p, m) in rows(0..self.own.start).chain(rows(self.own.end..self.p.len() / self.l)) {
            sum = add::<P, R, W>(&p[i..], &m[j..], sum);
            sum = add::<P, R, W>(&m[i..], &p[j..], sum);
        }
        for (p, m) in rows(self.own.clone()) {
            sum = add::<P, R, W>(&p[i..], &m[j..], sum);
        }
        for r in 0..R {
            let out = &mut out[triangle::row(i + r) + j..];
            if j + W <= TILE * ((i + r) / TILE + 1) {
                if let Some(out) = out.first_chunk_mut() {
                    sum[r].store(out);
                }
            } else {
                // The first four rows of a tile on the diagonal end with the diagonal's own tile of 4 × 4.
                let mut row = [0.0; W];
                sum[r].store(&mut row);
                out[..TILE].copy_from_slice(&row[..TILE]);
            }
        }
    }
}

/// sum + leftᵀ right.
#[inline(always)]
fn add<P: Pack<W>, const R: usize, const W: usize>(left: &[f64], right: &[f64], mut sum: [P; R]) -> [P; R] {
    if let (Some(left), Some(right)) = (left.first_chunk::<R>(), right.first_chunk::<W>()) {
        let right = P::load(right);
        for r in 0..R {
            sum[r] = P::splat(left[r]).mul_add(right, sum[r]);
        }
    }
    sum
}

fused! {
    #[inline(never)]
    fn evaluate<V>(flow: &mut Large, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<V>(y, dy);
    }
}

impl Flow for Large {
    fn block_len(&self) -> usize {
        triangle::len(self.tiles)
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        evaluate(self.width, self, y, dy);
    }
    fn weigh(&mut self, y: &[f64], out: &mut [f64]) {
        weight::triangle(y, self.tiles, &mut self.sizes, out);
    }
}
