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

use super::aligned::Aligned;
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
    p: [Aligned; 3],
    m: Aligned,
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
            p: std::array::from_fn(|_| Aligned::zeros((stride + 1) * stride)),
            m: Aligned::zeros((n + 1) * stride),
            sizes: vec![0.0; stride],
        }
    }

    #[inline(always)]
    fn evaluate<V: Registers>(&mut self, y: &[f64], dy: &mut [f64]) {
        let (n, l, block) = (self.n, self.stride, triangle::len(self.tiles));
        for (p, y) in self.p.iter_mut().zip(y.chunks_exact(block)) {
            let (rows, spare) = p.split_at_mut(l * l);
            triangle::expand::<V>(self.tiles, y, rows);
            row_sums::<V>(rows, l, spare);
            // Row N, which may be one of padding, takes them once the matrix is read.
            p.copy_within(l * l.., n * l);
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

/// P 1, as the sum of the rows of a symmetric P, a multiple of four of them.
#[inline(always)]
fn row_sums<V: Registers>(rows: &[f64], l: usize, out: &mut [f64]) {
    let tiles = l / TILE;
    for (s, out) in out.as_chunks_mut::<TILE>().0.iter_mut().enumerate() {
        let mut sum = [V::Four::splat(0.0); TILE];
        for four in rows.as_chunks::<TILE>().0.chunks_exact(TILE * tiles) {
            for r in 0..TILE {
                sum[r] = sum[r].add(V::Four::load(&four[r * tiles + s]));
            }
        }
        sum[0].add(sum[1]).add(sum[2].add(sum[3])).store(out);
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
            while j + 8 <= if tall { i } else { end } {
                if tall {
                    self.tile::<V::Eight, 8, 8>(i, j, out);
                } else {
                    self.tile::<V::Eight, 4, 8>(i, j, out);
                }
                j += 8;
            }
            if tall {
                self.diagonal::<V>(i, out);
            } else if j < end {
                self.tile::<V::Four, 4, 4>(i, j, out);
            }
            i = end;
        }
    }

    /// The rows of p and μ of terms that count twice, and those that count once.
    #[inline(always)]
    fn rows(&self, r: Range<usize>) -> impl Iterator<Item = (&[f64], &[f64])> {
        let (start, end) = (r.start * self.l, r.end * self.l);
        self.p[start..end].chunks_exact(self.l).zip(self.m[start..end].chunks_exact(self.l))
    }

    /// R rows from row i, W columns from column j.
    #[inline(always)]
    fn tile<P: Pack<W>, const R: usize, const W: usize>(&self, i: usize, j: usize, out: &mut [f64]) {
        let mut sum = [P::splat(0.0); R];
        for twice in [0..self.own.start, self.own.end..self.p.len() / self.l] {
            for (p, m) in self.rows(twice) {
                sum = add::<P, R, W>(&p[i..], &m[j..], sum);
                sum = add::<P, R, W>(&m[i..], &p[j..], sum);
            }
        }
        for (p, m) in self.rows(self.own.clone()) {
            sum = add::<P, R, W>(&p[i..], &m[j..], sum);
        }
        store(sum, i, j, out);
    }

    /// Eight rows from row i, up to the diagonal: four of them have four columns, and the others eight.
    #[inline(always)]
    fn diagonal<V: Registers>(&self, i: usize, out: &mut [f64]) {
        let (mut top, mut low) = ([V::Four::splat(0.0); 4], [V::Eight::splat(0.0); 4]);
        for twice in [0..self.own.start, self.own.end..self.p.len() / self.l] {
            for (p, m) in self.rows(twice) {
                let (p, m) = (&p[i..i + 8], &m[i..i + 8]);
                (top, low) = (add(p, m, top), add(&p[4..], m, low));
                (top, low) = (add(m, p, top), add(&m[4..], p, low));
            }
        }
        for (p, m) in self.rows(self.own.clone()) {
            let (p, m) = (&p[i..i + 8], &m[i..i + 8]);
            (top, low) = (add(p, m, top), add(&p[4..], m, low));
        }
        store(top, i, i, out);
        store(low, i + 4, i, out);
    }
}

/// Writes R rows from row i, W columns from column j.
#[inline(always)]
fn store<P: Pack<W>, const R: usize, const W: usize>(sum: [P; R], i: usize, j: usize, out: &mut [f64]) {
    for r in 0..R {
        if let Some(out) = out[triangle::row(i + r) + j..].first_chunk_mut() {
            sum[r].store(out);
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
