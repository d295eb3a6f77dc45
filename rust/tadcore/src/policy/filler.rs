//! Solves the table entries that an ensemble misses at an instant, each once, however many threads ask for it.

use super::Policy;
use super::closed_loop::{self, FreeRows};
use super::exponential;
use super::step_table::{StepTable, padded};
use super::transitions::Claim;
use crate::cancel::CancelToken;
use crate::error::{NoMemory, Stopped};
use crate::memory::{grow, spare};
use crate::network::Topology;
use crate::synthesis::{Problem, SIDE_BY_SIDE_UP_TO, Synthesizer};

/// Entries that a thread claims and solves at once, side by side: enough to keep eight lanes full, and few enough for
/// other threads to have their share and for a cancellation to be noticed soon.
const GROUP: usize = 64;

/// What the entries of one instant have in common, and how many were solved.
struct Instant<'a> {
    policy: &'a Policy,
    problem: Problem,
    free: FreeRows,
    step: usize,
    solved: u64,
}

/// A topology that is wanted, its canonical form, and the order that leads there.
struct Wanted<'a> {
    topology: &'a Topology,
    canonical: Topology,
    order: Vec<usize>,
    edges: usize,
}

/// What a thread needs to solve entries: its solver and scratch memory.
#[derive(Debug, Default)]
pub(crate) struct Filler {
    solver: Synthesizer,
    closed_loop: Vec<f64>,
    square: Vec<f64>,
    row: Vec<f64>,
    padded: Vec<f64>,
}

impl Filler {
    /// Makes the entries of `missing` at an instant available: in the table, or in `local` where the budget is used up.
    /// Says how many this thread solved.
    pub(crate) fn fill(
        &mut self,
        policy: &Policy,
        step: usize,
        missing: &[Topology],
        local: &mut StepTable,
        cancel: &CancelToken,
    ) -> Result<u64, Stopped> {
        spare("the transitions at all instants")?;
        self.solver.watch(cancel);
        let claims = policy.transitions.claims(step);
        let (problem, free) = (policy.problem(step, cancel)?, policy.free_rows(step));
        let mut instant = Instant { policy, problem, free, step, solved: 0 };
        let wanted: Vec<Wanted> = missing
            .iter()
            .map(|topology| {
                let (canonical, order) = policy.classes.canonical(topology);
                let edges = canonical.edges();
                Wanted { topology, canonical, order, edges }
            })
            .collect();
        let mut unknown: Vec<&Wanted> = Vec::new();
        for wanted in &wanted {
            if !instant.supply(wanted, local, &mut self.padded)? {
                unknown.push(wanted);
            }
        }
        // Those with many unknowns first: the quick ones fill the lanes to the end.
        unknown.sort_unstable_by(|a, b| (b.edges, &b.canonical).cmp(&(a.edges, &a.canonical)));
        unknown.dedup_by(|a, b| a.canonical == b.canonical);
        let group = if policy.game.size() <= SIDE_BY_SIDE_UP_TO { GROUP } else { 1 };
        let group = unknown.len().div_ceil(unknown.len().div_ceil(group).max(1)).max(1);
        for group in unknown.chunks(group) {
            cancel.check()?;
            let claimed: Vec<(Claim, &Wanted)> =
                group.iter().filter_map(|wanted| Some((claims.claim(&wanted.canonical)?, *wanted))).collect();
            let mut mine: Vec<&Wanted> = Vec::new();
            for &(_, wanted) in &claimed {
                if !instant.supply(wanted, local, &mut self.padded)? {
                    mine.push(wanted);
                }
            }
            self.solve(&mut instant, &mine, local, cancel)?;
        }
        for wanted in &unknown {
            claims.wait(&wanted.canonical, cancel)?;
        }
        for wanted in &wanted {
            // Past the budget, or left by a thread that was cancelled.
            if !instant.supply(wanted, local, &mut self.padded)? {
                self.solve(&mut instant, &[wanted], local, cancel)?;
            }
        }
        Ok(instant.solved)
    }

