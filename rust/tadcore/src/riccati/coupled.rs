//! Interaction I1: dP_p/ds = Q_p − P_p A − Aᵀ P_p + P_p S_p P_p for p = d, τ, a, from P_p = F_p at s = T − t = 0.
//!
//! With S_d = diag(1/r_d, 0), S_τ = e_N e_Nᵀ / r_τ and S_a = 1 1ᵀ / r_a, the matrix A = S_d P_d + S_τ P_τ + S_a P_a is a
//! row scaling plus two rank-one terms, and the equation is dP_p/ds = Q_p − G_p − G_pᵀ with
//!
//! G_p = P_p A − ½ P_p S_p P_p = c_p P_p (S_d P_d) + u_p tᵀ / r_τ + v_p aᵀ / r_a,   t = P_τ e_N,   a = P_a 1,
//!
//! u_p = P_p e_N and v_p = P_p 1, but u_τ = t/2, v_a = a/2 and c_d = ½ instead of 1. This costs three products with n
//! inner terms, and as every operation is the same for the entries (i, j) and (j, i), P_p stays symmetric to the bit:
//! the rounding asymmetry that the unsymmetrised form lets grow over the horizon cannot arise.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | P_d, P_τ, P_a | blocks 0, 1, 2 of `y` | reduced factors, N × N in rows of `l` entries |
//! | Q_p | `q` | running weights, diagonal |
//! | S_d P_d | `m` | its n nonzero rows, in strips of W columns |
//! | G_p | `g` | see above |
//!
//! Up to N = 8 the size is a constant of the compiler, and the product of one row is held in registers; above, rows
//! are padded to whole strips and the same code runs with the size as a variable.
//!
//! Source: eq:Riccati of the paper, with the sign of time reversed.

use super::dop853::{self, Flow};
use super::lanes::LANES;
use crate::cancel::CancelToken;
use crate::error::EquilibriumError;
use crate::game::Game;
use crate::width::{Width, widened};

/// Local error per step, in the weighted norm of [`dop853`]. Over 196 random games (n = 1…12, weights within two orders of
/// magnitude) this keeps every node to 4e-12, in the median to 4e-13; else to what the conditioning of the game allows.
const TOLERANCE: f64 = 3e-13;

struct Coupled {
    width: Width,
    n: usize,
    l: usize,
    block: usize,
    q: Vec<Vec<f64>>,
    minus_inv_rd: Vec<f64>,
    minus_inv_rtau: f64,
    minus_inv_ra: f64,
    m: Vec<f64>,
    g: Vec<f64>,
    t: Vec<f64>,
    a: Vec<f64>,
    v: Vec<f64>,
}

impl Coupled {
    /// Rows of `l` entries, padded to `rows` of them.
    fn new(game: &Game, l: usize, rows: usize) -> Self {
        let w = game.weights();
        let n = game.size();
        Self {
            width: Width::detect(),
            n,
            l,
            block: (rows * l).next_multiple_of(LANES),
            q: game.state_weights(false),
            minus_inv_rd: w.r_d.iter().map(|r| -1.0 / r).collect(),
            minus_inv_rtau: -1.0 / w.r_tau,
            minus_inv_ra: -1.0 / w.r_a,
            m: vec![0.0; n * l],
            g: vec![0.0; rows * l],
            t: vec![0.0; l],
            a: vec![0.0; l],
            v: vec![0.0; l],
        }
    }

    /// The terminal weights as a padded stack.
    fn terminal(&self, game: &Game) -> Vec<f64> {
        let mut y = vec![0.0; 3 * self.block];
        for (p, f) in game.state_weights(true).iter().enumerate() {
            for (i, &v) in f.iter().enumerate() {
                y[p * self.block + i * self.l + i] = v;
            }
        }
        y
    }

