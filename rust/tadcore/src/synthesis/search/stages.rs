//! The stages of the search for one list of networks; [`super`] says what they are.

use super::candidate::{BACK, Entry, Look};
use super::dispatch::{self, Engine, Kind};
use crate::simd::norm;
use crate::synthesis::newton::{Limits, Owner, Tasks, advance, balance};
use crate::synthesis::theta::Problem;

/// Size of the second part B at the start, relative to ‖F‖.
const FAR: f64 = 1.0;
/// Longest step of a second or third look, relative to ‖F‖: no jump from basin to basin.
pub(crate) const LONGEST_STEP: f64 = 0.3;
/// Relative gradient at which a second or third look has found its basin.
pub(crate) const BASIN: f64 = 1e-4;
/// Steps of a second or third look.
pub(crate) const LOOK_ITERATIONS: usize = 300;
/// Steps of a descent in single precision, and the relative gradient at which it is left undecided.
const SCOUT_ITERATIONS: usize = 60;
const FLAT: f64 = 1e-6;
/// Constrained players up to which pairs of rows are reversed too; beyond, one row at a time.
const PAIRS_UP_TO: usize = 8;
/// Rounds of reversals, each from the best point of the one before.
const ROUNDS: usize = 4;
/// Iterations of the first descent up to which later ones may end early, back at the best point or unable to win: more
/// of them mean a narrow valley, whose floor is worth following to its end.
const QUICK: usize = 30;
/// Iterations, at most, after the tolerance is met in such a valley.
const POLISH: usize = 50;

/// What a search needs besides its entries.
pub(crate) struct Search<'a> {
    pub problem: &'a Problem,
    pub limits: Limits,
    pub engine: &'a mut Engine,
    pub tasks: &'a mut Tasks,
    /// A list to spare: descents in doubled gains when they are done, and those in single precision.
    pub doubled: &'a mut Tasks,
}

