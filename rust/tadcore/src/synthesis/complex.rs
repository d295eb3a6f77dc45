//! Θ over complex gains G = A + iB: the second look.
//!
//! The paper's gains are 2 × 2 blocks; those that commute with rotations, aI + bJ, act like the numbers a + ib. With the
//! Hermitian forms X = GᴴRG − M = X_r + iX_i and E_p = W_pΔ + (W_pΔ)ᴴ, Θ keeps its shape and its real minimisers, but
//! many minima of the real problem are saddles here, with a way down through the imaginary directions.
//!
//! - X_r = AᵀRA + BᵀRB − M, X_i = AᵀRB − BᵀRA; E_r = WΔ + ·ᵀ, E_i = WB − ·ᵀ
//! - ∇_A = 4γ₁R(A X_r − B X_i) + 4WᵀE_r + 2cΔ;  ∇_B = 4γ₁R(A X_i + B X_r) + 4WᵀE_i + 2cB
//! - the Hessian's blocks are written out in [`ComplexGains::hessian`].
//!
//! The vector is laid out A first, then B, m × N each.

use super::newton::{Limits, Objective, Reached, Workspace, minimise};
use super::objective::norm;
use super::problem::Problem;
use super::start::Variable;
use crate::width::widened;

/// Θ over complex gains.
pub(super) struct ComplexGains<'a, const N: usize, const M: usize> {
    problem: &'a Problem,
    real: Vec<f64>,
    imaginary: Vec<f64>,
    delta: Vec<f64>,
    coupled_real: Vec<f64>,
    coupled_imaginary: Vec<f64>,
    scales: (f64, f64),
}

impl<'a, const N: usize, const M: usize> ComplexGains<'a, N, M> {
    /// `scales` are the real problem's gradient and value scales at the canonical start.
    pub(super) fn new(problem: &'a Problem, scales: (f64, f64)) -> Self {
        let (n, m, groups) = (problem.size, problem.rows, problem.coupling.len());
        Self {
            problem,
            real: vec![0.0; n * n],
            imaginary: vec![0.0; n * n],
            delta: vec![0.0; m * n],
            coupled_real: vec![0.0; groups * n * n],
            coupled_imaginary: vec![0.0; groups * n * n],
            scales,
        }
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        if N > 0 { (N, M) } else { (self.problem.size, self.problem.rows) }
    }
}

/// out += factor · xᵀy for rows x, y of length n.
#[inline(always)]
fn add_outer(out: &mut [f64], n: usize, factor: f64, x: &[f64], y: &[f64]) {
    for a in 0..n {
        let scale = factor * x[a];
        for (o, v) in out[a * n..(a + 1) * n].iter_mut().zip(y) {
            *o += scale * v;
        }
    }
}

/// row += factor · (x E) for a row x and a matrix E.
#[inline(always)]
fn add_product(row: &mut [f64], n: usize, factor: f64, x: &[f64], e: &[f64]) {
    for a in 0..n {
        let scale = factor * x[a];
        for (o, v) in row.iter_mut().zip(&e[a * n..(a + 1) * n]) {
            *o += scale * v;
        }
    }
}

