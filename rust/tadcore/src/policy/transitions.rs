//! The (step, topology) table of one-step transitions, shared by every chunk, thread and call on a game.
//!
//! One [`StepTable`] per grid instant behind its own lock. What is stored is a function of (step, topology) alone, so
//! it does not matter who computes an entry, nor whether it is kept. An entry is *claimed* before it is solved: threads
//! that meet at an instant share the missing entries among themselves instead of solving them twice. Past the byte
//! budget entries are not kept: each chunk then solves its own, for one step at a time.

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, TryLockError};
use std::time::Duration;

use super::budget::Budget;
use super::step_table::StepTable;
use crate::cancel::CancelToken;
use crate::error::{Cancelled, Stopped};
use crate::memory::reserve;
use crate::network::Topology;

/// Something for each of `count` instants.
pub(super) fn each<T>(count: usize, make: impl Fn() -> T, cancel: &CancelToken) -> Result<Vec<T>, Stopped> {
    let mut all = Vec::new();
    reserve("the empty tables of all instants", &mut all, count)?;
    for k in 0..count {
        if k % 65_536 == 0 {
            cancel.check()?;
        }
        all.push(make());
    }
    Ok(all)
}

/// How long a thread waits for an entry that another one solves before it looks at its cancel token again.
const PATIENCE: Duration = Duration::from_millis(20);

/// Entries of one instant that a thread is solving right now.
#[derive(Debug, Default)]
pub(super) struct Claims {
    held: Mutex<Held>,
    released: Condvar,
}

#[derive(Debug, Default)]
struct Held {
    topologies: HashSet<Topology>,
    /// Threads that wait for one of them: to wake nobody is a call to the system too.
    waiting: usize,
}

/// A claim; dropping it, also by a panic or a cancellation, lets the others go on.
pub(super) struct Claim<'a> {
    claims: &'a Claims,
    topology: &'a Topology,
}

impl Claims {
    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn claim<'a>(&'a self, topology: &'a Topology) -> Option<Claim<'a>> {
        let free = self.lock().topologies.insert(topology.clone());
        free.then(|| Claim { claims: self, topology })
    }

    pub(super) fn wait(&self, topology: &Topology, cancel: &CancelToken) -> Result<(), Cancelled> {
        let mut held = self.lock();
        while held.topologies.contains(topology) {
            cancel.check()?;
            held.waiting += 1;
            held = self.released.wait_timeout(held, PATIENCE).unwrap_or_else(PoisonError::into_inner).0;
            held.waiting -= 1;
        }
        Ok(())
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        let mut held = self.claims.lock();
        held.topologies.remove(self.topology);
        if held.waiting > 0 {
            self.claims.released.notify_all();
        }
    }
}

/// Transitions by grid instant and topology, within a byte budget; by topology alone where P is constant.
#[derive(Debug)]
pub(crate) struct Transitions {
    tables: Vec<RwLock<StepTable>>,
    claims: Vec<Claims>,
    /// The largest ‖C‖ among the entries of each instant, as bits: their order is that of the numbers.
    rates: Vec<AtomicU64>,
    pub(super) hits: AtomicU64,
    pub(super) misses: AtomicU64,
    entries: AtomicUsize,
    /// Whether anything is kept: not where every instant is passed once.
    kept: bool,
}

/// The tables that one pass reads.
pub(crate) struct StepTables<'a> {
    pub now: RwLockReadGuard<'a, StepTable>,
    after: Option<RwLockReadGuard<'a, StepTable>>,
    next: bool,
}

impl StepTables<'_> {
    /// The table of the next instant, if it was asked for.
    pub(crate) fn next(&self) -> Option<&StepTable> {
        self.next.then(|| self.after.as_deref().unwrap_or(&self.now))
    }
}

