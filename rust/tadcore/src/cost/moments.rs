//! S = ∫ z zᵀ ds over a step of ż = Cz, summed over the axes: every quadratic cost of the step is tr(MS).
//!
//! Where a step is stiff, or modes grow in it, large parts of z and of its products cancel in a cost. So all of it is
//! computed in double-double arithmetic, from C = G − 1h (feedback rows less the attacker's) without a rounding on. On
//! pieces with ‖C‖h ≤ ⅛ z is its Taylor series, z = Σ_j z_j s^j, z_{j+1} = h C z_j / (j + 1), s in [0, 1], and
//! S = h Σ_j z_j (Σ_k z_k / (j + k + 1))ᵀ. Some of a step is made of such pieces, one after another; the rest is doubled,
//! S(2h) = S(h) + E(h) S(h) E(h)ᵀ, E(2h) = E(h)², from E = exp(Ch) by its own series, so that no step is too stiff. S is
//! a sum of squares in which nothing cancels, as parts do in the Gramians of the costs, of which there are several besides.
//! Digits are lost only where a mode grows by more than 10⁸ in a step and z hardly holds it.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | C = G − 1h | `Moments::new` | feedback rows less the attacker's; kept transposed |
//! | z_j | `series` | coefficients of z on a piece |
//! | S | `over_step`, `add_piece` | ∫ z zᵀ ds |
//! | E(h) | `exponential` | exp(Ch) |
//! | tr(rᵀr S) | [`effort`] | what a feedback row r costs |

use super::double_double::{DoubleDouble, Numbers};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::simd::Width;

/// Terms of the series of z at most; those beyond are left out that are below [`ROUNDING`] in every row.
const TERMS: usize = 40;
/// Terms of exp(Ch): the next is below 10⁻⁴⁵ of the first, so that small entries keep their digits, too.
const EXPONENTIAL: usize = 24;
/// What is left out of a series, relative to what is kept.
const ROUNDING: f64 = 1e-33;

/// What integrates over steps of ż = Cz, in double-double arithmetic.
pub(super) struct Moments<'a> {
    width: Width,
    n: usize,
    dim: usize,
    /// Cᵀ, row by row.
    transposed: Numbers,
    /// |C|, row by row, to bound terms by.
    sizes: Vec<f64>,
    cancel: &'a CancelToken,
}

impl<'a> Moments<'a> {
    /// C of the feedback `rows` of the `players` and, the last, the attacker; z has `dim` axes. Rows of twice as many entries
    /// are on z and Jz, and so is C.
    pub fn new(rows: &[f64], players: usize, dim: usize, cancel: &'a CancelToken) -> Result<Self, Stopped> {
        let n = rows.len() / (players + 1);
        let mut transposed = Numbers::zeros(n * n)?;
        let (own, attacker) = rows.split_at(players * n);
        let entry = |ij: usize| {
            let (i, j) = (ij / n, ij % n);
            // The rows of Jz: J(Az + BJz) = AJz − Bz.
            let (i, other, sign) = match (i < players, j < players) {
                (true, _) => (i, j, 1.0),
                (false, true) => (i - players, j + players, -1.0),
                (false, false) => (i - players, j - players, 1.0),
            };
            DoubleDouble::difference(sign * own[i * n + other], sign * attacker[other])
        };
        (0..n * n).for_each(|ij| transposed.set(ij % n * n + ij / n, entry(ij)));
        let sizes = (0..n * n).map(|ij| entry(ij).hi.abs()).collect();
        Ok(Self { width: Width::in_use(), n, dim, transposed, sizes, cancel })
    }

    /// S over a step from z, which is given axis by axis and used up.
    pub fn over_step(&self, z: &mut Numbers, step: DoubleDouble) -> Result<Numbers, Stopped> {
        let halvings = self.halvings(step.hi);
        self.over_pieces(z, step, halvings, self.doublings(halvings))
    }

    /// How often to halve a step until ‖C‖h ≤ ⅛.
    fn halvings(&self, step: f64) -> u32 {
        let rows = self.sizes.chunks_exact(self.n).map(|row| row.iter().sum::<f64>());
        let (mut size, mut halvings) = (rows.fold(0.0, f64::max) * step, 0);
        while size > 0.125 && size.is_finite() {
            size *= 0.5;
            halvings += 1;
        }
        halvings
    }

    /// How many of the halvings to double back: with what takes the fewest operations.
    fn doublings(&self, halvings: u32) -> u32 {
        let (n, axes, terms) = (self.n as f64, self.dim as f64, 20.0);
        let piece = axes * n * terms * (2.0 * n + terms);
        let operations = |doublings: u32| {
            let pieces = piece * f64::from(halvings - doublings).exp2();
            let products = EXPONENTIAL as f64 + f64::from(halvings + 2 * doublings);
            pieces + if doublings > 0 { products * n * n * n } else { 0.0 }
        };
        (0..=halvings).min_by(|&a, &b| operations(a).total_cmp(&operations(b))).unwrap_or(0)
    }

