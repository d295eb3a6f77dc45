//! Double-double arithmetic: a number as the unevaluated sum hi + lo of two doubles, some 106 bits of it.
//!
//! What a sum or a product of doubles loses is a double itself and is found without error:
//! a + b = s + ((a − (s − t)) + (b − t)), s = fl(a + b), t = fl(s − a) (Knuth), and ab = p + fma(a, b, −p), p = fl(ab).
//! Sums and products of double-doubles keep these and are off by some 2⁻¹⁰⁴ of their parts (Dekker, *A floating-point
//! technique for extending the available precision*, 1971). All of it is IEEE arithmetic, so every processor and every
//! width of its vectors gives bitwise equal results.

use crate::error::NoMemory;
use crate::memory::zeros;
use crate::simd::{Width, dispatch};

use super::WHAT;

/// hi + lo, |lo| at most half a unit in the last place of hi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DoubleDouble {
    pub hi: f64,
    pub lo: f64,
}

/// a + b as its rounded value and what that lost.
#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let t = sum - a;
    (sum, (a - (sum - t)) + (b - t))
}

/// The sum of a large and a small number.
#[inline(always)]
fn normal(hi: f64, lo: f64) -> DoubleDouble {
    let sum = hi + lo;
    DoubleDouble { hi: sum, lo: lo - (sum - hi) }
}

impl DoubleDouble {
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// A double.
    pub fn exact(x: f64) -> Self {
        Self { hi: x, lo: 0.0 }
    }

    /// a − b, without error.
    pub fn difference(a: f64, b: f64) -> Self {
        let (hi, lo) = two_sum(a, -b);
        Self { hi, lo }
    }

    /// a / b.
    pub fn quotient(a: f64, b: f64) -> Self {
        Self::exact(a).over(b)
    }

    pub fn plus(self, other: Self) -> Self {
        let (sum, lost) = two_sum(self.hi, other.hi);
        let (low, lower) = two_sum(self.lo, other.lo);
        let once = normal(sum, lost + low);
        normal(once.hi, once.lo + lower)
    }

    /// self + a·b.
    #[inline(always)]
    pub fn plus_product(self, a: Self, b: Self) -> Self {
        let product = a.hi * b.hi;
        let rest = a.lo.mul_add(b.hi, a.hi.mul_add(b.lo, a.hi.mul_add(b.hi, -product)));
        let (sum, lost) = two_sum(self.hi, product);
        normal(sum, self.lo + (lost + rest))
    }

    pub fn times(self, other: Self) -> Self {
        Self::ZERO.plus_product(self, other)
    }

    /// self / x.
    pub fn over(self, x: f64) -> Self {
        let quotient = self.hi / x;
        let rest = (-quotient).mul_add(x, self.hi) + self.lo;
        normal(quotient, rest / x)
    }
}

/// Many of them: a vector, or a matrix row by row.
#[derive(Debug, Clone)]
pub(super) struct Numbers {
    hi: Vec<f64>,
    lo: Vec<f64>,
}

impl Numbers {
    pub fn zeros(len: usize) -> Result<Self, NoMemory> {
        Ok(Self { hi: zeros(WHAT, len)?, lo: zeros(WHAT, len)? })
    }

    pub fn at(&self, i: usize) -> DoubleDouble {
        DoubleDouble { hi: self.hi[i], lo: self.lo[i] }
    }

    pub fn set(&mut self, i: usize, x: DoubleDouble) {
        (self.hi[i], self.lo[i]) = (x.hi, x.lo);
    }

    pub fn fill(&mut self, x: DoubleDouble) {
        self.hi.fill(x.hi);
        self.lo.fill(x.lo);
    }

    /// The nearest doubles.
    pub fn nearest(&self) -> &[f64] {
        &self.hi
    }

    /// Adds Σ_k a_k b_k to the numbers from `start`, b_k the k-th `len` numbers of `b`.
    pub fn add_combined(&mut self, width: Width, start: usize, len: usize, a: &[DoubleDouble], b: &Self) {
        let (hi, lo) = (&mut self.hi[start..start + len], &mut self.lo[start..start + len]);
        combine(width, hi, lo, a, &b.hi[..a.len() * len], &b.lo[..a.len() * len]);
    }
}

