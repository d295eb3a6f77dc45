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

use super::newton::Objective;
use super::problem::Problem;

/// Θ over real gains, or over a stack of them. `N` is the size, or 0 when it is known only at run time.
pub(super) struct RealGains<'a, const N: usize> {
    problem: &'a Problem,
    copies: usize,
    /// X, N × N.
    x: Vec<f64>,
    /// Δ, m × N for each copy.
    delta: Vec<f64>,
    /// E_p, N × N each, for each copy.
    coupled: Vec<f64>,
    /// Q, mN × mN.
    quadratic: Vec<f64>,
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

pub(super) fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

impl<'a, const N: usize> RealGains<'a, N> {
    pub(super) fn new(problem: &'a Problem, copies: usize) -> Self {
        let (n, m) = (problem.size, problem.rows);
        let scale = Scale {
            fne: norm(&problem.fne),
            target: norm(&problem.target),
            coupling: problem.coupling.iter().map(|w| w.iter().map(|x| x * x).sum::<f64>()).sum(),
            closeness: problem.closeness.iter().fold(0.0, |a: f64, &b| a.max(b)),
            weight: problem.r.iter().fold(0.0, |a: f64, &b| a.max(b)),
        };
        let mut this = Self {
            problem,
            copies,
            x: vec![0.0; n * n],
            delta: vec![0.0; copies * m * n],
            coupled: vec![0.0; copies * problem.coupling.len() * n * n],
            quadratic: vec![0.0; m * n * m * n],
            scale,
        };
        this.fill_quadratic();
        this
    }

    #[inline(always)]
    fn n(&self) -> usize {
        if N > 0 { N } else { self.problem.size }
    }

    #[inline(always)]
    fn fill_quadratic(&mut self) {
        let (n, m) = (self.n(), self.problem.rows);
        let width = m * n;
        for i in 0..m {
            for j in 0..=i {
                let mut diagonal = 4.0 * self.problem.coupling_gram[i * m + j];
                if i == j {
                    diagonal += 2.0 * self.problem.closeness[i];
                }
                for a in 0..n {
                    let row = &mut self.quadratic[(i * n + a) * width + j * n..][..n];
                    for w in &self.problem.coupling {
                        let factor = 4.0 * w[j * n + a];
                        for (x, wi) in row.iter_mut().zip(&w[i * n..(i + 1) * n]) {
                            *x += factor * wi;
                        }
                    }
                    row[a] += diagonal;
                }
            }
        }
    }

    /// Adds 4γ₁ δ_ij r_i X to the constant part: the form whose definiteness certifies the point last evaluated.
    pub(super) fn certificate_form(&self, out: &mut [f64]) {
        let (n, m) = (self.n(), self.problem.rows);
        let width = m * n;
        out[..width * width].copy_from_slice(&self.quadratic);
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

impl<const N: usize> Objective for RealGains<'_, N> {
    fn width(&self) -> usize {
        self.copies * self.problem.rows * self.n()
    }

    #[inline(always)]
    fn value(&mut self, g: &[f64]) -> f64 {
        let p = self.problem;
        let (n, m) = (self.n(), p.rows);
        for (x, t) in self.x.iter_mut().zip(&p.target) {
            *x = -t;
        }
        let mut rest = 0.0;
        for (row, gi) in g.chunks_exact(n).enumerate() {
            let i = row % m;
            for a in 0..n {
                let factor = p.r[i] * gi[a];
                for (x, gb) in self.x[a * n..(a + 1) * n].iter_mut().zip(gi) {
                    *x += factor * gb;
                }
            }
            let delta = &mut self.delta[row * n..(row + 1) * n];
            delta.copy_from_slice(gi);
            if row < m {
                for (d, f) in delta.iter_mut().zip(&p.fne[i * n..(i + 1) * n]) {
                    *d -= f;
                }
            }
            rest += p.closeness[i] * delta.iter().map(|d| d * d).sum::<f64>();
        }
        let quartic: f64 = self.x.iter().map(|x| x * x).sum();
        let groups = p.coupling.len();
        for (at, e) in self.coupled.chunks_exact_mut(n * n).enumerate() {
            let w = &p.coupling[at % groups];
            let delta = &self.delta[at / groups * m * n..];
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
        p.gamma[0] * quartic + rest
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = (self.n(), p.rows);
        let groups = p.coupling.len();
        for (row, y) in out.chunks_exact_mut(n).enumerate() {
            let i = row % m;
            let c = 2.0 * p.closeness[i];
            for (y, d) in y.iter_mut().zip(&self.delta[row * n..(row + 1) * n]) {
                *y = c * d;
            }
            let own = 4.0 * p.gamma[0] * p.r[i];
            for a in 0..n {
                let factor = own * g[row * n + a];
                for (y, x) in y.iter_mut().zip(&self.x[a * n..(a + 1) * n]) {
                    *y += factor * x;
                }
                for (group, w) in p.coupling.iter().enumerate() {
                    let factor = 4.0 * w[i * n + a];
                    let at = (row / m * groups + group) * n * n + a * n;
                    for (y, x) in y.iter_mut().zip(&self.coupled[at..at + n]) {
                        *y += factor * x;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn hessian(&mut self, g: &[f64], out: &mut [f64]) {
        let p = self.problem;
        let (n, m) = (self.n(), p.rows);
        let (width, single) = (self.copies * m * n, m * n);
        for (row, gi) in g.chunks_exact(n).enumerate() {
            let i = row % m;
            for (column, gj) in g.chunks_exact(n).enumerate().take(row + 1) {
                let j = column % m;
                let factor = 4.0 * p.gamma[0] * p.r[i] * p.r[j];
                let diagonal: f64 = factor * gi.iter().zip(gj).map(|(x, y)| x * y).sum::<f64>();
                let own = 4.0 * p.gamma[0] * p.r[i];
                for a in 0..n {
                    let at = (row * n + a) * width + column * n;
                    let h = &mut out[at..at + n];
                    let scale = factor * gj[a];
                    for (h, x) in h.iter_mut().zip(gi) {
                        *h = scale * x;
                    }
                    if row / m == column / m {
                        let q = &self.quadratic[(i * n + a) * single + j * n..][..n];
                        for (h, q) in h.iter_mut().zip(q) {
                            *h += q;
                        }
                    }
                    if row == column {
                        for (h, x) in h.iter_mut().zip(&self.x[a * n..(a + 1) * n]) {
                            *h += own * x;
                        }
                    }
                    h[a] += diagonal;
                }
            }
        }
    }

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
