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
//! | P_d, P_τ, P_a | blocks 0, 1, 2 of `y` | reduced factors, N × N in rows of L entries |
//! | Q_p | `q` | running weights, diagonal |
//! | S_d P_d | `m` | its n nonzero rows |
//! | G_p | `g` | see above |
//!
//! Up to N = 8 the size is a constant of the compiler, whole matrices are integrated and the product of one row is held in
//! registers: this file. Larger games integrate lower triangles: [`super::large`].
//!
//! Source: eq:Riccati of the paper, with the sign of time reversed.

use super::dop853::{self, Flow};
use super::large::Large;
use super::stages::LANES;
use super::{finite, triangle, weight};
use crate::cancel::CancelToken;
use crate::error::EquilibriumError;
use crate::game::Game;
use crate::memory::zeros;
use crate::simd::{Width, dispatch};

/// Local error per step, in the weighted norm of [`dop853`]. Over 215 random games (n = 1…12, weights within two orders of
/// magnitude) this keeps every node to 1.9e-11, in the median to 2e-12; else to what the conditioning of the game allows.
const TOLERANCE: f64 = 1e-12;

/// N known to the compiler, in rows of L entries; products in tiles of R rows, the addition of the transpose in tiles of
/// B × B.
struct Small<const N: usize, const L: usize, const R: usize, const B: usize> {
    width: Width,
    q: Vec<Vec<f64>>,
    minus_inv_rd: Vec<f64>,
    minus_inv_rtau: f64,
    minus_inv_ra: f64,
    g: Vec<f64>,
}

impl<const N: usize, const L: usize, const R: usize, const B: usize> Small<N, L, R, B> {
    /// Rows of a block: whole tiles of both kinds.
    const ROWS: usize = N.next_multiple_of(R).next_multiple_of(B);
    const BLOCK: usize = (Self::ROWS * L).next_multiple_of(LANES);

    fn new(game: &Game, width: Width) -> Self {
        let w = game.weights();
        Self {
            width,
            q: game.state_weights(false),
            minus_inv_rd: w.r_d.iter().map(|r| -1.0 / r).collect(),
            minus_inv_rtau: -1.0 / w.r_tau,
            minus_inv_ra: -1.0 / w.r_a,
            g: vec![0.0; Self::ROWS * L],
        }
    }

    #[inline(always)]
    fn evaluate(&mut self, y: &[f64], dy: &mut [f64]) {
        let defenders = N - 1;
        let p: [&[[f64; L]]; 3] = std::array::from_fn(|p| &y[p * Self::BLOCK..].as_chunks().0[..Self::ROWS]);
        let g = &mut self.g.as_chunks_mut::<L>().0[..Self::ROWS];
        // −tᵀ / r_τ, −aᵀ / r_a and the rows of −S_d P_d
        let t = p[1][defenders].map(|x| x * self.minus_inv_rtau);
        let a = row_sums(&p[2][..N]).map(|x| x * self.minus_inv_ra);
        let mut m = [[0.0; L]; N];
        for k in 0..defenders {
            m[k] = p[0][k].map(|x| x * self.minus_inv_rd[k]);
        }
        for (own, matrix) in p.into_iter().enumerate() {
            let half = |p: usize| if p == own { 0.5 } else { 1.0 };
            let (half_d, half_tau, half_a) = (half(0), half(1), half(2));
            let (u, v) = (&matrix[defenders], row_sums(&matrix[..N]));
            let mut i = 0;
            while i < N {
                let sum = tile::<L, R>(&matrix[..defenders], i, &m);
                for r in 0..R {
                    let (u, v) = (half_tau * u[i + r], half_a * v[i + r]);
                    g[i + r] = std::array::from_fn(|c| half_d.mul_add(sum[r][c], u.mul_add(t[c], v * a[c])));
                }
                i += R;
            }
            let out = &mut dy[own * Self::BLOCK..][..Self::ROWS * L];
            add_transpose::<B>(N.div_ceil(B), L / B, g.as_flattened(), out);
            for (i, q) in self.q[own].iter().enumerate() {
                out[i * L + i] += q;
            }
        }
    }
}

