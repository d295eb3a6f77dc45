//! The index of one instant's table: from a topology to the slot of its entry.
//!
//! Up to [`DIRECT_BITS`] bits a key is an index itself (n ≤ 3 in I1, n ≤ 2 in I2): 8 KiB an instant, which stays in the
//! first cache while a whole chunk of trials passes. Up to 64 bits an open-addressing table, beyond a map of words.
//! Slot 0 stands for no entry.

use std::collections::HashMap;

use super::hash_table::OpenTable;

/// Bits of a topology up to which it is its own index.
pub const DIRECT_BITS: usize = 12;

/// Where the entry of a topology lies.
#[derive(Debug)]
pub enum Index {
    /// slot = `table[key]`; empty until the first entry.
    Direct(Vec<u16>),
    /// Keys up to 64 bits.
    Hashed(OpenTable),
    /// Keys of more words.
    Wide(HashMap<Box<[u64]>, u32>),
}

impl Index {
    /// An empty index for keys of `bits`, by the key itself where that is small.
    pub fn new(bits: usize, direct: bool) -> Self {
        match bits {
            0..=DIRECT_BITS if direct => Self::Direct(Vec::new()),
            0..=64 => Self::Hashed(OpenTable::default()),
            _ => Self::Wide(HashMap::new()),
        }
    }

    /// The slot of a key, 0 where there is none.
    #[inline(always)]
    pub fn find(&self, words: &[u64]) -> u32 {
        match self {
            Self::Direct(slots) => slots.get(words[0] as usize).map_or(0, |&slot| u32::from(slot)),
            Self::Hashed(table) => table.find(words[0]),
            Self::Wide(map) => map.get(words).copied().unwrap_or(0),
        }
    }

    pub fn insert(&mut self, words: &[u64], slot: usize, bits: usize) {
        match self {
            Self::Direct(slots) => {
                if slots.is_empty() {
                    slots.resize(1 << bits, 0);
                }
                slots[words[0] as usize] = slot as u16;
            }
            Self::Hashed(table) => table.insert(words[0], slot as u32),
            Self::Wide(map) => {
                map.insert(words.into(), slot as u32);
            }
        }
    }

    /// Forgets every key; `keys` are those held, which a direct index alone has to be told.
    pub fn clear<'a>(&mut self, keys: impl Iterator<Item = &'a [u64]>) {
        match self {
            Self::Direct(slots) => keys.for_each(|words| slots[words[0] as usize] = 0),
            Self::Hashed(table) => table.clear(),
            Self::Wide(map) => map.clear(),
        }
    }

    /// Bytes that one more key takes, the table's own memory with the first.
    pub fn entry_bytes(&self, bits: usize) -> usize {
        match self {
            Self::Direct(slots) if slots.is_empty() => size_of::<u16>() << bits,
            Self::Direct(_) => 0,
            Self::Hashed(_) => 4 * size_of::<(u64, u32)>(),
            Self::Wide(_) => 2 * (size_of::<(Box<[u64]>, u32)>() + 8 * bits.div_ceil(64)),
        }
    }
}
