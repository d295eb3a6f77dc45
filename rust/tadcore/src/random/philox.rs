//! Philox4x32-10, a random number as a function of a counter and a key (Salmon, Moraes, Dror and Shaw, *Parallel random
//! numbers: as easy as 1, 2, 3*, SC 2011).
//!
//! One counter, or the same for many trials: the rounds are multiplications of 32 bits and exclusive ors, which the
//! compiler does side by side where the loop is compiled for wide registers.

/// Multipliers of the two halves of a round.
const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// What a round adds to the key: the golden ratio and √3 − 1.
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// The keys of all rounds.
fn schedule(key: [u32; 2]) -> [[u64; 2]; ROUNDS as usize] {
    let of = |round: usize, half: usize| u64::from(key[half].wrapping_add(WEYL[half].wrapping_mul(round as u32)));
    std::array::from_fn(|round| [of(round, 0), of(round, 1)])
}

/// Rounds on words of 32 bits in the low halves of words of 64: the high halves are not read, and not cleared.
#[inline(always)]
fn rounds(mut x: [u64; 4], keys: &[[u64; 2]]) -> [u64; 4] {
    let low = |word: u64| word & 0xFFFF_FFFF;
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
    f64::from_bits(1023 << 52 | bits >> 12) - (1.0 - f64::EPSILON / 2.0)
}

/// A of four words, and B.
#[inline(always)]
fn pair(words: [u64; 4]) -> [f64; 2] {
    [(words[1], words[0]), (words[3], words[2])].map(|(high, low)| uniform(high << 32 | low & 0xFFFF_FFFF))
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

/// Counters whose third words differ, and sometimes their fourth ones: those of many trials.
pub struct Counters<const T: usize> {
    keys: [[u64; 2]; ROUNDS as usize],
    /// The third words, and what the first round makes of them.
    third: [u64; T],
    product: [u64; T],
    /// The fourth words.
    fourth: [u64; T],
    /// Whether those are all one.
    alike: bool,
}

impl<const T: usize> Counters<T> {
    /// Of trials.
    #[inline(always)]
    pub fn new(trials: &[u64; T], key: [u32; 2]) -> Self {
        let (mut third, mut product, mut fourth) = ([0; T], [0; T], [0; T]);
        let mut differ = 0;
        for t in 0..T {
            third[t] = trials[t] & 0xFFFF_FFFF;
            product[t] = MULTIPLIERS[1] * third[t];
            fourth[t] = trials[t] >> 32;
            differ |= fourth[t] ^ fourth[0];
        }
        Self { keys: schedule(key), third, product, fourth, alike: differ == 0 }
    }

    /// A and B of all of them, with these first two words, and these bits in the fourth.
    #[inline(always)]
    pub fn uniforms(&self, [first, second]: [u32; 2], bits: u32, a: &mut [f64; T], b: &mut [f64; T]) {
        let (first, second, bits) = (u64::from(first), u64::from(second), u64::from(bits));
        let keys = &self.keys;
        if !self.alike {
            for t in 0..T {
                [a[t], b[t]] = pair(rounds([first, second, self.third[t], self.fourth[t] | bits], keys));
            }
            return;
        }
        // Three rounds, of which what is the same for all is done once.
        let low = |word: u64| word & 0xFFFF_FFFF;
        let p = MULTIPLIERS[0] * first;
        let q = MULTIPLIERS[1] * low(p >> 32 ^ self.fourth[0] ^ bits ^ keys[0][1]);
        let own = [second ^ keys[0][0], q >> 32 ^ keys[1][0], low(p) ^ keys[1][1], q ^ keys[2][0]];
        for t in 0..T {
            let product = self.product[t];
            let one = MULTIPLIERS[0] * low(product >> 32 ^ own[0]);
            let (two, three) = (MULTIPLIERS[0] * low(product ^ own[1]), MULTIPLIERS[1] * low(one >> 32 ^ own[2]));
            let x = [three >> 32 ^ own[3], three, two >> 32 ^ one ^ keys[2][1], two];
            [a[t], b[t]] = pair(rounds(x, &keys[3..]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let (mut a, mut b, mut first) = ([0.0; 16], [0.0; 16], [0.0; 16]);
            Counters::new(&trials, [5, 6]).uniforms(start, 3 << 24, &mut a, &mut b);
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
                assert_eq!([a[t], b[t]], [uniform(w[1] << 32 | w[0]), uniform(w[3] << 32 | w[2])]);
                assert_eq!(first[t], a[t]);
            }
        }
    }
}
