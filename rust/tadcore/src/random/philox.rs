//! Philox4x32-10, a random number as a function of a counter and a key (Salmon, Moraes, Dror and Shaw, *Parallel random
//! numbers: as easy as 1, 2, 3*, SC 2011).
//!
//! One counter, or the same for many trials: the rounds are multiplications of 32 bits and exclusive ors, on eight counters
//! side by side where registers are wide, in plain loops elsewhere.

use crate::simd::{Number, Simd};

/// Multipliers of the two halves of a round.
const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// What a round adds to the key: the golden ratio and √3 − 1.
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;
/// The number before 1.
const BELOW: f64 = 1.0 - f64::EPSILON / 2.0;
/// Eights of counters whose rounds are done side by side.
const TOGETHER: usize = 1;

/// The keys of all rounds.
fn schedule(key: [u32; 2]) -> [[u64; 2]; ROUNDS as usize] {
    let of = |round: usize, half: usize| u64::from(key[half].wrapping_add(WEYL[half].wrapping_mul(round as u32)));
    std::array::from_fn(|round| [of(round, 0), of(round, 1)])
}

/// Rounds on words of 32 bits in the low halves of words of 64: the high halves are not read, and not cleared.
#[inline(always)]
fn rounds(mut x: [u64; 4], keys: &[[u64; 2]]) -> [u64; 4] {
    for key in keys {
        let (p0, p1) = (MULTIPLIERS[0] * low(x[0]), MULTIPLIERS[1] * low(x[2]));
        x = [p1 >> 32 ^ x[1] ^ key[0], p1, p0 >> 32 ^ x[3] ^ key[1], p0];
    }
    x
}

/// Four words of 32 bits from a counter and a key.
#[must_use]
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    rounds(counter.map(u64::from), &schedule(key)).map(|word| word as u32)
}

/// A number in (0, 1) from 64 bits: the middle of one of 2⁵² equal intervals, w · 2⁻⁵² + 2⁻⁵³ of the upper 52 bits. Every
/// operation is exact, and so is 1 − u.
#[inline(always)]
#[must_use]
pub fn uniform(bits: u64) -> f64 {
    // 1 + w · 2⁻⁵², less 1 − 2⁻⁵³.
    f64::from_bits(1023 << 52 | bits >> 12) - BELOW
}

/// A of four words, and B.
#[inline(always)]
fn pair(words: [u64; 4]) -> [f64; 2] {
    [(words[1], words[0]), (words[3], words[2])].map(|(high, low)| uniform(high << 32 | self::low(low)))
}

/// A of many counters.
#[inline(always)]
pub fn first_uniforms<const T: usize>(counters: &[[u64; T]; 4], key: [u32; 2], a: &mut [f64; T]) {
    let keys = schedule(key);
    for t in 0..T {
        let words = rounds([counters[0][t], counters[1][t], counters[2][t], counters[3][t]], &keys);
        a[t] = uniform(words[1] << 32 | words[0] & 0xFFFF_FFFF);
    }
}

/// Counters whose third words differ, and sometimes their fourth ones: those of many trials at one index.
pub struct Counters<const T: usize> {
    keys: [[u64; 2]; ROUNDS as usize],
    first: u64,
    /// The third words, and what the first round makes of them.
    third: [u64; T],
    product: [u64; T],
    /// The fourth words, and whether they are all one.
    fourth: [u64; T],
    alike: bool,
    /// What the third round makes of the third words, for all second ones, and its upper half under that round's key.
    later: [[u64; T]; 2],
}

/// The lower half of a word.
#[inline(always)]
fn low(word: u64) -> u64 {
    word & 0xFFFF_FFFF
}

impl<const T: usize> Counters<T> {
    /// Of no trials yet.
    pub fn new(key: [u32; 2]) -> Self {
        let none = [0; T];
        let (keys, later) = (schedule(key), [none; 2]);
        Self { keys, first: 0, third: none, product: none, fourth: none, alike: true, later }
    }

    /// Those of trials, with this first word, and these bits in the fourth.
    #[inline(always)]
    pub fn set(&mut self, trials: &[u64; T], first: u32, bits: u32) {
        (self.first, self.alike) = (first.into(), true);
        let mut differ = 0;
        for t in 0..T {
            self.third[t] = low(trials[t]);
            self.product[t] = MULTIPLIERS[1] * self.third[t];
            self.fourth[t] = trials[t] >> 32 | u64::from(bits);
            differ |= self.fourth[t] ^ self.fourth[0];
        }
        self.alike = differ == 0;
        let [_, own, _] = self.own();
        for t in 0..T {
            let product = MULTIPLIERS[0] * low(self.product[t] ^ own);
            (self.later[0][t], self.later[1][t]) = (product, product >> 32 ^ self.keys[2][1]);
        }
    }

    /// What the first three rounds have in common for all, where the fourth words are one: what is mixed with the upper
    /// half of the second round's product, with the lower half of the first's, and with the third's.
    #[inline(always)]
    fn own(&self) -> [u64; 3] {
        let keys = &self.keys;
        let p = MULTIPLIERS[0] * self.first;
        let q = MULTIPLIERS[1] * low(p >> 32 ^ self.fourth[0] ^ keys[0][1]);
        [low(p) ^ keys[1][1], q >> 32 ^ keys[1][0], q ^ keys[2][0]]
    }

