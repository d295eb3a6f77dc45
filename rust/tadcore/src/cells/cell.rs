//! One cell on its way: every history that its starts may have, few at a time.
//!
//! Where an edge is open the enclosure forks, once for each network that there may be; enclosures that come close to each
//! other again become one. A cell ends where all have ended; its starts have one outcome if all that was possible is one.

use super::enclosure::{Enclosure, Half};
use super::guards::{Ends, MOST_NETWORKS, Radii, Seen, ends, scale};
use crate::simulation::Outcome;

/// Steps after which errors are put into an orthogonal frame.
const TURN: usize = 8;
/// Enclosures of one cell at one instant; beyond it the closest become one.
const MOST: usize = 16;
/// Enclosures become one where they lie no further apart than this part of their width …
const CLOSE: f64 = 0.25;
/// … or than this part of what one fork put between them.
const COMMUTED: f64 = 0.2;

/// Why a cell ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// Every start ends so.
    Proved(Outcome),
    /// More than one outcome is possible, or too many networks: smaller cells may tell.
    Open,
    /// Every start diverges.
    Diverges,
}

/// Where a cell begins: at the last instant at which there was one history.
#[derive(Debug, Clone)]
pub(super) struct Origin {
    pub(super) step: usize,
    pub(super) states: Enclosure,
    /// Squared distances of which [`scale`] tells.
    pub(super) limits: (f64, f64),
}

/// A cell that is being stepped.
pub(super) struct Cell {
    pub(super) half: Half,
    limits: (f64, f64),
    begin: usize,
    pub(super) histories: Vec<Enclosure>,
    found: Option<Outcome>,
    /// Where there was one history last, if there have been more.
    pub(super) origin: Option<Origin>,
    /// The largest distance that a fork put between two enclosures.
    fork: f64,
    /// Whether it may fork at all.
    forks: bool,
    /// Steps of single enclosures.
    pub(super) steps: u64,
}

/// Scratch of one worker.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    ends: Ends,
    /// The networks of each history.
    seen: Vec<Seen>,
    pub(super) words: Vec<u64>,
    next: Vec<Enclosure>,
    spare: Vec<Enclosure>,
}

impl Cell {
    pub(super) fn new(origin: &Origin, offset: [f64; 2], half: Half, forks: bool) -> Self {
        let states = if offset == [0.0; 2] { origin.states.clone() } else { origin.states.part(offset) };
        let limits = if origin.step == 0 { scale(&states, half) } else { origin.limits };
        let (begin, histories) = (origin.step, vec![states]);
        Self { half, limits, begin, histories, found: None, origin: None, fork: 0.0, forks, steps: 0 }
    }

    /// The instant from which on it is stepped.
    pub(super) fn begin(&self) -> usize {
        self.begin
    }

    /// Looks at the states at t_k, the last instant or not; how the cell ends, if it does now.
    pub(super) fn look(&mut self, k: usize, last: bool, radii: &Radii, s: &mut Scratch) -> Option<Fate> {
        s.seen.resize_with(MOST + 1, Seen::default);
        let (mut index, mut open) = (0, false);
        while index < self.histories.len() {
            let states = &self.histories[index];
            ends(states, self.half, radii, self.limits, &mut s.ends);
            if s.ends.far.1 && self.histories.len() == 1 && self.origin.is_none() {
                return Some(Fate::Diverges);
            }
            let timeout = last && !s.ends.over;
            if timeout {
                s.ends.possible.push(Outcome::Timeout);
            }
            // The past is told of before it is lost.
            if s.ends.far.0 || s.ends.possible.len() > usize::from(s.ends.over || last) {
                self.note(k);
            }
            if s.ends.far.0 {
                return Some(Fate::Open);
            }
            for &end in &s.ends.possible {
                match self.found {
                    Some(found) if found != end => {
                        self.note(k);
                        return Some(Fate::Open);
                    }
                    _ => self.found = Some(end),
                }
            }
            if s.ends.over || last {
                self.histories.swap_remove(index);
                continue;
            }
            let seen = &mut s.seen[index];
            seen.read(&self.histories[index], self.half, radii, &s.ends);
            open |= seen.count() > 1;
            if seen.count() > MOST_NETWORKS || (open && !self.forks) {
                self.note(k);
                return Some(Fate::Open);
            }
            index += 1;
        }
        if open {
            self.note(k);
        }
        match (self.histories.is_empty(), self.found) {
            (true, Some(found)) => Some(Fate::Proved(found)),
            _ => None,
        }
    }

    /// Keeps the states at t_k, from which the parts of the cell can go on, if nothing was open before.
    fn note(&mut self, k: usize) {
        if self.origin.is_none() {
            // Where it is noted there is one history still.
            self.origin = Some(Origin { step: k, states: self.histories[0].clone(), limits: self.limits });
        }
    }

    /// Calls `each` with the networks that [`Cell::look`] found, until one is refused.
    pub(super) fn networks(&self, s: &mut Scratch, mut each: impl FnMut(&[u64]) -> bool) -> bool {
        let Scratch { seen, words, .. } = s;
        for seen in &seen[..self.histories.len()] {
            for number in 0..seen.count() {
                seen.network(number, words);
                if !each(words) {
                    return false;
                }
            }
        }
        true
    }

    /// Moves every history from t_k on, once for each network that it may have.
    pub(super) fn step<'a>(&mut self, k: usize, s: &mut Scratch, matrix: impl Fn(&[u64]) -> &'a [f64]) {
        let Scratch { seen, words, next, spare, .. } = s;
        next.clear();
        for (states, seen) in self.histories.iter().zip(&*seen) {
            let first = next.len();
            for number in 0..seen.count() {
                seen.network(number, words);
                let mut to = spare
                    .pop()
                    .filter(|e| e.size == states.size)
                    .unwrap_or_else(|| Enclosure::new(states.size, states.rows));
                states.step(matrix(words), self.half, &mut to);
                next.push(to);
                self.steps += 1;
            }
            for other in first + 1..next.len() {
                self.fork = self.fork.max(next[first].gap(&next[other], self.half));
            }
        }
        spare.append(&mut self.histories);
        std::mem::swap(&mut self.histories, next);
        if self.histories.len() > 1 {
            self.unite(spare);
        }
        if (k + 1).is_multiple_of(TURN) {
            self.histories.iter_mut().for_each(Enclosure::turn);
        }
    }

    /// Makes one of those that are close to each other, and of the closest where they are too many.
    fn unite(&mut self, spare: &mut Vec<Enclosure>) {
        let mut close = COMMUTED * self.fork;
        for states in &self.histories {
            close = close.max(CLOSE * states.width(self.half));
        }
        loop {
            let mut nearest = (f64::INFINITY, 0, 0);
            for b in 1..self.histories.len() {
                for a in 0..b {
                    let gap = self.histories[a].gap(&self.histories[b], self.half);
                    if gap < nearest.0 {
                        nearest = (gap, a, b);
                    }
                }
            }
            let (gap, a, b) = nearest;
            if b == 0 || (gap > close && self.histories.len() <= MOST) {
                return;
            }
            let other = self.histories.swap_remove(b);
            self.histories[a].merge(&other, self.half);
            spare.push(other);
        }
    }
}
