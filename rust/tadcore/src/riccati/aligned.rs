//! Numbers that begin with a cache line, so that no register is loaded from two lines.

use std::ops::{Deref, DerefMut};

/// Bytes of a cache line and of the widest register.
const LINE: usize = 64;

/// A slice of fixed length in memory of its own.
pub(super) struct Aligned {
    numbers: Vec<f64>,
    start: usize,
    len: usize,
}

impl Aligned {
    pub(super) fn zeros(len: usize) -> Self {
        let spare = LINE / size_of::<f64>() - 1;
        let numbers = vec![0.0; len + spare];
        let start = numbers.as_ptr().align_offset(LINE).min(spare);
        Self { numbers, start, len }
    }
}

impl Deref for Aligned {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.numbers[self.start..self.start + self.len]
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.start..self.start + self.len]
    }
}
