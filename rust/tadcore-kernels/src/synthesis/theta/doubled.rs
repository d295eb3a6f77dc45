//! Θ over twice as many gains, in two ways side by side, for the search's restarts.
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
//! - the Hessian's blocks are written out at [`Doubled`]'s [`Form`].
//!
//! The vector is laid out A first, then B, m × N each.

use super::coefficients::Coefficients;
use super::real::{
    add_product, add_row, add_row_entry, add_unit, add_unit_entry, add_weighted, along, assembled, assembled_entry,
    constant, numbers, symmetric_product,
};
use crate::cancel::{CancelToken, raised};
use crate::error::NoMemory;
use crate::simd::{Number, dot, norm, sum_of_squares, take};
use crate::synthesis::newton::{Form, Objective, Slot};

/// Θ over doubled gains.
pub struct Doubled<'a, T: Number, const N: usize> {
    problem: &'a Coefficients<T::Scalar>,
    cancel: Option<&'a CancelToken>,
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
    /// What stands before **I** in the Hessian's blocks AA, BB and BA at its point, m × m times three; those of AA and BB for j ≤ i.
    gram: Vec<T>,
    /// The gradient's scale, one for each lane.
    scale: T,
}

impl<'a, T: Number, const N: usize> Doubled<'a, T, N> {
    #[inline(always)]
    pub fn new(problem: &'a Coefficients<T::Scalar>, cancel: Option<&'a CancelToken>) -> Result<Self, NoMemory> {
        let (n, m, groups) = (problem.size, problem.rows, problem.coupling.len());
        Ok(Self {
            problem,
            cancel,
            complex: T::splat(0.0),
            sign: T::splat(1.0),
            x: numbers(2 * n * n)?,
            kept: numbers(2 * n * n)?,
            delta: numbers(m * n)?,
            coupled: numbers(2 * groups * n * n)?,
            gram: numbers(3 * m * m)?,
            scale: T::splat(1.0),
        })
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        (if N > 0 { N } else { self.problem.size }, self.problem.rows)
    }
}

