//! Θ, its gradient and its exact Hessian as functions of the m × N gain rows G.
//!
//! With X = GᵀRG − M, Δ = G − F and E_p = W_pΔ + (W_pΔ)ᵀ:
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

use super::coefficients::Coefficients;
use crate::simd::{Number, Scalar, dot, norm, sum_of_squares, take};
use crate::synthesis::newton::{Form, Objective, Slot};

/// Θ over gains, for one network or several side by side. `N` is the size, 0 when it is known only at run time.
pub struct RealGains<'a, T: Number, const N: usize> {
    problem: &'a Coefficients<T::Scalar>,
    /// X at the point last evaluated, N × N.
    x: Vec<T>,
    /// X at the point kept for the Hessian.
    kept: Vec<T>,
    /// Δ, m × N.
    delta: Vec<T>,
    /// E_p, N × N each.
    coupled: Vec<T>,
    /// 4γ₁ r_i r_j g_i·g_j at the point of the Hessian, m × m.
    gram: Vec<T>,
}

impl<'a, T: Number, const N: usize> RealGains<'a, T, N> {
    #[inline(always)]
    pub fn new(problem: &'a Coefficients<T::Scalar>) -> Self {
        let (n, m) = (problem.size, problem.rows);
        let zero = T::splat(0.0);
        Self {
            problem,
            x: vec![zero; n * n],
            kept: vec![zero; n * n],
            delta: vec![zero; m * n],
            coupled: vec![zero; problem.coupling.len() * n * n],
            gram: vec![zero; m * m],
        }
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        (if N > 0 { N } else { self.problem.size }, self.problem.rows)
    }

    /// The product of a direction in row i with the Hessian, X being `x`, or with the certificate's form: the Hessian
    /// without its Gauss–Newton part. Blocks j ≤ i.
    #[inline(always)]
    fn product<const GAUSS_NEWTON: bool>(&self, x: &[T], g: &[T], v: &Slot<T>, out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (i, a) = (v.entry / n, v.entry % n);
        let (gi, width, end) = (&g[i * n..][..n], m * n, (i + 1) * n);
        let (q, own) = (&p.quadratic[0][v.entry * width..][..end], &p.quadratic[0][v.own * width..][..end]);
        let blocks = q.chunks_exact(n).zip(own.chunks_exact(n)).zip(out.chunks_exact_mut(n));
        let players = g.chunks_exact(n).zip(&p.r).zip(&self.gram[i * m..]);
        let strength = T::all(p.strength[i]);
        for (j, (((q, own), h), ((gj, &r), &gram))) in blocks.zip(players).enumerate() {
            constant(h, q, own, v);
            if j == i {
                add_row(h, strength, x, n, a, i, v);
            }
            if GAUSS_NEWTON {
                let scale = strength * T::all(r) * along(gj, a, i, v);
                for b in 0..n {
                    h[b] = h[b].plus(scale, gi[b]);
                }
                add_unit(h, a, i, v, gram);
            }
        }
    }
}

/// h := q − relative·own, rows of a constant matrix.
#[inline(always)]
pub fn constant<T: Number>(h: &mut [T], q: &[T::Scalar], own: &[T::Scalar], v: &Slot<T>) {
    if v.differs {
        for ((h, &q), &own) in h.iter_mut().zip(q).zip(own) {
            *h = T::all(q).minus(v.relative, T::all(own));
        }
    } else {
        for (h, &q) in h.iter_mut().zip(q) {
            *h = T::all(q);
        }
    }
}

/// A row's product with the direction e_a − relative·e_i.
#[inline(always)]
pub fn along<T: Number>(row: &[T], a: usize, i: usize, v: &Slot<T>) -> T {
    if v.differs { row[a].minus(v.relative, row[i]) } else { row[a] }
}

/// h += x · (e_a − relative·e_i).
#[inline(always)]
pub fn add_unit<T: Number>(h: &mut [T], a: usize, i: usize, v: &Slot<T>, x: T) {
    h[a] = h[a] + x;
    if v.differs {
        h[i] = h[i].minus(v.relative, x);
    }
}

/// h += factor · (x_a − relative·x_i), rows of a matrix x.
#[inline(always)]
pub fn add_row<T: Number>(h: &mut [T], factor: T, x: &[T], n: usize, a: usize, i: usize, v: &Slot<T>) {
    let (xa, xi) = (&x[a * n..][..n], &x[i * n..][..n]);
    for b in 0..n {
        let x = if v.differs { xa[b].minus(v.relative, xi[b]) } else { xa[b] };
        h[b] = h[b].plus(factor, x);
    }
}

impl<T: Number, const N: usize> Form<T> for RealGains<'_, T, N> {
    #[inline(always)]
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]) {
        self.product::<true>(&self.kept, g, v, out);
    }
}

/// The form whose definiteness certifies the point last evaluated: its blocks are 4γ₁ δ_ij r_i X + Q_ij.
pub struct Certificate<'a, 'b, T: Number, const N: usize>(pub &'a RealGains<'b, T, N>);

