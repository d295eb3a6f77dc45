//! The stages of the search for one list of networks; [`super`] says what they are.

use super::candidate::{BACK, Candidate, Start};
use super::dispatch::{self, Dispatcher, Kind};
use super::moves::Moves;
use crate::error::Stopped;
use crate::simd::norm;
use crate::synthesis::newton::{Limits, Owner, Tasks, Workspace, advance};
use crate::synthesis::theta::Problem;

/// Size of the second part B at the start, relative to ‖F‖.
const FAR: f64 = 1.0;
/// Longest step in doubled gains, relative to ‖F‖: no jump from basin to basin.
pub(crate) const LONGEST_STEP: f64 = 0.3;
/// Relative gradient at which a descent in doubled gains has found its basin.
pub(crate) const BASIN: f64 = 1e-4;
/// Steps of a descent in doubled gains.
pub(crate) const DOUBLED_ITERATIONS: usize = 300;
/// Steps of a descent in single precision, and the relative gradient at which it is left undecided.
const SCREENING_ITERATIONS: usize = 60;
const FLAT: f64 = 1e-6;
/// Rounds of moves, each from the best point of the one before.
pub(super) const ROUNDS: usize = 4;

/// What a search needs besides its candidates.
pub(crate) struct Search<'a> {
    pub problem: &'a Problem,
    pub limits: Limits,
    pub dispatcher: &'a mut Dispatcher,
    pub tasks: &'a mut Tasks,
    /// A list to spare: descents in doubled gains when they are done, and those in single precision.
    pub doubled: &'a mut Tasks,
    /// Scratch of descents in large games.
    pub workspace: &'a mut Workspace<f64>,
}

