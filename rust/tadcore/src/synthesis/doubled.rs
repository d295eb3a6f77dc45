//! Θ over twice as many gains, in two ways side by side: the second look and the third.
//!
//! **Complex gains** G = A + iB. The paper's gains are 2 × 2 blocks; those that commute with rotations, aI + bJ, act like
//! the numbers a + ib. With the Hermitian forms X = GᴴRG − M and E_p = W_pΔ + (W_pΔ)ᴴ, Θ keeps its shape and its real
//! minimisers, but many minima of the real problem are saddles here, with a way down through the imaginary directions.
//!
//! **Stacked gains** G = [A; B], each row weighed as its player's, X = AᵀRA + BᵀRB − M, only A compared with F. With
//! enough copies this is the convex relaxation of the problem (its minimum bounds Θ from below); with two it is a smooth
//! way out of most local minima.
//!
//! They differ by two numbers, (s, σ) = (1, −1) for complex and (0, 1) for stacked gains, each lane having its own:
//!
//! - X_r = AᵀRA + BᵀRB − M, X_i = s(AᵀRB − BᵀRA); E_r = WΔ + (WΔ)ᵀ, E_i = WB + σ(WB)ᵀ
//! - Θ = γ₁(‖X_r‖² + ‖X_i‖²) + Σ_p(‖E_r‖² + ‖E_i‖²) + Σ_i c_i(‖Δ_i‖² + ‖B_i‖²)
//! - ∇_A = 4γ₁R(A X_r − B X_i) + 4WᵀE_r + 2cΔ;  ∇_B = 4γ₁R(A X_i + B X_r) + 4WᵀE_i + 2cB
//! - the Hessian's blocks are written out in [`Doubled::hessian`].
//!
//! The vector is laid out A first, then B, m × N each.

use super::newton::Objective;
use super::objective::{add_product, add_weighted, symmetric_product};
use super::problem::Problem;
use crate::lanes::{Number, dot, norm, sum_of_squares, take};

/// Θ over doubled gains.
pub(super) struct Doubled<'a, T, const N: usize> {
    problem: &'a Problem,
    /// s: 1 for complex gains, 0 for stacked ones.
    complex: T,
    /// σ.
    sign: T,
    /// X_r, then X_i, at the point last evaluated.
    x: Vec<T>,
    /// The same at the point kept for the Hessian.
    kept: Vec<T>,
    delta: Vec<T>,
    /// E_r of every group, then E_i of every group.
    coupled: Vec<T>,
    /// The gradient's scale, one for each lane.
    scale: T,
}

impl<'a, T: Number, const N: usize> Doubled<'a, T, N> {
    #[inline(always)]
    pub(super) fn new(problem: &'a Problem) -> Self {
        let (n, m, groups) = (problem.size, problem.rows, problem.coupling.len());
        let zero = T::splat(0.0);
        Self {
            problem,
            complex: zero,
            sign: T::splat(1.0),
            x: vec![zero; 2 * n * n],
            kept: vec![zero; 2 * n * n],
            delta: vec![zero; m * n],
            coupled: vec![zero; 2 * groups * n * n],
            scale: T::splat(1.0),
        }
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        (if N > 0 { N } else { self.problem.size }, self.problem.rows)
    }
}

