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

use super::Policy;
use super::budget::Budget;
use super::closed_loop::FreeRows;
use super::step_table::{Shelf, padded};
use crate::cancel::CancelToken;
use crate::error::Cancelled;
use crate::network::Topology;
use crate::synthesis::{Problem, SIDE_BY_SIDE_UP_TO, Synthesizer};

/// How long a thread waits for an entry that another one solves before it looks at its cancel token again.
const PATIENCE: Duration = Duration::from_millis(20);

/// Entries that a thread claims and solves at once, side by side: enough to keep eight lanes full, and few enough for
/// other threads to have their share and for a cancellation to be noticed soon.
const GROUP: usize = 64;

/// Entries of one instant that a thread is solving right now.
#[derive(Debug, Default)]
struct Claims {
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
struct Claim<'a> {
    claims: &'a Claims,
    topology: &'a Topology,
}

impl Claims {
    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn claim<'a>(&'a self, topology: &'a Topology) -> Option<Claim<'a>> {
        let free = self.lock().topologies.insert(topology.clone());
        free.then(|| Claim { claims: self, topology })
    }

    fn wait(&self, topology: &Topology, cancel: &CancelToken) -> Result<(), Cancelled> {
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
    pub(super) fn keep(
        &self,
        step: usize,
        words: &[u64],
        model: Option<&[u64]>,
        matrix: &[f64],
        budget: &Budget,
    ) -> bool {
        let mut shelf = self.shelves[step].write().unwrap_or_else(PoisonError::into_inner);
        if shelf.find(words) != 0 {
            return true;
        }
        let kept = budget.take(shelf.entry_bytes(model.is_some()));
        if kept {
            shelf.insert(words, model, matrix);
            self.entries.fetch_add(1, Ordering::Relaxed);
        }
        kept
    }
}

/// What the entries of one instant have in common, and how many were solved.
struct Instant {
    problem: Problem,
    free: FreeRows,
    step: usize,
    solved: u64,
}

/// A topology that is wanted, its model, and the order that leads there.
struct Wanted<'a> {
    topology: &'a Topology,
    model: Topology,
    order: Vec<usize>,
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
        let wanted: Vec<Wanted> = missing
            .iter()
            .map(|topology| {
                let (model, order) = self.kinds.model(topology);
                Wanted { topology, model, order }
            })
            .collect();
        let mut unknown: Vec<&Wanted> =
            wanted.iter().filter(|wanted| !self.supply(step, wanted, local, &mut filler.padded)).collect();
        // Those with many unknowns first: the quick ones fill the lanes to the end.
        unknown.sort_by(|a, b| (b.model.edges(), &b.model).cmp(&(a.model.edges(), &a.model)));
        unknown.dedup_by(|a, b| a.model == b.model);
        let group = if self.game.size() <= SIDE_BY_SIDE_UP_TO { GROUP } else { 1 };
        let group = unknown.len().div_ceil(unknown.len().div_ceil(group).max(1)).max(1);
        let mut instant = Instant { problem: self.problem(step), free: self.free_rows(step), step, solved: 0 };
        for group in unknown.chunks(group) {
            cancel.check()?;
            let claimed: Vec<(Claim, &Wanted)> =
                group.iter().filter_map(|wanted| Some((claims.claim(&wanted.model)?, *wanted))).collect();
            let mut mine: Vec<&Wanted> = claimed.iter().map(|&(_, wanted)| wanted).collect();
            mine.retain(|wanted| !self.supply(step, wanted, local, &mut filler.padded));
            self.solve_group(&mut instant, &mine, local, filler);
        }
        for wanted in &unknown {
            claims.wait(&wanted.model, cancel)?;
        }
        for wanted in &wanted {
            // Past the budget, or left by a thread that was cancelled.
            if !self.supply(step, wanted, local, &mut filler.padded) {
                self.solve_group(&mut instant, &[wanted], local, filler);
            }
        }
        Ok(instant.solved)
    }

    /// Makes an entry available that is there already, under its own name or another; says whether it is.
    fn supply(&self, step: usize, wanted: &Wanted, local: &mut Shelf, matrix: &mut Vec<f64>) -> bool {
        let shelf = self.transitions.shelf(step);
        let words = wanted.topology.words();
        if shelf.find(words) != 0 || local.find(words) != 0 {
            return true;
        }
        let model = wanted.model.words();
        let (held, slot) = match (shelf.find_model(model), local.find_model(model)) {
            (0, 0) => return false,
            (0, slot) => (&*local, slot as usize),
            (slot, _) => (&*shelf, slot as usize),
        };
        let other = Topology::from_words(self.game.constrained(), self.game.size(), held.key(slot));
        let (from, rows) = (held.matrix(slot), padded(self.game.size()));
        let of = self.kinds.model(&other).1;
        matrix.clear();
        matrix.resize(from.len(), 0.0);
        for (&j, &other_j) in wanted.order.iter().zip(&of) {
            for (&i, &other_i) in wanted.order.iter().zip(&of) {
                matrix[j * rows + i] = from[other_j * rows + other_i];
            }
        }
        drop(shelf);
        self.store(step, wanted.topology, &wanted.model, local, matrix);
        true
    }

    /// Stores an entry in the table or, where the budget is used up, in `local`.
    fn store(&self, step: usize, topology: &Topology, model: &Topology, local: &mut Shelf, matrix: &[f64]) {
        let model = self.kinds.some().then_some(model.words());
        if !self.transitions.keep(step, topology.words(), model, matrix, &self.budget) {
            local.insert(topology.words(), model, matrix);
        }
    }

    /// Solves entries of one instant together and stores them.
    fn solve_group(&self, instant: &mut Instant, wanted: &[&Wanted], local: &mut Shelf, filler: &mut Filler) {
        let (n, step) = (self.game.size(), instant.step);
        instant.solved += wanted.len() as u64;
        let mut unknown = Vec::new();
        for &wanted in wanted {
            match self.table.peek(step, wanted.topology) {
                Some(known) => {
                    let none: Vec<usize> = (0..n).collect();
                    pad(&known.transition, &none, &mut filler.padded);
                    self.store(step, wanted.topology, &wanted.model, local, &filler.padded);
                }
                None => unknown.push(wanted),
            }
        }
        filler.square.resize(n * n, 0.0);
        filler.closed_loop.resize(n * n, 0.0);
        filler.row.resize(n, 0.0);
        let Filler { solver, closed_loop, square, row, padded } = filler;
        let models: Vec<Topology> = unknown.iter().map(|wanted| wanted.model.clone()).collect();
        solver.solve_all(&instant.problem, &models, crate::synthesis::Options::default(), |index, gains| {
            super::closed_loop::matrix(&instant.free, &gains.rows, closed_loop);
            super::exponential::exponential(closed_loop, &instant.free.attacker, self.game.grid().step(), square, row);
            let Wanted { topology, model, order } = unknown[index];
            pad(square, order, padded);
            self.store(step, topology, model, local, padded);
        });
    }
}

/// A row-major matrix of a relabelled game by columns under their own names, each padded with zeros.
fn pad(matrix: &[f64], order: &[usize], out: &mut Vec<f64>) {
    let (n, rows) = (order.len(), padded(order.len()));
    out.clear();
    out.resize(n * rows, 0.0);
    for (row, &i) in matrix.chunks_exact(n).zip(order) {
        for (&x, &j) in row.iter().zip(order) {
            out[j * rows + i] = x;
        }
    }
}