impl Search<'_> {
    /// Finds the global minimum of Θ for every candidate.
    pub(crate) fn run(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        let limits = self.limits;
        self.limits.iterations = 0;
        self.first(Kind::Real, candidates, true)?;
        self.limits = limits;
        if candidates.iter().all(|candidate| candidate.complete) {
            return Ok(());
        }
        let faint = self.problem.faint();
        if faint.is_empty() {
            self.everywhere(candidates)?;
            return self.further(candidates);
        }
        self.settle(candidates, &faint)?;
        // Where S has no weight at all, what is flat stays so.
        if self.problem.unweighted().is_empty() { self.refine(candidates) } else { Ok(()) }
    }

    /// The stages from the first descent to the last, for the candidates that are not complete.
    pub(super) fn everywhere(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        if self.problem.is_large() {
            for candidate in candidates.iter_mut().filter(|candidate| !candidate.complete) {
                self.run_large(candidate)?;
            }
        } else {
            self.first(Kind::Certified, candidates, false)?;
            let open: Vec<usize> = (0..candidates.len()).filter(|&e| !candidates[e].certified).collect();
            if !open.is_empty() {
                self.restart(candidates, &open)?;
            }
        }
        self.polish(candidates)?;
        self.refine(candidates)
    }

    /// More for the candidates that are not certified: heavier weights where γ₁ dominates, then starts from fits.
    fn further(&mut self, candidates: &mut [Candidate]) -> Result<(), Stopped> {
        let open: Vec<usize> =
            (0..candidates.len()).filter(|&e| !candidates[e].complete && !candidates[e].certified).collect();
        if self.problem.is_large() || open.is_empty() {
            return Ok(());
        }
        let mut lower = self.search_heavier(candidates, &open)?;
        lower.extend(self.search_fits(candidates, &open)?);
        lower.sort_unstable();
        lower.dedup();
        // One by one: the others stay as they are.
        for e in lower {
            let candidate = std::slice::from_mut(&mut candidates[e]);
            self.polish(candidate)?;
            self.refine(candidate)?;
        }
        Ok(())
    }

    /// The same search of another Θ.
    pub(super) fn of<'b>(&'b mut self, problem: &'b Problem) -> Search<'b> {
        Search {
            problem,
            limits: self.limits,
            dispatcher: &mut *self.dispatcher,
            tasks: &mut *self.tasks,
            doubled: &mut *self.doubled,
            workspace: &mut *self.workspace,
        }
    }

    /// The first descent of the candidates that are `complete`, or of the others.
    fn first(&mut self, kind: Kind, candidates: &mut [Candidate], complete: bool) -> Result<(), Stopped> {
        self.begin(1);
        for (e, candidate) in candidates.iter().enumerate().filter(|(_, candidate)| candidate.complete == complete) {
            self.tasks.add(e, false, 0.0)?.copy_from_slice(&candidate.initial);
        }
        self.descend(kind, candidates)?;
        for task in 0..self.tasks.len() {
            let (candidate, reached) = (&mut candidates[self.tasks.owner(task)], self.tasks.reached(task));
            candidate.take(Start::Canonical, self.tasks.point(task), reached);
            candidate.iterations = reached.iterations;
            candidate.certified = complete || self.tasks.certified(task);
            candidate.note_quick();
        }
        Ok(())
    }

    /// Everything beyond the first descent, for the candidates `open`.
    fn restart(&mut self, candidates: &mut [Candidate], open: &[usize]) -> Result<(), Stopped> {
        let starts = self.double(candidates, open)?;
        self.finish(candidates, starts)?;
        let mut lower = open.to_vec();
        for _ in 0..ROUNDS {
            self.begin(1);
            for &e in &lower {
                let tasks = &mut *self.tasks;
                Moves::new(self.problem, &candidates[e]).list(|g| {
                    tasks.add(e, false, 0.0)?.copy_from_slice(g);
                    Ok(())
                })?;
            }
            let starts = vec![Start::Reversed; self.tasks.len()];
            lower = self.finish(candidates, starts)?;
            if lower.is_empty() {
                break;
            }
        }
        // Where a restart won there is another point to be tried for the certificate.
        let won: Vec<usize> = open.iter().copied().filter(|&e| candidates[e].start != Start::Canonical).collect();
        self.certify(candidates, &won)
    }

    /// Empties the list for points of as many copies of the gains.
    pub(super) fn begin(&mut self, copies: usize) {
        self.tasks.clear(self.problem.rows * self.problem.size, copies);
    }

    /// Makes the listed descents, without incumbents.
    pub(super) fn descend(&mut self, kind: Kind, candidates: &[Candidate]) -> Result<(), Stopped> {
        let owners: Vec<Owner> =
            candidates.iter().map(|e| Owner { variables: &e.variables, incumbent: None }).collect();
        self.dispatcher.run(kind, &self.problem.theta, self.tasks, &owners, self.limits)
    }

    /// Descends in doubled gains, and lists the restarts that come of it; the kind of start of each.
    pub(super) fn double(&mut self, candidates: &mut [Candidate], open: &[usize]) -> Result<Vec<Start>, Stopped> {
        let (n, m) = (self.problem.size, self.problem.rows);
        let scale = self.problem.theta.double.scale.fne;
        self.begin(2);
        for &e in open {
            for complex in [true, false] {
                far_start(&candidates[e], scale, self.tasks.add(e, complex, candidates[e].reached.scale)?);
            }
        }
        let limits = std::mem::replace(
            &mut self.limits,
            Limits {
                iterations: DOUBLED_ITERATIONS,
                tolerance: BASIN,
                acceptable: BASIN,
                longest: LONGEST_STEP * scale,
            },
        );
        self.descend(Kind::Doubled, candidates)?;
        self.limits = limits;

        let doubled = std::mem::replace(self.tasks, std::mem::take(self.doubled));
        self.begin(1);
        let mut starts = Vec::new();
        for task in 0..doubled.len() {
            let e = doubled.owner(task);
            candidates[e].iterations += doubled.reached(task).iterations;
            let start = if doubled.kind(task).0 { Start::Complex } else { Start::Stacked };
            let (a, b) = doubled.point(task).split_at(m * n);
            let signs = if norm(b) <= BACK * norm(a) { &[0.0][..] } else { &[0.0, 1.0, -1.0] };
            for &sign in signs {
                let point = self.tasks.add(e, false, 0.0)?;
                for (x, (a, b)) in point.iter_mut().zip(a.iter().zip(b)) {
                    *x = a + sign * b;
                }
                candidates[e].in_double(point);
                starts.push(start);
            }
        }
        *self.doubled = doubled;
        Ok(starts)
    }

    /// Drops the listed descents of which single precision already shows that they cannot get below the best point; the
    /// rest goes on from where it got.
    fn screen(&mut self, candidates: &mut [Candidate], starts: &mut Vec<Start>) -> Result<(), Stopped> {
        let (width, tasks, screened) = (self.problem.rows * self.problem.size, &mut *self.tasks, &mut *self.doubled);
        screened.clear(width, 1);
        for task in (0..tasks.len()).filter(|&task| candidates[tasks.owner(task)].quick) {
            screened.add(tasks.owner(task), false, 0.0)?.copy_from_slice(tasks.point(task));
        }
        let owners: Vec<Owner> = candidates.iter().map(Candidate::owner).collect();
        let limits = Limits { iterations: SCREENING_ITERATIONS, tolerance: FLAT, acceptable: FLAT, ..self.limits };
        self.dispatcher.run(Kind::Screening, &self.problem.theta, screened, &owners, limits)?;
        let mut next = 0..screened.len();
        let keep: Vec<bool> = (0..tasks.len())
            .map(|task| {
                let candidate = &mut candidates[tasks.owner(task)];
                let Some(descent) = candidate.quick.then(|| next.next()).flatten() else {
                    return true;
                };
                candidate.iterations += screened.reached(descent).iterations;
                let point = tasks.point_mut(task);
                point.copy_from_slice(screened.point(descent));
                candidate.in_double(point);
                !screened.pruned(descent)
            })
            .collect();
        tasks.retain(&keep);
        let mut keep = keep.iter();
        starts.retain(|_| *keep.next().unwrap_or(&true));
        Ok(())
    }

    /// Makes the listed descents and keeps what is lower; which candidates that changed.
    pub(super) fn finish(
        &mut self,
        candidates: &mut [Candidate],
        mut starts: Vec<Start>,
    ) -> Result<Vec<usize>, Stopped> {
        if dispatch::single(&self.problem.theta) {
            self.screen(candidates, &mut starts)?;
        }
        let owners: Vec<Owner> = candidates.iter().map(Candidate::owner).collect();
        self.dispatcher.run(Kind::Real, &self.problem.theta, self.tasks, &owners, self.limits)?;
        let mut lower = Vec::new();
        for (task, start) in starts.into_iter().enumerate() {
            let e = self.tasks.owner(task);
            if candidates[e].offer(start, self.tasks.point(task), self.tasks.reached(task)) && lower.last() != Some(&e)
            {
                lower.push(e);
            }
        }
        Ok(lower)
    }

    /// Tries the certificate at the best point of each of `which`.
    pub(crate) fn certify(&mut self, candidates: &mut [Candidate], which: &[usize]) -> Result<(), Stopped> {
        if which.is_empty() {
            return Ok(());
        }
        self.begin(1);
        for &e in which {
            self.tasks.add(e, false, 0.0)?.copy_from_slice(&candidates[e].g);
        }
        let limits = self.limits;
        self.limits.iterations = 0;
        self.descend(Kind::Certified, candidates)?;
        self.limits = limits;
        for task in 0..self.tasks.len() {
            candidates[self.tasks.owner(task)].certified = self.tasks.certified(task);
        }
        Ok(())
    }
}

/// Writes the canonical start with a second part B along the variables, in a fixed pattern as large as the gains F and
/// without symmetry: the golden angle spreads it.
pub(crate) fn far_start(candidate: &Candidate, scale: f64, out: &mut [f64]) {
    let (a, b) = out.split_at_mut(candidate.initial.len());
    a.copy_from_slice(&candidate.initial);
    let unknowns = candidate.variables.len();
    let size = FAR * scale / (unknowns as f64).sqrt();
    let pattern: Vec<f64> = (0..unknowns).map(|v| size * (1.0 + 2.399_963_229_728_653 * v as f64).cos()).collect();
    advance(b, &candidate.variables, &pattern);
}