dispatch! {
    fn combine<V>(hi: &mut [f64], lo: &mut [f64], a: &[DoubleDouble], b_hi: &[f64], b_lo: &[f64]) {
        let len = hi.len();
        let lo = &mut lo[..len];
        for (k, &a) in a.iter().enumerate() {
            let (b_hi, b_lo) = (&b_hi[k * len..][..len], &b_lo[k * len..][..len]);
            for i in 0..len {
                let sum = DoubleDouble { hi: hi[i], lo: lo[i] };
                let sum = sum.plus_product(a, DoubleDouble { hi: b_hi[i], lo: b_lo[i] });
                (hi[i], lo[i]) = (sum.hi, sum.lo);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(x: DoubleDouble) -> i128 {
        x.hi as i128 + x.lo as i128
    }

    fn of(x: i128) -> DoubleDouble {
        let hi = x as f64;
        DoubleDouble { hi, lo: (x - hi as i128) as f64 }
    }

    /// Whole numbers of 62 bits from a counter (SplitMix64), of either sign.
    fn drawn(i: u64) -> i128 {
        let x = i.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        i128::from((x ^ (x >> 31)) as i64 >> 1)
    }

    /// Sums and products of numbers that no double holds, beside whole numbers, to 2⁻¹⁰⁴ of their parts.
    #[test]
    fn whole_numbers_of_many_digits_come_out_exactly() {
        for i in 0..10_000 {
            let (a, b, c) = (drawn(3 * i), drawn(3 * i + 1), drawn(3 * i + 2) * drawn(i + 40_000));
            let error = |found: DoubleDouble, exact: i128, parts: i128| {
                let off = (whole(found) - exact).unsigned_abs();
                assert!(off <= 1 + (parts.unsigned_abs() >> 104), "{a} {b} {c}: {off}");
            };
            error(of(a).plus(of(b)), a + b, a.abs() + b.abs());
            error(of(a).times(of(b)), a * b, a * b);
            error(of(c).plus_product(of(a), of(b)), c + a * b, c.abs() + (a * b).abs());
            // c / a · a = c to two roundings, a a double.
            let a = (a >> 10) | 1;
            error(of(c).over(a as f64).times(of(a)), c, 2 * c);
            let (x, y) = (a as f64, (b >> 40) as f64);
            error(DoubleDouble::difference(x, y), a - (b >> 40), 0);
        }
    }

    /// Where the high parts cancel, the low ones add up without error.
    #[test]
    fn a_sum_of_low_parts_loses_nothing() {
        let (large, low, least) = (2.0_f64.powi(100), 2.0_f64.powi(40) + 1.0, 2.0_f64.powi(-20));
        let sum = DoubleDouble { hi: large, lo: low }.plus(DoubleDouble { hi: -large, lo: least });
        assert_eq!(sum, DoubleDouble { hi: low, lo: least });
    }

    /// Of any length, on every width that this processor has, with the bits of one number at a time.
    #[test]
    fn combinations_are_sums_of_products_on_every_width() {
        for len in 1..20 {
            let (mut start, mut b) = (Numbers::zeros(len).expect("memory"), Numbers::zeros(3 * len).expect("memory"));
            (0..len).for_each(|i| start.set(i, of(drawn(i as u64))));
            (0..3 * len).for_each(|i| b.set(i, of(drawn(100 + i as u64))));
            let a = [0, 1, 2].map(|k| of(drawn(200 + k)));
            for width in Width::all() {
                let mut found = start.clone();
                found.add_combined(width, 0, len, &a, &b);
                for i in 0..len {
                    let one = (0..3).fold(start.at(i), |sum, k| sum.plus_product(a[k], b.at(k * len + i)));
                    assert_eq!(found.at(i), one, "{width:?}");
                }
            }
        }
    }
}