    /// The right-hand side for N = `n` in rows of `l` entries, a multiple of W and of B; the rows are padded to a
    /// multiple of R and of B. Products in tiles of R × W, the addition of the transpose in tiles of B × B.
    #[inline(always)]
    fn evaluate<const W: usize, const R: usize, const B: usize>(
        &mut self,
        n: usize,
        l: usize,
        y: &[f64],
        dy: &mut [f64],
    ) {
        let rows = n.next_multiple_of(R).next_multiple_of(B);
        let (block, defenders, strips) = (self.block, n - 1, l / W);
        let m = self.m[..defenders * l].as_chunks_mut::<W>().0;
        let g = self.g[..rows * l].as_chunks_mut::<W>().0;
        let t = self.t[..l].as_chunks_mut::<W>().0;
        let a = self.a[..l].as_chunks_mut::<W>().0;
        let v = &mut self.v[..l];
        let p: [&[f64]; 3] = std::array::from_fn(|p| &y[p * block..p * block + rows * l]);
        // −tᵀ / r_τ and −aᵀ / r_a
        for (t, p) in t.iter_mut().zip(p[1][defenders * l..n * l].as_chunks::<W>().0) {
            *t = p.map(|x| x * self.minus_inv_rtau);
        }
        row_sums::<W>(&p[2][..n * l], a);
        for a in a.iter_mut() {
            *a = a.map(|x| x * self.minus_inv_ra);
        }
        // −S_d P_d, strip by strip
        for k in 0..defenders {
            for s in 0..strips {
                m[s * defenders + k] = p[0].as_chunks::<W>().0[k * strips + s].map(|x| x * self.minus_inv_rd[k]);
            }
        }
        for (own, matrix) in p.into_iter().enumerate() {
            row_sums::<W>(&matrix[..n * l], v.as_chunks_mut::<W>().0);
            let half = |p: usize| if p == own { 0.5 } else { 1.0 };
            let (half_d, half_tau, half_a) = (half(0), half(1), half(2));
            let u = &matrix[defenders * l..n * l];
            for s in 0..strips {
                let m = &m[s * defenders..(s + 1) * defenders];
                let (t, a) = (&t[s], &a[s]);
                let mut i = 0;
                while i < n {
                    let sum = tile::<W, R>(&matrix[..defenders * l], l, i, m);
                    for r in 0..R {
                        let (u, v) = (half_tau * u[i + r], half_a * v[i + r]);
                        g[(i + r) * strips + s] = std::array::from_fn(|c| half_d * sum[r][c] + (u * t[c] + v * a[c]));
                    }
                    i += R;
                }
            }
            let out = &mut dy[own * block..own * block + rows * l];
            add_transpose::<B>(n.div_ceil(B), l / B, g.as_flattened(), out);
            for (i, q) in self.q[own].iter().enumerate() {
                out[i * l + i] += q;
            }
        }
    }
}

/// R rows, from row i, of a product of a symmetric matrix (its first rows) with a strip of W columns.
#[inline(always)]
fn tile<const W: usize, const R: usize>(p: &[f64], l: usize, i: usize, strip: &[[f64; W]]) -> [[f64; W]; R] {
    let mut sum = [[0.0; W]; R];
    for (row, m) in p.chunks_exact(l).zip(strip) {
        // A column of a symmetric matrix is its row, where the entries for R rows lie together.
        let left = &row[i..i + R];
        for r in 0..R {
            for c in 0..W {
                sum[r][c] += left[r] * m[c];
            }
        }
    }
    sum
}

/// P 1, as the sum of the rows of a symmetric P.
#[inline(always)]
fn row_sums<const W: usize>(p: &[f64], out: &mut [[f64; W]]) {
    let mut rows = p.as_chunks::<W>().0.chunks_exact(out.len());
    if let Some(first) = rows.next() {
        out.copy_from_slice(first);
    }
    for row in rows {
        for (o, x) in out.iter_mut().zip(row) {
            for c in 0..W {
                o[c] += x[c];
            }
        }
    }
}

/// out = G + Gᵀ in tiles of B × B, each sum computed once.
#[inline(always)]
fn add_transpose<const B: usize>(tiles: usize, stride: usize, g: &[f64], out: &mut [f64]) {
    let (g, out) = (g.as_chunks::<B>().0, out.as_chunks_mut::<B>().0);
    for bi in 0..tiles {
        for bj in 0..=bi {
            let mut sum = [[0.0; B]; B];
            for r in 0..B {
                for c in 0..B {
                    sum[r][c] = g[(bi * B + r) * stride + bj][c] + g[(bj * B + c) * stride + bi][r];
                }
            }
            for r in 0..B {
                out[(bi * B + r) * stride + bj] = sum[r];
                out[(bj * B + r) * stride + bi] = std::array::from_fn(|c| sum[c][r]);
            }
        }
    }
}

widened! {
    #[inline(never)]
    fn small<const N: usize, const L: usize, const R: usize, const B: usize>(flow: &mut Coupled, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<L, R, B>(N, L, y, dy);
    }
}

