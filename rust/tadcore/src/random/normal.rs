//! Normal numbers by inversion: Φ⁻¹(u) by the rational functions of Wichura, *Algorithm AS 241*, PPND16 (Applied
//! Statistics 37, 1988), to about 16 digits.
//!
//! One number, or many at once. The many take the middle part together; the tails, every seventh number, are listed and
//! taken together again. The logarithm is the `libm` crate's, written out so that the compiler does it side by side, and
//! bitwise equal to it.

#![allow(clippy::excessive_precision, reason = "the digits as published")]

use crate::simd::{Number, Simd};

/// A fraction of two polynomials of degree 7, highest power first.
type Fraction = [[f64; 8]; 2];

/// |u − ½| up to which the middle part holds.
const MIDDLE: f64 = 0.425;
/// In r² = 0.425² − (u − ½)².
const CENTRAL: Fraction = [
    [
        2.5090809287301226727e3,
        3.3430575583588128105e4,
        6.7265770927008700853e4,
        4.5921953931549871457e4,
        1.3731693765509461125e4,
        1.9715909503065514427e3,
        1.3314166789178437745e2,
        3.387132872796366608,
    ],
    [
        5.2264952788528545610e3,
        2.8729085735721942674e4,
        3.9307895800092710610e4,
        2.1213794301586595867e4,
        5.3941960214247511077e3,
        6.8718700749205790830e2,
        4.2313330701600911252e1,
        1.0,
    ],
];
/// In √(−ln p) − 1.6, up to 5.
const NEAR: Fraction = [
    [
        7.74545014278341407640e-4,
        2.27238449892691845833e-2,
        2.41780725177450611770e-1,
        1.27045825245236838258,
        3.64784832476320460504,
        5.76949722146069140550,
        4.63033784615654529590,
        1.42343711074968357734,
    ],
    [
        1.05075007164441684324e-9,
        5.47593808499534494600e-4,
        1.51986665636164571966e-2,
        1.48103976427480074590e-1,
        6.89767334985100004550e-1,
        1.67638483018380384940,
        2.05319162663775882187,
        1.0,
    ],
];
/// In √(−ln p) − 5, beyond.
const FAR: Fraction = [
    [
        2.01033439929228813265e-7,
        2.71155556874348757815e-5,
        1.24266094738807843860e-3,
        2.65321895265761230930e-2,
        2.96560571828504891230e-1,
        1.78482653991729133580,
        5.46378491116411436990,
        6.65790464350110377720,
    ],
    [
        2.04426310338993978564e-15,
        1.42151175831644588870e-7,
        1.84631831751005468180e-5,
        7.86869131145613259100e-4,
        1.48753612908506148525e-2,
        1.36929880922735805310e-1,
        5.99832206555887937690e-1,
        1.0,
    ],
];

/// A polynomial at r by Horner's rule.
#[inline(always)]
fn at(coefficients: &[f64; 8], r: f64) -> f64 {
    let mut sum = coefficients[0];
    for c in &coefficients[1..] {
        sum = sum * r + c;
    }
    sum
}

/// Φ⁻¹(½ + q), |q| ≤ 0.425.
#[inline(always)]
fn central(q: f64) -> f64 {
    let r = 0.180625 - q * q;
    at(&CENTRAL[0], r) * q / at(&CENTRAL[1], r)
}

/// −Φ⁻¹(p) of a small p from √(−ln p).
#[inline(always)]
fn tail(root: f64) -> f64 {
    let (fraction, r) = if root <= 5.0 { (&NEAR, root - 1.6) } else { (&FAR, root - 5.0) };
    at(&fraction[0], r) / at(&fraction[1], r)
}

/// Φ⁻¹(u), u in (0, 1).
#[must_use]
pub fn normal(u: f64) -> f64 {
    let q = u - 0.5;
    if q.abs() <= MIDDLE {
        return central(q);
    }
    let size = tail((-libm::log(if q < 0.0 { u } else { 1.0 - u })).sqrt());
    if q < 0.0 { -size } else { size }
}

