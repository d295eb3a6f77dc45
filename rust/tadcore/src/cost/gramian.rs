//! W = ∫₀^δ exp(Cᵀs) M exp(Cs) ds, the cost of a step as a quadratic form in the state it begins with.
//!
//! dW/ds = M + CᵀW + WC, so over a step halved until ‖C‖h ≤ ½ it is the series Σ T_j with T_0 = M h and
//! T_{j+1} = (CᵀT_j + T_jC) h / (j + 2); then W(2h) = W(h) + E(h)ᵀ W(h) E(h) and E(2h) = E(h)² double it back. The
//! number of products grows with the logarithm of ‖C‖δ, so no step is too stiff. Modes much slower than ‖C‖ are known
//! to some ‖C‖δ roundings, as they are in exp(Cδ) and in C itself.

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::{copy, zeros};
use crate::policy::exponential::{exponential, multiply};

/// What asks for memory here.
pub(super) const WHAT: &str = "the costs of one run";

/// Terms of the series: the last is below 10⁻²⁴ of the first, since ‖C‖h ≤ ½ in both norms.
const TERMS: usize = 24;

/// Writes into `m`, which holds matrices M (N × N, symmetric), the W of each.
pub(super) fn gramians(
    c: &[f64],
    n: usize,
    step: f64,
    m: &mut [Vec<f64>],
    cancel: &CancelToken,
) -> Result<(), Stopped> {
    let doublings = doublings(c, n, step);
    let h = step * 0.5_f64.powi(doublings);
    let (mut e, mut unused) = (zeros(WHAT, n * n)?, vec![0.0; n]);
    exponential(c, &vec![0.0; n], h, &mut e, &mut unused, cancel)?;
    let (mut half, mut next) = (zeros(WHAT, n * n)?, zeros(WHAT, n * n)?);
    for w in m.iter_mut() {
        let mut term = copy(WHAT, w)?;
        term.iter_mut().for_each(|x| *x *= h);
        w.copy_from_slice(&term);
        for j in 0..TERMS {
            multiply(&mut half, &term, c, n, cancel)?;
            for (ij, x) in term.iter_mut().enumerate() {
                *x = (half[ij] + half[ij % n * n + ij / n]) * (h / (j + 2) as f64);
            }
            w.iter_mut().zip(&term).for_each(|(w, x)| *w += x);
        }
    }
    for _ in 0..doublings {
        let mut transposed = zeros(WHAT, n * n)?;
        transposed.iter_mut().enumerate().for_each(|(ij, x)| *x = e[ij % n * n + ij / n]);
        for w in m.iter_mut() {
            multiply(&mut half, w, &e, n, cancel)?;
            multiply(&mut next, &transposed, &half, n, cancel)?;
            w.iter_mut().zip(&next).for_each(|(w, x)| *w += x);
        }
        multiply(&mut next, &e, &e, n, cancel)?;
        std::mem::swap(&mut e, &mut next);
    }
    Ok(())
}

/// How often to halve a step until ‖C‖h ≤ ½, by rows and by columns.
fn doublings(c: &[f64], n: usize, step: f64) -> i32 {
    let columns = (0..n).map(|j| (0..n).map(|i| c[i * n + j].abs()).sum::<f64>());
    let rows = c.chunks_exact(n).map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
    let (mut size, mut doublings) = (rows.chain(columns).fold(0.0, f64::max) * step, 0);
    while size > 0.5 && size.is_finite() {
        size *= 0.5;
        doublings += 1;
    }
    doublings
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Jordan block has a closed form: exp(Cs) = e^{λs} [[1, s], [0, 1]]. From slow to stiff, decaying or growing.
    #[test]
    fn a_jordan_block_is_integrated_exactly() {
        for rate in [-1e9, -1e5, -3.0, -1e-3, 1e-3, 0.7, 30.0] {
            let c = [rate, 1.0, 0.0, rate];
            let mut w = vec![vec![1.0, 0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0, 1.0]];
            gramians(&c, 2, 1.0, &mut w, &CancelToken::new()).expect("memory");
            // ∫ e^{2λs} s^j ds over [0, 1] by parts, and by its series where the parts cancel.
            let a = 2.0 * rate;
            let integral = |j: i32| -> f64 {
                if a.abs() < 1e-1 {
                    return (0..20)
                        .scan(1.0, |term, k| {
                            let value = *term / f64::from(k + j + 1);
                            *term *= a / f64::from(k + 1);
                            Some(value)
                        })
                        .sum();
                }
                (1..=j).fold((a.exp() - 1.0) / a, |before, k| (a.exp() - f64::from(k) * before) / a)
            };
            let expected = [[integral(0), integral(1), integral(1), integral(2)], [0.0, 0.0, 0.0, integral(0)]];
            for (w, expected) in w.iter().zip(expected) {
                for (found, wanted) in w.iter().zip(expected) {
                    let error = (found - wanted).abs();
                    assert!(error <= 1e-15 * (10.0 + rate.abs()) * wanted.abs(), "λ = {rate}: {found:e}, {wanted:e}");
                }
            }
        }
    }
}
