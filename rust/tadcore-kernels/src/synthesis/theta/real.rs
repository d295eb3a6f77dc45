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
//! Gauss–Newton part: one more factorisation proves what no number of restarts can. A gradient ∇Θ that is not quite zero
//! leaves ½∇Θᵀ(form)⁻¹∇Θ to be gained at most.

use super::coefficients::{Coefficients, TABULATED_UP_TO};
use crate::cancel::{CancelToken, raised};
use crate::error::NoMemory;
use crate::memory::grow;
use crate::simd::{Number, Scalar, dot, norm, sum_of_squares, take};
use crate::synthesis::newton::{Form, Objective, Slot};

/// Θ over gains, for one network or several side by side. `N` is the size, 0 when it is known only at run time.
pub struct RealGains<'a, T: Number, const N: usize> {
    problem: &'a Coefficients<T::Scalar>,
    /// Looked at in the loops of large games; what they give is not used once it is raised.
    cancel: Option<&'a CancelToken>,
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
    pub fn new(problem: &'a Coefficients<T::Scalar>, cancel: Option<&'a CancelToken>) -> Result<Self, NoMemory> {
        let (n, m) = (problem.size, problem.rows);
        Ok(Self {
            problem,
            cancel,
            x: numbers(n * n)?,
            kept: numbers(n * n)?,
            delta: numbers(m * n)?,
            coupled: numbers(problem.coupling.len() * n * n)?,
            gram: numbers(m * m)?,
        })
    }

    #[inline(always)]
    fn dimensions(&self) -> (usize, usize) {
        (if N > 0 { N } else { self.problem.size }, self.problem.rows)
    }

    /// Puts the sizes of the parts of X at the point last evaluated, its diagonal alone, in the place of the X kept.
    #[inline(always)]
    pub fn measure(&mut self) {
        let (n, _) = self.dimensions();
        self.kept.fill(T::splat(0.0));
        for a in 0..n {
            let at = a * n + a;
            self.kept[at] = self.x[at].abs() + T::splat(2.0) * T::all(self.problem.target[at]);
        }
    }

    /// The product of a direction in row i with the Hessian, X being `x`, or with the certificate's form: the Hessian
    /// without its Gauss–Newton part. Blocks j ≤ i.
    #[inline(always)]
    fn product<const GAUSS_NEWTON: bool>(&self, x: &[T], g: &[T], v: &Slot<T>, out: &mut [T]) {
        let p = self.problem;
        let (n, m) = self.dimensions();
        let (i, a) = (v.entry / n, v.entry % n);
        let (gi, width, end) = (&g[i * n..][..n], m * n, (i + 1) * n);
        let players = g.chunks_exact(n).zip(&p.r).zip(&self.gram[i * m..]);
        if N == 0 && p.quadratic[0].is_empty() {
            for (j, (h, ((gj, &r), &gram))) in out[..end].chunks_exact_mut(n).zip(players).enumerate() {
                assembled(h, p, 1.0, [i, a, j], v);
                self.add_block::<GAUSS_NEWTON>(h, x, gi, gj, r, gram, [i, a, j], v);
            }
            return;
        }
        let (q, own) = (&p.quadratic[0][v.entry * width..][..end], &p.quadratic[0][v.own * width..][..end]);
        let blocks = q.chunks_exact(n).zip(own.chunks_exact(n)).zip(out.chunks_exact_mut(n));
        for (j, (((q, own), h), ((gj, &r), &gram))) in blocks.zip(players).enumerate() {
            constant(h, q, own, v);
            self.add_block::<GAUSS_NEWTON>(h, x, gi, gj, r, gram, [i, a, j], v);
        }
    }

    /// One entry of that product, where the constant part is not in memory.
    #[inline(always)]
    fn product_entry<const GAUSS_NEWTON: bool>(&self, x: &[T], g: &[T], v: &Slot<T>, at: usize) -> Option<T> {
        let p = self.problem;
        if N > 0 || !p.quadratic[0].is_empty() {
            return None;
        }
        let (n, m) = self.dimensions();
        let (i, a, j, b) = (v.entry / n, v.entry % n, at / n, at % n);
        let strength = T::all(p.strength[i]);
        let mut h = assembled_entry(p, 1.0, [i, a, j, b], v);
        if j == i {
            h = add_row_entry(h, strength, x, n, [i, a, b], v);
        }
        if GAUSS_NEWTON {
            let scale = strength * T::all(p.r[j]) * along(&g[j * n..][..n], a, i, v);
            h = add_unit_entry(h.plus(scale, g[i * n + b]), [i, a, b], v, self.gram[i * m + j]);
        }
        Some(h)
    }

    /// Adds to block j of the product what depends on the point.
    #[inline(always)]
    #[allow(clippy::too_many_arguments, reason = "one line of the formula, and all that it names")]
    fn add_block<const GAUSS_NEWTON: bool>(
        &self,
        h: &mut [T],
        x: &[T],
        gi: &[T],
        gj: &[T],
        r: T::Scalar,
        gram: T,
        [i, a, j]: [usize; 3],
        v: &Slot<T>,
    ) {
        let (n, _) = self.dimensions();
        let strength = T::all(self.problem.strength[i]);
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

/// Memory for numbers side by side.
#[inline(always)]
pub fn numbers<T: Number>(len: usize) -> Result<Vec<T>, NoMemory> {
    let mut numbers = Vec::new();
    grow("Θ of one network", &mut numbers, len, T::splat(0.0))?;
    Ok(numbers)
}

/// h := block j of row (i, a) of the Hessian's constant part with a sign, less relative times that of row (i, i).
#[inline(always)]
pub fn assembled<T: Number>(h: &mut [T], p: &Coefficients<T::Scalar>, sign: f64, [i, a, j]: [usize; 3], v: &Slot<T>) {
    let n = p.size;
    let four = T::Scalar::of(4.0 * sign);
    let twice = T::splat(if i == j { 2.0 } else { 0.0 }) * T::all(p.closeness[i]);
    let diagonal = T::splat(4.0) * T::all(p.gram[i * p.rows + j]) + twice;
    for h in h.iter_mut() {
        *h = T::splat(0.0);
    }
    for w in &p.coupling {
        let (factor, row) = (T::all(four * w[j * n + a]), &w[i * n..][..n]);
        for b in 0..n {
            h[b] = h[b] + factor * T::all(row[b]);
        }
    }
    h[a] = h[a] + diagonal;
    if v.differs {
        for b in 0..n {
            let mut own = T::splat(0.0);
            for w in &p.coupling {
                own = own + T::all(four * w[j * n + i]) * T::all(w[i * n + b]);
            }
            h[b] = h[b].minus(v.relative, if b == i { own + diagonal } else { own });
        }
    }
}

/// The same, one entry of the block.
#[inline(always)]
pub fn assembled_entry<T: Number>(p: &Coefficients<T::Scalar>, sign: f64, [i, a, j, b]: [usize; 4], v: &Slot<T>) -> T {
    let n = p.size;
    let four = T::Scalar::of(4.0 * sign);
    let twice = T::splat(if i == j { 2.0 } else { 0.0 }) * T::all(p.closeness[i]);
    let diagonal = T::splat(4.0) * T::all(p.gram[i * p.rows + j]) + twice;
    let (mut h, mut own) = (T::splat(0.0), T::splat(0.0));
    for w in &p.coupling {
        let right = T::all(w[i * n + b]);
        h = h + T::all(four * w[j * n + a]) * right;
        own = own + T::all(four * w[j * n + i]) * right;
    }
    let h = if b == a { h + diagonal } else { h };
    let own = if b == i { own + diagonal } else { own };
    if v.differs { h.minus(v.relative, own) } else { h }
}

/// Entry b of factor · (x_a − relative·x_i), added to h.
#[inline(always)]
pub fn add_row_entry<T: Number>(h: T, factor: T, x: &[T], n: usize, [i, a, b]: [usize; 3], v: &Slot<T>) -> T {
    let (xa, xi) = (x[a * n + b], x[i * n + b]);
    h.plus(factor, if v.differs { xa.minus(v.relative, xi) } else { xa })
}

/// Entry b of x · (e_a − relative·e_i), added to h.
#[inline(always)]
pub fn add_unit_entry<T: Number>(h: T, [i, a, b]: [usize; 3], v: &Slot<T>, x: T) -> T {
    let h = if b == a { h + x } else { h };
    if v.differs && b == i { h.minus(v.relative, x) } else { h }
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

    #[inline(always)]
    fn entry(&self, g: &[T], v: &Slot<T>, at: usize) -> Option<T> {
        self.product_entry::<true>(&self.kept, g, v, at)
    }
}

/// The form whose definiteness certifies the point last evaluated: its blocks are 4γ₁ δ_ij r_i X + Q_ij.
pub struct Certificate<'a, 'b, T: Number, const N: usize>(pub &'a RealGains<'b, T, N>);

impl<T: Number, const N: usize> Form<T> for Certificate<'_, '_, T, N> {
    #[inline(always)]
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]) {
        self.0.product::<false>(&self.0.x, g, v, out);
    }

    #[inline(always)]
    fn entry(&self, g: &[T], v: &Slot<T>, at: usize) -> Option<T> {
        self.0.product_entry::<false>(&self.0.x, g, v, at)
    }
}