    /// S by pieces of 2^−`halvings` of the step, `doublings` of the halvings doubled back.
    fn over_pieces(
        &self,
        z: &mut Numbers,
        step: DoubleDouble,
        halvings: u32,
        doublings: u32,
    ) -> Result<Numbers, Stopped> {
        let n = self.n;
        let h = (0..halvings).fold(step, |h, _| h.over(2.0));
        let mut s = Numbers::zeros(n * n)?;
        for _ in 0..1_u64 << (halvings - doublings) {
            self.add_piece(z, h, &mut s)?;
        }
        if doublings == 0 {
            return Ok(s);
        }
        // Eᵀ, E and what is between two products.
        let mut e = self.exponential(h)?;
        let (mut transposed, mut between) = (Numbers::zeros(n * n)?, Numbers::zeros(n * n)?);
        for i in 0..halvings {
            if i >= halvings - doublings {
                between.fill(DoubleDouble::ZERO);
                self.add_product(&mut between, &s, &e)?;
                (0..n * n).for_each(|ij| transposed.set(ij % n * n + ij / n, e.at(ij)));
                self.add_product(&mut s, &transposed, &between)?;
            }
            between.fill(DoubleDouble::ZERO);
            self.add_product(&mut between, &e, &e)?;
            std::mem::swap(&mut e, &mut between);
        }
        Ok(s)
    }

    /// Adds S over a piece, and moves z to its end.
    fn add_piece(&self, z: &mut Numbers, h: DoubleDouble, s: &mut Numbers) -> Result<(), Stopped> {
        let n = self.n;
        let fractions: Vec<DoubleDouble> = (1..=2 * TERMS).map(|j| DoubleDouble::exact(1.0).over(j as f64)).collect();
        let (mut terms, mut partners) = (Numbers::zeros(TERMS * n)?, Numbers::zeros(TERMS * n)?);
        for axis in 0..self.dim {
            let count = self.series(z, axis * n, h, &mut terms)?;
            partners.fill(DoubleDouble::ZERO);
            for j in 0..count {
                partners.add_combined(self.width, j * n, n, &fractions[j..j + count], &terms);
            }
            let mut own = [DoubleDouble::ZERO; TERMS];
            for i in 0..n {
                (0..count).for_each(|j| own[j] = terms.at(j * n + i).times(h));
                s.add_combined(self.width, i * n, n, &own[..count], &partners);
                z.set(axis * n + i, (0..count).rev().fold(DoubleDouble::ZERO, |sum, j| sum.plus(terms.at(j * n + i))));
            }
        }
        Ok(())
    }

    /// The terms (Ch)^j z / j! of z(h) along the axis that starts at `from`; how many there are.
    fn series(&self, z: &Numbers, from: usize, h: DoubleDouble, terms: &mut Numbers) -> Result<usize, Stopped> {
        let n = self.n;
        terms.fill(DoubleDouble::ZERO);
        (0..n).for_each(|i| terms.set(i, z.at(from + i)));
        // In (|C|h)^j |z| / j! nothing cancels, so that no later term can be larger again.
        let mut bound: Vec<f64> = terms.nearest()[..n].iter().map(|x| x.abs()).collect();
        let (mut most, mut next) = (bound.clone(), bound.clone());
        for j in 1..TERMS {
            self.cancel.check()?;
            for (row, out) in self.sizes.chunks_exact(n).zip(&mut next) {
                *out = row.iter().zip(&bound).map(|(c, b)| c * b).sum::<f64>() * (h.hi / j as f64);
            }
            std::mem::swap(&mut bound, &mut next);
            if bound.iter().zip(&most).all(|(b, most)| *b <= ROUNDING * most) {
                return Ok(j);
            }
            most.iter_mut().zip(&bound).for_each(|(most, b)| *most = most.max(*b));
            let factor = h.over(j as f64);
            let last: Vec<DoubleDouble> = (0..n).map(|i| terms.at((j - 1) * n + i).times(factor)).collect();
            terms.add_combined(self.width, j * n, n, &last, &self.transposed);
        }
        Ok(TERMS)
    }

    /// exp(Ch)ᵀ for ‖C‖h ≤ ⅛.
    fn exponential(&self, h: DoubleDouble) -> Result<Numbers, Stopped> {
        let n = self.n;
        let (mut term, mut next, mut sum) = (Numbers::zeros(n * n)?, Numbers::zeros(n * n)?, Numbers::zeros(n * n)?);
        for i in 0..n {
            term.set(i * n + i, DoubleDouble::exact(1.0));
            sum.set(i * n + i, DoubleDouble::exact(1.0));
        }
        for j in 1..EXPONENTIAL {
            next.fill(DoubleDouble::ZERO);
            self.add_product(&mut next, &term, &self.transposed)?;
            let factor = h.over(j as f64);
            for ij in 0..n * n {
                term.set(ij, next.at(ij).times(factor));
                sum.set(ij, sum.at(ij).plus(term.at(ij)));
            }
        }
        Ok(sum)
    }

    /// out += a b.
    fn add_product(&self, out: &mut Numbers, a: &Numbers, b: &Numbers) -> Result<(), Stopped> {
        let n = self.n;
        let mut row = vec![DoubleDouble::ZERO; n];
        for i in 0..n {
            self.cancel.check()?;
            (0..n).for_each(|j| row[j] = a.at(i * n + j));
            out.add_combined(self.width, i * n, n, &row, b);
        }
        Ok(())
    }
}

