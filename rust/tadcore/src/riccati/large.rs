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
//! | P_p[k], v_p | `p` | N rows and one more, in panels of `height` rows |
//! | μ_k | `m` | as many |
//! | Q_p | `q` | running weights, diagonal |
//!
//! Source: eq:Riccati of the paper as in [`super::coupled`]; the tiles are ours, by measurement.

use super::dop853::{self, Flow};
use super::triangle::{self, PANEL, TILE};
use super::weight;
use crate::cancel::{CancelToken, raised};
use crate::error::NoMemory;
use crate::game::Game;
use crate::simd::{Aligned, Number, Simd, Width, dispatch};

/// A row of a panel.
type Row = [f64; PANEL];

pub(super) struct Large {
    width: Width,
    n: usize,
    tiles: usize,
    height: usize,
    q: Vec<Vec<f64>>,
    scales: Vec<f64>,
    p: [Aligned; 3],
    m: Aligned,
    sizes: Vec<f64>,
    cancel: CancelToken,
}

impl Large {
    pub(super) fn new(game: &Game, width: Width, cancel: &CancelToken) -> Result<Self, NoMemory> {
        let (w, n) = (game.weights(), game.size());
        let tiles = triangle::tiles(n);
        // With room for row N.
        let height = TILE * (tiles + 1);
        let len = tiles.div_ceil(2) * height * PANEL;
        let zeros = || Aligned::zeros(dop853::WHAT, len);
        Ok(Self {
            width,
            n,
            tiles,
            height,
            q: game.state_weights(false),
            scales: w.r_d.iter().chain([&w.r_tau, &w.r_a]).map(|r| -1.0 / r).collect(),
            p: [zeros()?, zeros()?, zeros()?],
            m: zeros()?,
            sizes: vec![0.0; TILE * tiles],
            cancel: cancel.clone(),
        })
    }

    #[inline(always)]
    fn evaluate<V: Simd>(&mut self, y: &[f64], dy: &mut [f64]) {
        let (n, tiles, height, block) = (self.n, self.tiles, self.height, triangle::len(self.tiles));
        for (p, y) in self.p.iter_mut().zip(y.chunks_exact(block)) {
            triangle::expand::<V>(tiles, height, y, p);
            for panel in rows_mut(p).chunks_exact_mut(height) {
                // Row N, which may be one of padding, takes the sum once all are read.
                let sum = row_sum::<V>(&panel[..TILE * tiles]);
                sum.store(&mut panel[n]);
            }
        }
        let [d, target, attacker] = self.p.each_ref().map(|p| rows(p).chunks_exact(height));
        let panels = rows_mut(&mut self.m).chunks_exact_mut(height);
        for (((m, d), target), attacker) in panels.zip(d).zip(target).zip(attacker) {
            let rows = d[..n - 1].iter().chain([&target[n - 1], &attacker[n]]);
            for ((m, row), scale) in m.iter_mut().zip(rows).zip(&self.scales) {
                (V::Eight::splat(*scale) * V::Eight::load(row)).store(m);
            }
        }
        for p in 0..3 {
            // A term that counts once is half of one that counts twice; halves and doubles are exact.
            let own = [None, Some(n - 1), Some(n)][p];
            self.scale(own, 0.5);
            let out = &mut dy[p * block..(p + 1) * block];
            let once = if own.is_none() { n - 1 } else { 0 };
            let cancel = Some(&self.cancel);
            Update { p: rows(&self.p[p]), m: rows(&self.m), height, terms: n + 1, once, cancel }.lower::<V>(tiles, out);
            self.scale(own, 2.0);
            for (i, q) in self.q[p].iter().enumerate() {
                out[triangle::entry(i, i)] += q;
            }
        }
    }

    /// Multiplies a row of μ.
    #[inline(always)]
    fn scale(&mut self, row: Option<usize>, by: f64) {
        if let Some(row) = row {
            for panel in rows_mut(&mut self.m).chunks_exact_mut(self.height) {
                panel[row] = panel[row].map(|x| by * x);
            }
        }
    }
}

fn rows(panels: &[f64]) -> &[Row] {
    panels.as_chunks().0
}

fn rows_mut(panels: &mut [f64]) -> &mut [Row] {
    panels.as_chunks_mut().0
}

