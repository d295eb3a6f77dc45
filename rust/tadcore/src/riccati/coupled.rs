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
//! are padded to whole strips and the same code runs with the size as a variable. Measured on the 1,201-node grid of
//! the paper (one core): TABLE
//!
//! Source: eq:Riccati of the paper, with the sign of time reversed.

use super::dop853::{self, Flow};
use super::lanes::{LANES, Width, widened};
use crate::cancel::CancelToken;
use crate::error::EquilibriumError;
use crate::game::Game;

/// Local error relative to each matrix's largest entry, per step.
const TOLERANCE: f64 = 1e-13;

struct Coupled {
    width: Width,
    n: usize,
    l: usize,
    block: usize,
    q: Vec<Vec<f64>>,
    inv_rd: Vec<f64>,
    inv_rtau: f64,
    inv_ra: f64,
    m: Vec<f64>,
    g: Vec<f64>,
    t: Vec<f64>,
    a: Vec<f64>,
    v: Vec<f64>,
}

impl Coupled {
    /// `l` entries to a row, a multiple of the strip.
    fn new(game: &Game, l: usize, rows: usize) -> Self {
        let w = game.weights();
        let n = game.size();
        let block = (rows * l).next_multiple_of(LANES);
        Self {
            width: Width::detect(),
            n,
            l,
            block,
            q: game.state_weights(false),
            inv_rd: w.r_d.iter().map(|r| 1.0 / r).collect(),
            inv_rtau: 1.0 / w.r_tau,
            inv_ra: 1.0 / w.r_a,
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

    /// The right-hand side for N = `n` in rows of `l` = a multiple of W, R rows of G at a time.
    #[inline(always)]
    fn evaluate<const W: usize, const R: usize>(&mut self, n: usize, l: usize, y: &[f64], dy: &mut [f64]) {
        let block = self.block;
        let defenders = n - 1;
        let (p_d, p_tau, p_a) = (&y[..block], &y[block..2 * block], &y[2 * block..3 * block]);
        // t / r_τ and a / r_a
        let t = &mut self.t[..l];
        for (v, x) in t.iter_mut().zip(&p_tau[defenders * l..n * l]) {
            *v = x * self.inv_rtau;
        }
        let a = &mut self.a[..l];
        column_sums(n, l, p_a, a);
        for v in a.iter_mut() {
            *v *= self.inv_ra;
        }
        // S_d P_d, strip by strip
        for strip in 0..l / W {
            let m = &mut self.m[strip * defenders * W..(strip + 1) * defenders * W];
            for (k, row) in m.as_chunks_mut::<W>().0.iter_mut().enumerate() {
                for c in 0..W {
                    row[c] = p_d[k * l + strip * W + c] * self.inv_rd[k];
                }
            }
        }
        let v = &mut self.v[..l];
        for (p, matrix) in [p_d, p_tau, p_a].into_iter().enumerate() {
            column_sums(n, l, matrix, v);
            let u = &matrix[defenders * l..n * l];
            let (half_d, half_tau, half_a) =
                (if p == 0 { 0.5 } else { 1.0 }, if p == 1 { 0.5 } else { 1.0 }, if p == 2 { 0.5 } else { 1.0 });
            for strip in 0..l / W {
                let m = self.m[strip * defenders * W..(strip + 1) * defenders * W].as_chunks::<W>().0;
                let mut i = 0;
                while i < n {
                    let rows: [&[f64]; R] = std::array::from_fn(|r| &matrix[(i + r) * l..(i + r) * l + defenders]);
                    let mut sum = [[0.0; W]; R];
                    for (k, m) in m.iter().enumerate() {
                        for r in 0..R {
                            for c in 0..W {
                                sum[r][c] += rows[r][k] * m[c];
                            }
                        }
                    }
                    for r in 0..R {
                        let (u, v) = (half_tau * u[i + r], half_a * v[i + r]);
                        for c in 0..W {
                            let j = strip * W + c;
                            self.g[(i + r) * l + j] = half_d * sum[r][c] + (u * t[j] + v * a[j]);
                        }
                    }
                    i += R;
                }
            }
            let g = &self.g[..];
            let out = &mut dy[p * block..(p + 1) * block];
            for i in 0..n {
                for j in 0..n {
                    out[i * l + j] = -(g[i * l + j] + g[j * l + i]);
                }
                out[i * l + i] += self.q[p][i];
            }
        }
    }
}

/// P 1, as the sum of the rows of a symmetric P.
#[inline(always)]
fn column_sums(n: usize, l: usize, p: &[f64], out: &mut [f64]) {
    out[..l].copy_from_slice(&p[..l]);
    for i in 1..n {
        for j in 0..l {
            out[j] += p[i * l + j];
        }
    }
}

widened! {
    fn small<const N: usize, const L: usize>(flow: &mut Coupled, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<L, 1>(N, L, y, dy);
    }
}

widened! {
    fn large(flow: &mut Coupled, y: &[f64], dy: &mut [f64]) {
        flow.evaluate::<STRIP, TILE>(flow.n, flow.l, y, dy);
    }
}

/// N known to the compiler, in rows of L entries.
struct Small<const N: usize, const L: usize>(Coupled);

impl<const N: usize, const L: usize> Flow for Small<N, L> {
    fn block_len(&self) -> usize {
        self.0.block
    }
    fn derivative(&mut self, y: &[f64], dy: &mut [f64]) {
        small::<N, L>(self.0.width, &mut self.0, y, dy);
    }
}

/// Columns of a strip and rows of a tile for large N.
const STRIP: usize = 8;
const TILE: usize = 2;

/// Any N.
struct Large(Coupled);

impl Flow for Large {
    fn block_len(&self) -> usize {
        self.0.block
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
        ($n:literal, $l:literal) => {{
            let core = Coupled::new(game, $l, $n);
            let (y0, block) = (core.terminal(game), core.block);
            run(&mut Small::<$n, $l>(core), &y0, $l, block, game, cancel, nodes)
        }};
    }
    match n {
        2 => small!(2, 2),
        3 => small!(3, 4),
        4 => small!(4, 4),
        5 => small!(5, 6),
        6 => small!(6, 6),
        7 => small!(7, 8),
        8 => small!(8, 8),
        _ => {
            let l = n.next_multiple_of(STRIP);
            let core = Coupled::new(game, l, n.next_multiple_of(TILE));
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