/// R rows, from row i, of a product of a symmetric matrix, by its first rows, with the rows of `m`.
#[inline(always)]
fn tile<const L: usize, const R: usize>(p: &[[f64; L]], i: usize, m: &[[f64; L]]) -> [[f64; L]; R] {
    let mut sum = [[0.0; L]; R];
    for (row, m) in p.iter().zip(m) {
        // A column of a symmetric matrix is its row, where the entries for R rows lie together.
        let left = &row[i..i + R];
        for r in 0..R {
            for c in 0..L {
                sum[r][c] = left[r].mul_add(m[c], sum[r][c]);
            }
        }
    }
    sum
}

/// P 1, as the sum of the rows of a symmetric P.
#[inline(always)]
fn row_sums<const L: usize>(p: &[[f64; L]]) -> [f64; L] {
    p.iter().fold([0.0; L], |sum, row| std::array::from_fn(|c| sum[c] + row[c]))
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

dispatch! {
    #[inline(never)]
    fn small<V, const N: usize, const L: usize, const R: usize, const B: usize>(flow: &mut Small<N, L, R, B>, y: &[f64], dy: &mut [f64]) {
        flow.evaluate(y, dy);
    }
}

impl<const N: usize, const L: usize, const R: usize, const B: usize> Flow for Small<N, L, R, B> {
    fn block_len(&self) -> usize {
        Self::BLOCK
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        small(self.width, self, y, dy);
    }
    fn weigh(&mut self, y: &[f64], out: &mut [f64]) {
        let len = Self::ROWS * L;
        weight::whole(&y[..len], L, &mut [0.0; 8], &mut out[..len]);
    }
}

/// Solves eq:Riccati backward over the grid of `game`, writing N × N matrices into `nodes`, laid out (k, p, i, j).
/// Returns the number of steps.
pub(super) fn solve(game: &Game, cancel: &CancelToken, nodes: &mut [f64]) -> Result<usize, EquilibriumError> {
    let (n, width) = (game.size(), Width::in_use());
    macro_rules! small {
        ($n:literal, $l:literal, $r:literal, $b:literal) => {{
            let flow = &mut Small::<$n, $l, $r, $b>::new(game, width);
            run(flow, |i| i * $l + i, &mut unpack::<$n, $l>, game, cancel, nodes)
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
            let mut panels = zeros(dop853::WHAT, triangle::panels_len(n))?;
            let unpack = &mut |block: &[f64], out: &mut [f64]| triangle::unpack(width, n, block, &mut panels, out);
            run(&mut Large::new(game, width, cancel)?, |i| triangle::entry(i, i), unpack, game, cancel, nodes)
        }
    }
}

/// An N × N matrix from its block in rows of L entries.
fn unpack<const N: usize, const L: usize>(block: &[f64], out: &mut [f64]) {
    for (to, from) in out.as_chunks_mut::<N>().0.iter_mut().zip(block.as_chunks::<L>().0) {
        to.copy_from_slice(&from[..N]);
    }
}

/// `diagonal` says where entry (i, i) lies in a block, and `unpack` makes a block an N × N matrix.
fn run(
    flow: &mut dyn Flow,
    diagonal: impl Fn(usize) -> usize,
    unpack: &mut dyn FnMut(&[f64], &mut [f64]),
    game: &Game,
    cancel: &CancelToken,
    nodes: &mut [f64],
) -> Result<usize, EquilibriumError> {
    let (n, grid, block) = (game.size(), game.grid(), flow.block_len());
    let mut y0 = zeros(dop853::WHAT, 3 * block)?;
    for (y, f) in y0.chunks_exact_mut(block).zip(game.state_weights(true)) {
        for (i, v) in f.into_iter().enumerate() {
            y[diagonal(i)] = v;
        }
    }
    let (steps, mut in_range) = (grid.steps(), true);
    let taken = dop853::integrate(flow, &y0, grid.horizon(), steps, TOLERANCE, cancel, &mut |j, y| {
        in_range &= finite(y);
        let node = &mut nodes[(steps - j) * 3 * n * n..][..3 * n * n];
        for (y, matrix) in y.chunks_exact(block).zip(node.chunks_exact_mut(n * n)) {
            unpack(y, matrix);
        }
    })?;
    if in_range { Ok(taken) } else { Err(EquilibriumError::Range) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};

    fn large(game: &Game, width: Width) -> Large {
        Large::new(game, width, &CancelToken::new()).expect("memory")
    }

    /// The solution has the same bits for every vector width.
    #[test]
    fn widths_agree_to_the_bit() -> Result<(), crate::error::GameError> {
        fn values<F: Flow>(mut flow: F) -> Vec<f64> {
            let len = 3 * flow.block_len();
            let y: Vec<f64> = (0..len).map(|i| (1.3 + i as f64).sin() / (1.0 + (i % 7) as f64)).collect();
            let mut dy = vec![0.0; len];
            flow.derivative(&y, &mut dy);
            dy
        }
        for n in 8..=16 {
            let game = bank::varied_game(Interaction::I1, n, 1.0, 0.1)?;
            let expected = values(large(&game, Width::Baseline));
            for width in Width::all() {
                assert_eq!(values(large(&game, width)), expected, "n = {n}, {width:?}");
            }
        }
        macro_rules! small {
            ($n:literal, $l:literal, $r:literal, $b:literal) => {
                let game = bank::varied_game(Interaction::I1, $n - 1, 1.0, 0.1)?;
                let expected = values(Small::<$n, $l, $r, $b>::new(&game, Width::Baseline));
                for width in Width::all() {
                    assert_eq!(values(Small::<$n, $l, $r, $b>::new(&game, width)), expected, "N = {}, {width:?}", $n);
                }
            };
        }
        small!(2, 2, 2, 2);
        small!(4, 4, 4, 4);
        small!(5, 8, 6, 2);
        small!(8, 8, 4, 4);
        Ok(())
    }

    /// Lower triangles and whole matrices give the same right-hand side, to rounding.
    #[test]
    fn large_and_small_agree() -> Result<(), crate::error::GameError> {
        let game = bank::varied_game(Interaction::I1, 6, 1.0, 0.1)?;
        let (mut large, mut small) = (large(&game, Width::in_use()), Small::<7, 8, 4, 4>::new(&game, Width::in_use()));
        let entry = |p: usize, i: usize, j: usize| ((1 + p + i.min(j) + 3 * i.max(j)) as f64).sin();
        let (block, whole) = (large.block_len(), small.block_len());
        let (mut y, mut y_whole) = (vec![0.0; 3 * block], vec![0.0; 3 * whole]);
        for p in 0..3 {
            for i in 0..7 {
                for j in 0..7 {
                    y_whole[p * whole + i * 8 + j] = entry(p, i, j);
                    if j / 4 <= i / 4 {
                        y[p * block + triangle::entry(i, j)] = entry(p, i, j);
                    }
                }
            }
        }
        let (mut dy, mut dy_whole) = (vec![0.0; 3 * block], vec![0.0; 3 * whole]);
        large.derivative(&y, &mut dy);
        small.derivative(&y_whole, &mut dy_whole);
        for p in 0..3 {
            for i in 0..7 {
                for j in 0..=i {
                    let (a, b) = (dy[p * block + triangle::entry(i, j)], dy_whole[p * whole + i * 8 + j]);
                    assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{p}, {i}, {j}: {a} and {b}");
                }
            }
        }
        Ok(())
    }
}