    /// Solves entries of one instant together and stores them.
    fn solve(
        &mut self,
        instant: &mut Instant,
        wanted: &[&Wanted],
        local: &mut StepTable,
        cancel: &CancelToken,
    ) -> Result<(), Stopped> {
        instant.solved += wanted.len() as u64;
        let instant = &*instant;
        let (policy, n) = (instant.policy, instant.policy.game.size());
        let mut unknown = Vec::new();
        for &wanted in wanted {
            match policy.table.peek(instant.step, wanted.topology) {
                Some(known) => {
                    self.closed_loop.resize(n * n, 0.0);
                    closed_loop::matrix(&instant.free, &known.gains.rows, &mut self.closed_loop);
                    policy.transitions.note_rate(instant.step, closed_loop::norm(&self.closed_loop, n));
                    let none: Vec<usize> = (0..n).collect();
                    pad(&known.transition, &none, &mut self.padded)?;
                    instant.store(wanted, local, &self.padded)?;
                }
                None => unknown.push(wanted),
            }
        }
        grow(exponential::WHAT, &mut self.square, n * n, 0.0)?;
        grow(exponential::WHAT, &mut self.closed_loop, n * n, 0.0)?;
        self.row.resize(n, 0.0);
        let Self { solver, closed_loop, square, row, padded } = self;
        let (closed_loop, square) = (&mut closed_loop[..n * n], &mut square[..n * n]);
        let canonical_forms: Vec<Topology> = unknown.iter().map(|wanted| wanted.canonical.clone()).collect();
        policy.solve_forms(instant.step, &instant.problem, &canonical_forms, solver, cancel, |index, gains| {
            closed_loop::matrix(&instant.free, &gains.rows, closed_loop);
            policy.transitions.note_rate(instant.step, closed_loop::norm(closed_loop, n));
            let step = policy.game.grid().step();
            exponential::exponential(closed_loop, &instant.free.attacker, step, square, row, cancel)?;
            pad(square, &unknown[index].order, padded)?;
            Ok(instant.store(unknown[index], local, padded)?)
        })
    }
}

impl Instant<'_> {
    /// Makes an entry available that is there already, under its own name or another; says whether it is.
    fn supply(&self, wanted: &Wanted, local: &mut StepTable, matrix: &mut Vec<f64>) -> Result<bool, NoMemory> {
        let game = &self.policy.game;
        let table = self.policy.transitions.step_table(self.step);
        let words = wanted.topology.words();
        if table.find(words) != 0 || local.find(words) != 0 {
            return Ok(true);
        }
        let canonical = wanted.canonical.words();
        let (held, slot) = match (table.find_canonical(canonical), local.find_canonical(canonical)) {
            (0, 0) => return Ok(false),
            (0, slot) => (&*local, slot as usize),
            (slot, _) => (&*table, slot as usize),
        };
        let other = Topology::from_words(game.constrained(), game.size(), held.key(slot));
        let (from, rows) = (held.matrix(slot), padded(game.size()));
        let of = self.policy.classes.canonical(&other).1;
        matrix.clear();
        grow(exponential::WHAT, matrix, from.len(), 0.0)?;
        for (&j, &other_j) in wanted.order.iter().zip(&of) {
            for (&i, &other_i) in wanted.order.iter().zip(&of) {
                matrix[j * rows + i] = from[other_j * rows + other_i];
            }
        }
        drop(table);
        self.store(wanted, local, matrix)?;
        Ok(true)
    }

    /// Stores an entry in the table or, where the budget is used up, in `local`.
    fn store(&self, wanted: &Wanted, local: &mut StepTable, matrix: &[f64]) -> Result<(), NoMemory> {
        let words = wanted.topology.words();
        let canonical = self.policy.classes.any().then_some(wanted.canonical.words());
        if !self.policy.transitions.keep(self.step, words, canonical, matrix, &self.policy.budget) {
            local.insert(words, canonical, matrix)?;
        }
        Ok(())
    }
}

/// A row-major matrix of a relabelled game by columns under their own names, each padded with zeros.
fn pad(matrix: &[f64], order: &[usize], out: &mut Vec<f64>) -> Result<(), NoMemory> {
    let (n, rows) = (order.len(), padded(order.len()));
    out.clear();
    grow(exponential::WHAT, out, n * rows, 0.0)?;
    for (row, &i) in matrix.chunks_exact(n).zip(order) {
        for (&x, &j) in row.iter().zip(order) {
            out[j * rows + i] = x;
        }
    }
    Ok(())
}
