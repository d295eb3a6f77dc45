//! The policy: at grid instant t_k and under a topology, what every player does until t_{k+1}.
//!
//! $$z(t_{k+1}) = e^{C\delta}\, z(t_k), \qquad X_a(t_{k+1}) = X_a(t_k) + h_a \int_0^\delta e^{Cs}\,\mathrm{d}s\; z(t_k)$$
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | C | [`closed_loop::matrix`] | ż = C z with all feedback gains held at t_k (zero-order hold) |
//! | exp(Cδ) | [`StepPolicy::transition`] | z(t_{k+1}) = exp(Cδ) z(t_k) |
//! | h_a ∫exp(Cs)ds | [`StepPolicy::attacker`] | how far the attacker itself moves in the step |
//!
//! A [`Policy`] owns the game, its equilibrium and the table of everything computed so far; it is shared, by reference,
//! between all runs of the game, whatever their positions and radii.

mod anchors;
mod budget;
pub mod closed_loop;
pub mod exponential;
pub(crate) mod filler;
mod saved;
mod symmetry;
mod table;
pub(crate) mod transitions;
mod turning;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

pub use table::{DEFAULT_TABLE_BYTES, TableStats};
pub(crate) use tadcore_kernels::policy::step_table;
pub use turning::GainKind;

use crate::cancel::CancelToken;
use crate::error::{EquilibriumError, Stopped, TableError};
use crate::game::{Criterion, Game};
use crate::memory::{spare, zeros};
use crate::network::Topology;
use crate::riccati::{self, Equilibrium};
use crate::synthesis::{Gains, Options, Problem, Synthesizer};
use anchors::Anchors;
use budget::Budget;
use symmetry::SymmetryClasses;
use table::Table;
use transitions::Transitions;

/// The answer at one (step, topology).
#[derive(Debug, Clone, PartialEq)]
pub struct StepPolicy {
    /// The gains of the constrained players, and how they were found.
    pub gains: Gains,
    /// The squared residual norms of Θ, unweighted, in the order of γ.
    pub terms: Vec<f64>,
    /// exp(Cδ), N × N row-major; where gains turn, N × 2N: the rows for z of the matrix on z and Jz.
    pub transition: Vec<f64>,
    /// The attacker's displacement over the step is this row times z, or times z and Jz.
    pub attacker: Vec<f64>,
}

impl StepPolicy {
    fn bytes(&self) -> usize {
        let numbers = [&self.gains.rows, &self.gains.turn, &self.terms, &self.transition, &self.attacker];
        size_of::<Self>() + numbers.iter().map(|list| size_of_val(list.as_slice())).sum::<usize>()
    }
}

/// A game with its equilibrium and the table of its answers.
#[derive(Debug)]
pub struct Policy {
    game: Game,
    equilibrium: Arc<Equilibrium>,
    classes: SymmetryClasses,
    budget: Budget,
    anchors: Anchors,
    table: Table,
    /// The answers in gains that turn, where any were asked for.
    turning: OnceLock<Table>,
    transitions: Transitions,
}

impl Policy {
    /// Solves the Riccati equations of `game` and opens an empty table of at most `table_bytes`.
    ///
    /// # Errors
    /// [`EquilibriumError`] when the game has no equilibrium on [0, T], or the caller cancelled.
    pub fn new(game: Game, table_bytes: usize, cancel: &CancelToken) -> Result<Self, EquilibriumError> {
        let equilibrium = Arc::new(riccati::solve(&game, cancel)?);
        Ok(Self::with(game, equilibrium, table_bytes, true, cancel)?)
    }

    /// The same for one trial, which passes every instant once: where P varies no transition is kept.
    ///
    /// # Errors
    /// As [`Policy::new`].
    pub(crate) fn for_one(game: Game, table_bytes: usize, cancel: &CancelToken) -> Result<Self, EquilibriumError> {
        let equilibrium = Arc::new(riccati::solve(&game, cancel)?);
        let kept = equilibrium.is_constant();
        Ok(Self::with(game, equilibrium, table_bytes, kept, cancel)?)
    }

