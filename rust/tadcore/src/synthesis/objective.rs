//! Θ, its gradient and its exact Hessian as functions of the m × N gain rows G.
//!
//! With X = GᵀRG − M, Δ = G − F and E_p = W_pΔ + (W_pΔ)ᵀ (see [`super::problem`]):
//!
//! - Θ  = γ₁‖X‖² + Σ_p‖E_p‖² + Σ_i c_i‖Δ_i‖²
//! - ∇Θ = 4γ₁ R G X + 4 Σ_p W_pᵀE_p + 2 c Δ                                            (eq:errgradient, reduced)
//! - block (i, j) of ∇²Θ = 4γ₁ [δ_ij r_i X + r_i r_j (g_jᵀg_i + (GGᵀ)_ij **I**)] + Q_ij, where
//!   Q_ij = 4 Σ_p [(W_pᵀW_p)_ij **I** + w_jᵀw_i] + 2 δ_ij c_i **I** is constant.
//!
//! **A certificate of global optimality.** ‖X‖² ≥ ‖X*‖² + 2⟨X*, X − X*⟩ and the rest of Θ is quadratic, so at a critical
//! point G* the quadratic form with blocks 4γ₁δ_ij r_i X* + Q_ij bounds Θ − Θ* from below by half its value. Where that
//! form is positive semidefinite on the variables, G* is a *global* minimiser. It is the Hessian without its
//! Gauss–Newton part: one more factorisation proves what no number of restarts can.

//!
//! **Stacked gains.** The same code evaluates Θ over `copies` of the gains, G = [G₁; G₂; …], each row weighed as its
//! player's: X = Σ_c G_cᵀRG_c − M, and only G₁ is compared with F. With enough copies this is the convex relaxation of
//! the problem (its minimum bounds Θ from below); with two it is a smooth way out of most local minima.

use super::newton::{Limits, Objective, Reached, Rival, Workspace, minimise};
use super::problem::Problem;
use super::start::Variable;
use crate::width::widened;

/// Θ over real gains, or over a stack of them. `N` and `M` are the size and the constrained players, both 0 when they
/// are known only at run time.
pub(super) struct RealGains<'a, const N: usize, const M: usize> {
    problem: &'a Problem,
    copies: usize,
    /// X, N × N.
    x: Vec<f64>,
    /// Δ, m × N for each copy.
    delta: Vec<f64>,
    /// E_p, N × N each, for each copy.
    coupled: Vec<f64>,
    /// 4 Σ‖W_p‖² and the other factors of the gradient's scale.
    scale: Scale,
}

/// Norms that say how large the cancelling parts of the gradient are.
struct Scale {
    fne: f64,
    target: f64,
    coupling: f64,
    closeness: f64,
    weight: f64,
}

#[inline(always)]
pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

impl<'a, const N: usize, const M: usize> RealGains<'a, N, M> {
    pub(super) fn new(problem: &'a Problem, copies: usize) -> Self {
        let (n, m) = (problem.size, problem.rows);
        let scale = Scale {
            fne: norm(&problem.fne),
            target: norm(&problem.target),
            coupling: problem.coupling.iter().map(|w| w.iter().map(|x| x * x).sum::<f64>()).sum(),
            closeness: problem.closeness.iter().fold(0.0, |a: f64, &b| a.max(b)),
            weight: problem.r.iter().fold(0.0, |a: f64, &b| a.max(b)),
        };
        Self {
            problem,
            copies,
            x: vec![0.0; n * n],
            delta: vec![0.0; copies * m * n],
            coupled: vec![0.0; copies * problem.coupling.len() * n * n],
            scale,
        }
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        if N > 0 { (N, M) } else { (self.problem.size, self.problem.rows) }
    }

    /// Adds 4γ₁ δ_ij r_i X to the constant part: the form whose definiteness certifies the point last evaluated.
    pub(super) fn certificate_form(&self, out: &mut [f64]) {
        let (n, m) = self.dimensions();
        let width = m * n;
        out[..width * width].copy_from_slice(&self.problem.quadratic[0]);
        for i in 0..m {
            let factor = 4.0 * self.problem.gamma[0] * self.problem.r[i];
            for a in 0..n {
                let row = &mut out[(i * n + a) * width + i * n..][..n];
                for (h, x) in row.iter_mut().zip(&self.x[a * n..(a + 1) * n]) {
                    *h += factor * x;
                }
            }
        }
    }
}

