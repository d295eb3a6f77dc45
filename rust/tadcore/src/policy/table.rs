//! The answers of the policy by step and topology, gains and all: what recorded runs read, computed once.
//!
//! One map per grid instant behind its own lock, so that threads at different instants never meet. What is stored is a
//! function of (step, topology) alone: it does not matter who computes an entry, nor whether it is kept. Past the byte
//! budget entries are simply not kept.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock, TryLockError};

use super::StepPolicy;
use super::budget::Budget;
use super::transitions::each;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::network::Topology;

/// Bytes the tables of a game may hold unless told otherwise: 512 MiB, some two million transitions at n = 3.
pub const DEFAULT_TABLE_BYTES: usize = 512 << 20;

/// What a table has done so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TableStats {
    /// Entries held.
    pub entries: usize,
    /// Lookups that found their entry.
    pub hits: u64,
    /// Lookups that had to solve.
    pub misses: u64,
    /// Bytes held.
    pub bytes: usize,
    /// Bytes the table may hold.
    pub capacity: usize,
}

type StepAnswers = RwLock<HashMap<Topology, Arc<StepPolicy>>>;

/// Answers of the policy by grid instant and topology, within a byte budget.
#[derive(Debug)]
pub(super) struct Table {
    /// One for each instant; one in all where P is constant.
    instants: Vec<StepAnswers>,
    entries: AtomicUsize,
    pub(super) hits: AtomicU64,
    pub(super) misses: AtomicU64,
}

impl Table {
    pub(super) fn new(count: usize, cancel: &CancelToken) -> Result<Self, Stopped> {
        Ok(Self {
            instants: each(count, StepAnswers::default, cancel)?,
            entries: AtomicUsize::new(0),
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
        })
    }

    /// Of how many instants there are answers.
    pub(super) fn instants(&self) -> usize {
        self.instants.len()
    }

    fn instant(&self, step: usize) -> &StepAnswers {
        &self.instants[if self.instants.len() == 1 { 0 } else { step }]
    }

    /// The entry, if it is held.
    pub(super) fn get(&self, step: usize, topology: &Topology) -> Option<Arc<StepPolicy>> {
        let found = self.peek(step, topology);
        let counter = if found.is_some() { &self.hits } else { &self.misses };
        counter.fetch_add(1, Ordering::Relaxed);
        found
    }

    /// The entry, if it is held, without counting.
    pub(super) fn peek(&self, step: usize, topology: &Topology) -> Option<Arc<StepPolicy>> {
        self.instant(step).read().unwrap_or_else(PoisonError::into_inner).get(topology).cloned()
    }

    /// Keeps the entry if the budget allows.
    pub(super) fn keep(&self, step: usize, topology: &Topology, entry: &Arc<StepPolicy>, budget: &Budget) {
        let size = entry.bytes() + size_of_val(topology.words()) + size_of::<Topology>();
        if !budget.take(size) {
            return;
        }
        let mut answers = self.instant(step).write().unwrap_or_else(PoisonError::into_inner);
        if answers.insert(topology.clone(), Arc::clone(entry)).is_some() {
            budget.give(size);
        } else {
            self.entries.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether no thread holds an instant.
    pub(super) fn is_idle(&self) -> bool {
        self.instants.iter().all(|answers| !matches!(answers.try_write(), Err(TryLockError::WouldBlock)))
    }

    pub(super) fn entries(&self) -> usize {
        self.entries.load(Ordering::Relaxed)
    }
}