widened! {
    #[inline(never)]
    fn large(flow: &mut Coupled, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<STRIP, TILE, 4>(flow.n, flow.l, y, dy);
    }
}

/// N known to the compiler, in rows of L entries and tiles of R rows.
struct Small<const N: usize, const L: usize, const R: usize, const B: usize>(Coupled);

impl<const N: usize, const L: usize, const R: usize, const B: usize> Flow for Small<N, L, R, B> {
    fn block_len(&self) -> usize {
        self.0.block
    }
    fn shape(&self) -> (usize, usize) {
        (self.0.n, self.0.l)
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        small::<N, L, R, B>(self.0.width, &mut self.0, y, dy);
    }
}

/// Columns of a strip and rows of a tile for large N.
const STRIP: usize = 8;
const TILE: usize = 4;

/// Any N.
struct Large(Coupled);

impl Flow for Large {
    fn block_len(&self) -> usize {
        self.0.block
    }
    fn shape(&self) -> (usize, usize) {
        (self.0.n, self.0.l)
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        large(self.0.width, &mut self.0, y, dy);
    }
}

/// Solves eq:Riccati backward over the grid of `game`, writing N × N matrices into `nodes`, laid out (k, p, i, j).
/// Returns the number of steps.
pub(super) fn solve(game: &Game, cancel: &CancelToken, nodes: &mut [f64]) -> Result<usize, EquilibriumError> {
    let n = game.size();
    macro_rules! small {
        ($n:literal, $l:literal, $r:literal, $b:literal) => {{
            let core = Coupled::new(game, $l, usize::next_multiple_of($n, $r).next_multiple_of($b));
            let (y0, block) = (core.terminal(game), core.block);
            run(&mut Small::<$n, $l, $r, $b>(core), &y0, $l, block, game, cancel, nodes)
        }};
    }
    match n {
        2 => small!(2, 2, 2, 2),
        3 => small!(3, 4, 4, 4),
        4 => small!(4, 4, 4, 4),
        5 => small!(5, 8, 6, 2),
        6 => small!(6, 8, 6, 2),
        7 => small!(7, 8, 4, 4),
        8 => small!(8, 8, 4, 4),
        _ => {
            let l = n.next_multiple_of(STRIP);
            let core = Coupled::new(game, l, n.next_multiple_of(TILE).next_multiple_of(4));
            let (y0, block) = (core.terminal(game), core.block);
            run(&mut Large(core), &y0, l, block, game, cancel, nodes)
        }
    }
}

fn run(
    flow: &mut dyn Flow,
    y0: &[f64],
    l: usize,
    block: usize,
    game: &Game,
    cancel: &CancelToken,
    nodes: &mut [f64],
) -> Result<usize, EquilibriumError> {
    let (n, grid) = (game.size(), game.grid());
    let steps = grid.steps();
    dop853::integrate(flow, y0, grid.horizon(), steps, TOLERANCE, cancel, &mut |j, y| {
        let node = &mut nodes[(steps - j) * 3 * n * n..][..3 * n * n];
        for (p, matrix) in node.chunks_exact_mut(n * n).enumerate() {
            for (i, row) in matrix.chunks_exact_mut(n).enumerate() {
                row.copy_from_slice(&y[p * block + i * l..][..n]);
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};

    /// The right-hand side has the same bits for every vector width.
    #[test]
    fn widths_agree_to_the_bit() -> Result<(), crate::error::GameError> {
        for n in 1..=12 {
            let game = bank::varied_game(Interaction::I1, n, 1.0, 0.1)?;
            let size = n + 1;
            let l = size.next_multiple_of(STRIP);
            let mut core = Coupled::new(&game, l, size.next_multiple_of(TILE).next_multiple_of(4));
            let mut y = core.terminal(&game);
            for p in 0..3 {
                for i in 0..size {
                    for j in 0..size {
                        y[p * core.block + i * l + j] = (1.3 + (i + j + p) as f64).sin() / (1.0 + (i * j) as f64);
                    }
                }
            }
            let (mut one, mut other) = (vec![0.0; y.len()], vec![0.0; y.len()]);
            large(Width::Baseline, &mut core, &y, &mut one);
            large(Width::detect(), &mut core, &y, &mut other);
            assert_eq!(one, other, "n = {n}");
        }
        Ok(())
    }
}