impl<const N: usize, const M: usize> Objective for RealGains<'_, N, M> {
    #[inline(always)]
    fn width(&self) -> usize {
        let (n, m) = self.dimensions();
        self.copies * n * m
    }

    #[inline(always)]
    fn value(&mut self, g: &[f64]) -> f64 {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (r, closeness, fne) = (&p.r[..m], &p.closeness[..m], &p.fne[..m * n]);
        let x = &mut self.x[..n * n];
        for (x, t) in x.iter_mut().zip(&p.target[..n * n]) {
            *x = -t;
        }
        let mut rest = 0.0;
        for copy in 0..self.copies {
            let g = &g[copy * m * n..][..m * n];
            let delta = &mut self.delta[copy * m * n..][..m * n];
            for i in 0..m {
                let gi = &g[i * n..(i + 1) * n];
                for a in 0..n {
                    let factor = r[i] * gi[a];
                    for (x, gb) in x[a * n..(a + 1) * n].iter_mut().zip(gi) {
                        *x += factor * gb;
                    }
                }
                let di = &mut delta[i * n..(i + 1) * n];
                let mut sum = 0.0;
                for a in 0..n {
                    di[a] = if copy == 0 { gi[a] - fne[i * n + a] } else { gi[a] };
                    sum += di[a] * di[a];
                }
                rest += closeness[i] * sum;
            }
        }
        let quartic: f64 = x.iter().map(|x| x * x).sum();
        let groups = p.coupling.len();
        for copy in 0..self.copies {
            let delta = &self.delta[copy * m * n..][..m * n];
            for (group, w) in p.coupling.iter().enumerate() {
                let w = &w[..m * n];
                let e = &mut self.coupled[(copy * groups + group) * n * n..][..n * n];
                e.fill(0.0);
                for i in 0..m {
                    let di = &delta[i * n..(i + 1) * n];
                    for a in 0..n {
                        let factor = w[i * n + a];
                        for (x, d) in e[a * n..(a + 1) * n].iter_mut().zip(di) {
                            *x += factor * d;
                        }
                    }
                }
                for a in 0..n {
                    for b in 0..=a {
                        let sum = e[a * n + b] + e[b * n + a];
                        e[a * n + b] = sum;
                        e[b * n + a] = sum;
                    }
                }
                rest += e.iter().map(|x| x * x).sum::<f64>();
            }
        }
        p.gamma[0] * quartic + rest
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (r, closeness, x) = (&p.r[..m], &p.closeness[..m], &self.x[..n * n]);
        let groups = p.coupling.len();
        for copy in 0..self.copies {
            let g = &g[copy * m * n..][..m * n];
            let out = &mut out[copy * m * n..][..m * n];
            let delta = &self.delta[copy * m * n..][..m * n];
            for i in 0..m {
                let y = &mut out[i * n..(i + 1) * n];
                let c = 2.0 * closeness[i];
                for (y, d) in y.iter_mut().zip(&delta[i * n..(i + 1) * n]) {
                    *y = c * d;
                }
                let own = 4.0 * p.gamma[0] * r[i];
                for a in 0..n {
                    let factor = own * g[i * n + a];
                    for (y, x) in y.iter_mut().zip(&x[a * n..(a + 1) * n]) {
                        *y += factor * x;
                    }
                }
            }
            for (group, w) in p.coupling.iter().enumerate() {
                let w = &w[..m * n];
                let e = &self.coupled[(copy * groups + group) * n * n..][..n * n];
                for i in 0..m {
                    let y = &mut out[i * n..(i + 1) * n];
                    for a in 0..n {
                        let factor = 4.0 * w[i * n + a];
                        for (y, x) in y.iter_mut().zip(&e[a * n..(a + 1) * n]) {
                            *y += factor * x;
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn hessian(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let single = m * n;
        let (r, x, quadratic) = (&p.r[..m], &self.x[..n * n], &p.quadratic[0][..single * single]);
        let width = self.copies * single;
        for (upper, lower) in (0..self.copies).flat_map(|u| (0..=u).map(move |l| (u, l))) {
            let (gu, gl) = (&g[upper * single..][..single], &g[lower * single..][..single]);
            let same = upper == lower;
            for i in 0..m {
                let gi = &gu[i * n..(i + 1) * n];
                let last = if same { i + 1 } else { m };
                for j in 0..last {
                    let gj = &gl[j * n..(j + 1) * n];
                    let factor = 4.0 * p.gamma[0] * r[i] * r[j];
                    let mut dot = 0.0;
                    for a in 0..n {
                        dot += gi[a] * gj[a];
                    }
                    for a in 0..n {
                        let h = &mut out[(upper * single + i * n + a) * width + lower * single + j * n..][..n];
                        let scale = factor * gj[a];
                        if same {
                            let q = &quadratic[(i * n + a) * single + j * n..][..n];
                            for b in 0..n {
                                h[b] = q[b] + scale * gi[b];
                            }
                        } else {
                            for b in 0..n {
                                h[b] = scale * gi[b];
                            }
                        }
                        h[a] += factor * dot;
                    }
                    if same && i == j {
                        let own = 4.0 * p.gamma[0] * r[i];
                        for a in 0..n {
                            let h = &mut out[(upper * single + i * n + a) * width + lower * single + j * n..][..n];
                            for (h, x) in h.iter_mut().zip(&x[a * n..(a + 1) * n]) {
                                *h += own * x;
                            }
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, g: &[f64]) -> f64 {
        let (s, size) = (&self.scale, norm(g));
        let quartic = 4.0 * self.problem.gamma[0] * s.weight * size * (norm(&self.x) + 2.0 * s.target);
        quartic + (8.0 * s.coupling + 2.0 * s.closeness) * (size + s.fne)
    }

    fn value_scale(&self) -> f64 {
        let s = &self.scale;
        self.problem.gamma[0] * s.target * s.target + (4.0 * s.coupling + s.closeness) * s.fne * s.fne
    }
}

widened! {
    /// Newton on real or stacked gains.
    pub(super) fn minimise_real<const N: usize, const M: usize>(
        real: &mut RealGains<N, M>,
        g: &mut [f64],
        variables: &[Variable],
        limits: Limits,
        rival: Option<Rival>,
        w: &mut Workspace,
    ) -> Reached {
        minimise(real, g, variables, limits, rival, w)
    }
}