impl<T: Number, const N: usize> Form<T> for Certificate<'_, '_, T, N> {
    #[inline(always)]
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]) {
        self.0.product::<false>(&self.0.x, g, v, out);
    }
}

impl<T: Number, const N: usize> Objective<T> for RealGains<'_, T, N> {
    #[inline(always)]
    fn width(&self) -> usize {
        let (n, m) = self.dimensions();
        n * m
    }

    #[inline(always)]
    fn value(&mut self, g: &[T]) -> T {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (fne, g) = (&p.fne[..m * n], &g[..m * n]);
        let (x, delta) = (&mut self.x[..n * n], &mut self.delta[..m * n]);
        for (x, &t) in x.iter_mut().zip(&p.target[..n * n]) {
            *x = T::all(-t);
        }
        let mut rest = T::splat(0.0);
        let rows = g.chunks_exact(n).zip(fne.chunks_exact(n)).zip(delta.chunks_exact_mut(n));
        for (((gi, fi), di), (&r, &closeness)) in rows.zip(p.r.iter().zip(&p.closeness)) {
            for (x, &g) in x.chunks_exact_mut(n).zip(gi) {
                let factor = T::all(r) * g;
                for b in 0..n {
                    x[b] = x[b].plus(factor, gi[b]);
                }
            }
            for b in 0..n {
                di[b] = gi[b] - T::all(fi[b]);
            }
            rest = rest.plus(T::all(closeness), sum_of_squares(di));
        }
        let quartic = sum_of_squares(x);
        for (group, w) in p.coupling.iter().enumerate() {
            let e = &mut self.coupled[group * n * n..][..n * n];
            symmetric_product(e, n, &w[..m * n], delta, T::splat(1.0));
            rest = rest + sum_of_squares(e);
        }
        rest.plus(T::all(p.first), quartic)
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[T], out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let x = &self.x[..n * n];
        let rows = g[..m * n].chunks_exact(n).zip(self.delta.chunks_exact(n)).zip(out.chunks_exact_mut(n));
        for (i, ((gi, di), y)) in rows.enumerate() {
            let c = T::splat(2.0) * T::all(p.closeness[i]);
            for b in 0..n {
                y[b] = c * di[b];
            }
            add_product(y, n, T::all(p.strength[i]), gi, x);
            for (w, e) in p.coupling.iter().zip(self.coupled.chunks_exact(n * n)) {
                add_weighted(y, n, &w[i * n..(i + 1) * n], e);
            }
        }
    }

    #[inline(always)]
    fn keep(&mut self, lanes: T::Mask) {
        take(lanes, &self.x, &mut self.kept);
    }

    #[inline(always)]
    fn prepare(&mut self, g: &[T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        for i in 0..m {
            for j in 0..i + 1 {
                let factor = T::all(p.strength[i]) * T::all(p.r[j]);
                self.gram[i * m + j] = factor * dot(&g[i * n..][..n], &g[j * n..][..n]);
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, g: &[T]) -> T {
        let (s, size) = (&self.problem.scale, norm(g));
        let quartic = T::splat(s.quartic) * size;
        quartic * (norm(&self.x) + T::splat(2.0 * s.target))
            + T::splat(8.0 * s.coupling + 2.0 * s.closeness) * (size + T::splat(s.fne))
    }

    #[inline(always)]
    fn value_scale(&self) -> f64 {
        self.problem.scale.value
    }
}

/// E = WΔ + σ(WΔ)ᵀ, with w and Δ by rows.
#[inline(always)]
pub fn symmetric_product<T: Number>(e: &mut [T], n: usize, w: &[T::Scalar], delta: &[T], sign: T) {
    for (i, (w, d)) in w.chunks_exact(n).zip(delta.chunks_exact(n)).enumerate() {
        for (e, &w) in e.chunks_exact_mut(n).zip(w) {
            let factor = T::all(w);
            for b in 0..n {
                e[b] = if i == 0 { factor * d[b] } else { e[b].plus(factor, d[b]) };
            }
        }
    }
    for a in 0..n {
        for b in 0..=a {
            let (low, high) = (e[a * n + b], e[b * n + a]);
            e[a * n + b] = low.plus(sign, high);
            e[b * n + a] = high.plus(sign, low);
        }
    }
}

/// row += factor · (x E) for a row x and a matrix E.
#[inline(always)]
pub fn add_product<T: Number>(row: &mut [T], n: usize, factor: T, x: &[T], e: &[T]) {
    for (e, &x) in e.chunks_exact(n).zip(x) {
        let scale = factor * x;
        for b in 0..n {
            row[b] = row[b].plus(scale, e[b]);
        }
    }
}

/// row += 4 · (w E) for a row w of the problem.
#[inline(always)]
pub fn add_weighted<T: Number>(row: &mut [T], n: usize, w: &[T::Scalar], e: &[T]) {
    for (e, &w) in e.chunks_exact(n).zip(w) {
        let scale = T::all(T::Scalar::of(4.0) * w);
        for b in 0..n {
            row[b] = row[b].plus(scale, e[b]);
        }
    }
}