impl Search<'_> {
    /// Finds the global minimum of Θ for every entry.
    pub(crate) fn run(&mut self, entries: &mut [Entry]) {
        self.start(1);
        for (e, entry) in entries.iter().enumerate() {
            self.tasks.add(e, false, 0.0).copy_from_slice(&entry.start);
        }
        self.descend(Kind::Certified, entries);
        for (task, entry) in entries.iter_mut().enumerate() {
            let reached = self.tasks.reached(task);
            entry.take(Look::Canonical, self.tasks.point(task), reached);
            entry.iterations = reached.iterations;
            entry.certified = self.tasks.certified(task);
            entry.quick = entry.iterations <= QUICK;
        }
        let open: Vec<usize> = (0..entries.len()).filter(|&e| !entries[e].certified).collect();
        if !open.is_empty() {
            self.look_further(entries, &open);
        }
        self.polish(entries);
    }

    /// Everything beyond the first descent, for the entries `open`.
    fn look_further(&mut self, entries: &mut [Entry], open: &[usize]) {
        let looks = self.double(entries, open);
        self.finish(entries, looks);
        let mut lower = open.to_vec();
        for _ in 0..ROUNDS {
            self.start(1);
            for &e in &lower {
                self.reverse(e, &entries[e].g);
            }
            let looks = vec![Look::Reversed; self.tasks.len()];
            lower = self.finish(entries, looks);
            if lower.is_empty() {
                break;
            }
        }
        // Where a later look won there is another point to be tried for the certificate.
        let won: Vec<usize> = open.iter().copied().filter(|&e| entries[e].look != Look::Canonical).collect();
        self.certify(entries, &won);
    }

    /// In a narrow valley a gradient within the tolerance still leaves the gains uncertain: Newton goes on there for as
    /// long as the gradient falls.
    fn polish(&mut self, entries: &mut [Entry]) {
        self.start(1);
        for (e, entry) in entries.iter().enumerate().filter(|(_, entry)| !entry.quick) {
            self.tasks.add(e, false, 0.0).copy_from_slice(&entry.g);
        }
        if self.tasks.len() == 0 {
            return;
        }
        let limits = self.limits;
        self.limits = Limits { iterations: POLISH, tolerance: 0.0, ..limits };
        self.descend(Kind::Real, entries);
        self.limits = limits;
        for task in 0..self.tasks.len() {
            let (entry, reached) = (&mut entries[self.tasks.owner(task)], self.tasks.reached(task));
            entry.iterations += reached.iterations;
            if reached.gradient_norm < entry.reached.gradient_norm {
                entry.take(entry.look, self.tasks.point(task), reached);
            }
        }
    }

    /// Empties the list for points of as many copies of the gains.
    fn start(&mut self, copies: usize) {
        self.tasks.clear(self.problem.rows * self.problem.size, copies);
    }

    /// Makes the listed descents, without rivals.
    fn descend(&mut self, kind: Kind, entries: &[Entry]) {
        let owners: Vec<Owner> = entries.iter().map(|e| Owner { variables: &e.variables, rival: None }).collect();
        self.engine.run(kind, &self.problem.theta, self.tasks, &owners, self.limits);
    }

    /// Descends in doubled gains, and lists the starts that come of it and those without one row: the look of each.
    fn double(&mut self, entries: &mut [Entry], open: &[usize]) -> Vec<Look> {
        let (n, m) = (self.problem.size, self.problem.rows);
        let scale = self.problem.theta.double.scale.fne;
        self.start(2);
        for &e in open {
            for complex in [true, false] {
                far_start(&entries[e], scale, self.tasks.add(e, complex, entries[e].reached.scale));
            }
        }
        let limits = std::mem::replace(
            &mut self.limits,
            Limits { iterations: LOOK_ITERATIONS, tolerance: BASIN, acceptable: BASIN, longest: LONGEST_STEP * scale },
        );
        self.descend(Kind::Doubled, entries);
        self.limits = limits;

        let doubled = std::mem::replace(self.tasks, std::mem::take(self.doubled));
        self.start(1);
        let mut looks = Vec::new();
        for task in 0..doubled.len() {
            let e = doubled.owner(task);
            entries[e].iterations += doubled.reached(task).iterations;
            let look = if doubled.kind(task).0 { Look::Complex } else { Look::Stacked };
            let (a, b) = doubled.point(task).split_at(m * n);
            let signs = if norm(b) <= BACK * norm(a) { &[0.0][..] } else { &[0.0, 1.0, -1.0] };
            for &sign in signs {
                let point = self.tasks.add(e, false, 0.0);
                for (x, (a, b)) in point.iter_mut().zip(a.iter().zip(b)) {
                    *x = a + sign * b;
                }
                balance(point, &entries[e].variables);
                looks.push(look);
            }
            if look == Look::Stacked {
                for i in 0..m {
                    scale_rows(n, &entries[e].start, &[i], 0.0, self.tasks.add(e, false, 0.0));
                    looks.push(Look::Reversed);
                }
            }
        }
        *self.doubled = doubled;
        looks
    }

    /// Drops the listed descents of which single precision already shows that they cannot get below the best point; the
    /// rest goes on from where it got.
    fn scout(&mut self, entries: &mut [Entry], looks: &mut Vec<Look>) {
        let (width, tasks, scouts) = (self.problem.rows * self.problem.size, &mut *self.tasks, &mut *self.doubled);
        scouts.clear(width, 1);
        for task in (0..tasks.len()).filter(|&task| entries[tasks.owner(task)].quick) {
            scouts.add(tasks.owner(task), false, 0.0).copy_from_slice(tasks.point(task));
        }
        let owners: Vec<Owner> = entries.iter().map(Entry::owner).collect();
        let limits = Limits { iterations: SCOUT_ITERATIONS, tolerance: FLAT, acceptable: FLAT, ..self.limits };
        self.engine.run(Kind::Scout, &self.problem.theta, scouts, &owners, limits);
        let mut scout = 0..scouts.len();
        let keep: Vec<bool> = (0..tasks.len())
            .map(|task| {
                let entry = &mut entries[tasks.owner(task)];
                let Some(scout) = entry.quick.then(|| scout.next()).flatten() else {
                    return true;
                };
                entry.iterations += scouts.reached(scout).iterations;
                let point = tasks.point_mut(task);
                point.copy_from_slice(scouts.point(scout));
                balance(point, &entry.variables);
                !scouts.settled(scout)
            })
            .collect();
        tasks.retain(&keep);
        let mut keep = keep.iter();
        looks.retain(|_| *keep.next().unwrap_or(&true));
    }

    /// Makes the listed descents and keeps what is lower; which entries that changed.
    fn finish(&mut self, entries: &mut [Entry], mut looks: Vec<Look>) -> Vec<usize> {
        if dispatch::single(&self.problem.theta) {
            self.scout(entries, &mut looks);
        }
        let owners: Vec<Owner> = entries.iter().map(Entry::owner).collect();
        self.engine.run(Kind::Real, &self.problem.theta, self.tasks, &owners, self.limits);
        let mut lower = Vec::new();
        for (task, look) in looks.into_iter().enumerate() {
            let e = self.tasks.owner(task);
            if entries[e].offer(look, self.tasks.point(task), self.tasks.reached(task)) && lower.last() != Some(&e) {
                lower.push(e);
            }
        }
        lower
    }

    /// Lists the point `g` of an entry with one row or two rows reversed.
    fn reverse(&mut self, e: usize, g: &[f64]) {
        let (n, m) = (self.problem.size, self.problem.rows);
        let used: Vec<usize> = (0..m).filter(|&i| g[i * n..(i + 1) * n].iter().any(|&x| x != 0.0)).collect();
        for (k, &i) in used.iter().enumerate() {
            scale_rows(n, g, &[i], -1.0, self.tasks.add(e, false, 0.0));
            if m <= PAIRS_UP_TO {
                for &j in &used[k + 1..] {
                    scale_rows(n, g, &[i, j], -1.0, self.tasks.add(e, false, 0.0));
                }
            }
        }
    }

    /// Tries the certificate at the best point of each of `which`.
    pub(crate) fn certify(&mut self, entries: &mut [Entry], which: &[usize]) {
        if which.is_empty() {
            return;
        }
        self.start(1);
        for &e in which {
            self.tasks.add(e, false, 0.0).copy_from_slice(&entries[e].g);
        }
        let limits = self.limits;
        self.limits.iterations = 0;
        self.descend(Kind::Certified, entries);
        self.limits = limits;
        for task in 0..self.tasks.len() {
            entries[self.tasks.owner(task)].certified = self.tasks.certified(task);
        }
    }
}

/// Writes the gains with the named rows times `factor`.
fn scale_rows(n: usize, from: &[f64], rows: &[usize], factor: f64, out: &mut [f64]) {
    out.copy_from_slice(from);
    for &i in rows {
        out[i * n..(i + 1) * n].iter_mut().for_each(|x| *x *= factor);
    }
}

/// Writes the canonical start with a second part B along the variables, in a fixed pattern as large as the gains F and
/// without symmetry: the golden angle spreads it.
pub(crate) fn far_start(entry: &Entry, scale: f64, out: &mut [f64]) {
    let (a, b) = out.split_at_mut(entry.start.len());
    a.copy_from_slice(&entry.start);
    let unknowns = entry.variables.len();
    let size = FAR * scale / (unknowns as f64).sqrt();
    let pattern: Vec<f64> = (0..unknowns).map(|v| size * (1.0 + 2.399_963_229_728_653 * v as f64).cos()).collect();
    advance(b, &entry.variables, &pattern);
}
