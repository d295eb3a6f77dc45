//! The transitions of one grid instant, by topology: what an ensemble reads at every step.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | exp(Cδ) | [`StepTable::matrices`] from `slot × stride` | by columns, each padded with zeros to [`padded`] rows |
//! | 𝒜 | the words of a topology | the key |
//!
//! Where an entry lies is its slot ([`super::index`]). Slot 0 is never a topology's: a lookup that gives 0 found
//! nothing.

use super::index::Index;
use crate::error::NoMemory;
use crate::memory::{append, reserve};
use crate::simd::prefetch;

/// Bytes of a cache line.
pub const LINE: usize = 64;
/// Slots of a direct index in one.
const DIRECT_LINE: usize = LINE / size_of::<u16>();
/// Numbers of a matrix in one.
const MATRIX_LINE: usize = LINE / size_of::<f64>();

/// What asks for memory here.
const WHAT: &str = "the table of transitions at one instant";

/// Rows of a stored column for matrices of `n` rows: whole vectors of four.
#[must_use]
pub fn padded(n: usize) -> usize {
    n.next_multiple_of(4)
}

/// The transitions of one instant.
#[derive(Debug)]
pub struct StepTable {
    index: Index,
    /// By canonical form: the slot of the first topology that has it.
    canonical_forms: Index,
    matrices: Vec<f64>,
    keys: Vec<u64>,
    bits: usize,
    stride: usize,
    /// Numbers before the first matrix.
    skip: usize,
}

impl StepTable {
    /// An empty table for N = `size` and `rows` constrained players.
    pub fn new(rows: usize, size: usize) -> Self {
        let bits = rows * size;
        let (index, canonical_forms) = (Index::new(bits, true), Index::new(bits, false));
        Self {
            index,
            canonical_forms,
            matrices: Vec::new(),
            keys: Vec::new(),
            bits,
            stride: size * padded(size),
            skip: 0,
        }
    }

    /// The slot of a topology's entry, 0 where there is none.
    #[inline(always)]
    pub fn find(&self, words: &[u64]) -> u32 {
        self.index.find(words)
    }

    /// The slot of a topology with this canonical form, 0 where there is none.
    pub fn find_canonical(&self, words: &[u64]) -> u32 {
        self.canonical_forms.find(words)
    }

    /// The slots by key of a table with at most [`DIRECT_BITS`](super::index::DIRECT_BITS) bits, for sweeps that know
    /// their size.
    #[inline(always)]
    pub fn direct(&self) -> &[u16] {
        match &self.index {
            Index::Direct(slots) => slots,
            _ => &[],
        }
    }

    /// All matrices, one every `stride` numbers, the first at the start of a cache line.
    #[inline(always)]
    pub fn matrices(&self) -> &[f64] {
        &self.matrices[self.skip..]
    }

    /// Cache lines that lookups read: the index of a direct table, then the matrices.
    #[inline(always)]
    pub fn lines(&self) -> usize {
        self.direct().len() / DIRECT_LINE + self.matrices().len().div_ceil(MATRIX_LINE)
    }

    /// Fetches one of these lines into the second cache.
    #[inline(always)]
    pub fn prefetch(&self, line: usize) {
        match line.checked_sub(self.direct().len() / DIRECT_LINE) {
            None => prefetch(self.direct(), line * DIRECT_LINE),
            Some(line) => prefetch(&self.matrices, self.skip + line * MATRIX_LINE),
        }
    }

    /// Entries held.
    pub fn len(&self) -> usize {
        self.keys.len() / self.bits.div_ceil(64)
    }

    /// The keys in the order of their slots, the first of slot 1.
    pub fn keys(&self) -> std::slice::ChunksExact<'_, u64> {
        self.keys.chunks_exact(self.bits.div_ceil(64))
    }

    /// The key in a slot.
    pub fn key(&self, slot: usize) -> &[u64] {
        let words = self.bits.div_ceil(64);
        &self.keys[(slot - 1) * words..][..words]
    }

    /// The matrix in a slot.
    pub fn matrix(&self, slot: usize) -> &[f64] {
        &self.matrices()[slot * self.stride..][..self.stride]
    }

    /// Bytes that one more entry takes, the table's own memory with the first; `shared` if its canonical form is
    /// listed.
    pub fn entry_bytes(&self, shared: bool) -> usize {
        let words = self.bits.div_ceil(64);
        let canonical_forms = if shared { self.canonical_forms.entry_bytes(self.bits) } else { 0 };
        // A vector that grows by doubling is up to half empty.
        2 * (size_of::<f64>() * self.stride + size_of::<u64>() * words)
            + self.index.entry_bytes(self.bits)
            + canonical_forms
    }

    /// Adds an entry that is not there yet, and its canonical form if that is listed.
    pub fn insert(&mut self, words: &[u64], canonical: Option<&[u64]>, matrix: &[f64]) -> Result<(), NoMemory> {
        debug_assert!(self.find(words) == 0 && matrix.len() == self.stride);
        if self.matrices.capacity() < self.matrices.len() + self.stride {
            self.grow()?;
        }
        let slot = self.matrices().len() / self.stride;
        append(WHAT, &mut self.keys, words)?;
        self.matrices.extend_from_slice(matrix);
        self.index.insert(words, slot, self.bits);
        if let Some(canonical) = canonical.filter(|canonical| self.canonical_forms.find(canonical) == 0) {
            self.canonical_forms.insert(canonical, slot, self.bits);
        }
        Ok(())
    }

    /// Doubles the room for matrices; slot 0 is there from the beginning.
    fn grow(&mut self) -> Result<(), NoMemory> {
        let held = self.matrices().len().max(self.stride);
        let most = MATRIX_LINE - 1;
        let mut larger = Vec::<f64>::new();
        reserve(WHAT, &mut larger, 2 * held + most)?;
        let skip = larger.as_ptr().align_offset(LINE).min(most);
        larger.resize(skip, 0.0);
        larger.extend_from_slice(self.matrices());
        larger.resize(skip + held, 0.0);
        (self.matrices, self.skip) = (larger, skip);
        Ok(())
    }

    /// Forgets every entry and keeps the memory.
    pub fn clear(&mut self) {
        self.matrices.truncate(self.skip + self.stride);
        self.index.clear(self.keys.chunks_exact(self.bits.div_ceil(64)));
        self.keys.clear();
        self.canonical_forms.clear(std::iter::empty());
    }
}