impl<const N: usize, const M: usize> Objective for ComplexGains<'_, N, M> {
    #[inline(always)]
    fn width(&self) -> usize {
        let (n, m) = self.dimensions();
        2 * n * m
    }

    #[inline(always)]
    fn value(&mut self, g: &[f64]) -> f64 {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (ra, ib) = g.split_at(m * n);
        for (x, t) in self.real.iter_mut().zip(&p.target) {
            *x = -t;
        }
        self.imaginary.fill(0.0);
        let mut rest = 0.0;
        for i in 0..m {
            let (a, b) = (&ra[i * n..(i + 1) * n], &ib[i * n..(i + 1) * n]);
            add_outer(&mut self.real, n, p.r[i], a, a);
            add_outer(&mut self.real, n, p.r[i], b, b);
            add_outer(&mut self.imaginary, n, p.r[i], a, b);
            add_outer(&mut self.imaginary, n, -p.r[i], b, a);
            let delta = &mut self.delta[i * n..(i + 1) * n];
            for ((d, x), f) in delta.iter_mut().zip(a).zip(&p.fne[i * n..]) {
                *d = x - f;
            }
            rest += p.closeness[i] * delta.iter().chain(b).map(|x| x * x).sum::<f64>();
        }
        let blocks = self.coupled_real.chunks_exact_mut(n * n).zip(self.coupled_imaginary.chunks_exact_mut(n * n));
        for (w, (er, ei)) in p.coupling.iter().zip(blocks) {
            er.fill(0.0);
            ei.fill(0.0);
            for i in 0..m {
                add_outer(er, n, 1.0, &w[i * n..(i + 1) * n], &self.delta[i * n..(i + 1) * n]);
                add_outer(ei, n, 1.0, &w[i * n..(i + 1) * n], &ib[i * n..(i + 1) * n]);
            }
            for a in 0..n {
                for b in 0..=a {
                    let (s, d) = (er[a * n + b] + er[b * n + a], ei[a * n + b] - ei[b * n + a]);
                    (er[a * n + b], er[b * n + a]) = (s, s);
                    (ei[a * n + b], ei[b * n + a]) = (d, -d);
                }
            }
            rest += er.iter().chain(&*ei).map(|x| x * x).sum::<f64>();
        }
        p.gamma[0] * self.real.iter().chain(&self.imaginary).map(|x| x * x).sum::<f64>() + rest
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (ra, ib) = g.split_at(m * n);
        let (out_a, out_b) = out.split_at_mut(m * n);
        for i in 0..m {
            let (a, b) = (&ra[i * n..(i + 1) * n], &ib[i * n..(i + 1) * n]);
            let (ga, gb) = (&mut out_a[i * n..(i + 1) * n], &mut out_b[i * n..(i + 1) * n]);
            let c = 2.0 * p.closeness[i];
            for e in 0..n {
                ga[e] = c * self.delta[i * n + e];
                gb[e] = c * b[e];
            }
            let factor = 4.0 * p.gamma[0] * p.r[i];
            add_product(ga, n, factor, a, &self.real);
            add_product(ga, n, -factor, b, &self.imaginary);
            add_product(gb, n, factor, a, &self.imaginary);
            add_product(gb, n, factor, b, &self.real);
            let blocks = self.coupled_real.chunks_exact(n * n).zip(self.coupled_imaginary.chunks_exact(n * n));
            for (w, (er, ei)) in p.coupling.iter().zip(blocks) {
                add_product(ga, n, 4.0, &w[i * n..(i + 1) * n], er);
                add_product(gb, n, 4.0, &w[i * n..(i + 1) * n], ei);
            }
        }
    }

    /// With s = 4γ₁r_ir_j and the constant parts Q± = 4 Σ_p[(W_pᵀW_p)_ij **I** ± w_jᵀw_i] + 2δ_ij c_i **I**:
    /// - AA: 4δ_ij γ₁r_i X_r + s[(AAᵀ + BBᵀ)_ij **I** + a_jᵀa_i − b_jᵀb_i] + Q₊
    /// - BB: 4δ_ij γ₁r_i X_r + s[(AAᵀ + BBᵀ)_ij **I** + b_jᵀb_i − a_jᵀa_i] + Q₋
    /// - BA: −4δ_ij γ₁r_i X_i + s[(BAᵀ − ABᵀ)_ij **I** + a_jᵀb_i + b_jᵀa_i]
    #[inline(always)]
    fn hessian(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (half, width) = (m * n, 2 * m * n);
        let (ra, ib) = g.split_at(half);
        let (upper, lower) = out.split_at_mut(half * width);
        for i in 0..m {
            let (ai, bi) = (&ra[i * n..][..n], &ib[i * n..][..n]);
            for j in 0..m {
                let (aj, bj) = (&ra[j * n..][..n], &ib[j * n..][..n]);
                let s = 4.0 * p.gamma[0] * p.r[i] * p.r[j];
                let (mut same, mut cross) = (0.0, 0.0);
                for a in 0..n {
                    same += ai[a] * aj[a] + bi[a] * bj[a];
                    cross += bi[a] * aj[a] - ai[a] * bj[a];
                }
                for a in 0..n {
                    let (row, column) = ((i * n + a) * width, j * n);
                    let (sa, sb) = (s * aj[a], s * bj[a]);
                    if j <= i {
                        let q = (i * n + a) * half + column;
                        let (plus, minus) = (&p.quadratic[0][q..][..n], &p.quadratic[1][q..][..n]);
                        let aa = &mut upper[row + column..][..n];
                        for b in 0..n {
                            aa[b] = plus[b] + (sa * ai[b] - sb * bi[b]);
                        }
                        aa[a] += s * same;
                        let bb = &mut lower[row + half + column..][..n];
                        for b in 0..n {
                            bb[b] = minus[b] + (sb * bi[b] - sa * ai[b]);
                        }
                        bb[a] += s * same;
                    }
                    let ba = &mut lower[row + column..][..n];
                    for b in 0..n {
                        ba[b] = sa * bi[b] + sb * ai[b];
                    }
                    ba[a] += s * cross;
                }
            }
            let own = 4.0 * p.gamma[0] * p.r[i];
            for a in 0..n {
                let (row, column) = ((i * n + a) * width, i * n);
                for b in 0..n {
                    let (real, imaginary) = (own * self.real[a * n + b], own * self.imaginary[a * n + b]);
                    upper[row + column + b] += real;
                    lower[row + half + column + b] += real;
                    lower[row + column + b] -= imaginary;
                }
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, g: &[f64]) -> f64 {
        self.scales.0.max(norm(g) * f64::MIN_POSITIVE)
    }

    fn value_scale(&self) -> f64 {
        self.scales.1
    }
}

widened! {
    /// Newton on complex gains.
    pub(super) fn minimise_complex<const N: usize, const M: usize>(
        complex: &mut ComplexGains<N, M>,
        g: &mut [f64],
        variables: &[Variable],
        limits: Limits,
        w: &mut Workspace,
    ) -> Reached {
        minimise(complex, g, variables, limits, None, w)
    }
}