    /// The same game and equilibrium with empty tables.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory, or `cancel` was raised.
    pub fn afresh(&self, cancel: &CancelToken) -> Result<Self, Stopped> {
        Self::with(self.game.clone(), Arc::clone(&self.equilibrium), self.budget.capacity(), true, cancel)
    }

    /// Whether no thread is reading, writing or solving an entry. After a fork this is how a child finds out whether
    /// the tables can be used, or one of its parent's threads holds what nobody will ever give back.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.anchors.is_idle()
            && self.table.is_idle()
            && self.turning.get().is_none_or(Table::is_idle)
            && self.transitions.is_idle()
    }

    fn with(
        game: Game,
        equilibrium: Arc<Equilibrium>,
        table_bytes: usize,
        kept: bool,
        cancel: &CancelToken,
    ) -> Result<Self, Stopped> {
        // A constant P makes one instant of all.
        let steps = if equilibrium.is_constant() { 1 } else { game.grid().steps() };
        let instants = if equilibrium.is_constant() { 1 } else { steps + 1 };
        let (table, budget) = (Table::new(instants, cancel)?, Budget::new(table_bytes));
        let transitions = Transitions::new(steps, game.constrained(), game.size(), kept, cancel)?;
        let (classes, anchors) = (SymmetryClasses::of(&game), Anchors::of(&equilibrium, cancel)?);
        Ok(Self { game, equilibrium, classes, budget, anchors, table, turning: OnceLock::new(), transitions })
    }

    /// The game.
    #[must_use]
    pub fn game(&self) -> &Game {
        &self.game
    }

    /// Its equilibrium.
    #[must_use]
    pub fn equilibrium(&self) -> &Equilibrium {
        &self.equilibrium
    }

    /// What the tables have done so far: the answers kept for recorded runs and the transitions of ensembles.
    #[must_use]
    pub fn table(&self) -> TableStats {
        let transitions = &self.transitions;
        let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        TableStats {
            entries: self.table.entries() + self.turning.get().map_or(0, Table::entries) + transitions.entries(),
            hits: load(&self.table.hits) + load(&transitions.hits),
            misses: load(&self.table.misses) + load(&transitions.misses),
            bytes: self.budget.used(),
            capacity: self.budget.capacity(),
        }
    }

    /// The transitions, for ensembles.
    pub(crate) fn transitions(&self) -> &Transitions {
        &self.transitions
    }

    /// The price of team consistency at (step, topology): how much more Θ is where all who know everything play the
    /// equilibrium ([`Criterion::Component`]) than at the paper's minimum. Zero where nobody knows everything, or all do.
    ///
    /// The rows of the former are allowed to the latter: where the search finds them lower, nothing is paid.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn price(
        &self,
        step: usize,
        topology: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<f64, Stopped> {
        let whole = (0..topology.rows()).filter(|&i| topology.sees_all(i)).count();
        if whole == 0 || whole == topology.rows() {
            return Ok(0.0);
        }
        solver.watch(cancel);
        let (problem, canonical) = (self.problem(step, cancel)?, self.classes.canonical(topology).0);
        let mut theta = |criterion| -> Result<f64, Stopped> {
            Ok(solver.solve(&problem.clone().under(criterion), &canonical, Options::default())?.theta)
        };
        Ok((theta(Criterion::Component)? - theta(Criterion::Paper)?).max(0.0))
    }

    /// The synthesis problem at t_k.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn problem(&self, step: usize, cancel: &CancelToken) -> Result<Problem, Stopped> {
        Problem::new(&self.game, self.equilibrium.node(step), cancel)
    }

    /// The feedback rows of the players that see everything, at t_k.
    #[must_use]
    pub fn free_rows(&self, step: usize) -> closed_loop::FreeRows {
        closed_loop::free_rows(&self.game, self.equilibrium.node(step))
    }

    /// The answer at (step, topology), from the table or solved now.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn at(
        &self,
        step: usize,
        topology: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Arc<StepPolicy>, Stopped> {
        if let Some(found) = self.table.get(step, topology) {
            return Ok(found);
        }
        let entry = Arc::new(self.solve(step, topology, solver, cancel)?);
        self.table.keep(step, topology, &entry, &self.budget);
        Ok(entry)
    }

    /// The gains at (step, topology), without looking at the table: those of runs, or with `options` by any method at this
    /// instant alone.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for them, or `cancel` was raised.
    pub fn gains(
        &self,
        step: usize,
        topology: &Topology,
        options: Option<Options>,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Gains, Stopped> {
        let (canonical, order) = self.classes.canonical(topology);
        solver.watch(cancel);
        let problem = self.problem(step, cancel)?;
        let gains = match options {
            Some(options) => solver.solve(&problem, &canonical, options)?,
            None => self.solve_form(step, &problem, &canonical, solver, cancel)?,
        };
        Ok(Gains { rows: symmetry::back(&order, &gains.rows)?, ..gains })
    }

    /// The gains of one canonical form at t_k.
    fn solve_form(
        &self,
        step: usize,
        problem: &Problem,
        form: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<Gains, Stopped> {
        let mut found = None;
        self.solve_forms(step, problem, std::slice::from_ref(form), solver, cancel, |_, gains| {
            found = Some(gains.clone());
            Ok(())
        })?;
        Ok(found.unwrap_or_else(|| unreachable!("one network, one answer")))
    }

    /// Solves (step, topology) without looking at the table.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for it, or `cancel` was raised.
    pub fn solve(
        &self,
        step: usize,
        topology: &Topology,
        solver: &mut Synthesizer,
        cancel: &CancelToken,
    ) -> Result<StepPolicy, Stopped> {
        spare("the answers at all instants")?;
        let (canonical, order) = self.classes.canonical(topology);
        let n = self.game.size();
        solver.watch(cancel);
        let problem = self.problem(step, cancel)?;
        let gains = self.solve_form(step, &problem, &canonical, solver, cancel)?;
        let free = self.free_rows(step);
        let mut c = zeros(exponential::WHAT, n * n)?;
        closed_loop::matrix(&free, &gains.rows, &mut c);
        let rows = symmetry::back(&order, &gains.rows)?;
        let terms = problem.terms(self.equilibrium.node(step), &rows, cancel)?;
        let (mut transition, mut attacker) = (zeros(exponential::WHAT, n * n)?, vec![0.0; n]);
        let step = self.game.grid().step();
        exponential::exponential(&c, &free.attacker, step, &mut transition, &mut attacker, cancel)?;
        let mut own = vec![0.0; n];
        order.iter().zip(&attacker).for_each(|(&j, &x)| own[j] = x);
        Ok(StepPolicy {
            gains: Gains { rows, ..gains },
            terms,
            transition: symmetry::back(&order, &transition)?,
            attacker: own,
        })
    }

    /// The table of transitions as bytes.
    ///
    /// # Errors
    /// [`Stopped`] when there is no memory for them, or `cancel` was raised.
    pub fn save_transitions(&self, cancel: &CancelToken) -> Result<Vec<u8>, Stopped> {
        saved::write(&self.transitions, &self.game, cancel)
    }

    /// The bytes of the saved table that begins with these, so that its size is known before it is read.
    ///
    /// # Errors
    /// [`TableError`] for a beginning of no table, or of one that cannot be this game's.
    pub fn transitions_length(&self, start: &[u8]) -> Result<u64, TableError> {
        saved::length(start, &self.game, self.budget.capacity())
    }

    /// Adds the entries of a saved table, as far as the budget goes; says how many there are now.
    ///
    /// # Errors
    /// [`TableError`] for bytes that are no table, or one of another game, version or format; nothing is added then. Also
    /// when there is no memory for what they hold, or `cancel` was raised.
    pub fn load_transitions(&self, bytes: &[u8], cancel: &CancelToken) -> Result<usize, TableError> {
        let (rows, size) = (self.game.constrained(), self.game.size());
        saved::read(bytes, &self.game, self.budget.capacity(), cancel, |step, key, matrix| {
            let canonical =
                self.classes.any().then(|| self.classes.canonical(&Topology::from_words(rows, size, key)).0);
            self.transitions.note_rate(step, f64::INFINITY);
            self.transitions.keep(step, key, canonical.as_ref().map(Topology::words), matrix, &self.budget);
        })?;
        Ok(self.transitions.entries())
    }
}