/// ln p of a normal p below 1, by the operations of the `libm` crate (FreeBSD's `e_log.c`).
#[inline(always)]
pub fn ln(p: f64) -> f64 {
    const LN2: [f64; 2] = [6.931_471_803_691_238_164_90e-1, 1.908_214_929_270_587_700_02e-10];
    const G: [f64; 7] = [
        6.666_666_666_666_735_130e-1,
        3.999_999_999_940_941_908e-1,
        2.857_142_874_366_239_149e-1,
        2.222_219_843_214_978_396e-1,
        1.818_357_216_161_805_012e-1,
        1.531_383_769_920_937_332e-1,
        1.479_819_860_511_658_591e-1,
    ];
    /// The upper half of √½, and an exponent under which a double's last bits are a whole number.
    const ROOT: u64 = 0x3FE6_A09E << 32;
    const WHOLE: u64 = 1075 << 52;
    // p = 2^k (1 + f) with 1 + f between √½ and √2.
    let bits = p.to_bits() + ((1023 << 52) - ROOT);
    let k = f64::from_bits(bits >> 52 | WHOLE) - f64::from_bits(WHOLE | 1023);
    let f = f64::from_bits((bits & ((1 << 52) - 1)) + ROOT) - 1.0;
    let half = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (G[1] + w * (G[3] + w * G[5]));
    let odd = z * (G[0] + w * (G[2] + w * (G[4] + w * G[6])));
    s * (half + (odd + even)) + k * LN2[1] - half + f + k * LN2[0]
}

/// Where the fractions of the middle part leave off, and what is computed there instead.
pub struct Tails<const T: usize> {
    /// Those beyond, a bit for each number, eight in a byte.
    beyond: [u8; T],
    /// Which they are, one after another, and their p, then their sizes.
    which: [u16; T],
    sizes: [f64; T],
}

impl<const T: usize> Tails<T> {
    /// Room for `T` numbers.
    pub fn new() -> Self {
        Self { beyond: [0; T], which: [0; T], sizes: [0.0; T] }
    }
}

/// Fractions at several r: two chains of operations each, side by side, so that none waits for another.
#[inline(always)]
fn fractions<N: Number, const G: usize>([above, below]: &Fraction, r: [N; G]) -> [[N; G]; 2] {
    let (mut over, mut under) = ([N::splat(above[0]); G], [N::splat(below[0]); G]);
    for c in 1..8 {
        for g in 0..G {
            over[g] = over[g] * r[g] + N::splat(above[c]);
            under[g] = under[g] * r[g] + N::splat(below[c]);
        }
    }
    [over, under]
}

/// Eights whose middle parts are computed together.
const TOGETHER: usize = 2;
/// Tails that are computed together.
const TAILS: usize = 32;