impl<T: Number, const N: usize> Objective<T> for Doubled<'_, T, N> {
    #[inline(always)]
    fn width(&self) -> usize {
        let (n, m) = self.dimensions();
        2 * n * m
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, complex: bool, scale: f64) {
        self.complex.set_lane(lane, f64::from(u8::from(complex)));
        self.sign.set_lane(lane, if complex { -1.0 } else { 1.0 });
        self.scale.set_lane(lane, scale);
    }

    #[inline(always)]
    fn value(&mut self, g: &[T]) -> T {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (ra, ib) = g[..2 * m * n].split_at(m * n);
        let (real, imaginary) = self.x[..2 * n * n].split_at_mut(n * n);
        let delta = &mut self.delta[..m * n];
        for (x, &t) in real.iter_mut().zip(&p.target[..n * n]) {
            *x = T::splat(-t);
        }
        for x in imaginary.iter_mut() {
            *x = T::splat(0.0);
        }
        let mut rest = T::splat(0.0);
        for i in 0..m {
            let (ai, bi) = (&ra[i * n..(i + 1) * n], &ib[i * n..(i + 1) * n]);
            let r = T::splat(p.r[i]);
            for a in 0..n {
                let (fa, fb) = (r * ai[a], r * bi[a]);
                let (real, imaginary) = (&mut real[a * n..][..n], &mut imaginary[a * n..][..n]);
                for b in 0..n {
                    real[b] = real[b].plus(fa, ai[b]).plus(fb, bi[b]);
                    imaginary[b] = imaginary[b].plus(fa, bi[b]).minus(fb, ai[b]);
                }
            }
            let di = &mut delta[i * n..(i + 1) * n];
            for a in 0..n {
                di[a] = ai[a] - T::splat(p.fne[i * n + a]);
            }
            rest = rest.plus(T::splat(p.closeness[i]), sum_of_squares(di) + sum_of_squares(bi));
        }
        for x in imaginary.iter_mut() {
            *x = self.complex * *x;
        }
        let groups = p.coupling.len();
        for (group, w) in p.coupling.iter().enumerate() {
            let e = &mut self.coupled[group * n * n..][..n * n];
            symmetric_product(e, n, m, &w[..m * n], delta, T::splat(1.0));
            rest = rest + sum_of_squares(e);
            let e = &mut self.coupled[(groups + group) * n * n..][..n * n];
            symmetric_product(e, n, m, &w[..m * n], ib, self.sign);
            rest = rest + sum_of_squares(e);
        }
        rest.plus(T::splat(p.gamma[0]), sum_of_squares(real) + sum_of_squares(imaginary))
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[T], out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (ra, ib) = g[..2 * m * n].split_at(m * n);
        let (out_a, out_b) = out[..2 * m * n].split_at_mut(m * n);
        let (real, imaginary) = self.x[..2 * n * n].split_at(n * n);
        let groups = p.coupling.len();
        for i in 0..m {
            let (ai, bi) = (&ra[i * n..(i + 1) * n], &ib[i * n..(i + 1) * n]);
            let (ga, gb) = (&mut out_a[i * n..(i + 1) * n], &mut out_b[i * n..(i + 1) * n]);
            let c = T::splat(2.0 * p.closeness[i]);
            for a in 0..n {
                ga[a] = c * self.delta[i * n + a];
                gb[a] = c * bi[a];
            }
            let factor = 4.0 * p.gamma[0] * p.r[i];
            add_product(ga, n, T::splat(factor), ai, real);
            add_product(ga, n, T::splat(-factor), bi, imaginary);
            add_product(gb, n, T::splat(factor), ai, imaginary);
            add_product(gb, n, T::splat(factor), bi, real);
            for (group, w) in p.coupling.iter().enumerate() {
                let w = &w[i * n..(i + 1) * n];
                add_weighted(ga, n, w, &self.coupled[group * n * n..][..n * n]);
                add_weighted(gb, n, w, &self.coupled[(groups + group) * n * n..][..n * n]);
            }
        }
    }

    #[inline(always)]
    fn keep(&mut self, lanes: T::Mask) {
        take(lanes, &self.x, &mut self.kept);
    }

    /// With f = 4γ₁r_ir_j and the constant parts Q± = 4 Σ_p[(W_pᵀW_p)_ij **I** ± w_jᵀw_i] + 2δ_ij c_i **I**:
    /// - AA: 4δ_ij γ₁r_i X_r + f[(AAᵀ + sBBᵀ)_ij **I** + a_jᵀa_i − s b_jᵀb_i] + Q₊
    /// - BB: 4δ_ij γ₁r_i X_r + f[(BBᵀ + sAAᵀ)_ij **I** + b_jᵀb_i − s a_jᵀa_i] + Q_σ
    /// - BA: −4δ_ij γ₁r_i X_i + f[(BAᵀ − sABᵀ)_ij **I** + a_jᵀb_i + s b_jᵀa_i]
    #[inline(always)]
    fn hessian(&mut self, g: &[T], out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (half, width) = (m * n, 2 * m * n);
        let (ra, ib) = g[..width].split_at(half);
        let (real, imaginary) = self.kept[..2 * n * n].split_at(n * n);
        let (upper, lower) = out[..width * width].split_at_mut(half * width);
        let (s, stacked) = (self.complex, T::splat(0.0).less(self.sign));
        for i in 0..m {
            let (ai, bi) = (&ra[i * n..][..n], &ib[i * n..][..n]);
            for j in 0..m {
                let (aj, bj) = (&ra[j * n..][..n], &ib[j * n..][..n]);
                let f = T::splat(4.0 * p.gamma[0] * p.r[i] * p.r[j]);
                if j <= i {
                    let (aa, bb) = (dot(ai, aj), dot(bi, bj));
                    let (of_a, of_b) = (f * (aa + s * bb), f * (bb + s * aa));
                    for a in 0..n {
                        let (row, column) = ((i * n + a) * width, j * n);
                        let q = (i * n + a) * half + column;
                        let (plus, minus) = (&p.quadratic[0][q..][..n], &p.quadratic[1][q..][..n]);
                        let (fa, fb) = (f * aj[a], f * bj[a]);
                        let (sa, sb) = (s * fa, s * fb);
                        let h = &mut upper[row + column..][..n];
                        for b in 0..n {
                            h[b] = T::splat(plus[b]).plus(fa, ai[b]).minus(sb, bi[b]);
                        }
                        h[a] = h[a] + of_a;
                        let h = &mut lower[row + half + column..][..n];
                        for b in 0..n {
                            let q = T::select(stacked, T::splat(plus[b]), T::splat(minus[b]));
                            h[b] = q.plus(fb, bi[b]).minus(sa, ai[b]);
                        }
                        h[a] = h[a] + of_b;
                    }
                }
                let cross = f * (dot(bi, aj) - s * dot(ai, bj));
                for a in 0..n {
                    let (fa, sb) = (f * aj[a], s * (f * bj[a]));
                    let h = &mut lower[(i * n + a) * width + j * n..][..n];
                    for b in 0..n {
                        h[b] = (fa * bi[b]).plus(sb, ai[b]);
                    }
                    h[a] = h[a] + cross;
                }
            }
            let own = T::splat(4.0 * p.gamma[0] * p.r[i]);
            for a in 0..n {
                let at = (i * n + a) * width + i * n;
                let (xr, xi) = (&real[a * n..][..n], &imaginary[a * n..][..n]);
                for (h, &x) in upper[at..][..n].iter_mut().zip(xr) {
                    *h = h.plus(own, x);
                }
                for (h, &x) in lower[at + half..][..n].iter_mut().zip(xr) {
                    *h = h.plus(own, x);
                }
                for (h, &x) in lower[at..][..n].iter_mut().zip(xi) {
                    *h = h.minus(own, x);
                }
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, g: &[T]) -> T {
        self.scale.or_larger(norm(g) * T::splat(f64::MIN_POSITIVE))
    }

    #[inline(always)]
    fn value_scale(&self) -> f64 {
        self.problem.value_scale()
    }
}
