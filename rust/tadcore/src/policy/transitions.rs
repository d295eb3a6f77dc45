//! The (step, topology) table of one-step transitions, shared by every chunk, thread and call on a game.
//!
//! One [`Shelf`] per grid instant behind its own lock. What is stored is a function of (step, topology) alone, so it
//! does not matter who computes an entry, nor whether it is kept. An entry is *claimed* before it is solved: threads
//! that meet at an instant share the missing entries among themselves instead of solving them twice. Past the byte
//! budget entries are not kept: each chunk then solves its own, for one step at a time.

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::time::Duration;

use super::budget::Budget;
use super::shelf::{Shelf, padded};
use super::{Policy, StepPolicy};
use crate::cancel::CancelToken;
use crate::error::Cancelled;
use crate::network::Topology;
use crate::synthesis::Synthesizer;

/// How long a thread waits for an entry that another one solves before it looks at its cancel token again.
const PATIENCE: Duration = Duration::from_millis(20);

/// Entries of one instant that a thread is solving right now.
#[derive(Debug, Default)]
struct Claims {
    held: Mutex<HashSet<Topology>>,
    released: Condvar,
}

/// A claim; dropping it, also by a panic or a cancellation, lets the others go on.
struct Claim<'a> {
    claims: &'a Claims,
    topology: &'a Topology,
}

impl Claims {
    fn lock(&self) -> MutexGuard<'_, HashSet<Topology>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn claim<'a>(&'a self, topology: &'a Topology) -> Option<Claim<'a>> {
        let free = self.lock().insert(topology.clone());
        free.then(|| Claim { claims: self, topology })
    }

    fn wait(&self, topology: &Topology, cancel: &CancelToken) -> Result<(), Cancelled> {
        let mut held = self.lock();
        while held.contains(topology) {
            cancel.check()?;
            held = self.released.wait_timeout(held, PATIENCE).unwrap_or_else(PoisonError::into_inner).0;
        }
        Ok(())
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        self.claims.lock().remove(self.topology);
        self.claims.released.notify_all();
    }
}

/// Transitions by grid instant and topology, within a byte budget.
#[derive(Debug)]
pub(crate) struct Transitions {
    shelves: Vec<RwLock<Shelf>>,
    claims: Vec<Claims>,
    pub(super) hits: AtomicU64,
    pub(super) misses: AtomicU64,
    pub(super) entries: AtomicUsize,
}

impl Transitions {
    pub(super) fn new(steps: usize, rows: usize, size: usize) -> Self {
        Self {
            shelves: (0..steps).map(|_| RwLock::new(Shelf::new(rows, size))).collect(),
            claims: (0..steps).map(|_| Claims::default()).collect(),
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
            entries: AtomicUsize::new(0),
        }
    }

    /// The shelf of an instant, for reading.
    pub(crate) fn shelf(&self, step: usize) -> RwLockReadGuard<'_, Shelf> {
        self.shelves[step].read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts the lookups of a chunk.
    pub(crate) fn count(&self, lookups: u64, misses: u64) {
        self.hits.fetch_add(lookups - misses, Ordering::Relaxed);
        self.misses.fetch_add(misses, Ordering::Relaxed);
    }

    /// Adds an entry unless it is there or the budget is used up; says whether it is there now.
    pub(super) fn keep(&self, step: usize, words: &[u64], matrix: &[f64], budget: &Budget) -> bool {
        let mut shelf = self.shelves[step].write().unwrap_or_else(PoisonError::into_inner);
        if shelf.find(words) != 0 {
            return true;
        }
        let kept = budget.take(shelf.entry_bytes());
        if kept {
            shelf.insert(words, matrix);
            self.entries.fetch_add(1, Ordering::Relaxed);
        }
        kept
    }
}

/// What a thread needs to solve entries.
#[derive(Debug, Default)]
pub(crate) struct Filler {
    solver: Synthesizer,
    closed_loop: Vec<f64>,
    square: Vec<f64>,
    row: Vec<f64>,
    padded: Vec<f64>,
}

impl Policy {
    /// Makes the entries of `missing` at an instant available: in the table, or in `local` where the budget is used up.
    /// Says how many this thread solved.
    pub(crate) fn fill(
        &self,
        step: usize,
        missing: &[Topology],
        local: &mut Shelf,
        filler: &mut Filler,
        cancel: &CancelToken,
    ) -> Result<u64, Cancelled> {
        let claims = &self.transitions.claims[step];
        let problem = self.problem(step);
        let free = self.free_rows(step);
        let mut solved = 0;
        let mut solve = |topology: &Topology, local: &mut Shelf| {
            solved += 1;
            match self.table.peek(step, topology) {
                Some(known) => filler.lay_out(&known),
                None => {
                    let gains = filler.solver.solve(&problem, topology, crate::synthesis::Options::default());
                    filler.square.resize(self.game.size().pow(2), 0.0);
                    filler.closed_loop.resize(self.game.size().pow(2), 0.0);
                    filler.row.resize(self.game.size(), 0.0);
                    super::closed_loop::matrix(&free, &gains.rows, &mut filler.closed_loop);
                    super::exponential::exponential(
                        &filler.closed_loop,
                        &free.attacker,
                        self.game.grid().step(),
                        &mut filler.square,
                        &mut filler.row,
                    );
                    pad(&filler.square, self.game.size(), &mut filler.padded);
                }
            }
            if !self.transitions.keep(step, topology.words(), &filler.padded, &self.budget) {
                local.insert(topology.words(), &filler.padded);
            }
        };
        let held = |topology: &Topology| self.transitions.shelf(step).find(topology.words()) != 0;
        for topology in missing {
            cancel.check()?;
            if let Some(claim) = claims.claim(topology) {
                if !held(topology) {
                    solve(topology, local);
                }
                drop(claim);
            }
        }
        for topology in missing {
            claims.wait(topology, cancel)?;
            // Past the budget, or left by a thread that was cancelled.
            if !held(topology) && local.find(topology.words()) == 0 {
                solve(topology, local);
            }
        }
        Ok(solved)
    }
}

impl Filler {
    fn lay_out(&mut self, known: &StepPolicy) {
        pad(&known.transition, known.attacker.len(), &mut self.padded);
    }
}

/// A row-major matrix by columns, each padded with zeros.
fn pad(matrix: &[f64], n: usize, out: &mut Vec<f64>) {
    let rows = padded(n);
    out.clear();
    out.resize(n * rows, 0.0);
    for (i, row) in matrix.chunks_exact(n).enumerate() {
        for (j, &x) in row.iter().enumerate() {
            out[j * rows + i] = x;
        }
    }
}
