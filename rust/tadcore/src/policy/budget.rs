//! The bytes that a game's tables may hold together.

use std::sync::atomic::{AtomicUsize, Ordering};

/// A count of bytes with an upper bound, shared by all threads.
#[derive(Debug)]
pub(super) struct Budget {
    capacity: usize,
    used: AtomicUsize,
}

impl Budget {
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, used: AtomicUsize::new(0) }
    }

    /// Takes `bytes` if they are there.
    pub(super) fn take(&self, bytes: usize) -> bool {
        let enough = self.used.fetch_add(bytes, Ordering::Relaxed) + bytes <= self.capacity;
        if !enough {
            self.give(bytes);
        }
        enough
    }

    /// Gives `bytes` back.
    pub(super) fn give(&self, bytes: usize) {
        self.used.fetch_sub(bytes, Ordering::Relaxed);
    }

    pub(super) fn used(&self) -> usize {
        self.used.load(Ordering::Relaxed)
    }

    pub(super) fn capacity(&self) -> usize {
        self.capacity
    }
}