/// row S rowᵀ, which is ∫u² over the step of a player whose feedback is `row`.
pub(super) fn effort(s: &Numbers, row: &[f64]) -> Result<DoubleDouble, Stopped> {
    let n = row.len();
    let g: Vec<DoubleDouble> = row.iter().map(|&x| DoubleDouble::exact(x)).collect();
    let mut product = Numbers::zeros(n)?;
    product.add_combined(Width::in_use(), 0, n, &g, s);
    Ok((0..n).fold(DoubleDouble::ZERO, |sum, i| sum.plus_product(g[i], product.at(i))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// S of ż = Cz from z, which has one axis, over [0, 1].
    fn moments(c: [f64; 4], z: [f64; 2], doublings: Option<u32>) -> [f64; 4] {
        let cancel = CancelToken::new();
        // Feedback of two players, and an attacker that stays.
        let rows = [c[0], c[1], c[2], c[3], 0.0, 0.0];
        let motion = Moments::new(&rows, 2, 1, &cancel).expect("memory");
        let mut from = Numbers::zeros(2).expect("memory");
        (0..2).for_each(|i| from.set(i, DoubleDouble::exact(z[i])));
        let step = DoubleDouble::exact(1.0);
        let halvings = motion.halvings(1.0);
        let doublings = doublings.map_or(motion.doublings(halvings), |d| d.min(halvings));
        let s = motion.over_pieces(&mut from, step, halvings, doublings).expect("memory");
        [0, 1, 2, 3].map(|ij| s.at(ij).hi)
    }

    /// A Jordan block has a closed form: z = e^{λs} (x + sy, y). From slow to stiff, decaying or growing.
    #[test]
    fn a_jordan_block_is_integrated_exactly() {
        for rate in [-1e9_f64, -1e5, -3.0, -1e-3, 1e-3, 0.7, 30.0] {
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
            let (x, y) = (0.75, -2.0);
            let cross = x * y * integral(0) + y * y * integral(1);
            let first = x * x * integral(0) + 2.0 * x * y * integral(1) + y * y * integral(2);
            let expected = [first, cross, cross, y * y * integral(0)];
            for (found, wanted) in moments([rate, 1.0, 0.0, rate], [x, y], None).iter().zip(expected) {
                assert!((found - wanted).abs() <= 1e-14 * wanted.abs(), "λ = {rate}: {found:e}, {wanted:e}");
            }
        }
    }

    /// However much of a step is doubled, S is the same to the last digits of a double.
    #[test]
    fn pieces_and_doublings_give_one_result() {
        let c = [-40.0, 39.0, 17.0, -3.5];
        let one = moments(c, [1.0, -0.3], Some(0));
        for doublings in 1..=10 {
            for (found, wanted) in moments(c, [1.0, -0.3], Some(doublings)).iter().zip(one) {
                assert!((found - wanted).abs() <= f64::EPSILON * wanted.abs(), "{doublings}: {found:e}, {wanted:e}");
            }
        }
    }

    /// A spiral, ż = (λ + iω)(z − z_a) with an attacker that stays: |z|² grows by e^{2λs}, and z is at right angles to Jz.
    #[test]
    fn a_loop_that_turns_is_integrated_beside_jz() {
        let cancel = CancelToken::new();
        let (rate, turn) = (0.3_f64, 40.0);
        let motion = Moments::new(&[rate, turn, 0.0, 0.0], 1, 2, &cancel).expect("memory");
        // z = (3, 4), axis by axis with Jz = (−4, 3).
        let mut from = Numbers::zeros(4).expect("memory");
        [3.0, -4.0, 4.0, 3.0].into_iter().enumerate().for_each(|(i, x)| from.set(i, DoubleDouble::exact(x)));
        let s = motion.over_step(&mut from, DoubleDouble::exact(1.0)).expect("memory");
        let wanted = 25.0 * (2.0 * rate).exp_m1() / (2.0 * rate);
        for (ij, wanted) in [wanted, 0.0, 0.0, wanted].into_iter().enumerate() {
            assert!((s.at(ij).hi - wanted).abs() <= 1e-14 * 25.0, "{ij}: {:e}, {wanted:e}", s.at(ij).hi);
        }
    }

    /// Beside a mode that grows by e¹⁵ and is not in z, what decays is integrated to rounding.
    #[test]
    fn what_decays_beside_a_mode_that_grows_is_integrated_exactly() {
        // Its modes are 15 and −1, along (1, 1) and (1, −1): z along the second.
        let c = [7.0, 8.0, 8.0, 7.0];
        let wanted = 0.5 * (1.0 - (-2.0_f64).exp());
        for (ij, found) in moments(c, [1.0, -1.0], None).into_iter().enumerate() {
            let sign = if ij == 0 || ij == 3 { 1.0 } else { -1.0 };
            assert!((found - sign * wanted).abs() <= 4.0 * f64::EPSILON, "{found:e}, {wanted:e}");
        }
    }
}