/// Sizes of the parts that cancel in the certificate's form, after [`RealGains::measure`]: its diagonal is what the
/// rounding of each variable's entries is relative to.
pub struct Parts<'a, 'b, T: Number, const N: usize>(pub &'a RealGains<'b, T, N>);

impl<T: Number, const N: usize> Form<T> for Parts<'_, '_, T, N> {
    #[inline(always)]
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]) {
        self.0.product::<false>(&self.0.kept, g, v, out);
    }

    #[inline(always)]
    fn entry(&self, g: &[T], v: &Slot<T>, at: usize) -> Option<T> {
        self.0.product_entry::<false>(&self.0.kept, g, v, at)
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
            if N == 0 && raised(self.cancel) {
                break;
            }
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
            symmetric_product(e, n, &w[..m * n], delta, T::splat(1.0), self.cancel);
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
            if N == 0 && raised(self.cancel) {
                break;
            }
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
            if N == 0 && raised(self.cancel) {
                break;
            }
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
pub fn symmetric_product<T: Number>(
    e: &mut [T],
    n: usize,
    w: &[T::Scalar],
    delta: &[T],
    sign: T,
    cancel: Option<&CancelToken>,
) {
    for (i, (w, d)) in w.chunks_exact(n).zip(delta.chunks_exact(n)).enumerate() {
        if n > TABULATED_UP_TO && raised(cancel) {
            break;
        }
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