/// `scale` times the [`normal`] of every number, multiples of 2⁻⁵³ as all that are drawn: 64, or a multiple of it.
#[inline(always)]
pub fn normals<V: Simd, const T: usize>(numbers: &[f64; T], scale: f64, to: &mut [f64; T], tails: &mut Tails<T>) {
    let (half, by) = (V::Eight::splat(0.5), V::Eight::splat(scale));
    for at in (0..T).step_by(8 * TOGETHER) {
        let mut r = [half; TOGETHER];
        for g in 0..TOGETHER {
            let q = V::Eight::load(&numbers[at + 8 * g..]) - half;
            tails.beyond[at / 8 + g] = V::Eight::bits(V::Eight::splat(MIDDLE).less(q.abs())) as u8;
            r[g] = V::Eight::splat(0.180625) - q * q;
        }
        let [over, under] = fractions(&CENTRAL, r);
        for g in 0..TOGETHER {
            let q = V::Eight::load(&numbers[at + 8 * g..]) - half;
            (by * (over[g] * q / under[g])).store(&mut to[at + 8 * g..]);
        }
    }
    let mut count = 0;
    for (word, eight) in tails.beyond[..T / 8].as_chunks().0.iter().enumerate() {
        let mut bits = u64::from_le_bytes(*eight);
        while bits != 0 {
            let at = 64 * word + bits.trailing_zeros() as usize;
            tails.which[count] = at as u16;
            // Exactly u, or 1 − u.
            tails.sizes[count] = 0.5 - (numbers[at] - 0.5).abs();
            count += 1;
            bits &= bits - 1;
        }
    }
    let padded = count.next_multiple_of(TAILS).min(T);
    tails.sizes[count..padded].fill(0.25);
    let mut far = 0;
    for sizes in tails.sizes[..padded].as_chunks_mut::<TAILS>().0 {
        for size in sizes.iter_mut() {
            *size = (-ln(*size)).sqrt();
        }
        for sizes in sizes.as_chunks_mut::<16>().0 {
            let root = [V::Eight::load(&sizes[..8]), V::Eight::load(&sizes[8..])];
            let five = V::Eight::splat(5.0);
            far |= V::Eight::bits(five.less(root[0].or_larger(root[1])));
            let [over, under] = fractions(&NEAR, [root[0] - V::Eight::splat(1.6), root[1] - V::Eight::splat(1.6)]);
            (by * (over[0] / under[0])).store(&mut sizes[..8]);
            (by * (over[1] / under[1])).store(&mut sizes[8..]);
        }
    }
    let which = &tails.which[..count];
    if far != 0 {
        for (&at, size) in which.iter().zip(&mut tails.sizes) {
            *size = scale * normal(numbers[usize::from(at)]).abs();
        }
    }
    for (&at, &size) in which.iter().zip(&tails.sizes) {
        // The fraction of the middle part has no pole out there, and the sign of u − ½.
        let x = &mut to[usize::from(at)];
        *x = size.copysign(*x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::uniform;
    use crate::simd::Baseline;

    /// Bits without a pattern, with short runs of zeros and ones at the top, so that tails are met.
    fn bits(i: u64) -> u64 {
        let mut z = i.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        match i % 4 {
            0 => z,
            1 => z >> (i / 4 % 52),
            2 => !(z >> (i / 4 % 52)),
            _ => z >> (i / 4 % 4),
        }
    }

    /// Quantiles to 25 digits from another program (`tests/reference/normal_quantiles.py`).
    #[test]
    fn quantiles_are_right_to_fifteen_digits() {
        let table = include_str!("../../../../tests/reference/normal_quantiles.json");
        let table: Vec<[String; 2]> = serde_json::from_str(table).expect("the table");
        assert!(table.len() > 40);
        for row in table {
            let [u, exact] = row.map(|digits| digits.parse::<f64>().expect("a number"));
            let found = normal(u);
            assert!((found - exact).abs() <= 1e-15 * exact.abs(), "{u}: {found} {exact}");
            assert_eq!(found, -normal(1.0 - u));
        }
    }

    #[test]
    fn many_at_once_are_bitwise_one_after_another() {
        let mut tails = Tails::new();
        for first in (0..1_000_000).step_by(128) {
            let numbers: [f64; 128] = std::array::from_fn(|t| uniform(bits(first + t as u64)));
            let mut all = [0.0; 128];
            normals::<Baseline, _>(&numbers, 1.0, &mut all, &mut tails);
            for (x, u) in all.into_iter().zip(numbers) {
                assert!(x.to_bits() == normal(u).to_bits(), "{u}: {x}");
            }
        }
        // All of one kind, the last one alone, and the ends.
        let drawn = |u: f64| (u * 2f64.powi(53)).round() * 2f64.powi(-53);
        for fill in [0.5, drawn(0.01), drawn(0.99), drawn(1e-15), uniform(0), uniform(u64::MAX)] {
            for last in [0.5, drawn(0.001), drawn(1e-14)] {
                let (mut numbers, mut all) = ([fill; 128], [0.0; 128]);
                numbers[127] = last;
                normals::<Baseline, _>(&numbers, 3.0, &mut all, &mut tails);
                assert_eq!(all[..127], [3.0 * normal(fill); 127]);
                assert_eq!(all[127], 3.0 * normal(last));
            }
        }
    }

    #[test]
    fn the_logarithm_is_the_crates() {
        for i in 0..1_000_000 {
            let u = uniform(bits(i));
            assert!(ln(u).to_bits() == libm::log(u).to_bits(), "{u}");
        }
    }

    /// Moments of a sample, and its share in the tails.
    #[test]
    fn a_sample_is_normal() {
        let mut sums = [0.0; 5];
        let count = 400_000;
        for i in 0..count {
            let x =
                normal(crate::random::Draws { seed: 5, trial: i }.uniforms(crate::random::Purpose::Sensor, 0, 0)[0]);
            (0..4).for_each(|e| sums[e] += x.powi(e as i32 + 1));
            sums[4] += f64::from(x > 2.0);
        }
        let share = 0.022_750_131_948_179_2;
        for (found, (mean, spread)) in
            sums.into_iter().zip([(0.0, 1.0), (1.0, 2.0), (0.0, 15.0), (3.0, 96.0), (share, share)])
        {
            assert!((found / count as f64 - mean).abs() <= 5.0 * f64::sqrt(spread / count as f64), "{sums:?}");
        }
    }
}