/// With f = 4γ₁r_ir_j and the constant parts Q± = 4 Σ_p[(W_pᵀW_p)_ij **I** ± w_jᵀw_i] + 2δ_ij c_i **I** the Hessian has the
/// blocks
/// - AA: 4δ_ij γ₁r_i X_r + f[(AAᵀ + sBBᵀ)_ij **I** + a_jᵀa_i − s b_jᵀb_i] + Q₊
/// - BB: 4δ_ij γ₁r_i X_r + f[(BBᵀ + sAAᵀ)_ij **I** + b_jᵀb_i − s a_jᵀa_i] + Q_σ
/// - BA: −4δ_ij γ₁r_i X_i + f[(BAᵀ − sABᵀ)_ij **I** + a_jᵀb_i + s b_jᵀa_i]
impl<T: Number, const N: usize> Form<T> for Doubled<'_, T, N> {
    #[inline(always)]
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let half = m * n;
        let (ra, ib) = g[..2 * half].split_at(half);
        let (real, imaginary) = self.kept[..2 * n * n].split_at(n * n);
        let (s, stacked) = (self.complex, T::splat(0.0).less(self.sign));
        let lower = v.entry >= half;
        let (entry, own) = if lower { (v.entry - half, v.own - half) } else { (v.entry, v.own) };
        let (i, a) = (entry / n, entry % n);
        let (ai, bi) = (&ra[i * n..][..n], &ib[i * n..][..n]);
        let strength = T::all(p.strength[i]);
        let players = ra.chunks_exact(n).zip(ib.chunks_exact(n)).zip(&p.r).zip(self.gram[3 * i * m..].chunks_exact(3));
        let (cross, out) = out.split_at_mut(if lower { half } else { 0 });
        for (j, (h, (((aj, bj), &r), gram))) in cross.chunks_exact_mut(n).zip(players.clone()).enumerate() {
            let f = strength * T::all(r);
            let (fa, sb) = (f * along(aj, a, i, v), s * (f * along(bj, a, i, v)));
            for b in 0..n {
                h[b] = (fa * bi[b]).plus(sb, ai[b]);
            }
            if j == i {
                add_row(h, T::splat(0.0) - strength, imaginary, n, a, i, v);
            }
            add_unit(h, a, i, v, gram[2]);
        }
        let [plus, minus] = &p.quadratic;
        for (j, (h, (((aj, bj), &r), gram))) in out.chunks_exact_mut(n).zip(players).take(i + 1).enumerate() {
            if N == 0 && plus.is_empty() {
                // One lane, in which gains are of one kind.
                let sign = if lower && T::bits(stacked) == 0 { -1.0 } else { 1.0 };
                assembled(h, p, sign, [i, a, j], v);
            } else {
                let (at, at_own) = (entry * half + j * n, own * half + j * n);
                constant(h, &plus[at..][..n], &plus[at_own..][..n], v);
                if lower {
                    let (q, own) = (&minus[at..][..n], &minus[at_own..][..n]);
                    for b in 0..n {
                        let minus = T::all(q[b]).minus(v.relative, T::all(own[b]));
                        h[b] = T::select(stacked, h[b], minus);
                    }
                }
            }
            if j == i {
                add_row(h, strength, real, n, a, i, v);
            }
            let f = strength * T::all(r);
            let (fa, fb) = (f * along(aj, a, i, v), f * along(bj, a, i, v));
            let (first, second, x, y) = if lower { (fb, s * fa, bi, ai) } else { (fa, s * fb, ai, bi) };
            for b in 0..n {
                h[b] = h[b].plus(first, x[b]).minus(second, y[b]);
            }
            add_unit(h, a, i, v, gram[usize::from(lower)]);
        }
    }

    #[inline(always)]
    fn entry(&self, g: &[T], v: &Slot<T>, at: usize) -> Option<T> {
        let p = self.problem;
        if N > 0 || !p.quadratic[0].is_empty() {
            return None;
        }
        let (n, m) = self.dimensions();
        let half = m * n;
        let (ra, ib) = g[..2 * half].split_at(half);
        let (real, imaginary) = self.kept[..2 * n * n].split_at(n * n);
        let lower = v.entry >= half;
        let entry = if lower { v.entry - half } else { v.entry };
        let (i, a) = (entry / n, entry % n);
        let (j, b) = (at % half / n, at % n);
        let (s, strength, gram) = (self.complex, T::all(p.strength[i]), &self.gram[3 * (i * m + j)..][..3]);
        let (aj, bj, ai, bi) = (&ra[j * n..][..n], &ib[j * n..][..n], ra[i * n + b], ib[i * n + b]);
        let f = strength * T::all(p.r[j]);
        let (fa, fb) = (f * along(aj, a, i, v), f * along(bj, a, i, v));
        if lower && at < half {
            let h = (fa * bi).plus(s * fb, ai);
            let h = if j == i { add_row_entry(h, T::splat(0.0) - strength, imaginary, n, [i, a, b], v) } else { h };
            return Some(add_unit_entry(h, [i, a, b], v, gram[2]));
        }
        let sign = if lower && T::bits(T::splat(0.0).less(self.sign)) == 0 { -1.0 } else { 1.0 };
        let h = assembled_entry(p, sign, [i, a, j, b], v);
        let h = if j == i { add_row_entry(h, strength, real, n, [i, a, b], v) } else { h };
        let (first, second, x, y) = if lower { (fb, s * fa, bi, ai) } else { (fa, s * fb, ai, bi) };
        Some(add_unit_entry(h.plus(first, x).minus(second, y), [i, a, b], v, gram[usize::from(lower)]))
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
            *x = T::all(-t);
        }
        for x in imaginary.iter_mut() {
            *x = T::splat(0.0);
        }
        let mut rest = T::splat(0.0);
        let rows = ra.chunks_exact(n).zip(ib.chunks_exact(n)).zip(delta.chunks_exact_mut(n));
        for (i, ((ai, bi), di)) in rows.enumerate() {
            if N == 0 && raised(self.cancel) {
                break;
            }
            let r = T::all(p.r[i]);
            for (a, (real, imaginary)) in real.chunks_exact_mut(n).zip(imaginary.chunks_exact_mut(n)).enumerate() {
                let (fa, fb) = (r * ai[a], r * bi[a]);
                for b in 0..n {
                    real[b] = real[b].plus(fa, ai[b]).plus(fb, bi[b]);
                    imaginary[b] = imaginary[b].plus(fa, bi[b]).minus(fb, ai[b]);
                }
            }
            for (b, &f) in p.fne[i * n..][..n].iter().enumerate() {
                di[b] = ai[b] - T::all(f);
            }
            rest = rest.plus(T::all(p.closeness[i]), sum_of_squares(di) + sum_of_squares(bi));
        }
        for x in imaginary.iter_mut() {
            *x = self.complex * *x;
        }
        let groups = p.coupling.len();
        for (group, w) in p.coupling.iter().enumerate() {
            let e = &mut self.coupled[group * n * n..][..n * n];
            symmetric_product(e, n, &w[..m * n], delta, T::splat(1.0), self.cancel);
            rest = rest + sum_of_squares(e);
            let e = &mut self.coupled[(groups + group) * n * n..][..n * n];
            symmetric_product(e, n, &w[..m * n], ib, self.sign, self.cancel);
            rest = rest + sum_of_squares(e);
        }
        rest.plus(T::all(p.first), sum_of_squares(real) + sum_of_squares(imaginary))
    }

    #[inline(always)]
    fn gradient(&mut self, g: &[T], out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (ra, ib) = g[..2 * m * n].split_at(m * n);
        let (out_a, out_b) = out[..2 * m * n].split_at_mut(m * n);
        let (real, imaginary) = self.x[..2 * n * n].split_at(n * n);
        let groups = p.coupling.len();
        let rows = ra.chunks_exact(n).zip(ib.chunks_exact(n)).zip(self.delta.chunks_exact(n));
        let slopes = out_a.chunks_exact_mut(n).zip(out_b.chunks_exact_mut(n));
        for (i, (((ai, bi), di), (ga, gb))) in rows.zip(slopes).enumerate() {
            if N == 0 && raised(self.cancel) {
                break;
            }
            let c = T::splat(2.0) * T::all(p.closeness[i]);
            for b in 0..n {
                ga[b] = c * di[b];
                gb[b] = c * bi[b];
            }
            let factor = T::all(p.strength[i]);
            add_product(ga, n, factor, ai, real);
            add_product(ga, n, T::splat(0.0) - factor, bi, imaginary);
            add_product(gb, n, factor, ai, imaginary);
            add_product(gb, n, factor, bi, real);
            let (real, imaginary) = self.coupled[..2 * groups * n * n].split_at(groups * n * n);
            for ((w, er), ei) in p.coupling.iter().zip(real.chunks_exact(n * n)).zip(imaginary.chunks_exact(n * n)) {
                let w = &w[i * n..(i + 1) * n];
                add_weighted(ga, n, w, er);
                add_weighted(gb, n, w, ei);
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
        let (ra, ib) = g[..2 * m * n].split_at(m * n);
        let s = self.complex;
        for i in 0..m {
            if N == 0 && raised(self.cancel) {
                break;
            }
            let (ai, bi) = (&ra[i * n..][..n], &ib[i * n..][..n]);
            for j in 0..m {
                let (aj, bj) = (&ra[j * n..][..n], &ib[j * n..][..n]);
                let f = T::all(p.strength[i]) * T::all(p.r[j]);
                let gram = &mut self.gram[3 * (i * m + j)..][..3];
                if j <= i {
                    let (aa, bb) = (dot(ai, aj), dot(bi, bj));
                    (gram[0], gram[1]) = (f * (aa + s * bb), f * (bb + s * aa));
                }
                gram[2] = f * (dot(bi, aj) - s * dot(ai, bj));
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, g: &[T]) -> T {
        self.scale.or_larger(norm(g) * T::least())
    }

    #[inline(always)]
    fn value_scale(&self) -> f64 {
        self.problem.scale.value
    }
}
