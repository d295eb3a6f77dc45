//! A hash table from keys of one word to slots.

/// Open addressing with linear probing, at most half full; slot 0 marks a free place.
#[derive(Debug, Default)]
pub struct OpenTable {
    places: Vec<(u64, u32)>,
    held: usize,
    shift: u32,
}

impl OpenTable {
    #[inline(always)]
    fn home(key: u64, shift: u32) -> usize {
        // Fibonacci hashing: the high bits of a product with 2⁶⁴/φ are well mixed.
        (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> shift) as usize
    }

    #[inline(always)]
    pub fn find(&self, key: u64) -> u32 {
        if self.places.is_empty() {
            return 0;
        }
        let mask = self.places.len() - 1;
        let mut at = Self::home(key, self.shift);
        loop {
            let (held, slot) = self.places[at & mask];
            if slot == 0 || held == key {
                return slot;
            }
            at += 1;
        }
    }

    pub fn insert(&mut self, key: u64, slot: u32) {
        self.held += 1;
        if 2 * (self.held + 1) > self.places.len() {
            let size = (2 * self.places.len()).max(16);
            let old = std::mem::replace(&mut self.places, vec![(0, 0); size]);
            self.shift = 64 - size.trailing_zeros();
            for (key, slot) in old.into_iter().filter(|&(_, slot)| slot != 0) {
                self.place(key, slot);
            }
        }
        self.place(key, slot);
    }

    pub fn clear(&mut self) {
        self.places.fill((0, 0));
        self.held = 0;
    }

    fn place(&mut self, key: u64, slot: u32) {
        let mask = self.places.len() - 1;
        let mut at = Self::home(key, self.shift);
        while self.places[at & mask].1 != 0 {
            at += 1;
        }
        self.places[at & mask] = (key, slot);
    }
}
