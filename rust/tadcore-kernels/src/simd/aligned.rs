//! Memory in cache lines: numbers that begin with one, so that no register is loaded from two, and lines asked for ahead.

use std::ops::{Deref, DerefMut};

use crate::error::NoMemory;
use crate::memory;

/// Bytes of a cache line and of the widest register.
const LINE: usize = 64;

/// A slice of fixed length in memory of its own.
pub struct Aligned {
    numbers: Vec<f64>,
    start: usize,
    len: usize,
}

impl Aligned {
    pub fn zeros(what: &'static str, len: usize) -> Result<Self, NoMemory> {
        let spare = LINE / size_of::<f64>() - 1;
        let numbers: Vec<f64> = memory::zeros(what, len + spare)?;
        let start = numbers.as_ptr().align_offset(LINE).min(spare);
        Ok(Self { numbers, start, len })
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

/// Asks for the cache line of `data[i]`, if there is one, before it is needed.
#[inline(always)]
pub fn prefetch<T>(data: &[T], i: usize) {
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (data, i);
    #[cfg(target_arch = "x86_64")]
    if let Some(x) = data.get(i) {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        // SAFETY: SSE is part of x86-64; a prefetch reads nothing that the program sees, and the address is a reference's.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(std::ptr::from_ref(x).cast()) }
    }
}
