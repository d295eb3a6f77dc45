//! What a game has solved, and what becomes of it in a child of a fork.
//!
//! A fork copies the memory and the one thread that forks. A lock that another thread held stays held in the child, for
//! ever. So each process has a generation of its own: a child makes one, and takes over from its parent's what it can
//! see to be free, without waiting for anything.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};
use std::thread;
use std::time::Duration;

use tadcore::cancel::CancelToken;
use tadcore::error::{Cancelled, EquilibriumError};
use tadcore::game::Game;
use tadcore::policy::Policy;

/// How long a thread waits for another that solves the game before it looks at its cancel token again.
const PATIENCE: Duration = Duration::from_millis(5);

/// The policy of one process, and the generations of those forked from it.
pub(crate) struct Generation {
    process: u32,
    policy: Mutex<Option<Arc<Policy>>>,
    next: OnceLock<Box<Generation>>,
}

impl Generation {
    /// The generation of this process, with nothing solved.
    pub(crate) fn new() -> Self {
        Self::holding(None)
    }

    fn holding(policy: Option<Arc<Policy>>) -> Self {
        Self { process: std::process::id(), policy: Mutex::new(policy), next: OnceLock::new() }
    }

    /// The generation of this process: the last, or one after it.
    fn own(&self) -> &Self {
        let mut last = self;
        while let Some(next) = last.next.get() {
            last = next;
        }
        if last.process == std::process::id() {
            return last;
        }
        last.next.get_or_init(|| Box::new(Self::holding(last.left())))
    }

    /// What a parent has left that nobody holds.
    fn left(&self) -> Option<Arc<Policy>> {
        let held = match self.policy.try_lock() {
            Ok(held) => held,
            Err(TryLockError::Poisoned(held)) => held.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        let policy = held.as_ref()?;
        // Without memory for empty tables there is none for the equilibrium either: it is found out in time.
        if policy.is_idle() { Some(Arc::clone(policy)) } else { policy.afresh(&CancelToken::new()).ok().map(Arc::new) }
    }

    /// The policy if it is solved; without waiting for a thread that solves it.
    pub(crate) fn solved(&self) -> Option<Arc<Policy>> {
        match self.own().policy.try_lock() {
            Ok(held) => held.clone(),
            Err(TryLockError::Poisoned(held)) => held.into_inner().clone(),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// The policy, solved by the first who asks.
    pub(crate) fn solve(
        &self,
        game: &Game,
        table_bytes: usize,
        cancel: &CancelToken,
    ) -> Result<Arc<Policy>, EquilibriumError> {
        let mut held = self.own().wait(cancel)?;
        if let Some(policy) = &*held {
            return Ok(Arc::clone(policy));
        }
        let policy = Arc::new(Policy::new(game.clone(), table_bytes, cancel)?);
        *held = Some(Arc::clone(&policy));
        Ok(policy)
    }

    fn wait(&self, cancel: &CancelToken) -> Result<MutexGuard<'_, Option<Arc<Policy>>>, Cancelled> {
        loop {
            match self.policy.try_lock() {
                Ok(held) => return Ok(held),
                Err(TryLockError::Poisoned(held)) => return Ok(PoisonError::into_inner(held)),
                Err(TryLockError::WouldBlock) => {
                    cancel.check()?;
                    thread::sleep(PATIENCE);
                }
            }
        }
    }
}
