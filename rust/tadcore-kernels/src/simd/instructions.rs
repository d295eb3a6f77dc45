//! The instructions of a width: how many numbers its registers hold, and what is not done lane by lane.

#[cfg(not(target_arch = "aarch64"))]
use super::group::Group;
use super::number::Number;

/// A width's instructions.
///
/// The methods of the wide ones are inlined into functions that are compiled for them, and reached only through a
/// [`Width`](super::Width) that the processor confirmed.
pub trait Simd: Copy {
    /// Four numbers.
    type Four: Number<Scalar = f64>;
    /// Eight numbers.
    type Eight: Number<Scalar = f64>;
    /// Eight keys of 64 bits.
    type Keys: Copy;
    /// A register of numbers, for problems side by side.
    type Double: Number<Scalar = f64>;
    /// The same in single precision.
    type Single: Number<Scalar = f32>;
    /// In single precision, as many as keep the larger matrices in the first cache.
    type Half: Number<Scalar = f32>;
    /// How many sums of eight numbers fit beside what goes into them: rows of a tile.
    const ROWS: usize;
    /// Whether loops are compiled for every size; where they are slow anyway, one version for all sizes will do.
    const SIZED: bool;
    /// Whether keys are multiplied in registers.
    const PRODUCTS: bool = false;

    /// Rows as columns.
    fn transpose(rows: [Self::Four; 4]) -> [Self::Four; 4];
    /// The first four of eight, and the others.
    fn halves(eight: Self::Eight) -> [Self::Four; 2];
    fn no_keys() -> Self::Keys;
    /// The keys with `bit` set in the lanes of a mask.
    fn set(keys: Self::Keys, bit: u64, lanes: <Self::Eight as Number>::Mask) -> Self::Keys;
    fn keys(keys: Self::Keys) -> [u64; 8];
    fn load_keys(keys: &[u64; 8]) -> Self::Keys;
    /// The low 16 bits of each key, four in a word.
    fn low(keys: Self::Keys) -> [u64; 2];
    /// The bits that are in both.
    #[inline(always)]
    fn both(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        let (keys, others) = (Self::keys(keys), Self::keys(others));
        Self::load_keys(&std::array::from_fn(|l| keys[l] & others[l]))
    }
    /// The same key eight times.
    #[inline(always)]
    fn all_keys(key: u64) -> Self::Keys {
        Self::load_keys(&[key; 8])
    }
    /// The bits that are in one of both alone.
    #[inline(always)]
    fn differ(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        let (keys, others) = (Self::keys(keys), Self::keys(others));
        Self::load_keys(&std::array::from_fn(|l| keys[l] ^ others[l]))
    }
    /// The keys without their lowest `BITS` bits, moved down.
    #[inline(always)]
    fn down<const BITS: u32>(keys: Self::Keys) -> Self::Keys {
        Self::load_keys(&Self::keys(keys).map(|key| key >> BITS))
    }
    /// The halves of each key, exchanged.
    #[inline(always)]
    fn swap(keys: Self::Keys) -> Self::Keys {
        Self::load_keys(&Self::keys(keys).map(|key| key.rotate_left(32)))
    }
    /// The products of the lower halves.
    #[inline(always)]
    fn product(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        let low = |key: u64| key & 0xFFFF_FFFF;
        let (keys, others) = (Self::keys(keys), Self::keys(others));
        Self::load_keys(&std::array::from_fn(|l| low(keys[l]) * low(others[l])))
    }
    /// The numbers whose bits these are.
    #[inline(always)]
    fn numbers(keys: Self::Keys) -> Self::Eight {
        Self::Eight::load(&Self::keys(keys).map(f64::from_bits))
    }
    /// What a table says of each key.
    #[inline(always)]
    fn entries(table: &Entries, keys: Self::Keys) -> Self::Keys {
        Self::load_keys(&Self::keys(keys).map(|key| u64::from(table.get(key))))
    }
}

/// A table of words of 16 bits by keys of so many bits; 0 where nothing is known.
pub struct Entries {
    /// One more than there are keys: wide instructions read 32 bits at a time.
    words: Vec<u16>,
    last: u64,
}

impl Entries {
    /// Nothing is known of any key of `bits` bits.
    #[must_use]
    pub fn new(bits: usize) -> Self {
        Self { words: vec![0; (1 << bits) + 1], last: (1 << bits) - 1 }
    }
    /// The largest key.
    #[inline(always)]
    pub fn last(&self) -> u64 {
        self.last
    }
    /// The words, one more than there are keys.
    #[inline(always)]
    pub fn words(&self) -> &[u16] {
        &self.words
    }
    /// The word of a key.
    #[inline(always)]
    pub fn get(&self, key: u64) -> u16 {
        self.words[(key & self.last) as usize]
    }
    /// Sets it.
    pub fn set(&mut self, key: u64, word: u16) {
        self.words[(key & self.last) as usize] = word;
    }
}

/// What the target guarantees: numbers one by one, or the registers of NEON.
#[derive(Debug, Clone, Copy)]
pub struct Baseline;

#[cfg(not(target_arch = "aarch64"))]
impl Simd for Baseline {
    type Four = Group<f64, 4>;
    type Eight = Group<f64, 8>;
    type Keys = [u64; 8];
    type Double = f64;
    type Single = f32;
    type Half = f32;
    const ROWS: usize = 4;
    const SIZED: bool = false;

    #[inline(always)]
    fn transpose(rows: [Group<f64, 4>; 4]) -> [Group<f64, 4>; 4] {
        std::array::from_fn(|c| Group(std::array::from_fn(|r| rows[r].0[c])))
    }
    #[inline(always)]
    fn halves(Group(eight): Group<f64, 8>) -> [Group<f64, 4>; 2] {
        std::array::from_fn(|h| Group(std::array::from_fn(|c| eight[4 * h + c])))
    }
    #[inline(always)]
    fn no_keys() -> [u64; 8] {
        [0; 8]
    }
    #[inline(always)]
    fn set(keys: [u64; 8], bit: u64, lanes: [bool; 8]) -> [u64; 8] {
        std::array::from_fn(|l| keys[l] | if lanes[l] { bit } else { 0 })
    }
    #[inline(always)]
    fn keys(keys: [u64; 8]) -> [u64; 8] {
        keys
    }
    #[inline(always)]
    fn load_keys(keys: &[u64; 8]) -> [u64; 8] {
        *keys
    }
    #[inline(always)]
    fn low(keys: [u64; 8]) -> [u64; 2] {
        low(keys)
    }
}

/// The low 16 bits of each key, four in a word.
#[inline(always)]
pub fn low(keys: [u64; 8]) -> [u64; 2] {
    [0, 4].map(|first| (0..4).fold(0, |word, l| word | (keys[first + l] & 0xFFFF) << (16 * l)))
}