    /// A and B of all of them, with this second word.
    #[inline(always)]
    pub fn uniforms<V: Simd>(&self, second: u32, [a, b]: &mut [[f64; T]; 2]) {
        let second = u64::from(second);
        if V::PRODUCTS && self.alike {
            for at in (0..T).step_by(8 * TOGETHER) {
                self.eights::<V>(second, at, [&mut *a, &mut *b]);
            }
        } else {
            for t in 0..T {
                let counter = [self.first, second, self.third[t], self.fourth[t]];
                [a[t], b[t]] = pair(rounds(counter, &self.keys));
            }
        }
    }

    /// The same of some eights from one on: without what the first three rounds have in common for all.
    #[inline(always)]
    fn eights<V: Simd>(&self, second: u64, at: usize, to: [&mut [f64; T]; 2]) {
        let keys = &self.keys;
        let [two, _, three] = self.own();
        let own = [second ^ keys[0][0], two, three].map(V::all_keys);
        let by = MULTIPLIERS.map(V::all_keys);
        let eight = |words: &[u64; T], g: usize| V::load_keys(words[at + 8 * g..].first_chunk().unwrap_or(&[0; 8]));
        let mut x = [[V::no_keys(); 4]; TOGETHER];
        for (g, x) in x.iter_mut().enumerate() {
            let product = eight(&self.product, g);
            let one = V::product(by[0], V::differ(V::down::<32>(product), own[0]));
            x[1] = V::product(by[1], V::differ(V::down::<32>(one), own[1]));
            x[0] = V::differ(V::down::<32>(x[1]), own[2]);
            x[2] = V::differ(eight(&self.later[1], g), one);
            x[3] = eight(&self.later[0], g);
        }
        for key in &keys[3..9] {
            let key = key.map(V::all_keys);
            for x in &mut x {
                let (p0, p1) = (V::product(by[0], x[0]), V::product(by[1], x[2]));
                *x = [
                    V::differ(V::down::<32>(p1), V::differ(x[1], key[0])),
                    p1,
                    V::differ(V::down::<32>(p0), V::differ(x[3], key[1])),
                    p0,
                ];
            }
        }
        // The last round, whose words stand in a double's bits at once.
        for (half, to) in to.into_iter().enumerate() {
            let key = V::all_keys(keys[9][half] >> 12 | 1023 << 52);
            for (g, x) in x.iter().enumerate() {
                let words = V::swap(V::product(by[1 - half], x[2 - 2 * half]));
                let words = V::differ(words, V::both(x[1 + 2 * half], V::all_keys(0xFFFF_FFFF)));
                let number = V::numbers(V::differ(V::down::<12>(words), key)) - V::Eight::splat(BELOW);
                number.store(&mut to[at + 8 * g..]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Width, dispatch};

    dispatch! {
        /// A and B of trials, by one width.
        fn drawn<V>(trials: &[u64; 16], start: [u32; 2]) -> [[f64; 16]; 2] {
            let mut both = [[0.0; 16]; 2];
            let mut counters = Counters::new([5, 6]);
            counters.set(trials, start[0], 3 << 24);
            counters.uniforms::<V>(start[1], &mut both);
            both
        }
    }

    /// The answers that its authors publish with their library (Random123, `kat_vectors`): zeros, ones, digits of π.
    #[test]
    fn the_answers_of_its_authors() {
        let pi = [0x243F_6A88, 0x85A3_08D3, 0x1319_8A2E, 0x0370_7344];
        for (counter, key, expected) in [
            ([0; 4], [0; 2], [0x6627_E8D5, 0xE169_C58D, 0xBC57_AC4C, 0x9B00_DBD8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408F_276D, 0x41C8_3B0E, 0xA20B_C7C6, 0x6D54_51FD]),
            (pi, [0xA409_3822, 0x299F_31D0], [0xD16C_FE09, 0x94FD_CCEB, 0x5001_E420, 0x2412_6EA1]),
        ] {
            assert_eq!(philox(counter, key), expected);
        }
    }

    #[test]
    fn uniform_numbers_are_inside_and_symmetric() {
        assert_eq!(uniform(0), f64::EPSILON / 2.0);
        assert_eq!(uniform(u64::MAX), 1.0 - f64::EPSILON / 2.0);
        assert!(uniform(u64::MAX) < 1.0);
        for bits in [0, 1 << 12, 0x0123_4567_89AB_CDEF, 1 << 63, u64::MAX] {
            assert_eq!(uniform(bits) + uniform(!bits), 1.0);
            assert_eq!(uniform(bits), (bits >> 12) as f64 * 2f64.powi(-52) + 2f64.powi(-53));
        }
    }

    #[test]
    fn many_counters_are_one_after_another() {
        for (trials, start) in [(1, [9, 4]), (1 << 40, [u32::MAX, 77]), ((1 << 32) - 7, [0, u32::MAX])] {
            let trials: [u64; 16] = std::array::from_fn(|t| trials + (t * t) as u64);
            let mut first = [0.0; 16];
            let counters = [
                [start[0].into(); 16],
                [start[1].into(); 16],
                trials.map(|trial| trial & 0xFFFF_FFFF),
                trials.map(|trial| trial >> 32 | 3 << 24),
            ];
            first_uniforms(&counters, [5, 6], &mut first);
            for t in 0..16 {
                let last = [trials[t] as u32, (trials[t] >> 32) as u32 | 3 << 24];
                let w = philox([start[0], start[1], last[0], last[1]], [5, 6]).map(u64::from);
                let expected = [uniform(w[1] << 32 | w[0]), uniform(w[3] << 32 | w[2])];
                assert_eq!(first[t], expected[0]);
                for width in Width::all() {
                    assert_eq!(drawn(width, &trials, start).map(|numbers| numbers[t]), expected, "{width:?}");
                }
            }
        }
    }
}
