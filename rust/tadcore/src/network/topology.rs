//! A visibility network as a set of bits, for any number of players.
//!
//! Bit i·N + j is entry (i, j) of the augmented adjacency matrix 𝒜 (eq:extadj): for j ≠ i "player i sees player j", for
//! j = i "player i sees the attacker". Rows are the players with limited observations (d₁…d_n; in I2 also τ).
//! Up to 64 bits lie inline, more (n ≥ 8) on the heap; no size is refused.

/// A visibility network: who sees whom at one instant.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Topology {
    rows: usize,
    size: usize,
    words: Words,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Words {
    Inline(u64),
    Heap(Box<[u64]>),
}

impl Topology {
    /// The empty network of `rows` constrained players among `size` = N.
    #[must_use]
    pub fn empty(rows: usize, size: usize) -> Self {
        let bits = rows * size;
        let words = if bits <= 64 { Words::Inline(0) } else { Words::Heap(vec![0; bits.div_ceil(64)].into()) };
        Self { rows, size, words }
    }

    /// The network in which every constrained player sees everyone.
    #[must_use]
    pub fn complete(rows: usize, size: usize) -> Self {
        Self::from_fn(rows, size, |_, _| true)
    }

    /// The network whose entry (i, j) is `seen(i, j)`.
    #[must_use]
    pub fn from_fn(rows: usize, size: usize, seen: impl Fn(usize, usize) -> bool) -> Self {
        let mut topology = Self::empty(rows, size);
        for i in 0..rows {
            for j in 0..size {
                if seen(i, j) {
                    topology.set(i, j);
                }
            }
        }
        topology
    }

    /// The network with the bits of `key`, for at most 64 entries.
    #[must_use]
    pub fn from_key(rows: usize, size: usize, key: u64) -> Self {
        debug_assert!(rows * size <= 64, "a key holds at most 64 entries");
        Self { rows, size, words: Words::Inline(key) }
    }

    /// The network with the bits of `words`, 64 a word.
    ///
    /// # Panics
    /// When `words` is not as long as [`Topology::words`] of that size (a programming error).
    #[must_use]
    pub fn from_words(rows: usize, size: usize, words: &[u64]) -> Self {
        let mut topology = Self::empty(rows, size);
        topology.words_mut().copy_from_slice(words);
        topology
    }

    /// The bits as one number, when there are at most 64.
    #[must_use]
    pub fn key(&self) -> Option<u64> {
        match self.words {
            Words::Inline(key) => Some(key),
            Words::Heap(_) => None,
        }
    }

    /// The bits, 64 a word.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        match &self.words {
            Words::Inline(word) => std::slice::from_ref(word),
            Words::Heap(words) => words,
        }
    }

    /// Constrained players.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// N.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Entry (i, j) of 𝒜.
    #[must_use]
    pub fn sees(&self, i: usize, j: usize) -> bool {
        let bit = i * self.size + j;
        self.words()[bit / 64] >> (bit % 64) & 1 == 1
    }

    /// Whether player i sees the attacker.
    #[must_use]
    pub fn sees_attacker(&self, i: usize) -> bool {
        self.sees(i, i)
    }

    /// Whether player i knows everything: it sees everyone.
    #[must_use]
    pub fn sees_all(&self, i: usize) -> bool {
        (0..self.size).all(|j| self.sees(i, j))
    }

    /// The network of the same players under other names: its player i is player `order`\[i] here.
    #[must_use]
    pub fn relabelled(&self, order: &[usize]) -> Self {
        let Words::Inline(word) = self.words else {
            return Self::from_fn(self.rows, self.size, |i, j| self.sees(order[i], order[j]));
        };
        let mut out = 0;
        for (i, &row) in order[..self.rows].iter().enumerate() {
            let seen = word >> (row * self.size);
            for (j, &other) in order[..self.size].iter().enumerate() {
                out |= (seen >> other & 1) << (i * self.size + j);
            }
        }
        Self { words: Words::Inline(out), ..*self }
    }

    /// Row i as a word, for N ≤ 64: bit j is entry (i, j).
    #[must_use]
    pub fn row(&self, i: usize) -> u64 {
        debug_assert!(self.size <= 64, "a word holds at most 64 entries");
        let (words, bit) = (self.words(), i * self.size);
        let (word, shift) = (bit / 64, bit % 64);
        let low = words[word] >> shift;
        let high = if shift + self.size > 64 { words[word + 1] << (64 - shift) } else { 0 };
        (low | high) & (u64::MAX >> (64 - self.size))
    }

    fn words_mut(&mut self) -> &mut [u64] {
        match &mut self.words {
            Words::Inline(word) => std::slice::from_mut(word),
            Words::Heap(words) => words,
        }
    }

    /// Sets entry (i, j) of 𝒜.
    pub fn set(&mut self, i: usize, j: usize) {
        let bit = i * self.size + j;
        self.words_mut()[bit / 64] |= 1 << (bit % 64);
    }

    /// Clears entry (i, j) of 𝒜.
    pub fn unset(&mut self, i: usize, j: usize) {
        let bit = i * self.size + j;
        self.words_mut()[bit / 64] &= !(1 << (bit % 64));
    }

    /// Keeps what is in `other`, too, which is of the same size.
    pub fn keep(&mut self, other: &Self) {
        self.words_mut().iter_mut().zip(other.words()).for_each(|(a, b)| *a &= b);
    }

    /// Forgets every edge.
    pub fn clear(&mut self) {
        self.words_mut().fill(0);
    }

    /// Whether everyone sees everyone.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.edges() == self.rows * self.size
    }

    /// Number of edges.
    #[must_use]
    pub fn edges(&self) -> usize {
        self.words().iter().map(|w| w.count_ones() as usize).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_any_size_are_kept_apart() {
        for (rows, size) in [(1, 2), (3, 4), (8, 8), (8, 9), (40, 41)] {
            for i in 0..rows {
                for j in 0..size {
                    let mut t = Topology::empty(rows, size);
                    t.set(i, j);
                    assert_eq!(t.edges(), 1);
                    assert!(t.sees(i, j));
                    assert!((0..rows).all(|r| t.row(r) == if r == i { 1 << j } else { 0 }));
                    let mut rest = Topology::complete(rows, size);
                    rest.unset(i, j);
                    assert_eq!(rest.edges(), rows * size - 1);
                    t.keep(&rest);
                    assert_eq!((t.edges(), rest.sees(i, j)), (0, false));
                }
            }
            assert!(Topology::complete(rows, size).is_complete());
        }
    }
}