/// The sum of rows, a multiple of four of them.
#[inline(always)]
fn row_sum<V: Simd>(rows: &[Row]) -> V::Eight {
    let mut sum = [V::Eight::splat(0.0); TILE];
    for four in rows.as_chunks::<TILE>().0 {
        for r in 0..TILE {
            sum[r] = sum[r] + V::Eight::load(&four[r]);
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}

/// Σ_k (pᵀ μ + μᵀ p) over so many `terms`, the first of them, up to `once`, as pᵀ μ alone.
struct Update<'a> {
    p: &'a [Row],
    m: &'a [Row],
    height: usize,
    terms: usize,
    once: usize,
    cancel: Option<&'a CancelToken>,
}

impl<'a> Update<'a> {
    /// All tiles on and below the diagonal.
    #[inline(always)]
    fn lower<V: Simd>(&self, tiles: usize, out: &mut [f64]) {
        let out = &mut out.as_chunks_mut::<TILE>().0.as_chunks_mut::<TILE>().0[..triangle::len(tiles) / (TILE * TILE)];
        let mut i = 0;
        while i < tiles {
            if raised(self.cancel) {
                return;
            }
            let panel = i / 2;
            if V::ROWS == 8 && i + 2 <= tiles {
                for j in 0..panel {
                    let sum = self.product::<V::Eight, 8, 8>((panel, |x| x), (j, |x| x));
                    let [a, b, c, d, e, f, g, h] = sum;
                    put_wide::<V>([a, b, c, d], i, j, out);
                    put_wide::<V>([e, f, g, h], i + 1, j, out);
                }
                let (top, low) = self.diagonal::<V>(panel);
                put::<V>(top, i, i, out);
                put_wide::<V>(low, i + 1, panel, out);
                i += 2;
                continue;
            }
            for j in 0..panel {
                let sum = if i % 2 == 0 {
                    self.product::<V::Eight, 4, 8>((panel, low), (j, |x| x))
                } else {
                    self.product::<V::Eight, 4, 8>((panel, high), (j, |x| x))
                };
                put_wide::<V>(sum, i, j, out);
            }
            if i % 2 == 0 {
                put::<V>(self.product::<V::Four, 4, 4>((panel, low), (panel, low)), i, i, out);
            } else {
                put_wide::<V>(self.product::<V::Eight, 4, 8>((panel, high), (panel, |x| x)), i, panel, out);
            }
            i += 1;
        }
    }

    /// Rows of p and μ of one panel.
    #[inline(always)]
    fn panel(&self, panel: usize) -> (&'a [Row], &'a [Row]) {
        let start = panel * self.height;
        (&self.p[start..start + self.terms], &self.m[start..start + self.terms])
    }

    /// R rows that the first function picks of one panel by W columns that the other picks of another.
    #[inline(always)]
    fn product<P: Number<Scalar = f64>, const R: usize, const W: usize>(
        &self,
        (i, left): (usize, impl Fn(&Row) -> &[f64; R]),
        (j, right): (usize, impl Fn(&Row) -> &[f64; W]),
    ) -> [P; R] {
        let ((pi, mi), (pj, mj)) = (self.panel(i), self.panel(j));
        let mut sum = [P::splat(0.0); R];
        for (p, m) in pi.iter().zip(mj).take(self.once) {
            sum = add(left(p), right(m), sum);
        }
        for (((pi, mi), pj), mj) in pi.iter().zip(mi).zip(pj).zip(mj).skip(self.once) {
            sum = add(left(pi), right(mj), sum);
            sum = add(left(mi), right(pj), sum);
        }
        sum
    }

    /// Eight rows up to the diagonal: four of them have four columns, and the others eight.
    #[inline(always)]
    fn diagonal<V: Simd>(&self, panel: usize) -> ([V::Four; TILE], [V::Eight; TILE]) {
        let (p, m) = self.panel(panel);
        let (mut top, mut bottom) = ([V::Four::splat(0.0); TILE], [V::Eight::splat(0.0); TILE]);
        for (p, m) in p.iter().zip(m).take(self.once) {
            (top, bottom) = (add(low(p), low(m), top), add(high(p), m, bottom));
        }
        for (p, m) in p.iter().zip(m).skip(self.once) {
            (top, bottom) = (add(low(p), low(m), top), add(high(p), m, bottom));
            (top, bottom) = (add(low(m), low(p), top), add(high(m), p, bottom));
        }
        (top, bottom)
    }
}

fn low(row: &Row) -> &[f64; TILE] {
    &row.as_chunks().0[0]
}

fn high(row: &Row) -> &[f64; TILE] {
    &row.as_chunks().0[1]
}

/// sum + leftᵀ right.
#[inline(always)]
fn add<P: Number<Scalar = f64>, const R: usize>(left: &[f64; R], right: &[f64], mut sum: [P; R]) -> [P; R] {
    let right = P::load(right);
    for r in 0..R {
        sum[r] = sum[r].plus(P::splat(left[r]), right);
    }
    sum
}

type Tile = [[f64; TILE]; TILE];

// No closures below: they are functions of their own, and the compiler would not inline the wide instructions into them.

/// Writes tile (I, J); one on the diagonal as the mean of itself and its transpose, symmetric to the bit.
#[inline(always)]
fn put<V: Simd>(mut tile: [V::Four; TILE], i: usize, j: usize, out: &mut [Tile]) {
    if i == j {
        let transpose = V::transpose(tile);
        for r in 0..TILE {
            tile[r] = V::Four::splat(0.5) * (tile[r] + transpose[r]);
        }
    }
    let out = &mut out[triangle::number(i, j)];
    for r in 0..TILE {
        tile[r].store(&mut out[r]);
    }
}

/// Writes the two tiles of row I in panel `j`.
#[inline(always)]
fn put_wide<V: Simd>(rows: [V::Eight; TILE], i: usize, j: usize, out: &mut [Tile]) {
    let (mut left, mut right) = ([V::Four::splat(0.0); TILE], [V::Four::splat(0.0); TILE]);
    for r in 0..TILE {
        [left[r], right[r]] = V::halves(rows[r]);
    }
    put::<V>(left, i, 2 * j, out);
    put::<V>(right, i, 2 * j + 1, out);
}

dispatch! {
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