impl Transitions {
    pub(super) fn new(
        steps: usize,
        rows: usize,
        size: usize,
        kept: bool,
        cancel: &CancelToken,
    ) -> Result<Self, Stopped> {
        let tables = if kept { steps } else { 1 };
        Ok(Self {
            tables: each(tables, || RwLock::new(StepTable::new(rows, size)), cancel)?,
            claims: each(tables, Claims::default, cancel)?,
            rates: each(steps, || AtomicU64::new(0), cancel)?,
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
            entries: AtomicUsize::new(0),
            kept,
        })
    }

    /// Where an instant's entries are.
    fn at(&self, step: usize) -> usize {
        if self.tables.len() == 1 { 0 } else { step }
    }

    /// The rate of an instant.
    fn rate_at(&self, step: usize) -> &AtomicU64 {
        &self.rates[if self.rates.len() == 1 { 0 } else { step }]
    }

    /// Instants that have tables of their own.
    pub(super) fn instants(&self) -> usize {
        self.tables.len()
    }

    /// The table of an instant, for reading.
    pub(crate) fn step_table(&self, step: usize) -> RwLockReadGuard<'_, StepTable> {
        self.tables[self.at(step)].read().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tables of an instant and, where it has one of its own, of the next: one lock is never held twice.
    pub(crate) fn step_tables(&self, step: usize, next: bool) -> StepTables<'_> {
        let own = next && self.at(step) != self.at(step + 1);
        let after = own.then(|| self.step_table(step + 1));
        StepTables { now: self.step_table(step), after, next }
    }

    /// The largest ‖C‖ among the entries of an instant, or more: infinite for entries from a file.
    pub(crate) fn rate(&self, step: usize) -> f64 {
        f64::from_bits(self.rate_at(step).load(Ordering::Relaxed))
    }

    /// Notes the ‖C‖ of an entry, at least 0.
    pub(super) fn note_rate(&self, step: usize, rate: f64) {
        self.rate_at(step).fetch_max(rate.to_bits(), Ordering::Relaxed);
    }

    /// What threads are solving at an instant.
    pub(super) fn claims(&self, step: usize) -> &Claims {
        &self.claims[self.at(step)]
    }

    /// Whether no thread holds an instant, and none solves an entry.
    pub(super) fn is_idle(&self) -> bool {
        let free = |table: &RwLock<StepTable>| !matches!(table.try_write(), Err(TryLockError::WouldBlock));
        let unclaimed = |claims: &Claims| match claims.held.try_lock() {
            Ok(held) => held.topologies.is_empty(),
            Err(TryLockError::Poisoned(held)) => held.into_inner().topologies.is_empty(),
            Err(TryLockError::WouldBlock) => false,
        };
        self.tables.iter().all(free) && self.claims.iter().all(unclaimed)
    }

    /// Entries held at all instants.
    pub(super) fn entries(&self) -> usize {
        self.entries.load(Ordering::Relaxed)
    }

    /// Counts the lookups of a chunk.
    pub(crate) fn count(&self, lookups: u64, misses: u64) {
        self.hits.fetch_add(lookups - misses, Ordering::Relaxed);
        self.misses.fetch_add(misses, Ordering::Relaxed);
    }

    /// Adds an entry unless it is there or the budget is used up; says whether it is there now.
    pub(super) fn keep(
        &self,
        step: usize,
        words: &[u64],
        canonical: Option<&[u64]>,
        matrix: &[f64],
        budget: &Budget,
    ) -> bool {
        if !self.kept {
            return false;
        }
        let mut table = self.tables[self.at(step)].write().unwrap_or_else(PoisonError::into_inner);
        if table.find(words) != 0 {
            return true;
        }
        let bytes = table.entry_bytes(canonical.is_some());
        if !budget.take(bytes) {
            return false;
        }
        // What the system has no memory for is beyond the budget, too.
        let kept = table.insert(words, canonical, matrix).is_ok();
        if kept {
            self.entries.fetch_add(1, Ordering::Relaxed);
        } else {
            budget.give(bytes);
        }
        kept
    }
}
