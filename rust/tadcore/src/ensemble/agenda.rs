//! What is due at which step: entries by step, put in once and taken out once.
//!
//! A step's entries lie together in pieces of a cache line, so that neither putting one in nor taking all out looks at what
//! is due at other steps; while one piece is worked on, the next is fetched.

use crate::simd::prefetch;

/// Entries of a piece.
const PIECE: usize = 7;
/// No piece.
const NONE: u32 = u32::MAX;

/// Something due, and what is to be known of it then.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Entry {
    pub(super) number: u32,
    pub(super) state: u32,
}

/// A cache line of entries.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Piece {
    entries: [Entry; PIECE],
    /// The piece before it, and how many entries it has.
    before: u32,
    filled: u32,
}

impl Piece {
    pub(super) fn entries(&self) -> &[Entry] {
        &self.entries[..self.filled as usize]
    }
}

/// The entries of every step.
pub(super) struct Agenda {
    /// The last piece of each step.
    steps: Vec<u32>,
    pieces: Vec<Piece>,
    /// The first piece that is free again.
    free: u32,
}

impl Agenda {
    /// Bytes for so many entries at once: pieces, of which one a step is not full, in a list that doubles.
    pub(super) fn bytes(entries: usize, steps: usize) -> usize {
        2 * size_of::<Piece>() * (entries / PIECE + steps.min(entries)) + size_of::<u32>() * steps
    }

    /// For the steps below `count`.
    pub(super) fn new(count: usize) -> Self {
        Self { steps: vec![NONE; count], pieces: Vec::new(), free: NONE }
    }

    /// Puts an entry in; what is due later than the last step never is.
    #[inline]
    pub(super) fn put(&mut self, step: usize, entry: Entry) {
        let Some(last) = self.steps.get_mut(step) else { return };
        if let Some(piece) = self.pieces.get_mut(*last as usize)
            && (piece.filled as usize) < PIECE
        {
            piece.entries[piece.filled as usize] = entry;
            piece.filled += 1;
            return;
        }
        let mut piece = Piece { entries: [Entry::default(); PIECE], before: *last, filled: 1 };
        piece.entries[0] = entry;
        if self.free == NONE {
            *last = self.pieces.len() as u32;
            self.pieces.push(piece);
        } else {
            *last = self.free;
            self.free = std::mem::replace(&mut self.pieces[*last as usize], piece).before;
        }
    }

    /// Takes out a piece of what is due at a step, as long as there is one.
    #[inline]
    pub(super) fn take(&mut self, step: usize) -> Option<Piece> {
        let last = self.steps[step];
        let taken = *self.pieces.get(last as usize)?;
        prefetch(&self.pieces, taken.before as usize);
        self.pieces[last as usize].before = self.free;
        self.free = last;
        self.steps[step] = taken.before;
        Some(taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries put in while others are taken out, up to many pieces a step: each comes out once, at its step.
    #[test]
    fn each_entry_comes_out_at_its_step() {
        let mut agenda = Agenda::new(50);
        let mut expected = vec![Vec::new(); 50];
        let mut number = 0;
        for step in 0..50 {
            for i in 0..(step * 7) % 90 {
                let due = step + 1 + (i * i + step) % 60;
                let entry = Entry { number, state: number ^ 77 };
                agenda.put(due, entry);
                if due < 50 {
                    expected[due].push(entry);
                }
                number += 1;
            }
            let mut out = Vec::new();
            while let Some(piece) = agenda.take(step) {
                out.extend_from_slice(piece.entries());
            }
            out.sort_unstable();
            assert_eq!(out, expected[step], "{step}");
        }
        // Pieces are used again: never more than were in use at once.
        assert!(agenda.pieces.len() < number as usize / PIECE);
        assert_eq!(size_of::<Piece>(), 64);
    }
}
