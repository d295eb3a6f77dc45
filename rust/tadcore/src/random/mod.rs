//! Random numbers that are a function of where they are used: what a seed gives to each trial, and to nothing else.
//!
//! Nothing is drawn in sequence. A number belongs to a place, (seed, trial, purpose, entity, index), so a trial's numbers
//! do not depend on other trials, threads or widths, and two studies with one seed share them wherever both ask.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | seed | the key: (seed mod 2³², seed div 2³²) | a study's |
//! | trial, < 2⁵⁶ | third word, and the low 24 bits of the fourth | a trial's number |
//! | purpose | the high 8 bits of the fourth word: [`Purpose`] | what for |
//! | entity, index | second and first word | whose; which flip or step |
//! | A, B | [`Draws::uniforms`] | two numbers in (0, 1) |
//! | ξ | [`normal`] | Φ⁻¹ of such a number |
//! | U, D | [`Chain`] | mean time up, mean time down of something that fails |
//!
//! Logarithms are those of the `libm` crate: the same bits on every platform.

mod chain;
mod normal;
mod philox;

pub use chain::{Begin, Chain, NEVER, Walk};
pub use normal::normal;
pub(crate) use normal::{Tails, ln, normals};
pub(crate) use philox::{Counters, first_uniforms};
pub use philox::{philox, uniform};

/// Trials that a seed has numbers for.
pub const TRIALS: u64 = 1 << 56;

/// What a number is drawn for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Failures of a sensor; entity: the player.
    Sensor,
    /// Failures of an edge; entity: its bit in the adjacency.
    Edge,
    /// Failures of a link; entity: (listener) · m + (speaker).
    Link,
    /// A disturbance; entity: the player. The pair of axes: 0 and 1 from A and B, then 2 and 3, …
    Disturbance(u8),
}

impl Purpose {
    fn code(self) -> u32 {
        match self {
            Self::Sensor => 1,
            Self::Edge => 2,
            Self::Link => 3,
            Self::Disturbance(pair) => 4 + u32::from(pair),
        }
    }

    /// Its bits in the fourth word.
    pub(crate) fn bits(self) -> u32 {
        self.code() << 24
    }
}

/// The numbers of one trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draws {
    /// The study's.
    pub seed: u64,
    /// The trial's number, below [`TRIALS`].
    pub trial: u64,
}

/// The key of a seed.
pub(crate) fn key(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}

impl Draws {
    /// A and B at one place.
    #[must_use]
    pub fn uniforms(&self, purpose: Purpose, entity: u32, index: u32) -> [f64; 2] {
        self.at(purpose.bits(), entity, index)
    }

    /// A at one place, by the bits of its purpose.
    pub(crate) fn first(&self, bits: u32, entity: u32, index: u32) -> f64 {
        self.at(bits, entity, index)[0]
    }

    fn at(&self, bits: u32, entity: u32, index: u32) -> [f64; 2] {
        let last = [self.trial as u32, bits | (self.trial >> 32) as u32];
        let words = philox([index, entity, last[0], last[1]], key(self.seed));
        [(words[1], words[0]), (words[3], words[2])].map(|(high, low)| uniform(u64::from(high) << 32 | u64::from(low)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_kept_apart() {
        let mut seen = std::collections::HashSet::new();
        for seed in [0, 1, 1 << 32, u64::MAX] {
            for trial in [0, 1, 1 << 32, (1 << 32) + 1, TRIALS - 1] {
                for purpose in
                    [Purpose::Sensor, Purpose::Edge, Purpose::Link, Purpose::Disturbance(0), Purpose::Disturbance(1)]
                {
                    for (entity, index) in [(0, 0), (0, 1), (1, 0), (u32::MAX, u32::MAX)] {
                        let ab = Draws { seed, trial }.uniforms(purpose, entity, index);
                        assert!(ab.iter().all(|u| *u > 0.0 && *u < 1.0 && seen.insert(u.to_bits())));
                    }
                }
            }
        }
        assert_eq!(seen.len(), 4 * 5 * 5 * 4 * 2);
    }

    /// Words of the counter as the docs give them.
    #[test]
    fn a_counter_is_laid_out_as_documented() {
        let (seed, trial) = (0x0123_4567_89AB_CDEF, 0x00FE_DCBA_9876_5432);
        let words = philox([7, 5, 0x9876_5432, 0x03FE_DCBA], [0x89AB_CDEF, 0x0123_4567]);
        let wide = |high: u32, low: u32| uniform(u64::from(high) << 32 | u64::from(low));
        let expected = [wide(words[1], words[0]), wide(words[3], words[2])];
        assert_eq!(Draws { seed, trial }.uniforms(Purpose::Link, 5, 7), expected);
        assert_eq!([Purpose::Disturbance(0), Purpose::Disturbance(1)].map(Purpose::code), [4, 5]);
    }
}
